"""The command line: ``torchsynth synthesize``, ``train``, ``recipes``, ``show``, ``schema``, ``samples``, ``rerun``."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from torchsynth import config, jobs, records
from torchsynth.errors import ConfigError, InputError, TorchsynthError
from torchsynth.progress import progress_bar, training_bar
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES, with_target
from torchsynth.samples import PREFIX, SAMPLES

app = typer.Typer(
    help="Example-based texture synthesis: give a small sample, get as much texture as you want.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_MOST = 10_000

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
    seed: Annotated[int, typer.Option(help="Which texture of the many possible ones.")] = 0,
    count: Annotated[int, typer.Option(help="How many outputs; their seeds are SEED, SEED + 1, ...")] = 1,
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
    figure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=FILE",
            help="Also draw: patches (their boundaries), sources (where pixels come from), field.",
        ),
    ] = None,
    codebook: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Use what 'torchsynth train' trained. [default recipe: wei_levoy_tsvq]"
        ),
    ] = None,
    levels_dir: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Also write every pyramid level here.")
    ] = None,
    source_map: Annotated[
        Path | None, typer.Option(metavar="FILE.npz", help="Also write where each pixel was copied from.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make new texture that looks like the exemplar.

    Beside OUT.png a record OUT.json is written; 'torchsynth rerun OUT.json' makes the same bytes again.
    With --count N the files are OUT-0.png to OUT-(N-1).png.
    """
    if not 1 <= count <= _MOST:
        raise InputError(
            "--count", f"must be from 1 to {_MOST}", f"it is {count}", "choose a number between them"
        )
    usual = "wei_levoy" if target is None else "ashikhmin_target"
    if codebook is not None and target is not None:
        raise InputError(
            "--codebook", "serves the recipe it was trained for", "--target adds another layer to it",
            "write a recipe that follows a target in YAML, train it with --config, and use it with --config",
        )  # fmt: skip
    chosen = _chosen(recipe, config_file, changes, usual if codebook is None else "wei_levoy_tsvq")
    job = records.Job(
        exemplar=exemplar,
        recipe=_adapted(chosen, target is not None, passes, blur_seams),
        size=None if size is None else jobs.parse_size(size),
        seeds=tuple(range(seed, seed + count)),
        valid=valid,
        initial=initial,
        target=target,
        target_region=target_region,
        angle=angle,
        scale=scale,
        codebook=codebook,
    )
    files = jobs.Files(output, levels_dir, source_map, overwrite, _figures(figure or ()))
    _run(job, files)


@app.command()
def rerun(
    record: Annotated[Path, typer.Argument(help="The .json that was written beside a picture.")],
    output: Output,
    overwrite: Overwrite = False,
) -> None:
    """Make a picture again from its record: the same bytes, with the same versions."""
    job = records.load_record(record)
    for change in records.changed_versions(record):
        typer.echo(f"note: the record was made with {change}; the bytes may differ", err=True)
    _run(job, jobs.Files(output, None, None, overwrite))


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
    chosen = _chosen(recipe, config_file, changes, "wei_levoy_tsvq")
    job = records.Job(exemplar, chosen, None, (), valid=valid)
    with _cancellable(), training_bar() as progress:
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
        return _fail(str(error))
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else 0
    return 0


def entry_point() -> None:
    """What the ``torchsynth`` script calls."""
    sys.exit(main())


def _fail(message: str) -> int:
    line = " ".join(message.splitlines())  # a file name may hold a line break
    typer.secho(f"error: {line}", err=True, fg="red" if sys.stderr.isatty() else None)
    return 2


def _chosen(recipe: str | None, file: Path | None, changes: list[str] | None, usual: str) -> Recipe:
    """The recipe that was asked for, or the usual one, with the changes that were asked for."""
    if recipe is not None and file is not None:
        raise ConfigError("--recipe and --config", "only one of them can be given", "both are", "drop one")
    return config.load_recipe(file or recipe or usual, changes or ())


def _adapted(recipe: Recipe, has_target: bool, passes: int | None, blur_seams: int | None) -> Recipe:
    """The recipe with what the options of the command line ask of it."""
    if passes is not None and not has_target:
        raise InputError(
            "--passes", "must come with a target to follow", "there is none", "give --target as well"
        )
    if has_target and (passes is not None or not recipe.follows_target):
        recipe = with_target(recipe, passes=1 if passes is None else passes)
    if blur_seams is not None:
        recipe = config.parse_recipe(
            recipe.model_dump(mode="json", exclude_none=True) | {"blur_seams": blur_seams}, "--blur-seams"
        )
    return recipe


def _figures(wanted: Sequence[str]) -> dict[str, Path]:
    """Which drawings go where."""
    figures: dict[str, Path] = {}
    for text in wanted:
        kind, equals, path = text.partition("=")
        if not equals or not path or kind in figures:
            fact = f"{kind} is there twice" if kind in figures else f"it is {text!r}"
            raise InputError(
                "--figure", "must be KIND=FILE, each kind once", fact, "write e.g. patches=seams.png"
            )
        figures[kind] = Path(path)
    return figures


def _run(job: records.Job, files: jobs.Files) -> None:
    with _cancellable(), progress_bar() as progress:
        written = jobs.run(job, files, progress)
    for path in written:
        typer.echo(path)


@contextmanager
def _cancellable() -> Iterator[None]:
    """Ctrl-C ends the work with one line and exit code 2."""
    try:
        yield
    except KeyboardInterrupt:
        raise typer.Exit(_fail("cancelled: no unfinished file was left behind")) from None


def _list(rows: dict[str, str]) -> None:
    width = max(map(len, rows))
    for name, about in rows.items():
        typer.echo(f"{name:{width}}   {about}")
