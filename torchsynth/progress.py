"""The progress bar of the command line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from torchsynth import synthesis
from torchsynth._typing import Image
from torchsynth.batch import BatchProgress
from torchsynth.training import TrainingProgress


@contextmanager
def progress_bar() -> Iterator[synthesis.Progress | None]:
    """A callback that draws level, done / total and time left on a terminal; None elsewhere."""
    with _bar() as draw:
        if draw is None:
            yield None
            return

        def show(level: int, sweep: int, done: int, total: int, _preview: Callable[[], Image]) -> None:
            draw(f"level {level} sweep {sweep + 1}", done, total)

        yield show


@contextmanager
def training_bar() -> Iterator[TrainingProgress | None]:
    """The same for training, which goes by the exemplar's pixels."""
    with _bar() as draw:
        if draw is None:
            yield None
            return

        def show(level: int, done: int, total: int) -> None:
            draw(f"training level {level}", done, total)

        yield show


@contextmanager
def batch_bar() -> Iterator[BatchProgress | None]:
    """The same for many outputs, which are counted."""
    with _bar("outputs") as draw:
        if draw is None:
            yield None
            return

        def show(done: int, total: int, about: str) -> None:
            draw(about, done, total)

        yield show


@contextmanager
def _bar(unit: str = "pixels") -> Iterator[Callable[[str, int, int], None] | None]:
    """What draws a description, done / total and time left on a terminal; None elsewhere."""
    if not sys.stderr.isatty():  # rich itself also draws where FORCE_COLOR is set
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing", total=None)

        def draw(description: str, done: int, total: int) -> None:
            bar.update(task, description=description, completed=done, total=total)

        yield draw
