"""One batch of a grid: outputs of one exemplar, recipe and size, made together wherever there is a machine."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from torchsynth.errors import InputError
from torchsynth.figures import Figures
from torchsynth.inputs import Inputs
from torchsynth.io import check_storable, encode_image
from torchsynth.orders import Order
from torchsynth.records import Job, record_of
from torchsynth.result import Result, check_sources
from torchsynth.source_map import encode_source_map
from torchsynth.synthesis import synthesize
from torchsynth.versions import versions


@dataclass(frozen=True)
class Output:
    """One picture that is wanted.

    Args:
        key: The SHA-256 of all that decides its files: their names, recipe,
            exemplar, size, seed, versions, format, and what is written beside the picture.
        seed: Its seed.
        stem: The name of its files, without their endings.
        about: What the manifest says of it.
    """

    key: str
    seed: int
    stem: str
    about: dict[str, Any]


@dataclass(frozen=True)
class Work:
    """What is made at once.

    Args:
        job: What to make; its seeds are those of the outputs.
        inputs: Its files, read: whoever makes it need not have them.
        outputs: One for each seed.
        suffix: The ending of the pictures, with the dot.
        source_maps: Whether source maps are wanted.
        figures: Which drawings are wanted.
        made_with: The versions that the outputs' keys stand for.
    """

    job: Job
    inputs: Inputs
    outputs: tuple[Output, ...]
    suffix: str
    source_maps: bool
    figures: tuple[str, ...]
    made_with: dict[str, str]

    def of(self, outputs: Sequence[Output]) -> Work:
        """The same for some of the outputs only."""
        seeds = tuple(output.seed for output in outputs)
        return replace(self, outputs=tuple(outputs), job=replace(self.job, seeds=seeds))

    @property
    def about(self) -> str:
        """Which work it is, for messages."""
        seeds = self.job.seeds
        each = f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"
        first = self.outputs[0].about
        return f"{first['exemplar']}, {first['recipe']}, {'x'.join(map(str, first['size']))}, {each}"


@dataclass(frozen=True)
class Made:
    """The files of one finished output, by name; the record is the last, and says what the picture hashes to.

    Args:
        output: Which it is.
        files: What they hold.
        sha256: Of the picture.
    """

    output: Output
    files: dict[str, bytes]
    sha256: str


@dataclass(frozen=True)
class Failure:
    """Why something was not made.

    Args:
        about: What.
        outputs: How many pictures are missing for it.
        message: Why.
    """

    about: str
    outputs: int
    message: str

    def __str__(self) -> str:
        return f"{self.about} ({self.outputs} output{'s' * (self.outputs != 1)}): {self.message}"


def attempt(work: Work) -> list[Made] | Failure:
    """Make a batch, or say why it cannot be made.

    Args:
        work: The batch.
    """
    try:
        return _made(work)
    except Exception as error:
        told = str(error) if str(error) else "no reason given"
        known = isinstance(error, (InputError, OSError))
        return Failure(work.about, len(work.outputs), told if known else f"{type(error).__name__}: {told}")


def _made(work: Work) -> list[Made]:
    if versions() != work.made_with:
        raise InputError(
            "versions", f"must be the same everywhere for the same bytes: {_listed(work.made_with)}",
            f"here they are {_listed(versions())}", "install the same on every machine",
        )  # fmt: skip
    order = Order.of(work.job, work.inputs)
    check_storable(Path(f"picture{work.suffix}"), len(order.picture.image), order.size)
    if work.source_maps:
        check_sources(order.recipe, "source_maps")
    paths = {kind: Path(f"{kind}.{'gif' if kind == 'animation' else 'png'}") for kind in work.figures}
    figures = Figures.of(paths, order, None).trained()
    watching, recorder = figures.watched(None)
    result = synthesize(
        order.exemplar, order.size, order.recipe, controls=order.controls, seed=list(work.job.seeds),
        codebook=figures.codebook, progress=watching,
    )  # fmt: skip
    images = order.finished(result.image)
    pictures = [encode_image(image, Path(f"picture{work.suffix}"), order.depth) for image in images]
    finished = []
    for item, picture in enumerate(pictures):
        drawn: dict[str, bytes] = {}
        figures.put(lambda path, data: drawn.update({path.name: data}), paths, result, item, recorder)  # noqa: B023 (called at once)
        finished.append(_finished(work, result, item, order, picture, drawn))
    return finished


def _finished(
    work: Work, result: Result, item: int, order: Order, picture: bytes, drawn: dict[str, bytes]
) -> Made:
    """The files of one output of a batch."""
    output, digest = work.outputs[item], hashlib.sha256(picture).hexdigest()
    files = {f"{output.stem}{work.suffix}": picture}
    files |= {f"{output.stem}-{name}": data for name, data in drawn.items()}
    if work.source_maps:
        height, width = order.exemplar.shape
        source = result.source[item : item + 1]
        files[f"{output.stem}.npz"] = encode_source_map(source, (height, width))
    job = replace(work.job, seeds=(output.seed,))
    record = record_of(job, result.recipe, work.inputs.digests, order.size, output.seed)
    record["batch"] = {"key": output.key, "sha256": digest, "files": list(files)}
    files[f"{output.stem}.json"] = json.dumps(record, indent=2).encode()
    return Made(output, files, digest)


def _listed(found: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in found.items())
