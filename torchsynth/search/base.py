"""What the sweep and the searchers say to each other.

A searcher is a part with these verbs: ``wants()`` names the neighbors whose sources it has to see, and
``takes_chances`` whether it needs a random number with each; ``tree_search`` is the search whose trees a
codebook may hold, or None;
``fit(index, complete)`` computes whatever it needs of the candidates, once, and ``memory(volume)`` says how
much memory that takes; ``capacity(state)`` says how many queries fit its memory budget;
``largest_term`` bounds its sums, so that they stay exact; ``has_sources`` says whether it proposes exemplar
pixels; and ``search(state, query)`` proposes candidates with their costs. Which proposal wins is not its
concern. Two have a verb more: trees are grown ahead of fitting (``grow``, ``prepare``), for codebooks, and
coherent search says what patches go on with (``continued``), for the search that prefers that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from torchsynth._typing import Draws, Sites, Sources
from torchsynth.neighborhood import Layer

MEMORY_BUDGET = 32 * 2**20
"""Bytes that the costs of one search may take."""

TABLE_BUDGET = 2**30
"""Bytes that what a searcher keeps of all candidates may take: beyond that, it reads them again and again."""

_HALF = 31
_MASK = 2**_HALF - 1
_GOLDEN = -0x61C8864680B583EB


class Volume(NamedTuple):
    """How much there is to be searched, which is what the memory of a search depends on.

    Args:
        exemplars: How many exemplars there are.
        pixels: How many pixels each of them has: at most so many are candidates.
        channels: How many channels a pixel has.
        item: How many bytes a number takes.
        layers: What is compared.
        complete: Whether every feature of every query will be readable.
        guide_channels: How many channels a pixel of the guide has.
    """

    exemplars: int
    pixels: int
    channels: int
    item: int
    layers: Sequence[Layer]
    complete: bool
    guide_channels: int = 0

    @property
    def features(self) -> int:
        """How many numbers a candidate's vector has."""
        return sum(
            len(layer.template.offsets()) * (self.guide_channels if layer.is_guide else self.channels)
            for layer in self.layers
        )

    @property
    def candidates(self) -> int:
        """How many candidates there are, of all exemplars together."""
        return self.exemplars * self.pixels

    @property
    def vectors(self) -> int:
        """How many bytes all candidates' vectors take."""
        return self.candidates * self.features * self.item


def table_fits(size: int) -> bool:
    """Whether a searcher may keep a table of so many bytes.

    Example:
        >>> table_fits(10**6), table_fits(10**12)
        (True, False)
    """
    return size <= TABLE_BUDGET


class Offers(NamedTuple):
    """What the neighbors that a search wants to see have to offer.

    Args:
        source: ``(B, sites, neighbors)``: the flat exemplar position each was copied from, or -1.
        missing: Which neighbors offer nothing, the same for all samples; never all of a site. None
            means that there are none.
        spares: For each offer the position of a random candidate to put in its place.
        chances: For each offer a random number from 0 to 2**31 - 1; None if the search takes no chances.
    """

    source: Int64[Tensor, "batch sites neighbors"]
    missing: Bool[Tensor, "sites neighbors"] | None
    spares: Int64[Tensor, "batch sites neighbors"]
    chances: Int64[Tensor, "batch sites neighbors"] | None = None


def chance(draws: Int64[Tensor, "*any"]) -> Int64[Tensor, "*any"]:
    """A random number from 0 to 2**31 - 1 for each draw, independent of the spare candidate.

    Example:
        >>> chance(torch.tensor([2**62 - 1])).item() == 2**31 - 1
        True
    """
    shifted: Tensor = draws >> _HALF
    return shifted


def spare(draws: Int64[Tensor, "*any"], number: int) -> Int64[Tensor, "*any"]:
    """The number of a random candidate of so many, for each draw.

    Example:
        >>> spare(torch.tensor([0, 2**30, 2**31 - 1]), 10).tolist()
        [0, 5, 9]
    """
    scaled: Tensor = (draws & _MASK).mul_(number).bitwise_right_shift_(_HALF)
    return scaled


def scatter_draws(draws: Draws, count: int) -> Int64[Tensor, "batch sites count"]:
    """Several independent random numbers from each one, by mixing in the place of each.

    The multipliers and shifts are those of SplitMix64 (Steele, Lea & Flood 2014), modulo 2**64.

    Example:
        >>> scatter_draws(torch.tensor([[5, 6]]), 3).shape
        torch.Size([1, 2, 3])
    """
    places = torch.arange(1, count + 1, device=draws.device)
    return _mixed(draws.unsqueeze(2) + places * _GOLDEN)


def draw_at(draws: Draws, place: int) -> Draws:
    """The one of the independent random numbers that :func:`scatter_draws` puts at a place, from 1.

    Places below 1 give others, which no search sees.

    Example:
        >>> draws = torch.tensor([[5, 6]])
        >>> draw_at(draws, 3).equal(scatter_draws(draws, 3)[..., 2])
        True
    """
    return _mixed(draws + ((place * _GOLDEN + 2**63) % 2**64 - 2**63))  # modulo 2**64, as in a tensor


def _mixed(words: Tensor) -> Tensor:
    """The words, mixed in place."""
    for shift, multiplier in ((30, -0x40A7B892E31B1A47), (27, -0x6B2FB644ECCEEE15)):
        words.bitwise_xor_(_shifted(words, shift)).mul_(multiplier)
    return words.bitwise_xor_(_shifted(words, 31)).bitwise_and_(2**62 - 1)


def _shifted(words: Tensor, shift: int) -> Tensor:
    """Shift right, filling with zeros: torch's own shift of a negative number fills with ones."""
    return (words >> shift).bitwise_and_(2 ** (64 - shift) - 1)


class Query(NamedTuple):
    """The neighborhoods of the pixels whose turn it is.

    Args:
        features: ``(B, sites, features + 1)``: whole numbers, 0 where the neighbor does not exist, and
            a 1 at the end, with which one matrix product can add a constant for each candidate.
        readable: Which features exist, the same for all samples; None means all of them.
        offers: What the wanted neighbors offer; None if no search wants any.
        extended: The features again, and behind them a 1 for each feature that does not exist, so that
            one product can take its share away; None where all of them exist.
        tolerance: How much larger than the smallest distance one may be that still matters, as a share of it.
    """

    features: Float[Tensor, "batch sites augmented"]
    readable: Bool[Tensor, "sites features"] | None = None
    offers: Offers | None = None
    extended: Float[Tensor, "batch sites extended"] | None = None
    tolerance: float = 0.0


class Proposals(NamedTuple):
    """Candidates for each query, and what each would cost.

    Args:
        cost: See :data:`Costs`.
        source: ``(B, sites, columns)``: the flat exemplar position that each cost belongs to, any if it is
            a value of its own; None where place ``i``, counted through the blocks, is candidate ``i`` of
            the index.
        values: ``(B, sites, columns, C)``: the value that each proposal has of its own; None where
            proposals are copies of exemplar pixels.
    """

    cost: Float[Tensor, "batch sites *places"]
    source: Int64[Tensor, "batch sites columns"] | None = None
    values: Float[Tensor, "batch sites columns channels"] | None = None

    def source_at(self, place: Int64[Tensor, "batch sites"], candidates: Sites) -> Sources:
        """The exemplar positions at the chosen places, given those of all candidates."""
        if self.source is None:
            return candidates.take(place)
        return self.source.gather(2, place.unsqueeze(2)).squeeze(2)

    def values_at(self, place: Int64[Tensor, "batch sites"]) -> Float[Tensor, "batch sites channels"] | None:
        """The own values of what was proposed at the chosen places, if it has any."""
        if self.values is None:
            return None
        chosen = place[..., None, None].expand(-1, -1, 1, self.values.shape[3])
        return self.values.gather(2, chosen).squeeze(2)


Costs: TypeAlias = Float[Tensor, "batch sites *places"]
"""The cost of each proposed candidate, for each query: exact whole numbers, infinite where a column
stands for no candidate. Searchers may lay many candidates out in blocks of columns, which is easier on
the caches."""
