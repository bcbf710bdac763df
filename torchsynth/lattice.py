"""Positions on the pixel lattice: sites, cells, and where the neighbors of a cell lie in memory.

A *site* is a flat position, ``row * width + column``; a *cell* is the pair ``(row, column)``. One
pyramid level up, the parent of a cell is ``cell // 2``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import torch
from jaxtyping import Bool, Int64
from torch import Tensor

from torchsynth._typing import Cells, Offsets, Sites

Shape: TypeAlias = tuple[int, int]
"""Height and width in pixels."""

Boundary: TypeAlias = Literal["torus", "open"]
"""``torus``: a neighborhood that leaves the output on one side comes in on the other, so that the
output tiles. ``open``: what lies outside is unknown and is left out of the comparison."""


@dataclass(frozen=True)
class Reads:
    """Where the neighbors of some sites lie: flat positions, and which of them exist.

    ``inside`` is None when all of them do (always so on a torus); a position that does not exist is
    stored as 0 and must not be used.
    """

    positions: Int64[Tensor, "sites neighbors"]
    inside: Bool[Tensor, "sites neighbors"] | None


def to_cells(sites: Sites, width: int) -> Cells:
    """Flat positions as (row, column) pairs.

    Example:
        >>> to_cells(torch.tensor([0, 7]), width=5).tolist()
        [[0, 0], [1, 2]]
    """
    return torch.stack((sites // width, sites % width), dim=1)


def parents(cells: Cells, up: int) -> Cells:
    """The cells ``up`` pyramid levels coarser: each step halves and rounds down.

    Example:
        >>> parents(torch.tensor([[5, 2]]), up=1).tolist()
        [[2, 1]]
    """
    return cells >> up


def read(cells: Cells, offsets: Offsets, shape: Shape, boundary: Boundary) -> Reads:
    """Find the neighbors ``cell + offset`` of every cell in a plane of the given shape.

    Example:
        >>> up = torch.tensor([[-1, 0]])
        >>> read(torch.tensor([[0, 3]]), up, (4, 5), "torus").positions.tolist()
        [[18]]
        >>> read(torch.tensor([[0, 3]]), up, (4, 5), "open").inside.tolist()
        [[False]]
    """
    height, width = shape
    rows = cells[:, :1] + offsets[:, 0]
    columns = cells[:, 1:] + offsets[:, 1]
    if boundary == "torus":
        return Reads(rows.remainder(height) * width + columns.remainder(width), None)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    return Reads((rows * width + columns) * inside, None if bool(inside.all()) else inside)
