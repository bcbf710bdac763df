"""Exhaustive search: every candidate of the exemplar, for every query."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad

from torchsynth.index import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Costs, Proposals, Query, Volume, table_fits
from torchsynth.search.sieve import Sieve

# A product with few queries is fastest when each block of candidates, and its costs, stay in the
# innermost caches: a fifth less time than one wide product, together with finding the minimum.
_BLOCK = 192
# Below this many candidates, one block is best: the number of calls is what counts.
_ONE_BLOCK = 2048
# The table is in float32: bytes of each number.
_ITEM = 4
# A second table, in float64, may take such a part of what the first may: it is seldom needed.
_EXACT_SHARE = 4


@dataclass(frozen=True)
class ExhaustiveState:
    """What is computed of the candidates, once. Costs are laid out in blocks of columns, like the table.

    Args:
        index: The candidates.
        table: Minus twice the weighted candidates, and below them their weighted squared lengths, which a
            query's last 1 picks up: infinite in columns that pad the last block. Below that, unless every
            query is complete, minus their weighted squares, for what a query lacks: zero in those columns.
            The blocks of the first exemplar come first. None where it would take too much memory: then
            each search reads the candidates anew.
        columns: How many columns a block has.
        workspace: Where costs are written, again and again: fresh memory for each of thousands of
            searches would cost a tenth of the time.
        sieve: Where costs are exact in float64 only, and there is a table: that is in float32, and this
            finds those candidates of which the exact costs are needed.
        complete: Whether every feature of every query is readable.
    """

    index: Index
    table: Float[Tensor, "blocks rows columns"] | None
    columns: int
    workspace: Float[Tensor, " size"]
    sieve: Sieve | None = None
    complete: bool = False

    @property
    def width(self) -> int:
        """How many costs a query has."""
        return -(-len(self.index.sites) // self.columns) * self.columns

    @cached_property
    def exact(self) -> Float[Tensor, "blocks rows columns"] | None:
        """The table in float64, made when it is first needed; None where it would take too much memory."""
        rows = _rows(len(self.index.weights), self.complete)
        if not table_fits(_EXACT_SHARE * self.index.exemplars * self.width * rows * 2 * _ITEM):
            return None
        return _table(self.index, self.width // self.columns, rows, self.columns, torch.float64)


class Exhaustive(Part):
    """Compare each query with every candidate; exact, and the reference for all faster searches.

    The squared distance is expanded, ``|q|^2 - 2 q.x + |x|^2``, so that a batch of queries costs one
    matrix product; ``|q|^2`` changes nothing and is left out. With the whole-number features of
    :mod:`torchsynth.neighborhood` this is exact, and equals ``torch.cdist`` squared. Memory for the
    costs is bounded by searching few queries at a time, but not fewer than one pixel of each output.

    Source: Wei & Levoy 2000, section 2.1.

    Example:
        >>> features = torch.tensor([[[0.0, 3.0], [1.0, 1.0]]])
        >>> index = Index.of_vectors(features, torch.tensor([1, 1]))
        >>> state = Exhaustive().fit(index, complete=True)
        >>> found = Exhaustive().search(state, Query(torch.tensor([[[0.0, 2.0, 1.0]]])))
        >>> (found.cost + 2.0**2).tolist()
        [[[[1.0, 2.0]]]]
    """

    kind: Literal["exhaustive"] = "exhaustive"

    largest_term: ClassVar[int] = 3 * 128**2
    """The most that one feature adds to a sum: ``|x|^2 - 2 q.x``, with both from -128 to 127."""

    has_sources: ClassVar[bool] = True
    """Whether what it proposes are exemplar pixels."""

    tree_search: ClassVar[None] = None
    """There are no trees that a codebook might hold."""

    takes_chances: ClassVar[bool] = False
    """Whether each offer needs a random number."""

    def wants(self) -> None:
        """No sources: the neighbors' values are enough."""

    def fit(self, index: Index, complete: bool) -> ExhaustiveState:
        """Prepare the candidates.

        Args:
            index: The candidates.
            complete: Whether every feature of every query will be readable.
        """
        number, features = len(index.sites), len(index.weights)
        columns = number if number <= _ONE_BLOCK else _BLOCK
        blocks, rows = -(-number // columns), _rows(features, complete)
        table, sieve, dtype = None, None, index.dtype
        if table_fits(index.exemplars * blocks * columns * rows * _ITEM):
            table, dtype = _table(index, blocks, rows, columns, torch.float32), torch.float32
            if index.dtype != dtype:
                lengths = table[:, features]
                longest = float(lengths[lengths.isfinite()].max().double().sqrt())
                sieve = Sieve(longest * (1 + 1e-6), rows)
        capacity = max(1, MEMORY_BUDGET // (blocks * columns * dtype.itemsize))
        workspace = torch.empty(capacity * blocks * columns, dtype=dtype, device=index.sites.device)
        return ExhaustiveState(index, table, columns, workspace, sieve, complete)

    def memory(self, volume: Volume) -> int:
        """About how many bytes fitting takes, and at most so many."""
        table = volume.candidates * _rows(volume.features, volume.complete) * _ITEM
        # One in float64 may be needed as well, where costs are exact in that only.
        exact = 2 * table if volume.item > _ITEM and table_fits(_EXACT_SHARE * 2 * table) else 0
        return (table if table_fits(table) else 0) + exact

    def capacity(self, state: ExhaustiveState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        return len(state.workspace) // state.width

    def search(self, state: ExhaustiveState, query: Query) -> Proposals:
        """Propose every candidate that matters.

        Returns:
            Every candidate, or those that may be within the query's tolerance of the best. Of every one
            the costs ``(B, sites, blocks, columns)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite in the padding. Candidate ``i``
            of the index is column ``i`` counted through the blocks. Valid until the next search with
            the same state.
        """
        batch, sites, _ = query.features.shape
        needed = batch * sites * state.width
        out = state.workspace[:needed] if needed <= len(state.workspace) else None
        if state.table is None:
            return Proposals(
                _streamed(state, query, state.workspace.new_empty(needed) if out is None else out)
            )
        # Unreadable neighbors drop out of the candidates' lengths too, query by query.
        cost = _costs(state, state.table, query, out)
        if state.sieve is None:
            return Proposals(cost)
        return state.sieve.sift(state.index, cost, query) or Proposals(_exact_costs(state, query))


def _costs(state: ExhaustiveState, table: Tensor, query: Query, out: Tensor | None = None) -> Costs:
    """The costs by a table, in its type."""
    queries = query.features if query.extended is None else query.extended
    return _product(queries.to(table.dtype), table[:, : queries.shape[2]], state.index.exemplars, out)


def _exact_costs(state: ExhaustiveState, query: Query) -> Costs:
    """The costs of all candidates in float64."""
    if state.exact is not None:
        return _costs(state, state.exact, query)
    batch, sites, _ = query.features.shape
    return _streamed(state, query, query.features.new_empty(batch * sites * state.width))


def _rows(features: int, complete: bool) -> int:
    """How many rows the table has."""
    return features + 1 if complete else 2 * features + 1


def _table(
    index: Index, blocks: int, rows: int, columns: int, dtype: torch.dtype
) -> Float[Tensor, "blocks rows columns"]:
    """The table of :class:`ExhaustiveState`."""
    weights, features = index.weights.to(index.dtype).unsqueeze(1), len(index.weights)
    table = torch.empty(index.exemplars, blocks, rows, columns, dtype=dtype, device=weights.device)
    for some in index.slices(columns):
        vectors = pad(index.vectors(some), (0, 0, 0, -some.stop % columns))
        vectors = vectors.view(index.exemplars, -1, columns, features).mT
        start = some.start // columns
        here = table[:, start : start + vectors.shape[1]]
        squares = vectors.square().mul_(weights)
        here[:, :, :features] = vectors.mul_(-2 * weights)
        here[:, :, features] = squares.sum(2)
        if rows > features + 1:
            here[:, :, features + 1 :] = squares.neg_()
    # In the columns that stand for no candidate.
    table[:, -1, features, len(index.sites) - (blocks - 1) * columns :] = float("inf")
    return table.flatten(0, 1)


def _streamed(state: ExhaustiveState, query: Query, out: Float[Tensor, " costs"]) -> Costs:
    """The same costs as by the table, slice by slice of the candidates."""
    index, weights = state.index, state.index.weights.to(state.index.dtype)
    batch, sites, _ = query.features.shape
    products = (query.features[..., :-1] * (-2 * weights)).view(index.exemplars, -1, len(weights))
    # The lengths are the same for all samples that share an exemplar.
    counting = weights.unsqueeze(0) if query.readable is None else query.readable * weights
    cost = out.view(index.exemplars, -1, state.width)
    cost[..., len(index.sites) :] = float("inf")
    for some in index.slices():
        vectors = index.vectors(some)
        found = torch.matmul(products, vectors.mT).view(index.exemplars, -1, sites, vectors.shape[1])
        found += torch.matmul(counting, vectors.square_().mT).unsqueeze(1)
        cost[..., some] = found.flatten(1, 2)
    return out.view(batch, sites, -1, state.columns)


def _product(queries: Tensor, blocks: Tensor, exemplars: int, out: Tensor | None = None) -> Costs:
    """The product of each query with each column: ``(B, sites, blocks, columns)``."""
    batch, sites, features = queries.shape
    number, _, columns = blocks.shape
    if exemplars == 1:
        # One exemplar for all samples: their queries go into the same products.
        grouped = queries.reshape(1, -1, features).expand(number, -1, -1)
    else:
        grouped = queries.repeat_interleave(number // exemplars, dim=0)
    if out is not None:
        out = out.view(number, -1, columns)
    cost = torch.bmm(grouped, blocks, out=out)
    return (
        cost.view(exemplars, number // exemplars, -1, columns).transpose(1, 2).view(batch, sites, -1, columns)
    )
