"""A grid of outputs, made and written; what is there already is left as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from torchsynth.batch.engines import Engine, in_process
from torchsynth.batch.grid import Grid
from torchsynth.batch.manifest import Manifest
from torchsynth.batch.planning import Plan, plan
from torchsynth.batch.work import Failure, Work
from torchsynth.errors import OutputError
from torchsynth.io import check_writable

BatchProgress: TypeAlias = Callable[[int, int, str], None]
"""``(done, total, about)``: how many outputs are there of how many, and what was finished last."""


@dataclass(frozen=True)
class Report:
    """What became of a grid.

    Args:
        made: The pictures that were written.
        kept: How many were there already.
        failures: What could not be made, and why.
    """

    made: tuple[Path, ...]
    kept: int
    failures: tuple[Failure, ...]


def run_batch(
    grid: Grid, folder: Path, *, engine: Engine = in_process, progress: BatchProgress | None = None
) -> Report:
    """Make all outputs of a grid, those of one exemplar, recipe and size some at a time.

    Pictures and records are written whole or not at all, as soon as a batch is finished, and so is the
    manifest now and then, and at the end. Stopped at any moment and started again, it makes what is missing.
    One job that cannot be done does not keep the others from being done.

    Args:
        grid: What is wanted.
        folder: Where it goes; it is made if its parent is there.
        engine: Where the work is done; see :func:`torchsynth.batch.on_ray`.
        progress: Told after each batch.

    Returns:
        What was made, what was there, and what could not be made.

    Raises:
        OutputError: If the folder cannot be written, or holds a manifest that is none.

    Example:
        >>> import tempfile
        >>> grid = Grid(exemplars=["sample:brick"], recipes=["ashikhmin"], sizes=["8x8"], seeds="0..2")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     first, second = (run_batch(grid, Path(folder)) for _ in range(2))
        >>> len(first.made), first.kept, len(second.made), second.kept
        (3, 0, 0, 3)
    """
    manifest = _opened(folder)
    planned = plan(grid)
    work, failures, kept = _left_to_do(planned, manifest)
    manifest.write()
    total = len(planned.outputs)
    made: list[Path] = []
    done = total - sum(len(one.outputs) for one in work)
    try:
        for outcome in engine(work):
            if isinstance(outcome, Failure):
                failures.append(outcome)
                done, about = done + outcome.outputs, outcome.about
            else:
                manifest.save(outcome)
                made.extend(folder / next(iter(one.files)) for one in outcome)
                done, about = done + len(outcome), made[-1].name
            if progress is not None:
                progress(done, total, about)
    finally:
        if manifest.unwritten:
            manifest.write()
    return Report(tuple(made), kept, tuple(failures))


def _opened(folder: Path) -> Manifest:
    """The manifest of a folder that can be written."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(str(folder), "must be a folder", "it is a file", "choose another name")
    check_writable(folder / "x" if folder.exists() else folder, overwrite=True)
    manifest = Manifest.read(folder)
    manifest.clear()
    return manifest


def _left_to_do(planned: Plan, manifest: Manifest) -> tuple[list[Work], list[Failure], int]:
    """The batches without what is there already, and how much that is."""
    left, failures, kept = [], list(planned.failures), 0
    for work in planned.work:
        missing = []
        for output in work.outputs:
            try:
                there = manifest.holds(output, work.suffix)
            except OutputError as error:
                failures.append(Failure(output.stem, 1, str(error)))
                continue
            kept += there
            if not there:
                missing.append(output)
        if missing:
            left.append(work.of(missing))
    return left, failures, kept
