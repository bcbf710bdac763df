"""The command for image analogies: ``torchsynth analogy``."""

from __future__ import annotations

from typing import Annotated

import typer

from torchsynth import jobs, records
from torchsynth.options import (
    Changes,
    Config,
    Count,
    Figure,
    LevelsDir,
    Output,
    Overwrite,
    Seed,
    SourceMapFile,
    Valid,
    chosen,
    figures,
    run,
    seeds_from,
)
from torchsynth.records import Completion


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command()(analogy)


def analogy(
    a: Annotated[str, typer.Argument(metavar="A", help="A picture, or a map of the parts of A_PRIME.")],
    a_prime: Annotated[
        str, typer.Argument(metavar="A_PRIME", help="The same after a filter, or the texture of the map.")
    ],
    b: Annotated[str, typer.Argument(metavar="B", help="Another picture, or map, of the same kind as A.")],
    output: Output,
    labels: Annotated[
        bool,
        typer.Option(
            "--labels", help="A and B are maps: each color is a label, and none is nearer to another."
        ),
    ] = False,
    recipe: Annotated[
        str | None,
        typer.Option(
            help="A recipe that compares guides. Default: analogy, with fewer levels if A is too small.",
            show_default=False,
        ),
    ] = None,
    config_file: Config = None,
    changes: Changes = None,
    valid: Valid = None,
    seed: Seed = 0,
    count: Count = 1,
    figure: Figure = None,
    levels_dir: LevelsDir = None,
    source_map: SourceMapFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Make B', which is to B as A_PRIME is to A: carry a filter over, or paint with textures.

    The output has the size of B, and every pixel of it is copied from A_PRIME.
    """
    usual = recipe is None and config_file is None and not changes
    job = records.Job(
        exemplar=a_prime,
        recipe=None if usual else chosen(recipe, config_file, changes, "analogy"),
        size=None,
        seeds=seeds_from(seed, count),
        valid=valid,
        completion=Completion(task="analogy", labels=labels),
        guide=a,
        output_guide=b,
    )
    run(job, jobs.Files(output, levels_dir, source_map, overwrite, figures(figure or ())))
