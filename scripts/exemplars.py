"""The pictures of a folder as gray exemplars of one size, as the experiments compare algorithms on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

import torchsynth as ts

SMALLEST = 64
"""Smaller pictures are left out: few of their neighborhoods are whole on a coarse level."""

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")

_MOST_LEVELS = 4
_COARSEST = 16  # as in the paper; below that, few 9x9 neighborhoods are whole


@dataclass(frozen=True)
class Texture:
    """A picture to synthesize from.

    Args:
        name: That of its file, without the suffix.
        image: ``(1, H, W)``.
    """

    name: str
    image: torch.Tensor

    @property
    def levels(self) -> int:
        """Four, or as many as leave the coarsest 16 pixels a side."""
        side = min(self.image.shape[1:])
        return 1 + sum(side >> level >= _COARSEST for level in range(1, _MOST_LEVELS))

    @property
    def caption(self) -> str:
        """Its name, size and levels, in words."""
        height, width = self.image.shape[1:]
        return f"{self.name}, {height}x{width}, {self.levels} level{'s' if self.levels > 1 else ''}"


def gathered(
    folder: Path, side: int, only: Sequence[str] | None = None, without: Sequence[str] = ()
) -> tuple[list[Texture], list[str]]:
    """The textures of a folder, by name, and why others are left out.

    Args:
        folder: Where the pictures are.
        side: The most pixels a side; see :func:`exemplar`.
        only: The names that are wanted; None takes all.
        without: The names that are not.

    Raises:
        InputError: If there is no folder, no picture in it that is large enough, or none of a name that is
            wanted; if a picture cannot be read; if two have one name.
    """
    files = _chosen(_files(folder), only, without)
    textures, left_out = [], []
    least = min(SMALLEST, side)
    for path in files:
        image = exemplar(ts.read_image(path), side)
        if min(image.shape[1:]) < least:
            left_out.append(f"{path.name} is left out: it has fewer than {least} pixels a side")
        else:
            textures.append(Texture(path.stem, image))
    if not textures:
        raise ts.InputError(
            str(folder), f"must hold pictures of {least}x{least} pixels or more", "all are smaller",
            "give larger ones",
        )  # fmt: skip
    return textures, left_out


def exemplar(image: torch.Tensor, side: int) -> torch.Tensor:
    """A picture in gray, shrunk by half, or less if it would become smaller than wanted, and cropped.

    Args:
        image: ``(C, H, W)``; an alpha channel is dropped, and the mean of the others taken.
        side: The most pixels a side. Smaller pictures stay as they are.
    """
    colors = image[:-1] if len(image) in (2, 4) else image
    gray = colors.mean(0, keepdim=True)
    height, width = gray.shape[1:]
    factor = min(2.0, min(height, width) / side)
    if factor > 1:
        shape = (round(height / factor), round(width / factor))
        gray = torch.nn.functional.interpolate(gray.unsqueeze(0), size=shape, mode="area")[0]
    height, width = gray.shape[1:]
    top, left = (max(0, (one - side) // 2) for one in (height, width))
    return gray[:, top : top + side, left : left + side].contiguous()


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise ts.InputError(
            "--textures", "must be a folder", f"{folder} is none", "give a folder with pictures"
        )
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file())
    if not found:
        raise ts.InputError(
            "--textures", f"must hold pictures ({' '.join(SUFFIXES)})", f"{folder} has none",
            "give another folder",
        )  # fmt: skip
    return found


def _chosen(files: Sequence[Path], only: Sequence[str] | None, without: Sequence[str]) -> list[Path]:
    names = [path.stem for path in files]
    for name in (*(only or ()), *without):
        if name not in names:
            raise ts.InputError(
                "--only and --without", "must be names of pictures, without their suffix",
                f"there is no {name!r}", f"choose among {', '.join(names)}",
            )  # fmt: skip
    chosen = [path for path in files if (only is None or path.stem in only) and path.stem not in without]
    doubled = [path.name for path in chosen if names.count(path.stem) > 1]
    if doubled:
        raise ts.InputError(
            "--textures", "must have a name of its own for each picture", f"there are {', '.join(doubled)}",
            "rename one",
        )  # fmt: skip
    if not chosen:
        raise ts.InputError("--without", "must leave pictures", "it leaves none", "name fewer")
    return chosen
