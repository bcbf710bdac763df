"""A synthesis from files to files, with a record from which it can be made again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from torchsynth import checks
from torchsynth.codebook import check_savable
from torchsynth.codecs import Depth
from torchsynth.errors import InputError, OutputError
from torchsynth.exemplar import Exemplar
from torchsynth.figures import Figures
from torchsynth.inputs import Inputs
from torchsynth.io import (
    Picture,
    Put,
    check_storable,
    check_writable,
    encode_image,
    read_picture,
    staging,
)
from torchsynth.lattice import Shape
from torchsynth.memory import outputs_that_fit
from torchsynth.orders import Order
from torchsynth.recipe import Recipe
from torchsynth.records import Job, paths_of, record_of
from torchsynth.result import Result, check_sources
from torchsynth.source_map import encode_source_map
from torchsynth.synthesis import Progress, synthesize
from torchsynth.training import TrainingProgress, train
from torchsynth.wishes import grays_of, white

_BATCH = 8
"""Outputs made together: more gain little and hold more memory."""


@dataclass(frozen=True)
class Files:
    """Where the results go.

    Args:
        output: The picture; with several outputs a number is put before the extension.
        levels: A folder for the pyramid levels, if they are wanted.
        source_map: A ``.npz`` file for the source map, if it is wanted.
        overwrite: Whether files that are there already may be replaced.
        figures: Where each of :data:`torchsynth.viz.kinds.KINDS` that is wanted goes.
    """

    output: Path
    levels: Path | None
    source_map: Path | None
    overwrite: bool
    figures: dict[str, Path] = field(default_factory=dict)


def run(
    job: Job, files: Files, progress: Progress | None = None, note: Callable[[str], None] | None = None
) -> list[Path]:
    """Make the outputs of a job and write them, each file whole or not at all.

    Several outputs are made some at a time; those that are written stay, whatever happens to the rest.

    Args:
        job: What to make.
        files: Where it goes.
        progress: See :data:`torchsynth.synthesis.Progress`.
        note: Told what a user should know, though it is no error.

    Returns:
        The pictures that were written.

    Raises:
        InputError: If an input cannot be used.
        OutputError: If a file cannot be written, or exists; checked before the work starts.
    """
    inputs = Inputs.read(job)
    order = Order.of(job, inputs)
    recipe = order.recipe
    _note_grays(inputs.pictures, note)
    if (
        job.completion.task in ("fill", "extend", "tile")
        and files.output.suffix.lower() in (".jpg", ".jpeg")
        and note
    ):
        note("a .jpg changes every pixel a little, also where the picture was to stay; .png and .tif do not")
    checks.check_seeds(job.seeds, None)
    check_storable(files.output, len(order.picture.image), order.size)
    targets = [_targets(files, number, recipe) for number in _numbers(job)]
    figures = Figures.of(files.figures, order, inputs.codebook)
    _check_targets(job, files, [path for one in targets for path in one.all])
    depth = order.depth
    if files.source_map is not None:
        check_sources(recipe, "--source-map")
    sample = order.exemplar
    batch = outputs_that_fit(recipe, sample, order.size, min(_BATCH, len(job.seeds)))
    figures = figures.trained()
    for start in range(0, len(job.seeds), batch):
        seeds = job.seeds[start : start + batch]
        watching, recorder = figures.watched(progress)
        result = synthesize(
            sample, order.size, recipe, controls=order.controls, seed=seeds, codebook=figures.codebook,
            progress=watching,
        )  # fmt: skip
        finished = order.finished(result.image)
        if start == 0:
            _note_structure(result.recipe, note)
        with staging() as put:
            for item, target in enumerate(targets[start : start + batch]):
                put(target.picture, encode_image(finished[item], target.picture, depth))
                _put_details(put, result, item, depth, target)
                figures.put(put, target.figures, result, item, recorder)
                record = record_of(job, result.recipe, inputs.digests, order.size, seeds[item])
                put(target.record, json.dumps(record, indent=2).encode())
    return [target.picture for target in targets]


def run_training(
    job: Job, output: Path, *, overwrite: bool, progress: TrainingProgress | None = None
) -> Path:
    """Train the codebook for a job's exemplar and recipe, and write it, whole or not at all.

    Returns:
        The file that was written.

    Raises:
        InputError: If an input cannot be used.
        OutputError: If the file cannot be written, or exists; checked before the work starts.
    """
    pictures = Inputs.read(job).pictures
    _check_distinct(paths_of(job).values(), [output])
    check_savable(output, overwrite=overwrite)
    valid = white(pictures["valid"]) if "valid" in pictures else None
    assert job.recipe is not None, "only completions have a usual recipe"  # noqa: S101 (for the type checker)
    codebook = train(Exemplar(pictures["exemplar"].image, valid), job.recipe, progress=progress)
    return codebook.save(output, overwrite=overwrite)


def size_larger_by(image: str, pixels: int) -> Shape:
    """The size of a picture file, with so many pixels more on each side.

    Raises:
        InputError: If the file cannot be read, or there are no more pixels.

    Example:
        >>> size_larger_by("sample:brick", 8)
        (144, 144)
    """
    checks.check_positive(pixels, "by")
    height, width = read_picture(image).image.shape[1:]
    return height + 2 * pixels, width + 2 * pixels


@dataclass(frozen=True)
class _Targets:
    """Where the files of one output go; ``levels`` by whether they are the structure's, by level and name."""

    picture: Path
    record: Path
    source_map: Path | None
    levels: dict[tuple[bool, int, str], Path]
    figures: dict[str, Path]

    @property
    def all(self) -> list[Path]:
        """All of them."""
        maybe = [] if self.source_map is None else [self.source_map]
        return [self.picture, self.record, *maybe, *self.levels.values(), *self.figures.values()]


def _targets(files: Files, number: int | None, recipe: Recipe) -> _Targets:
    picture = _numbered(files.output, number)
    prefix = "" if number is None else f"{number}-"
    folder = files.levels
    levels = {False: recipe.levels, True: 0 if recipe.structure is None else recipe.structure.recipe.levels}
    pictures = {
        (structure, level, name): folder
        / f"{prefix}{'structure-' if structure else ''}level-{level}-{name}{files.output.suffix}"
        for structure, number_of_levels in levels.items()
        for level in range(number_of_levels)
        for name in ("exemplar", "start", "image")
        if folder is not None
    }
    source_map = None if files.source_map is None else _numbered(files.source_map, number)
    figures = {kind: _numbered(path, number) for kind, path in files.figures.items()}
    return _Targets(picture, picture.with_suffix(".json"), source_map, pictures, figures)


def _check_targets(job: Job, files: Files, targets: Sequence[Path]) -> None:
    """Everything that can be known about the output files before the work."""
    if files.source_map is not None and files.source_map.suffix.lower() != ".npz":
        suffix = files.source_map.suffix
        raise InputError(
            str(files.source_map), "a source map must end in .npz",
            f"it ends in {suffix!r}" if suffix else "it has no extension", "rename it",
        )  # fmt: skip
    _check_distinct(paths_of(job).values(), targets)
    folder = files.levels
    if folder is not None and os.path.exists(folder) and not os.path.isdir(folder):
        raise OutputError(str(folder), "must be a folder", "it is a file", "choose another name")
    new_folder = folder if folder is not None and not os.path.exists(folder) else None
    if new_folder is not None:
        check_writable(new_folder, overwrite=False)
    for path in targets:
        if new_folder is None or path.parent != new_folder:
            check_writable(path, overwrite=files.overwrite)


def _check_distinct(inputs: Iterable[str], targets: Iterable[Path]) -> None:
    """No two files of a job may be the same: the later one would destroy the earlier."""
    taken = {os.path.realpath(path) for path in inputs}
    seen: set[str] = set()
    for path in targets:
        place = os.path.realpath(path)
        if place in taken or place in seen:
            other = "an input" if place in taken else "another output"
            raise OutputError(
                str(path), "must be a file of its own", f"it is {other} as well", "choose another name"
            )
        seen.add(place)


def _note_grays(inputs: dict[str, Picture], note: Callable[[str], None] | None) -> None:
    """Say what is done with a mask that is not only black and white."""
    grays = grays_of(inputs["hole"]) if "hole" in inputs else 0
    if grays > 0 and note is not None:
        note(f"{grays} pixel(s) of the hole are gray: those lighter than half are filled, the others are not")


def _note_structure(recipe: Recipe, note: Callable[[str], None] | None) -> None:
    """Say how the exemplar's edges were widened, where that was chosen."""
    if recipe.structure is not None and note is not None:
        what, size = {"erode": "dark", "dilate": "bright"}[recipe.structure.operation], recipe.structure.size
        note(f"the {what} edges of the exemplar were widened with a {size}x{size} square")


def _put_details(put: Put, result: Result, item: int, depth: Depth, targets: _Targets) -> None:
    """The levels and the source map of one sample of a result, where they are wanted."""
    if targets.source_map is not None:
        height, width = result.levels[0].exemplar.shape[-2:]
        put(targets.source_map, encode_source_map(result.source[item : item + 1], (height, width)))
    for (structure, level, name), path in targets.levels.items():
        made = result.structure if structure else result
        assert made is not None, "the recipe has one"  # noqa: S101 (for the type checker)
        pictures = getattr(made.levels[level], name)
        picture = pictures[item if len(pictures) > 1 else 0]
        # Blurred, a picture of black and white is gray.
        put(path, encode_image(picture, path, "8-bit" if depth == "1-bit" else depth))


def _numbers(job: Job) -> Sequence[int | None]:
    return range(len(job.seeds)) if len(job.seeds) > 1 else (None,)


def _numbered(path: Path, number: int | None) -> Path:
    return path if number is None else path.with_stem(f"{path.stem}-{number}")
