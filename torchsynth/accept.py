"""Acceptance: which of the proposed candidates a pixel takes."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

import torch
from jaxtyping import Bool, Float, Int64
from pydantic import Field
from torch import Tensor

from torchsynth.part import Part

# Candidates of unequal chance are weighed in so many steps: sums of them stay exact.
_CHANCE_STEPS = 256

# A draw is a whole number of so many bits.
_DRAW_BITS = 31


class Choice(NamedTuple):
    """The accepted candidate of each query: its place among the proposed, and what it costs.

    Args:
        place: Its place, counted through the blocks of the proposed costs.
        cost: What it costs.
        refused: Which queries take none, since even that one is too bad; None if every query takes one.
    """

    place: Int64[Tensor, "batch sites"]
    cost: Float[Tensor, "batch sites"]
    refused: Bool[Tensor, "batch sites"] | None = None


class Evidence(NamedTuple):
    """What an acceptance may want to know beside the costs.

    Args:
        common: The queries' own weighted squared lengths, which costs leave out.
        compared: The weights of all compared values, summed, as a mean squared difference is per value.
        draws: Random whole numbers from 0 to 2**31 - 1.
        largest: The mean squared difference from which on a candidate is refused, as it has grown by now.
        unit: The squared difference of two values that are as different as can be.
    """

    common: Float[Tensor, "batch sites"]
    compared: Float[Tensor, "*sites"]
    draws: Int64[Tensor, "batch sites"]
    largest: float | None
    unit: float


class Best(Part):
    """Take the cheapest candidate; among equals, the first in the exemplar's raster order.

    Source: Wei & Levoy 2000, table 1.

    Example:
        >>> import torch
        >>> Best().choose(torch.tensor([[[[5.0, 2.0], [2.0, 3.0]]]]), None).place.tolist()
        [[1]]
    """

    kind: Literal["best"] = "best"

    weighs: ClassVar[bool] = False
    """Whether it wants to see evidence."""

    tolerance: ClassVar[float] = 0.0
    """How much larger than the smallest difference one may be that may still be chosen."""

    @property
    def refuses(self) -> bool:
        """Whether a query may end up with no candidate at all."""
        return False

    def choose(self, cost: Float[Tensor, "batch sites *places"], evidence: Evidence | None = None) -> Choice:  # noqa: ARG002
        """Choose one candidate for each query."""
        return first_minimum(cost)


class WithinTolerance(Part):
    """Take a random one of the candidates that are nearly as good as the best.

    Args:
        epsilon: How much larger than the smallest weighted squared difference one may be, as a share of
            it. Visible effect: 0 copies the exemplar verbatim sooner, large values grow noise.
        pick: ``uniform`` gives all of them the same chance; ``distance`` gives nearer ones more, in
            inverse proportion to their difference.
        max_error: The mean squared difference, in squared units of [0, 1], from which on even the
            picked one is refused: the pixel waits until more of its neighbors are known. None refuses
            nothing.
        growth: By what ``max_error`` is multiplied when all pixels of a layer were refused.

    Source: Efros & Leung 1999, section 2.1; the largest error from the GrowImage notes on it.

    Example:
        >>> import torch
        >>> two = torch.tensor([[10, 2**31 - 10]])
        >>> cost = torch.tensor([[[5.0, 1.0, 1.0]] * 2])
        >>> evidence = Evidence(torch.ones(1, 2), torch.ones(2), two, None, 255.0**2)
        >>> WithinTolerance().choose(cost, evidence).place.tolist()
        [[1, 2]]
    """

    kind: Literal["within_tolerance"] = "within_tolerance"
    epsilon: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.1
    pick: Literal["uniform", "distance"] = "uniform"
    max_error: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = 0.3
    growth: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 1.1

    weighs: ClassVar[bool] = True
    """Whether it wants to see evidence."""

    @property
    def tolerance(self) -> float:
        """How much larger than the smallest difference one may be that may still be chosen."""
        return self.epsilon

    @property
    def refuses(self) -> bool:
        """Whether a query may end up with no candidate at all."""
        return self.max_error is not None

    def choose(self, cost: Float[Tensor, "batch sites *places"], evidence: Evidence | None = None) -> Choice:
        """Choose one candidate for each query."""
        assert evidence is not None, "the sweep gives what an acceptance weighs"  # noqa: S101 (for the type checker)
        blocks = cost.unsqueeze(2) if cost.ndim == 3 else cost
        flat = blocks.flatten(0, 1)
        common = evidence.common.flatten().double()
        smallest = flat.amin((1, 2)).double() + common
        # Differences are whole numbers, so the limit may be rounded down to one.
        limit = ((1.0 + self.epsilon) * smallest).floor() - common
        # Infinite costs stand for no candidate, and stay outside of any limit.
        inside = flat <= limit.clamp(max=torch.finfo(flat.dtype).max).to(flat.dtype).view(-1, 1, 1)
        chances: Tensor = inside
        if self.pick == "distance":
            distances = flat.double() + common.view(-1, 1, 1)
            shares = (_CHANCE_STEPS * smallest.view(-1, 1, 1) / distances).round()
            shares = shares.where(smallest.view(-1, 1, 1) > 0, torch.ones_like(shares))
            chances = shares.where(inside, torch.zeros_like(shares)).long()
        place = _pick(chances, evidence.draws.flatten()).view(cost.shape[:2])
        taken = blocks.flatten(2).gather(2, place.unsqueeze(2)).squeeze(2)
        if evidence.largest is None:
            return Choice(place, taken)
        bound = evidence.largest * (evidence.compared.double() * evidence.unit)
        error = taken.double() + evidence.common.double()
        return Choice(place, taken, (error >= bound) & (bound > 0))


Accept: TypeAlias = Annotated[Best | WithinTolerance, Field(discriminator="kind")]
"""Any acceptance; the ``kind`` field tells them apart in YAML."""


def _pick(
    chances: Int64[Tensor, "queries blocks columns"] | Bool[Tensor, "queries blocks columns"],
    draws: Int64[Tensor, " queries"],
) -> Int64[Tensor, " queries"]:
    """One column of each query, with the chances given, by one draw: first its block, then the column."""
    _, _, columns = chances.shape
    upto = chances.sum(2).cumsum(1)
    wanted = ((draws * upto[:, -1]) >> _DRAW_BITS).unsqueeze(1)
    block = (upto <= wanted).sum(1)
    before = torch.nn.functional.pad(upto, (1, 0)).gather(1, block.unsqueeze(1))
    inside = chances.gather(1, block.view(-1, 1, 1).expand(-1, 1, columns)).squeeze(1)
    column = (inside.cumsum(1) <= wanted - before).sum(1)
    return block * columns + column


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
