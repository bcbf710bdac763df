"""Exact costs of the few candidates that matter, where exact arithmetic for all of them would be slow.

With large weights, sums of products of whole numbers are exact in float64 only, which takes three times as
long as float32. But rounding in float32 is bounded: whoever is cheaper than the cheapest by more than twice
that bound is found by it, too. So float32 sifts, and what is left is computed exactly. The result is the
same, bit for bit.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from torchsynth.index import CHUNK, Index
from torchsynth.search.base import Proposals, Query

_ROUNDING = 2.0**-24
"""The largest relative error of one rounding to float32."""

# Weights, and the candidates' lengths, are rounded themselves before they are multiplied and added.
_MORE_ROUNDINGS = 4

# Candidates that are left, one by one, take about so many times as long as all of them together.
_FEW = 32


class Sieve(NamedTuple):
    """What bounds the errors of approximate costs.

    Args:
        longest: The largest weighted length of any candidate.
        terms: How many products are added up for a cost.
    """

    longest: float
    terms: int

    def error(self, lengths: Float[Tensor, "batch sites"]) -> Float[Tensor, "batch sites"]:
        """The most by which an approximate cost can be wrong, for queries of these weighted lengths.

        A sum of ``n`` products, in any order, is wrong by at most about ``n`` roundings of the sum of their
        absolute values (N. Higham, *Accuracy and stability of numerical algorithms*, section 3.1). Here that
        is at most ``2 |q| |x| + 2 |x|^2``, by Cauchy and Schwarz.
        """
        absolute = 2 * self.longest * (lengths + self.longest)
        # A hundredth more covers the products of roundings, and those of this bound.
        return 1.01 * _ROUNDING * (self.terms + _MORE_ROUNDINGS) * absolute

    def sift(
        self, index: Index, approximate: Float[Tensor, "batch sites *places"], query: Query
    ) -> Proposals | None:
        """The candidates that may be within a query's tolerance of the best, with their exact costs.

        Args:
            index: The candidates.
            approximate: What all of them cost, about.
            query: The queries.

        Returns:
            Proposals in the order of the candidates; infinite costs fill up the rows of queries that
            are left with fewer than others. None if so many are left that computing all of them exactly
            would take less time: of a map of few labels, thousands may be equally good.
        """
        weights = index.weights.to(index.dtype)
        features = query.features[..., :-1]
        common = features.square() @ weights
        error = self.error(common.sqrt())
        flat = approximate.flatten(2)
        best = flat.amin(2).to(index.dtype) + error + common
        limit = (1.0 + query.tolerance) * best - common + error
        # Rounded up: the comparison is in float32.
        bound = torch.nextafter(limit.float(), torch.full_like(limit, torch.inf).float())
        bound = bound.clamp(max=torch.finfo(bound.dtype).max)  # infinite costs stand for no candidate
        asking, found = (flat <= bound.unsqueeze(2)).flatten(0, 1).nonzero().unbind(1)
        if len(asking) * _FEW > flat.numel():
            return None
        cost = _exact(index, query, asking, found)
        return _packed(cost, asking, index.sites.take(found), flat.shape[0], flat.shape[1])


def _exact(
    index: Index, query: Query, asking: Int64[Tensor, " pairs"], found: Int64[Tensor, " pairs"]
) -> Float[Tensor, " pairs"]:
    """The exact cost of each pair of query and candidate."""
    sites = query.features.shape[1]
    weights = index.weights.to(index.dtype)
    queries = query.features[..., :-1].flatten(0, 1)
    rows = found
    if index.exemplars > 1:
        rows = found + asking // sites * len(index.sites)
    step = max(1, CHUNK // (len(weights) * index.dtype.itemsize))
    costs = []
    for some in (slice(start, start + step) for start in range(0, len(rows), step)):
        vectors = index.at(rows[some])
        asked = queries.index_select(0, asking[some]).mul_(-2)
        if query.readable is None:
            asked += vectors
        else:
            there = query.readable.index_select(0, asking[some] % sites)
            asked += vectors * there
        costs.append(asked.mul_(vectors) @ weights)
    return torch.cat(costs)


def _packed(
    cost: Float[Tensor, " pairs"],
    asking: Int64[Tensor, " pairs"],
    source: Int64[Tensor, " pairs"],
    batch: int,
    sites: int,
) -> Proposals:
    """The pairs as proposals: those of each query side by side."""
    counts = asking.bincount(minlength=batch * sites)
    place = torch.arange(len(asking), device=asking.device) - (counts.cumsum(0) - counts)[asking]
    packed = cost.new_full((batch * sites, int(counts.max())), torch.inf)
    packed[asking, place] = cost
    sources = torch.zeros_like(packed, dtype=torch.int64)
    sources[asking, place] = source
    return Proposals(packed.view(batch, sites, -1), sources.view(batch, sites, -1))
