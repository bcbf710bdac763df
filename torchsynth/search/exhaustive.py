"""Exhaustive search: every candidate of the exemplar, for every query."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth.neighborhood import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Costs, Proposals, Query

# A product with few queries is fastest when each block of candidates, and its costs, stay in the
# innermost caches: a fifth less time than one wide product, together with finding the minimum.
_BLOCK = 192
# Below this many candidates, one block is best: the number of calls is what counts.
_ONE_BLOCK = 2048


@dataclass(frozen=True)
class ExhaustiveState:
    """What is computed of the candidates, once. They are laid out in blocks of columns.

    Args:
        table: Minus twice the weighted candidates, and below them their weighted squared lengths, which a
            query's last 1 picks up: infinite in columns that pad the last block. Below that, unless every
            query is complete, minus their weighted squares, for what a query lacks: zero in those columns.
        features: How many features a candidate has.
        exemplars: How many exemplars there are; the blocks of the first come first.
        workspace: Where costs are written, again and again: fresh memory for each of thousands of
            searches would cost a tenth of the time.
    """

    table: Float[Tensor, "blocks rows columns"]
    features: int
    exemplars: int
    workspace: Float[Tensor, " size"]

    @property
    def width(self) -> int:
        """How many costs a query has."""
        return len(self.table) // self.exemplars * self.table.shape[2]


class Exhaustive(Part):
    """Compare each query with every candidate; exact, and the reference for all faster searches.

    The squared distance is expanded, ``|q|^2 - 2 q.x + |x|^2``, so that a batch of queries costs one
    matrix product; ``|q|^2`` changes nothing and is left out. With the whole-number features of
    :mod:`torchsynth.neighborhood` this is exact, and equals ``torch.cdist`` squared. Memory for the
    costs is bounded by searching few queries at a time, but not fewer than one pixel of each output.

    Source: Wei & Levoy 2000, section 2.1.

    Example:
        >>> features = torch.tensor([[[0.0, 3.0], [1.0, 1.0]]])
        >>> index = Index(features, torch.tensor([0, 1]), torch.tensor([1, 1]), (1, 2), features[..., :1])
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
        exemplars, number, features = index.features.shape
        weights = index.weights.to(index.features.dtype)
        columns = number if number <= _ONE_BLOCK else _BLOCK
        blocks = -(-number // columns)
        rows = features + 1 if complete else 2 * features + 1
        table = weights.new_zeros(exemplars * blocks, rows, columns)
        table[:, features] = float("inf")  # stays in the columns that stand for no candidate
        # Block by block: the copies on the way are small.
        for block in range(blocks):
            vectors = index.features[:, block * columns : (block + 1) * columns].transpose(1, 2)
            weighted = vectors * weights.unsqueeze(1)
            lengths = weighted * vectors
            here, filled = slice(block, None, blocks), vectors.shape[2]
            table[here, :features, :filled] = weighted.mul_(-2)
            table[here, features, :filled] = lengths.sum(1)
            if not complete:
                table[here, features + 1 :, :filled] = lengths.neg_()
        capacity = max(1, MEMORY_BUDGET // (blocks * columns * table.element_size()))
        workspace = table.new_empty(capacity * blocks * columns)
        return ExhaustiveState(table, features, exemplars, workspace)

    def copies(self, complete: bool) -> int:
        """How much memory fitting takes, in sizes of the candidates' vectors."""
        return 1 if complete else 2

    def beside(self, pixels: int) -> int:  # noqa: ARG002 (searchers share one signature)
        """How many bytes fitting takes for exemplars of so many pixels, beside those copies."""
        return 0

    def capacity(self, state: ExhaustiveState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        return len(state.workspace) // state.width

    def search(self, state: ExhaustiveState, query: Query) -> Proposals:
        """Propose every candidate.

        Returns:
            Costs ``(B, sites, blocks, columns)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite in the padding. Candidate ``i``
            of the index is column ``i`` counted through the blocks. Valid until the next search with
            the same state.
        """
        batch, sites, _ = query.features.shape
        needed = batch * sites * state.width
        out = state.workspace[:needed] if needed <= len(state.workspace) else None
        if query.extended is not None:
            # Unreadable neighbors drop out of the candidates' lengths too, query by query.
            return Proposals(_product(query.extended, state.table, state.exemplars, out))
        products = state.table[:, : state.features + 1]
        return Proposals(_product(query.features, products, state.exemplars, out))


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
