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


@contextmanager
def progress_bar() -> Iterator[synthesis.Progress | None]:
    """A callback that draws level, done / total and time left on a terminal; None elsewhere."""
    if not sys.stderr.isatty():  # rich itself also draws where FORCE_COLOR is set
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("pixels"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing", total=None)

        def show(level: int, sweep: int, done: int, total: int, _preview: Callable[[], Image]) -> None:
            bar.update(task, description=f"level {level} sweep {sweep + 1}", completed=done, total=total)

        yield show
