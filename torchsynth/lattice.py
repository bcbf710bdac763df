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

from torchsynth._typing import Cells, Frames, Offsets, Sites

Shape: TypeAlias = tuple[int, int]
"""Height and width in pixels."""

Boundary: TypeAlias = Literal["torus", "open"]
"""``torus``: a neighborhood that leaves the output on one side comes in on the other, so that the
output tiles. ``open``: what lies outside is unknown and is left out of the comparison."""


@dataclass(frozen=True)
class Reads:
    """Where the neighbors of some sites lie: flat positions, and which of them exist.

    ``inside`` is None when all of them do (always so on a torus). One that does not exist is stored as
    the position behind the last, where planes of the output keep an empty pixel.
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


def distorted(offsets: Offsets, frames: Frames) -> Int64[Tensor, "sites neighbors 2"]:
    """The offsets of each site, turned and scaled by its frame and rounded to pixels.

    Example:
        >>> quarter_turn = torch.tensor([[[0.0, -1.0], [1.0, 0.0]]], dtype=torch.float64)
        >>> distorted(torch.tensor([[0, 3]]), quarter_turn).tolist()
        [[[-3, 0]]]
    """
    return torch.einsum("sij,kj->ski", frames, offsets.to(frames)).round().long()


def read(
    cells: Cells,
    offsets: Offsets | Int64[Tensor, "sites neighbors 2"],
    shape: Shape,
    boundary: Boundary,
) -> Reads:
    """Find the neighbors ``cell + offset`` of every cell in a plane of the given shape.

    Args:
        cells: Where to look from.
        offsets: The same for all cells, or for each cell its own.
        shape: Height and width of the plane.
        boundary: What lies beyond its border.

    Example:
        >>> up = torch.tensor([[-1, 0]])
        >>> read(torch.tensor([[0, 3]]), up, (4, 5), "torus").positions.tolist()
        [[18]]
        >>> read(torch.tensor([[0, 3]]), up, (4, 5), "open").positions.tolist()
        [[20]]
    """
    height, width = shape
    rows = cells[:, :1] + offsets[..., 0]
    columns = cells[:, 1:] + offsets[..., 1]
    if boundary == "torus":
        return Reads(_around(rows, height, width) + _around(columns, width), None)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    return only(Reads(rows * width + columns, None), inside, shape)


def only(reads: Reads, there: Bool[Tensor, "sites neighbors"], shape: Shape) -> Reads:
    """Leave out the neighbors that are not there.

    Example:
        >>> only(Reads(torch.tensor([[7, 8]]), None), torch.tensor([[True, False]]), (3, 3)).positions.tolist()
        [[7, 9]]
    """
    inside = there if reads.inside is None else there & reads.inside
    if bool(inside.all()):
        return Reads(reads.positions, None)
    return Reads(reads.positions.masked_fill(~inside, shape[0] * shape[1]), inside)


def _around(places: Tensor, length: int, step: int = 1) -> Tensor:
    """Places on a ring of some length, each as so many steps.

    From a table where that is the smaller one, as divisions take twice the time of look-ups.
    """
    if places.numel() > 0:
        first, last = (int(end) for end in places.aminmax())
        if last - first < places.numel():
            table = torch.arange(first, last + 1, device=places.device).remainder_(length).mul_(step)
            return table.take(places - first)
    return places.remainder(length).mul_(step)
