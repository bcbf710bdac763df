"""Regions that grow: dilation of masks, by kornia's."""

from __future__ import annotations

import torch
from kornia.morphology import dilation

from torchsynth._typing import Region


def grown(region: Region, pixels: int) -> Region:
    """A region and all that is at most so many pixels away from it, along rows and columns.

    Example:
        >>> region = torch.tensor([[False, False, False, True, False]])
        >>> grown(region, 1).tolist()
        [[False, False, True, True, True]]
    """
    pixels = min(pixels, max(region.shape))  # farther than the picture is large, there is nothing
    picture = region.to(torch.float32)[None, None]
    for axis in (2, 3):  # a square is a column and a row: far fewer comparisons
        shape = [1, 1]
        shape[axis - 2] = 2 * pixels + 1
        picture = dilation(picture, torch.ones(shape, device=region.device))
    grown_: Region = picture[0, 0] > 0
    return grown_
