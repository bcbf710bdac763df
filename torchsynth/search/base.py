"""What the sweep and the searchers say to each other.

A searcher is a part with these verbs: ``fit(index, complete)`` computes whatever it needs of the
candidates, once, and ``copies(complete)`` says how much memory that takes; ``capacity(state)`` says how
many queries fit its memory budget; ``largest_term`` bounds its sums, so that they stay exact; and ``search(state, query)`` proposes candidates with their costs. Which proposal wins is not its concern.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from jaxtyping import Bool, Float, Int64
from torch import Tensor

MEMORY_BUDGET = 32 * 2**20
"""Bytes that the costs of one search may take."""


@dataclass(frozen=True)
class Query:
    """The neighborhoods of the pixels whose turn it is.

    Args:
        features: ``(B, sites, features + 1)``: whole numbers, 0 where the neighbor does not exist, and
            a 1 at the end, with which one matrix product can add a constant for each candidate.
        readable: Which features exist, the same for all samples; None means all of them.
    """

    features: Float[Tensor, "batch sites augmented"]
    readable: Bool[Tensor, "sites features"] | None = None


@dataclass(frozen=True)
class Proposals:
    """Candidates for each query, and what each would cost.

    Args:
        cost: See :data:`Costs`.
        rows: Which candidate of the index each cost belongs to; None where place ``i``, counted through
            the blocks, is candidate ``i``.
    """

    cost: Float[Tensor, "batch sites blocks columns"]
    rows: Int64[Tensor, "batch sites blocks columns"] | None = None

    def rows_at(self, place: Int64[Tensor, "batch sites"]) -> Int64[Tensor, "batch sites"]:
        """The candidates at the chosen places."""
        if self.rows is None:
            return place
        return self.rows.flatten(2).gather(2, place.unsqueeze(2)).squeeze(2)


Costs: TypeAlias = Float[Tensor, "batch sites blocks columns"]
"""The cost of each proposed candidate, for each query: exact whole numbers, infinite where a column
stands for no candidate. Searchers may lay candidates out in blocks, which is easier on the caches."""
