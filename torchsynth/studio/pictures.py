"""Tensors as pictures and HTML for the page: results, pyramids, progress."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from PIL import Image as Pillow
from torch import Tensor

from torchsynth._typing import Image


def pixels_of(image: Float[Tensor, "channels height width"]) -> NDArray[np.uint8]:
    """A picture as a browser shows it: ``(H, W, 3)``, or 4 if it has an alpha channel.

    Pictures of more than four channels show their first.

    Example:
        >>> pixels_of(torch.ones(2, 1, 1)).tolist()
        [[[255, 255, 255, 255]]]
    """
    channels = len(image)
    colors = image[:3] if channels in (3, 4) else image[:1].expand(3, -1, -1)
    shown = torch.cat((colors, image[-1:])) if channels in (2, 4) else colors
    steps = (shown.detach().cpu().double().clamp(0, 1) * 255).round().to(torch.uint8)
    array: NDArray[np.uint8] = steps.permute(1, 2, 0).contiguous().numpy()
    return array


def enlarged(pixels: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """A picture with every pixel as a square of so many.

    Example:
        >>> enlarged(np.array([[1, 2]], np.uint8), 2).tolist()
        [[1, 1, 2, 2], [1, 1, 2, 2]]
    """
    return pixels.repeat(factor, axis=0).repeat(factor, axis=1)


def data_url(image: Float[Tensor, "channels height width"]) -> str:
    """A picture as text that a page can hold.

    Example:
        >>> data_url(torch.zeros(1, 1, 1))[:22]
        'data:image/png;base64,'
    """
    buffer = io.BytesIO()
    Pillow.fromarray(pixels_of(image)).save(buffer, "PNG", compress_level=1)
    return f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"


class Pyramids:
    """The levels of sample, start and result side by side, coarse to fine, as far as they are known.

    Args:
        samples: The sample at each level, the finest first.

    Example:
        >>> pyramids = Pyramids([torch.zeros(1, 1, 4, 4), torch.zeros(1, 1, 2, 2)])
        >>> pyramids.put("start", 1, torch.zeros(1, 1, 3, 3))
        >>> pyramids.html().count("<img")
        3
    """

    ROWS = ("sample", "start", "result")

    def __init__(self, samples: Sequence[Image]) -> None:
        self._levels = len(samples)
        self._cells: dict[tuple[str, int], str] = {}
        for level, image in enumerate(samples):
            self.put("sample", level, image)

    def put(self, row: str, level: int, image: Image) -> None:
        """Show a picture in one of the rows."""
        height, width = image.shape[-2:]
        size = f"{height}x{width}"
        self._cells[row, level] = (
            f'<figure><img src="{data_url(image[0])}" alt="{row}, level {level}" data-size="{size}">'
            f"<figcaption>{height} &times; {width}</figcaption></figure>"
        )

    def html(self) -> str:
        """The whole table: levels from left to right, or the three pictures of the only level."""
        order = list(reversed(range(self._levels)))
        titles = {level: _level_name(level, self._levels) for level in order}
        if self._levels == 1:
            return _table_of({"": [self._cell(row, 0) for row in self.ROWS]}, self.ROWS)
        rows = {row: [self._cell(row, level) for level in order] for row in self.ROWS}
        return _table_of(rows, list(titles.values()))

    def _cell(self, row: str, level: int) -> str:
        empty = "<span class='waiting'></span>"
        return self._cells.get((row, level), empty)


def bar(text: str, share: float, state: str = "running") -> str:
    """A progress bar with a line of text.

    Args:
        text: What is said.
        share: How much is done, from 0 to 1.
        state: ``idle``, ``running``, ``done``, ``cancelled`` or ``failed``.

    Example:
        >>> 'aria-valuenow="50"' in bar("half", 0.5)
        True
    """
    percent = round(100 * share)
    return (
        f'<div class="bar {state}" role="progressbar" aria-valuemin="0" aria-valuemax="100" '
        f'aria-valuenow="{percent}"><div class="done" style="width:{percent}%"></div></div>'
        f'<div class="said {state}" role="status">{escape(text)}</div>'
    )


def table(rows: Mapping[str, Sequence[str]], heads: Sequence[str]) -> str:
    """A table of texts, one row for each name.

    Example:
        >>> table({"time": ["1 s", "2 s"]}, ["A", "B"]).count("<td>2 s</td>")
        1
    """
    return _table_of(
        {name: [escape(one) for one in cells] for name, cells in rows.items()}, heads, "measures"
    )


def _table_of(rows: Mapping[str, Sequence[str]], heads: Sequence[str], kind: str = "pyramids") -> str:
    """A table of HTML."""
    head = "".join(f"<th scope='col'>{escape(one)}</th>" for one in heads)
    body = "".join(
        f"<tr><th scope='row'>{escape(name)}</th>{''.join(f'<td>{one}</td>' for one in cells)}</tr>"
        for name, cells in rows.items()
    )
    return f"<table class='{kind}'><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table>"


def _level_name(level: int, levels: int) -> str:
    return f"level {level}" + {0: ", finest", levels - 1: ", coarsest"}.get(level, "")
