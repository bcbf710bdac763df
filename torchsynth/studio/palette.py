"""Colors for the brush, taken from the sample."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image as Pillow
from torch import Tensor

from torchsynth.studio.pictures import pixels_of

COLORS = 8
"""How many colors a sample gives at once."""


def palette(image: Float[Tensor, "channels height width"], colors: int = COLORS) -> list[str]:
    """Some colors that stand for all of a sample's, dark to bright: each is one of its own.

    Args:
        image: The sample.
        colors: At most so many.

    Returns:
        ``#rrggbb``, the same ones each time.

    Source:
        Heckbert 1982, median cut; then the nearest color that the sample has.

    Example:
        >>> palette(torch.tensor([[[0.0, 1.0, 1.0]]]))
        ['#000000', '#ffffff']
    """
    seen = np.unique(pixels_of(image)[..., :3].reshape(-1, 3), axis=0).astype(np.int64)
    cut = Pillow.fromarray(pixels_of(image)[..., :3]).quantize(colors, Pillow.Quantize.MEDIANCUT)
    wanted = np.array(cut.getpalette(), np.int64).reshape(-1, 3)[:colors]
    nearest = {tuple(seen[((seen - one) ** 2).sum(1).argmin()].tolist()) for one in wanted}
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in sorted(nearest, key=lambda one: (sum(one), one))]


def color_at(image: Float[Tensor, "channels height width"], row: int, column: int) -> str:
    """The color of one pixel of a sample.

    Example:
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
