"""Minimum-error boundary cuts: where an overlap changes from the old block to the new one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor


def boundary_cut(error: Float64[Tensor, "strips length width"]) -> Int64[Tensor, "strips length"]:
    """The cheapest path down each strip, by dynamic programming: one column for each row.

    From row to row a path moves by at most one column; of equally cheap ones the lowest columns are taken,
    beginning with the last row.

    Args:
        error: What it costs to pass through each pixel; whole numbers, or infinite.

    Source: Efros & Freeman 2001, section 2.1.

    Example:
        >>> boundary_cut(torch.tensor([[[5.0, 1.0, 9.0], [9.0, 9.0, 2.0], [0.0, 3.0, 4.0]]]).double()).tolist()
        [[1, 2, 1]]
    """
    strips, length, _ = error.shape
    upto = torch.nn.functional.pad(error, (1, 1), value=math.inf)
    for row in range(1, length):
        before = upto[:, row - 1]
        best = torch.minimum(torch.minimum(before[:, :-2], before[:, 1:-1]), before[:, 2:])
        upto[:, row, 1:-1] += best
    path = torch.empty(strips, length, dtype=torch.int64, device=error.device)
    column = upto[:, -1, 1:-1].argmin(1, keepdim=True)
    path[:, -1:] = column
    around = torch.arange(3, device=error.device)
    for row in range(length - 2, -1, -1):
        step = upto[:, row].gather(1, column + around).argmin(1, keepdim=True)
        column = column + step - 1
        path[:, row : row + 1] = column
    return path


def beyond_cuts(
    error: Float64[Tensor, "batch side side"], overlaps: Sequence[int]
) -> Bool[Tensor, "batch side side"]:
    """Where a new block is shown: beyond the cuts through all its overlaps, the cuts included.

    Args:
        error: The squared difference between the new block and what was there.
        overlaps: How wide the overlap with what was there is at the top, left, bottom and right; 0
            where there is none.

    Source: Efros & Freeman 2001, section 2.1.

    Example:
        >>> error = torch.tensor([[[5.0, 1.0, 9.0], [9.0, 2.0, 9.0], [0.0, 3.0, 4.0]]]).double()
        >>> beyond_cuts(error, (0, 2, 0, 0)).int().tolist()
        [[[0, 1, 1], [0, 1, 1], [1, 1, 1]]]
    """
    shown = torch.ones_like(error, dtype=torch.bool)
    sides = [side for side in range(4) if overlaps[side] > 0]
    if not sides:
        return shown
    widest = max(overlaps)
    strips = [_turned(error, side)[:, :, : overlaps[side]] for side in sides]
    padded = [torch.nn.functional.pad(one, (0, widest - one.shape[2]), value=math.inf) for one in strips]
    paths = boundary_cut(torch.cat(padded)).unflatten(0, (len(sides), len(error)))
    depth = torch.arange(error.shape[2], device=error.device)
    for side, path in zip(sides, paths, strict=True):
        shown &= _turned_back(depth >= path.unsqueeze(2), side)
    return shown


def _turned(block: Tensor, side: int) -> Tensor:
    """A block turned so that one of its sides (top, left, bottom, right) is the first column."""
    block = block if side % 2 else block.transpose(1, 2)
    return block.flip(2) if side >= 2 else block


def _turned_back(block: Tensor, side: int) -> Tensor:
    block = block.flip(2) if side >= 2 else block
    return block if side % 2 else block.transpose(1, 2)
