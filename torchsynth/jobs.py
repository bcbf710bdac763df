"""A synthesis from files to files, with a record from which it can be made again."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from torchsynth import config
from torchsynth.controls import Controls
from torchsynth.errors import ConfigError, InputError
from torchsynth.exemplar import Exemplar
from torchsynth.io import (
    Depth,
    Picture,
    Put,
    check_storable,
    check_writable,
    encode_image,
    read_picture,
    staging,
)
from torchsynth.lattice import Shape
from torchsynth.recipe import Recipe
from torchsynth.result import Result
from torchsynth.synthesis import Progress, synthesize

_BATCH = 8
"""Outputs made together: more gain little and hold more memory."""

_LIBRARIES = ("torchsynth-textures", "torch", "kornia", "numpy")


@dataclass(frozen=True)
class Job:
    """What to make.

    Args:
        exemplar: Path of the sample, or ``sample:NAME``.
        recipe: The algorithm.
        size: Height and width; None means twice the exemplar's.
        seeds: One for each output.
        valid: Path of a picture that is white where the exemplar may be sampled.
        initial: Path of a picture to start from.
        sha256: What each of the three files has to hash to, where that is known.
    """

    exemplar: str
    recipe: Recipe
    size: Shape | None
    seeds: tuple[int, ...]
    valid: str | None = None
    initial: str | None = None
    sha256: dict[str, str] | None = None


@dataclass(frozen=True)
class Files:
    """Where the results go.

    Args:
        output: The picture; with several outputs a number is put before the extension.
        levels: A folder for the pyramid levels, if they are wanted.
        source_map: A ``.npz`` file for the source map, if it is wanted.
        overwrite: Whether files that are there already may be replaced.
    """

    output: Path
    levels: Path | None
    source_map: Path | None
    overwrite: bool


def run(job: Job, files: Files, progress: Progress | None = None) -> list[Path]:
    """Make the outputs of a job and write them, each file whole or not at all.

    Returns:
        The pictures that were written.

    Raises:
        InputError: If an input cannot be used.
        OutputError: If a file cannot be written, or exists; checked before the work starts.
    """
    inputs = _read_inputs(job)
    exemplar = inputs["exemplar"]
    height, width = exemplar.image.shape[1:]
    size = job.size or (2 * height, 2 * width)
    _check_files(job, files, exemplar)
    digests = {name: picture.sha256 for name, picture in inputs.items()}
    valid = inputs["valid"].image.mean(0) > 0.5 if "valid" in inputs else None
    initial = inputs["initial"].image if "initial" in inputs else None
    sample, controls = Exemplar(exemplar.image, valid), Controls(initial)
    written: list[Path] = []
    for start in range(0, len(job.seeds), _BATCH):
        seeds = job.seeds[start : start + _BATCH]
        result = synthesize(sample, size, job.recipe, controls=controls, seed=seeds, progress=progress)
        with staging() as put:
            for item, seed in enumerate(seeds):
                number = start + item if len(job.seeds) > 1 else None
                _put_output(put, result, item, exemplar.depth, files, number)
                record = _record(job, size, seed, digests)
                path = _numbered(files.output, number)
                text = json.dumps(record, indent=2)
                put(path.with_suffix(".json"), lambda file, text=text: file.write_text(text))
                written.append(path)
    return written


def parse_size(text: str) -> Shape:
    """Height and width from ``HxW``.

    Raises:
        InputError: If the text does not look like that.

    Example:
        >>> parse_size("192x256")
        (192, 256)
    """
    match = re.fullmatch(r"(-?\d+)[xX](-?\d+)", text.strip())
    if match is None:
        raise InputError(
            "size", "must be HxW, height and width in pixels", f"it is {text!r}", "write e.g. 256x256"
        )
    return int(match[1]), int(match[2])


def load_record(path: Path) -> Job:
    """Read the record that was written beside a picture, as the job that makes it again.

    Raises:
        ConfigError: If the file is not such a record.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        inputs: dict[str, dict[str, str]] = data["inputs"]
        height, width = data["size"]
        recipe, seed = data["recipe"], data["seed"]
        paths = {name: _found(one["path"], path.parent) for name, one in inputs.items()}
        digests = {name: one["sha256"] for name, one in inputs.items()}
        exemplar = paths["exemplar"]
    except OSError as error:
        fact = str(error.strerror).lower()
        raise ConfigError(str(path), "must be a readable file", fact, "check the path") from None
    except (ValueError, KeyError, TypeError):
        raise ConfigError(
            str(path), "must be a record that 'torchsynth synthesize' wrote", "it is not",
            "pass the .json beside the picture",
        ) from None  # fmt: skip
    return Job(
        exemplar=exemplar,
        recipe=config.parse_recipe(recipe, f"{path}: recipe"),
        size=(height, width),
        seeds=(seed,),
        valid=paths.get("valid"),
        initial=paths.get("initial"),
        sha256=digests,
    )


def _read_inputs(job: Job) -> dict[str, Picture]:
    paths = {"exemplar": job.exemplar, "valid": job.valid, "initial": job.initial}
    pictures = {name: read_picture(path) for name, path in paths.items() if path is not None}
    for name, expected in (job.sha256 or {}).items():
        if pictures[name].sha256 != expected:
            raise InputError(
                str(paths[name]), f"must be the file the record was made with (SHA-256 {expected[:12]}...)",
                f"its SHA-256 is {pictures[name].sha256[:12]}...",
                "restore the file, or use 'torchsynth synthesize' for the new one",
            )  # fmt: skip
    return pictures


def _check_files(job: Job, files: Files, exemplar: Picture) -> None:
    """Everything that can be known about the output files before the work."""
    check_storable(exemplar.image, files.output)
    if files.source_map is not None and files.source_map.suffix.lower() != ".npz":
        raise InputError(
            str(files.source_map), "a source map is written as .npz",
            f"it ends in {files.source_map.suffix!r}", "rename it",
        )  # fmt: skip
    numbers: Sequence[int | None] = range(len(job.seeds)) if len(job.seeds) > 1 else (None,)
    for number in numbers:
        output = _numbered(files.output, number)
        for path in (output, output.with_suffix(".json")):
            check_writable(path, overwrite=files.overwrite)
        if files.source_map is not None:
            check_writable(_numbered(files.source_map, number), overwrite=files.overwrite)
        if files.levels is not None and files.levels.is_dir():
            for path in _level_paths(files, number, job.recipe.levels).values():
                check_writable(path, overwrite=files.overwrite)
        elif files.levels is not None:
            check_writable(files.levels, overwrite=False)


def _put_output(put: Put, result: Result, item: int, depth: Depth, files: Files, number: int | None) -> None:
    """One sample of a result: its picture, and its levels and source map where they are wanted."""
    output = _numbered(files.output, number)
    put(output, lambda file: encode_image(result.image[item], file, depth))
    if files.source_map is not None:
        source = result.source[item].cpu().numpy().astype(np.int32)
        exemplar_size = np.array(result.levels[0].exemplar.shape[-2:], dtype=np.int32)
        put(
            _numbered(files.source_map, number),
            lambda file: np.savez_compressed(file, source=source, exemplar_size=exemplar_size),
        )
    if files.levels is not None:
        files.levels.mkdir(exist_ok=True)
        for (level, name), path in _level_paths(files, number, len(result.levels)).items():
            pictures = getattr(result.levels[level], name)
            picture = pictures[item if len(pictures) > 1 else 0]
            put(path, lambda file, picture=picture: encode_image(picture, file, depth))


def _level_paths(files: Files, number: int | None, levels: int) -> dict[tuple[int, str], Path]:
    """The file of each picture of each level."""
    folder = files.levels or Path()
    prefix = "" if number is None else f"{number}-"
    return {
        (level, name): folder / f"{prefix}level-{level}-{name}{files.output.suffix}"
        for level in range(levels)
        for name in ("exemplar", "start", "image")
    }


def _record(job: Job, size: Shape, seed: int, digests: dict[str, str]) -> dict[str, Any]:
    paths = {"exemplar": job.exemplar, "valid": job.valid, "initial": job.initial}
    return {
        "recipe": job.recipe.model_dump(mode="json", exclude_none=True),
        "size": list(size),
        "seed": seed,
        "inputs": {name: {"path": paths[name], "sha256": digest} for name, digest in digests.items()},
        "versions": {name: version(name) for name in _LIBRARIES} | {"python": platform.python_version()},
    }


def _found(path: str, folder: Path) -> str:
    """An input's path as it was given, or beside its record if it is only there."""
    beside = folder / path
    return str(beside) if not Path(path).exists() and beside.exists() else path


def _numbered(path: Path, number: int | None) -> Path:
    return path if number is None else path.with_stem(f"{path.stem}-{number}")
