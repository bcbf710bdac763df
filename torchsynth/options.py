"""What several commands of the command line share: options, and how a job is run."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from torchsynth import config, jobs, records
from torchsynth.errors import ConfigError, InputError
from torchsynth.progress import progress_bar
from torchsynth.recipe import Recipe

MOST = 10_000
"""The most outputs of one call."""

Overwrite = Annotated[bool, typer.Option(help="Replace files that are there already.")]
Config = Annotated[Path | None, typer.Option("--config", help="A recipe from a YAML file.")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Change one value of the recipe, e.g. levels=3 or sweeps[0].layers[0].template.size=7.",
    ),
]
Valid = Annotated[str | None, typer.Option(metavar="FILE", help="Sample only where this picture is white.")]
Output = Annotated[
    Path, typer.Option("-o", "--output", help="The picture to write: .png, .tif, .bmp, .webp or .jpg.")
]
Seed = Annotated[int, typer.Option(help="Which texture of the many possible ones.")]
Count = Annotated[int, typer.Option(help="How many outputs; their seeds are SEED, SEED + 1, ...")]
Figure = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KIND=FILE",
        help="Also draw: patches (their boundaries), sources (where pixels come from), field, cost (of each "
        "match), coverage (of the exemplar), pyramid (all levels), tree (of TSVQ), sheet (beside the exemplar), "
        "animation (a .gif, .png, .apng or .webp).",
    ),
]
LevelsDir = Annotated[Path | None, typer.Option(metavar="DIR", help="Also write every pyramid level here.")]
SourceMapFile = Annotated[
    Path | None, typer.Option(metavar="FILE.npz", help="Also write where each pixel was copied from.")
]


def fail(message: str) -> int:
    """Say in one line what was wrong; returns the exit code."""
    line = " ".join(message.splitlines())  # a file name may hold a line break
    typer.secho(f"error: {line}", err=True, fg="red" if sys.stderr.isatty() else None)
    return 2


def chosen(recipe: str | None, file: Path | None, changes: list[str] | None, usual: str) -> Recipe:
    """The recipe that was asked for, or the usual one, with the changes that were asked for."""
    if recipe is not None and file is not None:
        raise ConfigError("--recipe and --config", "only one of them can be given", "both are", "drop one")
    return config.load_recipe(file or recipe or usual, changes or ())


def figures(wanted: Sequence[str]) -> dict[str, Path]:
    """Which drawings go where."""
    found: dict[str, Path] = {}
    for text in wanted:
        kind, equals, path = text.partition("=")
        if not equals or not path or kind in found:
            fact = f"{kind} is there twice" if kind in found else f"it is {text!r}"
            raise InputError(
                "--figure", "must be KIND=FILE, each kind once", fact, "write e.g. patches=seams.png"
            )
        found[kind] = Path(path)
    return found


def seeds_from(seed: int, count: int) -> tuple[int, ...]:
    """The seeds of so many outputs.

    Raises:
        InputError: If there are none, or too many.

    Example:
        >>> seeds_from(3, 2)
        (3, 4)
    """
    if not 1 <= count <= MOST:
        raise InputError(
            "--count", f"must be from 1 to {MOST}", f"it is {count}", "choose a number between them"
        )
    return tuple(range(seed, seed + count))


def run(job: records.Job, files: jobs.Files) -> None:
    """Run a job with a progress bar, and name the files it wrote."""
    with cancellable(), progress_bar() as progress:
        written = jobs.run(job, files, progress, note=lambda text: typer.echo(f"note: {text}", err=True))
    for path in written:
        typer.echo(path)


@contextmanager
def cancellable() -> Iterator[None]:
    """Ctrl-C ends the work with one line and exit code 2."""
    try:
        yield
    except KeyboardInterrupt:
        raise typer.Exit(fail("cancelled: no unfinished file was left behind")) from None
