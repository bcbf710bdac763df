"""The command that carries maps over to an output: ``torchsynth apply``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import torch
import typer

from torchsynth._typing import SourceMap
from torchsynth.errors import InputError, OutputError
from torchsynth.io import (
    Picture,
    check_storable,
    check_writable,
    encode_image,
    read_picture,
    staging,
)
from torchsynth.lattice import Shape
from torchsynth.options import Overwrite, cancellable
from torchsynth.result import transfer
from torchsynth.source_map import read_source_map


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command("apply")(apply_to_files)


def apply_to_files(
    source_map: Annotated[
        Path, typer.Argument(metavar="SOURCE_MAP", help="What 'synthesize --source-map' wrote.")
    ],
    maps: Annotated[
        list[str],
        typer.Argument(
            metavar="MAP...", help="Pictures that lie upon the exemplar: normals, roughness, height."
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where the same pictures of the output go.")
    ],
    overwrite: Overwrite = False,
) -> None:
    """Make the other maps of a material: each pixel is copied from where the output's was.

    The maps have the exemplar's size, any depth and number of channels, and keep both; their files keep
    their names.
    """
    with cancellable():
        saved = read_source_map(source_map)
        source, size = saved.source, saved.exemplar
        pictures = {name: read_picture(name) for name in maps}
        for name, picture in pictures.items():
            _check_size(name, picture, size)
        _check_inside(source_map, source, size)
        targets = _targets(pictures, out, (source.shape[2], source.shape[3]), overwrite=overwrite)
        with staging() as put:
            for name, picture in pictures.items():
                image = transfer(source, picture.image, size)[0]
                put(targets[name], encode_image(image, targets[name], picture.depth))
    for path in targets.values():
        typer.echo(path)


def _check_size(name: str, picture: Picture, size: Shape) -> None:
    height, width = picture.image.shape[1:]
    if (height, width) != size:
        raise InputError(
            name, f"must have the exemplar's size, {size[0]}x{size[1]}", f"it is {height}x{width}",
            "pass the maps that belong to the exemplar",
        )  # fmt: skip


def _check_inside(path: Path, source: SourceMap, size: Shape) -> None:
    """A pixel without source is told by :func:`torchsynth.result.transfer`; one from outside is damage."""
    limits = torch.tensor(size).view(1, 2, 1, 1)
    if bool((source >= limits).any()) or bool((source < -1).any()):
        raise InputError(
            str(path), f"must lead into an exemplar of {size[0]}x{size[1]}", "it leads outside",
            "write it again",
        )  # fmt: skip


def _targets(pictures: dict[str, Picture], out: Path, size: Shape, *, overwrite: bool) -> dict[str, Path]:
    """Where each map goes; all that can be known about these files before the work."""
    if os.path.exists(out) and not os.path.isdir(out):
        raise OutputError(str(out), "must be a folder", "it is a file", "choose another name")
    if not os.path.exists(out):
        check_writable(out, overwrite=False)
    targets = {name: out / Path(name).name for name in pictures}
    taken = [os.path.realpath(name) for name in pictures]
    for name, path in targets.items():
        if list(targets.values()).count(path) > 1 or os.path.realpath(path) in taken:
            fact = "two maps have that name" if os.path.realpath(path) not in taken else "it is a map as well"
            raise OutputError(str(path), "must be a file of its own", fact, "choose another folder or name")
        check_storable(path, len(pictures[name].image), size)
        if os.path.exists(out):
            check_writable(path, overwrite=overwrite)
    return targets
