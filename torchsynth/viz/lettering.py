"""Words and scales of color, which matplotlib draws; nothing else in this package needs it.

Every line is drawn for itself, in the letters that come with matplotlib whatever the user's settings, and
without matplotlib's global state.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth.errors import InputError
from torchsynth.viz.paper import Laid, block, paper

LINE = 18
"""The height of a line of words, in pixels."""

BAR = 72
"""The width of a scale of colors with its numbers, in pixels."""

_LETTERS = 12
_STRIPE = 14
_SCALE = "viridis"


def check_matplotlib(subject: str) -> None:
    """Drawings with words need an extra library.

    Args:
        subject: What is to be drawn.

    Raises:
        InputError: If it is not installed.

    Example:
        >>> check_matplotlib("figure tree")
    """
    if find_spec("matplotlib") is None:
        raise InputError(
            subject, "needs Matplotlib for its words and colors", "it is not installed",
            'install it with: pip install "torchsynth-textures[viz]"',
        )  # fmt: skip


def lettering(text: str) -> Float[Tensor, "3 height width"]:
    """One line of words, black on white, as wide as they are.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> lettering("seed 1").shape[1] == LINE
        True
    """
    check_matplotlib("words")
    return _drawn(text)


def caption(text: str, width: int) -> Float[Tensor, "3 height width"]:
    """Words in as many lines as they need to be no wider than this.

    Args:
        text: The words; a word that is too long alone is cut.
        width: In pixels.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> caption("wei_levoy 64x64, seed 0", 100).shape[1:] == (2 * LINE, 100)
        True
    """
    lines = [lettering(line)[..., :width] for line in _wrapped(text, width)]
    return paper((LINE * len(lines), width), (Laid(line, LINE * n, 0) for n, line in enumerate(lines)))


def shades(values: Float[Tensor, "height width"]) -> Float[Tensor, "3 height width"]:
    """Numbers from 0 to 1 as colors, the larger the lighter.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> dark, light = shades(torch.tensor([[0.0, 1.0]])).mean(0)[0]
        >>> bool(dark < light)
        True
    """
    check_matplotlib("colors")
    from matplotlib import colormaps

    colors = colormaps[_SCALE](values.double().cpu().numpy())[..., :3]
    return torch.from_numpy(colors).permute(2, 0, 1).float()


def scale(height: int, ticks: Sequence[tuple[float, str]]) -> Float[Tensor, "3 height width"]:
    """The key to :func:`shades`: a strip of its colors, 1 at the top, with words beside it.

    Args:
        height: In pixels.
        ticks: At which values there are words, and which.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> scale(60, [(0.0, "0"), (1.0, "12")]).shape[1:] == (60, BAR)
        True
    """
    strip = shades(torch.linspace(1, 0, height).unsqueeze(1).expand(-1, _STRIPE))
    laid = [Laid(strip, 0, 0)]
    for value, text in ticks:
        row = round((1 - value) * (height - 1))
        laid.append(Laid(block((0.0, 0.0, 0.0), (1, 4)), row, _STRIPE))
        words = lettering(text)[..., : BAR - _STRIPE - 6]
        laid.append(Laid(words, min(max(0, row - LINE // 2), height - LINE), _STRIPE + 6))
    return paper((height, BAR), laid)


@lru_cache(maxsize=1024)
def _drawn(text: str) -> Tensor:
    width = _width(text) + 1
    canvas = _canvas(width)
    canvas.figure.text(
        0, 0.28, text, va="baseline", ha="left", color="black", fontproperties=_font(), parse_math=False,
        usetex=False, antialiased=True,
    )  # fmt: skip
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    return torch.from_numpy(pixels.copy()).permute(2, 0, 1).float() / 255


@lru_cache(maxsize=4096)
def _width(text: str) -> int:
    """How many pixels a line takes."""
    if not text:
        return 0
    renderer = _canvas(1).get_renderer()
    width: float = renderer.get_text_width_height_descent(text, _font(), ismath=False)[0]
    return math.ceil(width)


def _canvas(width: int) -> Any:  # noqa: ANN401 (matplotlib may be missing)
    """A white line of so many pixels, at one pixel a point."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 72, LINE / 72), dpi=72, facecolor="white", edgecolor="white")
    figure.set_layout_engine("none")  # whatever the user's settings
    return FigureCanvasAgg(figure)


def _font() -> Any:  # noqa: ANN401 (matplotlib may be missing)
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties

    return FontProperties(fname=Path(mpl.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"), size=_LETTERS)


def _wrapped(text: str, width: int) -> Iterator[str]:
    """Lines no wider than this, but for single words."""
    line = ""
    for word in text.split():
        longer = f"{line} {word}".strip()
        if line and _width(longer) > width:
            yield line
            longer = word
        line = longer
    yield line
