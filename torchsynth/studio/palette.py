"""Colors for the brush, taken from the sample."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from torchsynth.studio.pictures import pixels_of

COLORS = 8
"""How many colors a sample gives at once."""

# Colors of one cell count as one, and a cell counts if it holds so many of the pixels.
_CELL, _BASE, _SHARE = 24, 256 // 24 + 1, 0.003


def palette(image: Float[Tensor, "channels height width"], colors: int = COLORS) -> list[str]:
    """Some colors that stand for all of a sample's, dark to bright: each is one of its own.

    Args:
        image: The sample.
        colors: At most so many.

    Returns:
        ``#rrggbb``, the same ones each time.

    Source:
        Gonzalez 1985: one after the other, the color that is farthest from those before it.

    Example:
        >>> import torch
        >>> palette(torch.tensor([[[0.0, 1.0, 1.0]]]))
        ['#000000', '#ffffff']
    """
    pixels = pixels_of(image)[..., :3].reshape(-1, 3).astype(np.int64)
    cells = pixels // _CELL @ np.array([_BASE**2, _BASE, 1])
    names, sizes = np.unique(cells, return_counts=True)
    common = names[sizes >= min(sizes.max(), len(pixels) * _SHARE)]
    middles = np.array([_middle(pixels[cells == one]) for one in common])
    chosen = _apart(middles, _middle(pixels[cells == names[sizes.argmax()]]), colors)
    return ["#{:02x}{:02x}{:02x}".format(*one) for one in sorted(chosen, key=lambda one: (sum(one), one))]


def _middle(pixels: NDArray[np.int64]) -> list[int]:
    """The color that is nearest to the mean of all."""
    nearest: list[int] = pixels[((pixels * len(pixels) - pixels.sum(0)) ** 2).sum(1).argmin()].tolist()
    return nearest


def _apart(found: NDArray[np.int64], first: list[int], number: int) -> list[list[int]]:
    """The first color, and each time the one that is farthest from all that are chosen."""
    chosen = [np.array(first)]
    distance = ((found - chosen[0]) ** 2).sum(1)
    while len(chosen) < number and distance.max() > 0:
        chosen.append(found[distance.argmax()])
        distance = np.minimum(distance, ((found - chosen[-1]) ** 2).sum(1))
    return [one.tolist() for one in chosen]


def color_at(image: Float[Tensor, "channels height width"], row: int, column: int) -> str:
    """The color of one pixel of a sample.

    Example:
        >>> import torch
        >>> color_at(torch.ones(1, 2, 2), 0, 1)
        '#ffffff'
    """
    r, g, b = pixels_of(image[:, row : row + 1, column : column + 1])[0, 0, :3].tolist()
    return f"#{r:02x}{g:02x}{b:02x}"


def with_color(colors: list[str], color: str) -> list[str]:
    """The colors with one more in front; it comes only once.

    Example:
        >>> with_color(["#000000", "#ffffff"], "#ffffff")
        ['#ffffff', '#000000']
    """
    return [color, *(one for one in colors if one != color)]
