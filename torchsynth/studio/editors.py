"""Canvases to paint on, in the page."""

from __future__ import annotations

from importlib.resources import files
from typing import Any, TypeAlias

from jaxtyping import Float
from torch import Tensor

from torchsynth.lattice import Shape
from torchsynth.studio.pictures import data_url
from torchsynth.studio.toolkit import gr

Sheet: TypeAlias = dict[str, Any]
"""What is painted on: ``height``, ``width``, ``url`` of a picture, ``colors`` and ``others``."""

HOLE_COLORS = ["#e0218a"]
"""Holes are painted in a color that textures seldom have."""

GRAYS = ["#000000", "#404040", "#808080", "#bfbfbf", "#ffffff"]

_TEMPLATE = "<div class='painter'><div class='painter-tools'></div><div class='painter-paper'></div></div>"


def canvas(name: str, sheet: Sheet) -> gr.HTML:
    """A canvas with a brush; its value is what was painted, as :func:`.painting.layer_of` reads it.

    Args:
        name: The element's id.
        sheet: What is painted on, and with which colors.
    """
    return gr.HTML(
        "", elem_id=name, html_template=_TEMPLATE, apply_default_css=False, padding=False,
        js_on_load=(files("torchsynth.studio") / "painter.js").read_text(encoding="utf-8"), sheet=sheet,
    )  # fmt: skip


def blank(shape: Shape, colors: list[str], *, others: bool = False) -> Sheet:
    """An empty sheet for a picture of that size.

    Args:
        shape: Of the picture.
        colors: What it is painted with, the first one chosen.
        others: Whether other colors can be picked.

    Example:
        >>> blank((2, 3), ["#000000"])
        {'height': 2, 'width': 3, 'url': '', 'colors': ['#000000'], 'others': False}
    """
    return {"height": shape[0], "width": shape[1], "url": "", "colors": colors, "others": others}


def showing(
    image: Float[Tensor, "channels height width"], colors: list[str], *, others: bool = False
) -> Sheet:
    """A sheet with a picture on it, and nothing painted yet.

    Example:
        >>> import torch
        >>> showing(torch.zeros(1, 2, 3), [])["url"][:15]
        'data:image/png;'
    """
    height, width = image.shape[1:]
    return blank((height, width), colors, others=others) | {"url": data_url(image)}


def on(sheet: Sheet) -> gr.HTML:
    """The canvas with another sheet. If only its colors are others, what was painted stays."""
    return gr.HTML(sheet=sheet)
