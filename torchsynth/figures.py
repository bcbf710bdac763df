"""The drawings of a job: what can be known before the work, what has to be recorded during it, and their files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from itertools import chain
from pathlib import Path

from torchsynth._typing import Image
from torchsynth.codebook import Codebook
from torchsynth.io import Put, check_storable, encode_image
from torchsynth.lattice import Shape
from torchsynth.orders import Order
from torchsynth.result import Level, Result
from torchsynth.synthesis import Progress
from torchsynth.training import train
from torchsynth.viz import (
    OF_OUTPUT_SIZE,
    Recorder,
    check_animation,
    check_drawable,
    draw,
    encode_animation,
)

# What words and gaps may add to the pictures of a drawing.
_MARGIN = 1200


@dataclass(frozen=True)
class Figures:
    """What is drawn of a job.

    Args:
        kinds: The drawings that are wanted, of :data:`torchsynth.viz.kinds.KINDS`.
        order: What the job asks for.
        codebook: The trees that are searched, if they were trained before.
    """

    kinds: tuple[str, ...]
    order: Order
    codebook: Codebook | None

    @classmethod
    def of(cls, paths: Mapping[str, Path], order: Order, codebook: Codebook | None) -> Figures:
        """What is drawn where, checked before any work.

        Args:
            paths: Where each drawing that is wanted goes.
            order: What the job asks for.
            codebook: The trees that were trained before, if there are any.

        Raises:
            InputError: If there is no such drawing, it cannot be drawn of this job, or its file cannot hold it.
        """
        for kind, path in paths.items():
            check_drawable(kind, order.recipe, order.controls)
            if kind == "animation":
                check_animation(path, order.size)
            else:
                check_storable(path, 3, order.size if kind in OF_OUTPUT_SIZE else _at_most(order))
        return cls(tuple(paths), order, codebook)

    def trained(self) -> Figures:
        """The same with the trees that are drawn: a synthesis that searches these gives the same bytes."""
        if "tree" not in self.kinds or self.codebook is not None:
            return self
        return replace(self, codebook=train(self.order.exemplar, self.order.recipe))

    def watched(self, progress: Progress | None) -> tuple[Progress | None, Recorder | None]:
        """What is told of a synthesis, and what records it, if that is wanted."""
        if "animation" not in self.kinds:
            return progress, None
        recorder = Recorder()
        return recorder if progress is None else _both(progress, recorder), recorder

    def put(
        self, put: Put, paths: Mapping[str, Path], result: Result, item: int, recorder: Recorder | None
    ) -> None:
        """Draw one output and have the files written.

        Args:
            put: See :func:`torchsynth.io.staging`.
            paths: Where the drawings of this output go.
            result: All outputs that were made together.
            item: Which of them.
            recorder: What recorded them.
        """
        alone = _alone(result, item)
        for kind, path in paths.items():
            if kind == "animation" and recorder is not None:
                # Blurred seams are not seen by the recorder.
                frames = chain(recorder.frames(item), [alone.image.float().cpu()])
                put(path, encode_animation(map(self.order.finished, frames), path))
            else:
                drawing = draw(kind, alone, self.order.controls, self.codebook)[0]
                put(path, encode_image(drawing, path, "8-bit"))


def _alone(result: Result, item: int) -> Result:
    """One of several outputs by itself, so that its drawing does not depend on the others."""

    def one(level: Level) -> Level:
        tensors = {part.name: getattr(level, part.name) for part in fields(Level)}
        return Level(
            **{name: batch[item : item + 1] if len(batch) > 1 else batch for name, batch in tensors.items()}
        )

    return replace(result, levels=tuple(map(one, result.levels)), seeds=result.seeds[item : item + 1])


def _both(first: Progress, second: Progress) -> Progress:
    def told(level: int, sweep: int, done: int, total: int, preview: Callable[[], Image]) -> None:
        first(level, sweep, done, total, preview)
        second(level, sweep, done, total, preview)

    return told


def _at_most(order: Order) -> Shape:
    """No drawing with several pictures is larger than this."""
    (height, width), (rows, columns) = order.exemplar.shape, order.size
    across = max(order.recipe.levels * max(width, columns), width + columns)
    return height + 2 * rows + _MARGIN, across + _MARGIN
