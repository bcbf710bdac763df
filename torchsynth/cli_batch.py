"""The command that makes many outputs: ``torchsynth batch``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from torchsynth.batch import Engine, in_process, load_grid, on_ray, run_batch
from torchsynth.errors import InputError
from torchsynth.options import cancellable
from torchsynth.progress import batch_bar

SOME_FAILED = 1
"""The exit code if some jobs could not be done."""


class EngineName(StrEnum):
    """Where the work is done."""

    LOCAL = "local"
    RAY = "ray"


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command()(batch)


def batch(
    jobs: Annotated[
        Path,
        typer.Argument(
            metavar="JOBS.yaml",
            help="Lists of exemplars, recipes, sizes and seeds: all combinations are made.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the outputs go.")],
    engine: Annotated[
        EngineName, typer.Option(help="Where the work is done: in this process, or on a Ray cluster.")
    ] = EngineName.LOCAL,
    ray_address: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Of the cluster. Default: RAY_ADDRESS, or one on this machine.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Make many outputs, and after an interruption only those that are missing.

    DIR/manifest.json lists what is there; beside each picture is its record, as 'torchsynth rerun' reads it. Jobs that
    cannot be done are named at the end, and the exit code is then 1.
    """
    with cancellable():
        grid = load_grid(jobs)
        with batch_bar() as progress:
            report = run_batch(grid, out, engine=_engine(engine, ray_address), progress=progress)
    for path in report.made:
        typer.echo(path)
    failed = sum(failure.outputs for failure in report.failures)
    typer.echo(f"{len(report.made)} made, {report.kept} there already, {failed} failed", err=True)
    for failure in report.failures:
        typer.echo(f"failed: {' '.join(str(failure).splitlines())}", err=True)
    if failed:
        raise typer.Exit(SOME_FAILED)


def _engine(name: EngineName, ray_address: str | None) -> Engine:
    if name is EngineName.RAY:
        return on_ray(ray_address)
    if ray_address is not None:
        raise InputError("--ray-address", "is for --engine ray", f"the engine is {name}", "give that, too")
    return in_process
