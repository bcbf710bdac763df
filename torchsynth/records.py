"""What was asked for: jobs, and the records they are written down in."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from torchsynth import config
from torchsynth.errors import ConfigError
from torchsynth.lattice import Shape
from torchsynth.recipe import Recipe
from torchsynth.versions import versions
from torchsynth.wishes import FIELDS, is_file

PICTURES = (
    "exemplar", "valid", "initial", "target", "target_region", "image", "hole", "guide", "output_guide",
)  # fmt: skip
"""The inputs that are always files."""

Task: TypeAlias = Literal["synthesize", "fill", "extend", "tile", "analogy"]
"""What is done; ``fill``, ``extend`` and ``tile`` complete a picture."""


class Completion(BaseModel):
    """What is done with the pictures; which of these count depends on the task.

    Args:
        task: What is done.
        hole: What marks the hole, if no file does: ``alpha`` or a color such as ``#ff00ff``.
        at: Row and column at which the picture lies in the extended one; None puts it in the middle.
        within: Sample only so many pixels around the hole.
        width: Of the strip that makes a picture tile.
        labels: Whether the guides of an analogy are maps.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    task: Task = "synthesize"
    hole: str | None = None
    at: tuple[int, int] | None = None
    within: int | None = None
    width: int | None = None
    labels: bool = False


_FROM_SCRATCH = Completion()


@dataclass(frozen=True)
class Job:
    """What to make.

    Args:
        exemplar: Path of the sample, or ``sample:NAME``. A picture that is completed from itself is its own.
        recipe: The algorithm; None means the usual one of a task.
        size: Height and width; None means the target's, or twice the exemplar's.
        seeds: One for each output.
        valid: Path of a picture that is white where the exemplar may be sampled.
        initial: Path of a picture to start from.
        target: Path of a picture to follow; its alpha channel, if it has one, marks what was painted.
        target_region: Path of a picture that is white where the target was painted.
        angle: By how much the texture is turned: degrees, a maker such as ``swirl:180``, or a path.
        scale: By how much it is enlarged: a factor, a maker such as ``zoom:0.5,2``, or a path.
        codebook: Path of a codebook that was trained for this exemplar and recipe.
        source_map: Path of the source map of an output that is to be gone over once more.
        completion: What is done.
        image: Path of the picture to be completed, if it is not the exemplar.
        hole: Path of a picture that is white where it is to be filled.
        guide: Path of the picture that lies upon the exemplar: A of an analogy.
        output_guide: Path of the picture that lies upon the output: B.
        sha256: What each of these files has to hash to, where that is known.
    """

    exemplar: str
    recipe: Recipe | None
    size: Shape | None
    seeds: tuple[int, ...]
    valid: str | None = None
    initial: str | None = None
    target: str | None = None
    target_region: str | None = None
    angle: str | None = None
    scale: str | None = None
    codebook: str | None = None
    source_map: str | None = None
    completion: Completion = _FROM_SCRATCH
    image: str | None = None
    hole: str | None = None
    guide: str | None = None
    output_guide: str | None = None
    sha256: dict[str, str] | None = None


def load_record(path: Path) -> Job:
    """Read the record that was written beside a picture, as the job that makes it again.

    Raises:
        ConfigError: If the file is not such a record.
    """
    try:
        record = _Record.model_validate_json(path.read_bytes())
    except OSError as error:
        fact = f"the system says: {(error.strerror or str(error)).lower()}"
        raise ConfigError(str(path), "must be a readable file", fact, "check the path") from None
    except ValidationError:
        raise ConfigError(
            str(path), "must be a record that 'torchsynth synthesize' wrote", "it is not",
            "pass the .json beside the picture",
        ) from None  # fmt: skip
    paths = {name: _found(one.path, path.parent) for name, one in record.inputs.items()}
    return Job(
        exemplar=paths["exemplar"],
        recipe=config.parse_recipe(record.recipe, f"{path}: recipe"),
        size=record.size,
        seeds=(record.seed,),
        valid=paths.get("valid"),
        initial=paths.get("initial"),
        target=paths.get("target"),
        target_region=paths.get("target_region"),
        angle=paths.get("angle", record.fields.get("angle")),
        scale=paths.get("scale", record.fields.get("scale")),
        codebook=paths.get("codebook"),
        source_map=paths.get("source_map"),
        completion=record.completion,
        image=paths.get("image"),
        hole=paths.get("hole"),
        guide=paths.get("guide"),
        output_guide=paths.get("output_guide"),
        sha256={name: one.sha256 for name, one in record.inputs.items()},
    )


def changed_versions(path: Path) -> list[str]:
    """Which versions a record names that are not today's: with these, other bytes may come out.

    Raises:
        ConfigError: If the file is not a record.
    """
    load_record(path)
    recorded = json.loads(path.read_text(encoding="utf-8")).get("versions")
    recorded = recorded if isinstance(recorded, dict) else {}
    now = versions()
    return [
        f"{name} {recorded.get(name, 'unknown')}, now {now[name]}"
        for name in now
        if recorded.get(name) != now[name]
    ]


def record_of(job: Job, recipe: Recipe, digests: dict[str, str], size: Shape, seed: int) -> dict[str, Any]:
    """What is written beside a picture, for :func:`load_record` to read.

    Args:
        job: What was asked for.
        recipe: What it was made with.
        digests: SHA-256 of each input file, by what it is for.
        size: Of the output.
        seed: Of this output.
    """
    completion = job.completion.model_dump(mode="json", exclude_defaults=True)
    return {
        "recipe": recipe.plain(),
        "size": list(size),
        "seed": seed,
        **({} if job.completion == _FROM_SCRATCH else {"completion": completion}),
        **({"fields": words_of(job)} if words_of(job) else {}),
        "inputs": {name: {"path": path, "sha256": digests[name]} for name, path in paths_of(job).items()},
        "versions": versions(),
    }


def words_of(job: Job) -> dict[str, str]:
    """The fields that are given without a file."""
    given = {name: getattr(job, name) for name in FIELDS}
    return {name: word for name, word in given.items() if word is not None and not is_file(word)}


def paths_of(job: Job) -> dict[str, str]:
    """The input files by what they are for."""
    names = (*PICTURES, "codebook", "source_map", *FIELDS)
    paths = {name: getattr(job, name) for name in names if getattr(job, name) is not None}
    return {name: path for name, path in paths.items() if name not in words_of(job)}


class _Input(BaseModel):
    path: str
    sha256: str


class _Record(BaseModel):
    """What :func:`record_of` writes; it may hold more than is needed to read it."""

    recipe: dict[str, Any]
    size: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]
    seed: int
    inputs: dict[
        Literal[
            "exemplar", "valid", "initial", "target", "target_region", "image", "hole", "guide",
            "output_guide", "angle", "scale", "codebook", "source_map",
        ],
        _Input,
    ]  # fmt: skip
    completion: Completion = _FROM_SCRATCH
    fields: dict[Literal["angle", "scale"], str] = {}

    @model_validator(mode="after")
    def _has_an_exemplar(self) -> _Record:
        if "exemplar" not in self.inputs:
            raise ValueError("there is no exemplar")
        return self


def _found(path: str, folder: Path) -> str:
    """An input's path as it was given, or beside its record if it is only there."""
    beside = folder / path
    return str(beside) if not os.path.exists(path) and os.path.exists(beside) else path
