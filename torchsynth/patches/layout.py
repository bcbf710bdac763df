"""Where the blocks of a quilt lie."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import torch
from jaxtyping import Bool, Int64
from torch import Tensor

from torchsynth.lattice import Boundary, Shape, read

Shape4: TypeAlias = tuple[int, int, int, int]
"""The number, channels, height and width of exemplars."""


@dataclass(frozen=True)
class Spot:
    """A place for one block.

    Args:
        number: Counted in raster order.
        overlaps: How far it overlaps blocks that are there already: at the top, left, bottom and right.
        positions: The output's flat positions under the block, row by row; one that is outside has the
            position behind the last.
        inside: Which of them are inside.
    """

    number: int
    overlaps: tuple[int, int, int, int]
    positions: Int64[Tensor, " pixels"]
    inside: Bool[Tensor, " pixels"]


def spots(shape: Shape, boundary: Boundary, block: int, overlap: int, device: torch.device) -> Iterator[Spot]:
    """The places of all blocks, in raster order.

    With borders, blocks follow each other in equal steps, and the last ones stick out. On a torus they are
    spread evenly, at ``floor(j * side / n)``, with the fewest blocks n that overlap at least as far as was
    asked for; those that reach around it also overlap the first ones.

    Args:
        shape: Height and width of the output.
        boundary: ``open`` or ``torus``.
        block: Side of the blocks.
        overlap: How far they overlap at least.
        device: Where positions are to be.

    Example:
        >>> [spot.overlaps for spot in spots((4, 7), "torus", 4, 1, torch.device("cpu"))]
        [(0, 0, 0, 0), (0, 2, 0, 0), (0, 2, 0, 1), (2, 0, 2, 0), (2, 2, 2, 0), (2, 2, 2, 1)]
        >>> [spot.overlaps for spot in spots((4, 7), "open", 4, 1, torch.device("cpu"))]
        [(0, 0, 0, 0), (0, 1, 0, 0)]
    """
    rows, columns = (_starts(side, boundary, block, overlap) for side in shape)
    square = torch.cartesian_prod(*(torch.arange(block, device=device),) * 2)
    number = 0
    for row, top in enumerate(rows):
        above, below = _overlaps(rows, row, block, shape[0], boundary)
        for column, left in enumerate(columns):
            before, after = _overlaps(columns, column, block, shape[1], boundary)
            reads = read(torch.tensor([[top, left]], device=device), square, shape, boundary)
            positions = reads.positions.squeeze(0)
            inside = positions < shape[0] * shape[1]
            yield Spot(number, (above, before, below, after), positions, inside)
            number += 1


def number_of_blocks(shape: Shape, boundary: Boundary, block: int, overlap: int) -> int:
    """How many blocks there are.

    Example:
        >>> number_of_blocks((256, 256), "open", 36, 6)
        81
    """
    rows, columns = (len(_starts(side, boundary, block, overlap)) for side in shape)
    return rows * columns


def _starts(side: int, boundary: Boundary, block: int, overlap: int) -> list[int]:
    step = block - overlap
    if boundary == "torus":
        number = -(-side // step)
        return [one * side // number for one in range(number)]
    return list(range(0, max(1, side - overlap), step))


def _overlaps(starts: list[int], number: int, block: int, side: int, boundary: Boundary) -> tuple[int, int]:
    """How far a block overlaps the one before it and, around a torus, the first one."""
    before = block - (starts[number] - starts[number - 1]) if number else 0
    return before, max(0, starts[number] + block - side) if boundary == "torus" else 0
