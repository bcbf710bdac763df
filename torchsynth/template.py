"""Neighborhood templates: which neighbors of a pixel are compared.

A template is a set of offsets ``(dy, dx)``, rows before columns, and it means the same on both sides
everywhere in the library: *neighbor = p + offset*::

    causal 5x5       anticausal 5x5       square 3x3 (with its center)
    o o o o o                                 o o o
    o o o o o                                 o o o
    o o x                o o o                o o o
                     o o o o o
                     o o o o o
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal, TypeAlias

import torch
from pydantic import AfterValidator, Field, model_validator

from torchsynth._typing import Offsets
from torchsynth.part import Part


def _odd(size: int) -> int:
    if size % 2 == 0:
        raise ValueError(f"a side must be odd, but {size} is even")
    return size


Side: TypeAlias = Annotated[
    int, Field(ge=1, le=255, json_schema_extra={"not": {"multipleOf": 2}}), AfterValidator(_odd)
]
"""The side of a neighborhood in pixels: odd, so that it has a center."""


class Causal(Part):
    """The L shape of a scanline: all rows above, and the pixels to the left in the same row.

    An ``n x n`` causal template has ``(n * n - 1) / 2`` neighbors: 12 for 5x5, 40 for 9x9. The pixel
    itself is not among them. Source: Wei & Levoy 2000, section 2.

    Args:
        size: Side of the square in pixels, odd, 3 or more. Visible effect: a larger one keeps larger
            structures whole, and costs in proportion to its area.

    Example:
        >>> Causal(size=3).offsets().tolist()
        [[-1, -1], [-1, 0], [-1, 1], [0, -1]]
    """

    kind: Literal["causal"] = "causal"
    size: Annotated[Side, Field(ge=3)]

    def offsets(self) -> Offsets:
        """The ``(dy, dx)`` of each neighbor, in raster order."""
        square = _raster(self.size)
        return square[: len(square) // 2]


class Anticausal(Part):
    """The other half of the square: the pixel itself, those to its right, and all rows below.

    In a scanline these are the pixels that are still to come, so it is laid on planes that are there
    from the start, such as a painted target. Source: Ashikhmin 2001, section 4 and figure 7.

    Args:
        size: Side of the square in pixels, odd. Visible effect: a larger one follows a target's larger
            structures, and its details less.

    Example:
        >>> Anticausal(size=3).offsets().tolist()
        [[0, 0], [0, 1], [1, -1], [1, 0], [1, 1]]
    """

    kind: Literal["anticausal"] = "anticausal"
    size: Side

    def offsets(self) -> Offsets:
        """The ``(dy, dx)`` of each neighbor, in raster order."""
        square = _raster(self.size)
        return square[len(square) // 2 :]


class Square(Part):
    """All pixels of an ``n x n`` square, with or without the one in the middle.

    With its center it compares finished planes, such as the coarser pyramid level; without it, it is
    the symmetric neighborhood of a pixel that is about to be replaced.

    Args:
        size: Side of the square in pixels, odd. Visible effect: a larger one keeps larger structures
            whole, and costs in proportion to its area.
        center: Whether the pixel in the middle is compared as well.

    Example:
        >>> len(Square(size=5).offsets()), len(Square(size=5, center=False).offsets())
        (25, 24)
    """

    kind: Literal["square"] = "square"
    size: Side
    center: bool = True

    @model_validator(mode="after")
    def _has_neighbors(self) -> Square:
        if self.size == 1 and not self.center:
            raise ValueError("a square without its center needs a side of 3 or more, but its side is 1")
        return self

    def offsets(self) -> Offsets:
        """The ``(dy, dx)`` of each neighbor, in raster order."""
        square = _raster(self.size)
        return square if self.center else square[(square != 0).any(1)]


Template: TypeAlias = Annotated[Causal | Anticausal | Square, Field(discriminator="kind")]
"""Any template; the ``kind`` field tells them apart in YAML."""


def _raster(size: int) -> Offsets:
    return _kept_raster(size).clone()


@cache
def _kept_raster(size: int) -> Offsets:
    with torch.inference_mode(mode=False):
        side = torch.arange(size) - size // 2
        return torch.cartesian_prod(side, side)
