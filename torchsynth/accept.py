"""Acceptance: which of the proposed candidates a pixel takes."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth._typing import Rows
from torchsynth.part import Part


class Choice(NamedTuple):
    """The accepted candidate of each query: its place among the proposed, and what it costs."""

    place: Rows
    cost: Float[Tensor, "batch sites"]


class Best(Part):
    """Take the cheapest candidate; among equals, the first in the exemplar's raster order.

    Source: Wei & Levoy 2000, table 1.

    Example:
        >>> import torch
        >>> Best().choose(torch.tensor([[[[5.0, 2.0], [2.0, 3.0]]]])).place.tolist()
        [[1]]
    """

    kind: Literal["best"] = "best"

    def choose(self, cost: Float[Tensor, "batch sites *places"]) -> Choice:
        """Choose one candidate for each query."""
        return first_minimum(cost)


Accept: TypeAlias = Best
"""Any acceptance; the ``kind`` field tells them apart in YAML."""


def first_minimum(cost: Float[Tensor, "batch sites *places"]) -> Choice:
    """The smallest cost of each query and its first place, counted through the blocks.

    ``argmin`` along a row of many thousands is slow on a CPU, plain minima are not: so the minima of
    blocks are taken, then the first block that has the smallest, then the first column in it.
    """
    if cost.ndim == 3 or cost.shape[2] == 1:
        smallest, place = (cost if cost.ndim == 3 else cost.squeeze(2)).min(2)
        return Choice(place, smallest)
    batch, sites, _, columns = cost.shape
    flat = cost.flatten(0, 1)
    block = flat.amin(2).argmin(1)
    inside = flat.gather(1, block.view(-1, 1, 1).expand(-1, 1, columns)).squeeze(1)
    smallest, column = inside.min(1)
    place = torch.add(column, block, alpha=columns)
    return Choice(place.view(batch, sites), smallest.view(batch, sites))
