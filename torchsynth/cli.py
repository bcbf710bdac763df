"""The command line: synthesize, train, rerun, recipes, samples, show, schema; others are added to it."""

from __future__ import annotations

import json
import logging
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from torchsynth import (
    cli_analogy,
    cli_apply,
    cli_batch,
    cli_completion,
    cli_measure,
    cli_studio,
    config,
    jobs,
    records,
)
from torchsynth.errors import InputError, TorchsynthError
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
    cancellable,
    chosen,
    fail,
    figures,
    run,
    seeds_from,
)
from torchsynth.progress import training_bar
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES, further_pass, with_target
from torchsynth.samples import PREFIX, SAMPLES
from torchsynth.wishes import parse_size

app = typer.Typer(
    help="Example-based texture synthesis: give a small sample, get as much texture as you want.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command()
def synthesize(
    exemplar: Annotated[str, typer.Argument(help="The sample picture, or sample:NAME for a built-in one.")],
    output: Output,
    recipe: Annotated[
        str | None,
        typer.Option(
            help="A recipe by name; see 'torchsynth recipes'. Default: wei_levoy; ashikhmin_target with a "
            "target, wei_levoy_tsvq with a codebook.",
            show_default=False,
        ),
    ] = None,
    config_file: Config = None,
    changes: Changes = None,
    size: Annotated[
        str | None,
        typer.Option(
            metavar="HxW",
            help="Height and width of the output. Default: those of the target, or twice those of the exemplar.",
            show_default=False,
        ),
    ] = None,
    seed: Seed = 0,
    count: Count = 1,
    valid: Valid = None,
    initial: Annotated[
        str | None, typer.Option(metavar="FILE", help="Start from this picture instead of noise.")
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Follow this picture; if it has an alpha channel and the exemplar none, where it is opaque.",
        ),
    ] = None,
    target_region: Annotated[
        str | None, typer.Option(metavar="FILE", help="Follow the target only where this picture is white.")
    ] = None,
    passes: Annotated[
        int | None,
        typer.Option(help="How often to go over the output, 1 to 20: more follow the target more closely."),
    ] = None,
    angle: Annotated[
        str | None,
        typer.Option(
            metavar="FIELD",
            help="Turn the texture counter-clockwise: degrees, swirl:DEGREES, radial, wave:DEGREES,PERIODS, "
            "or a gray picture (black 0, white 360 degrees; float TIFF: degrees).",
        ),
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(
            metavar="FIELD",
            help="Enlarge its structures: a factor, zoom:LEFT,RIGHT, or a gray picture "
            "(black 1/4, middle 1, white 4; float TIFF: factors).",
        ),
    ] = None,
    blur_seams: Annotated[
        int | None, typer.Option(metavar="PIXELS", help="Blur along the boundaries of patches, e.g. 3.")
    ] = None,
    refine: Annotated[
        str | None,
        typer.Option(
            metavar="FILE.npz",
            help="Go once more over the output with this source map (see --source-map), by default with "
            "ashikhmin, or ashikhmin_target if there is a target.",
        ),
    ] = None,
    figure: Figure = None,
    codebook: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Use what 'torchsynth train' trained. [default recipe: wei_levoy_tsvq]"
        ),
    ] = None,
    levels_dir: LevelsDir = None,
    source_map: SourceMapFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Make new texture that looks like the exemplar.

    Beside OUT.png a record OUT.json is written; 'torchsynth rerun OUT.json' makes the same bytes again.
    With --count N the files are OUT-0.png to OUT-(N-1).png.
    """
    usual = "ashikhmin_target" if target is not None else "wei_levoy" if refine is None else "ashikhmin"
    if codebook is not None and target is not None:
        raise InputError(
            "--codebook", "serves the recipe it was trained for", "--target adds another layer to it",
            "write a recipe that follows a target in YAML, train it with --config, and use it with --config",
        )  # fmt: skip
    picked = chosen(recipe, config_file, changes, usual if codebook is None else "wei_levoy_tsvq")
    job = records.Job(
        exemplar=exemplar,
        recipe=_adapted(picked, target is not None, passes, blur_seams, refine is not None),
        size=None if size is None else parse_size(size),
        seeds=seeds_from(seed, count),
        valid=valid,
        initial=initial,
        target=target,
        target_region=target_region,
        angle=angle,
        scale=scale,
        codebook=codebook,
        source_map=refine,
    )
    files = jobs.Files(output, levels_dir, source_map, overwrite, figures(figure or ()))
    run(job, files)


for commands in (cli_completion, cli_analogy, cli_apply, cli_batch, cli_measure, cli_studio):
    commands.register(app)


@app.command()
def rerun(
    record: Annotated[Path, typer.Argument(help="The .json that was written beside a picture.")],
    output: Output,
    figure: Figure = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a picture again from its record: the same bytes, with the same versions."""
    job = records.load_record(record)
    for change in records.changed_versions(record):
        typer.echo(f"note: the record was made with {change}; the bytes may differ", err=True)
    run(job, jobs.Files(output, None, None, overwrite, figures(figure or ())))


@app.command()
def train(
    exemplar: Annotated[str, typer.Argument(help="The sample picture, or sample:NAME for a built-in one.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The codebook to write: a .safetensors file.")
    ],
    recipe: Annotated[
        str | None,
        typer.Option(
            help="A recipe by name that searches with trees. Default: wei_levoy_tsvq.", show_default=False
        ),
    ] = None,
    config_file: Config = None,
    changes: Changes = None,
    valid: Valid = None,
    overwrite: Overwrite = False,
) -> None:
    """Train the trees for an exemplar once, for 'torchsynth synthesize --codebook'."""
    picked = chosen(recipe, config_file, changes, "wei_levoy_tsvq")
    job = records.Job(exemplar, picked, None, (), valid=valid)
    with cancellable(), training_bar() as progress:
        written = jobs.run_training(job, output, overwrite=overwrite, progress=progress)
    typer.echo(written)


@app.command()
def recipes() -> None:
    """List the recipes, one line each."""
    _list({name: make().description for name, make in RECIPES.items()})


@app.command()
def samples() -> None:
    """List the built-in samples; each can be used wherever an image file can."""
    _list({f"{PREFIX}{name}": about for name, about in SAMPLES.items()})


@app.command()
def show(recipe: Annotated[str, typer.Argument(help="A recipe's name, or a YAML file.")]) -> None:
    """Print a recipe as YAML: a start for one of your own."""
    typer.echo(config.dump_recipe(config.load_recipe(recipe)), nl=False)


@app.command()
def schema() -> None:
    """Print the JSON schema of recipe files, for editors."""
    typer.echo(json.dumps(config.recipe_schema(), indent=2))


def _print_version(wanted: bool) -> bool:
    if wanted:
        typer.echo(f"torchsynth {version('torchsynth-textures')}")
        raise typer.Exit
    return wanted


@app.callback()
def _options(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0, or 2 with one line about what was wrong.

    Args:
        arguments: As in a shell; None means this process's own.

    Example:
        >>> main(["show", "nothing"])
        2
    """
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # its complaints come as our errors
    try:
        app(arguments, prog_name="torchsynth")
    except TorchsynthError as error:
        return fail(str(error))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    return 0


def entry_point() -> None:
    """What the ``torchsynth`` script calls."""
    sys.exit(main())


def _adapted(
    recipe: Recipe, has_target: bool, passes: int | None, blur_seams: int | None, again: bool
) -> Recipe:
    """The recipe with what the options of the command line ask of it."""
    if passes is not None and again:
        raise InputError(
            "--passes", "cannot be given to --refine", "that is one pass", "leave one of them out"
        )
    if passes is not None and not has_target:
        raise InputError(
            "--passes", "must come with a target to follow", "there is none", "give --target as well"
        )
    if has_target and (passes is not None or not recipe.follows_target):
        recipe = with_target(recipe, passes=passes)
    if again:
        recipe = further_pass(recipe)
    if blur_seams is not None:
        recipe = config.parse_recipe(recipe.plain() | {"blur_seams": blur_seams}, "--blur-seams")
    return recipe


def _list(rows: dict[str, str]) -> None:
    width = max(map(len, rows))
    for name, about in rows.items():
        typer.echo(f"{name:{width}}   {about}")
