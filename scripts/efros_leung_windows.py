"""What the width of the window does: ``python scripts/efros_leung_windows.py --out windows.png``.

This is the experiment of figure 2 in A. Efros and T. Leung, *Texture synthesis by non-parametric sampling*,
ICCV 1999: one row for each picture, with the picture at the left and beside it what is grown from it with
windows of 5, 11, 15 and 23 pixels. A window that is smaller than the largest regular feature holds pieces
of it; a larger one holds it whole, and then the distances between several of them. One that is nearly as
large as the picture finds few places to continue from, and garbage grows.

Time grows with the area of the window and with those of the picture and the output: only the middle of each
picture is used.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import arguments
import numpy as np
import torch
from layout import Pixels, framed, in_a_column, in_a_row, labelled, shown
from PIL import Image

import torchsynth as ts

RINGS = "rings"
PICTURES = (RINGS, "sample:brick", "sample:gravel", "sample:grass", "sample:pebbles")
WINDOWS = (5, 11, 15, 23)

# Of the rings, in pixels: the distance between them, how far each may be from its place, and their size.
_DISTANCE, _JITTER, _RADIUS, _LINE = 16, 2.0, 5.5, 2.0


def rings(height: int, width: int, seed: int = 0) -> torch.Tensor:
    """Black rings on white, each a little off its place in a grid; no two overlap."""
    generator = torch.Generator().manual_seed(seed)
    across = (height // _DISTANCE + 2, width // _DISTANCE + 2)
    grid = torch.cartesian_prod(*(torch.arange(count) * float(_DISTANCE) for count in across))
    centers = grid + (2 * torch.rand(grid.shape, generator=generator) - 1) * _JITTER
    rows, columns = torch.arange(height).view(-1, 1, 1), torch.arange(width).view(-1, 1)
    nearest = torch.hypot(rows - centers[:, 0], columns - centers[:, 1]).amin(2)
    # A line fades out over one pixel at either side.
    ink = (_LINE / 2 + 0.5 - (nearest - _RADIUS).abs()).clamp(0, 1)
    return (1 - ink).unsqueeze(0)


def picture(name: str, part: tuple[int, int]) -> torch.Tensor:
    """The middle of a picture, or a picture of rings."""
    if name == RINGS:
        return rings(*part)
    image = ts.read_image(name)
    height, width = (min(side, wanted) for side, wanted in zip(image.shape[1:], part, strict=True))
    top, left = (image.shape[1] - height) // 2, (image.shape[2] - width) // 2
    image = image[:, top : top + height, left : left + width]
    return image[:-1] if len(image) in (2, 4) else image


def check_windows(images: dict[str, torch.Tensor], windows: Sequence[int]) -> None:
    """Every window must fit into every picture, before the first takes its minutes."""
    for name, image in images.items():
        height, width = image.shape[1:]
        if max(windows) > min(height, width):
            raise ts.InputError(
                "windows", f"must fit into the middle of {name}, {height}x{width}",
                f"one has {max(windows)} pixels", "leave it out, or use a larger part",
            )  # fmt: skip


def figure(
    images: Sequence[torch.Tensor], windows: Sequence[int], size: tuple[int, int], seed: int = 0
) -> Pixels:
    """One row for each picture: itself, and what is grown from it with each window."""
    rows = []
    for image in images:
        sample = shown(image)
        row = [labelled(framed(sample, max(len(sample), size[0]), sample.shape[1]), "picture")]
        for window in windows:
            recipe = ts.recipes.efros_leung(window=window)
            grown = ts.synthesize(image, size, recipe, seed=seed).image[0]
            row.append(labelled(framed(shown(grown), max(len(sample), size[0]), size[1]), f"{window} pixels"))
        rows.append(in_a_row(row))
    width = max(row.shape[1] for row in rows)
    return in_a_column([framed(row, len(row), width) for row in rows])


def window(text: str) -> int:
    """A side that a window can have."""
    side = arguments.whole_number(3)(text)
    if side % 2 == 0:
        raise argparse.ArgumentTypeError(f"must be odd, to have a middle, but it is {side}")
    return side


def picture_to_write(text: str) -> Path:
    """A file whose name says in which format pictures are written."""
    path = arguments.file_to_write(text)
    if path.suffix.lower() not in (".png", ".jpg"):
        raise argparse.ArgumentTypeError(f"must end in .png or .jpg, but it is {path}")
    return path


def main() -> None:
    """Make the figure."""
    parser = argparse.ArgumentParser(description="Efros & Leung's experiment on the width of the window.")
    names = f"files, sample:NAME, or the word {RINGS} for rings drawn here; default: {' '.join(PICTURES)}"
    parser.add_argument("--pictures", nargs="+", default=PICTURES, metavar="PICTURE", help=names)
    parser.add_argument("--windows", nargs="+", type=window, default=WINDOWS, metavar="PIXELS")
    part = "how much of each picture's middle is used; default: 64x64"
    parser.add_argument("--part", type=arguments.size, default=(64, 64), metavar="HxW", help=part)
    size = "of each output; default: 96x96"
    parser.add_argument("--size", type=arguments.size, default=(96, 96), metavar="HxW", help=size)
    parser.add_argument("--seed", type=arguments.whole_number(0), default=0)
    parser.add_argument("--out", type=picture_to_write, required=True, help="the figure to write")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        images = {name: picture(name, options.part) for name in options.pictures}
        check_windows(images, options.windows)
        made = figure(list(images.values()), options.windows, options.size, options.seed)
        Image.fromarray((made * 255).round().astype(np.uint8)).save(options.out, quality=90)
        print(options.out)


if __name__ == "__main__":
    main()
