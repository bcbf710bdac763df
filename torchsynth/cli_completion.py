"""The commands that complete pictures: ``torchsynth fill``, ``extend`` and ``tile``."""

from __future__ import annotations

import os
import re
from typing import Annotated

import typer

from torchsynth import jobs, records
from torchsynth.errors import InputError
from torchsynth.lattice import Shape
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
    chosen,
    figures,
    run,
    seeds_from,
)
from torchsynth.recipe import Recipe
from torchsynth.records import Completion
from torchsynth.wishes import parse_size

ImageFile = Annotated[
    str, typer.Argument(metavar="IMAGE", help="The picture, or sample:NAME for a built-in one.")
]
RecipeName = Annotated[
    str | None,
    typer.Option(
        help="A recipe by name: coherent_fill (fast), efros_leung, wei_levoy_fill or any other. Default: "
        "coherent_fill, with fewer levels if the picture is too small for them.",
        show_default=False,
    ),
]
SampleFrom = Annotated[
    str | None, typer.Option(metavar="REGION", help="Sample only where this picture is white.")
]


def register(app: typer.Typer) -> None:
    """Add the commands to an application."""
    for command in (fill, extend, tile):
        app.command()(command)


def fill(
    image: ImageFile,
    hole: Annotated[
        str,
        typer.Argument(
            help="What to fill: a picture that is white there (lighter than half); or the word alpha, for "
            "where IMAGE is transparent; or a color such as #ff00ff that marks it in IMAGE."
        ),
    ],
    output: Output,
    from_: Annotated[
        str | None, typer.Option("--from", metavar="OTHER_IMAGE", help="Sample another picture.")
    ] = None,
    sample_from: SampleFrom = None,
    within: Annotated[
        int | None,
        typer.Option(metavar="PIXELS", help="Sample only so many pixels around the hole: faster for photos."),
    ] = None,
    recipe: RecipeName = None,
    config_file: Config = None,
    changes: Changes = None,
    seed: Seed = 0,
    count: Count = 1,
    figure: Figure = None,
    levels_dir: LevelsDir = None,
    source_map: SourceMapFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Fill the holes of a picture with texture: repair it, or remove what is marked.

    Outside the hole the picture stays as it is; write it as .png or .tif, as .jpg changes every pixel.
    """
    marked = os.path.exists(hole)
    job = records.Job(
        exemplar=image if from_ is None else from_,
        recipe=_recipe(recipe, config_file, changes),
        size=None,
        seeds=seeds_from(seed, count),
        valid=sample_from,
        completion=Completion(task="fill", hole=None if marked else hole, within=within),
        image=None if from_ is None else image,
        hole=hole if marked else None,
    )
    run(job, jobs.Files(output, levels_dir, source_map, overwrite, figures(figure or ())))


def extend(
    image: ImageFile,
    output: Output,
    size: Annotated[
        str | None, typer.Option(metavar="HxW", help="Height and width of the result.", show_default=False)
    ] = None,
    by: Annotated[
        int | None, typer.Option(metavar="PIXELS", help="Extend by so much on each of the four sides.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="ROW,COLUMN",
            help="Where the picture goes in the result, e.g. 0,0 to extend it only to the right and below. "
            "Default: in the middle, give or take 3 pixels.",
            show_default=False,
        ),
    ] = None,
    sample_from: SampleFrom = None,
    recipe: RecipeName = None,
    config_file: Config = None,
    changes: Changes = None,
    seed: Seed = 0,
    count: Count = 1,
    figure: Figure = None,
    levels_dir: LevelsDir = None,
    source_map: SourceMapFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Extend a picture beyond its borders with more of the same; the picture itself stays as it is."""
    if (size is None) == (by is None):
        fact = "neither is given" if size is None else "both are"
        raise InputError("--size and --by", "one of them must be given", fact, "write e.g. --size 300x400")
    job = records.Job(
        exemplar=image,
        recipe=_recipe(recipe, config_file, changes),
        size=parse_size(size) if size is not None else jobs.size_larger_by(image, by or 0),
        seeds=seeds_from(seed, count),
        valid=sample_from,
        completion=Completion(task="extend", at=_place(at, by)),
    )
    run(job, jobs.Files(output, levels_dir, source_map, overwrite, figures(figure or ())))


def tile(
    image: ImageFile,
    output: Output,
    width: Annotated[
        int | None,
        typer.Option(
            metavar="PIXELS",
            help="Width of the strip that is made anew, half of it at each border. Default: an eighth of the "
            "shorter side.",
            show_default=False,
        ),
    ] = None,
    hole: Annotated[
        str | None,
        typer.Option(metavar="HOLE", help="Fill this as well: see 'torchsynth fill'.", show_default=False),
    ] = None,
    recipe: RecipeName = None,
    config_file: Config = None,
    changes: Changes = None,
    seed: Seed = 0,
    count: Count = 1,
    figure: Figure = None,
    levels_dir: LevelsDir = None,
    source_map: SourceMapFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a picture tile, by making a strip along its border anew; all else stays as it is."""
    marked = hole is not None and os.path.exists(hole)
    job = records.Job(
        exemplar=image,
        recipe=_recipe(recipe, config_file, changes),
        size=None,
        seeds=seeds_from(seed, count),
        completion=Completion(task="tile", hole=None if marked else hole, width=width),
        hole=hole if marked else None,
    )
    run(job, jobs.Files(output, levels_dir, source_map, overwrite, figures(figure or ())))


def _recipe(name: str | None, file: Config, changes: list[str] | None) -> Recipe | None:
    """The recipe that was asked for; None if nothing was."""
    if name is None and file is None and not changes:
        return None
    return chosen(name, file, changes, "coherent_fill")


def _place(at: str | None, by: int | None) -> Shape | None:
    """Where the picture goes: where it was asked for, or so far from all sides; None leaves it open."""
    if at is not None:
        return _parse_place(at)
    return None if by is None else (by, by)


def _parse_place(text: str) -> Shape:
    match = re.fullmatch(r"(\d{1,9}),(\d{1,9})", text.strip())
    if match is None:
        raise InputError("--at", "must be ROW,COLUMN in pixels", f"it is {text!r}", "write e.g. 0,64")
    return int(match[1]), int(match[2])
