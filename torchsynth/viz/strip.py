"""All pyramid levels of a result side by side."""

from __future__ import annotations

import torch
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.result import Result
from torchsynth.viz.paper import GAP, Laid, paper, shown, stretched


def draw_pyramid(result: Result) -> Image:
    """The pyramid: a column for each level, the coarsest first, enlarged to the size of the finest.

    The rows are the exemplar at that level, what the level started from, and what it became. A level that a
    later one starts from can so be followed from left to right.

    Example:
        >>> import torchsynth as ts
        >>> recipe = ts.recipes.wei_levoy(levels=2, neighborhood=5)
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (20, 24), recipe)
        >>> draw_pyramid(result).shape  # two columns of 24, three rows of 16, 20 and 20, and gaps of 8
        torch.Size([1, 3, 88, 72])
    """
    rows = []
    for name in ("exemplar", "start", "image"):
        pictures = [shown(getattr(level, name).cpu().float()) for level in reversed(result.levels)]
        height, width = pictures[-1].shape[-2:]
        rows.append([stretched(picture, (height, width)) for picture in pictures])
    return torch.stack([_page(rows, item) for item in range(len(result.image))])


def _page(rows: list[list[Image]], item: int) -> Tensor:
    step = GAP + max(row[0].shape[-1] for row in rows)
    laid, top = [], GAP
    for row in rows:
        for number, pictures in enumerate(row):
            picture = pictures[item if len(pictures) > 1 else 0]
            laid.append(Laid(picture, top, GAP + number * step))
        top += GAP + row[0].shape[-2]
    return paper((top, GAP + step * len(rows[0])), laid)
