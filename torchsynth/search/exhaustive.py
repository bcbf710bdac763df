"""Exhaustive search: every candidate of the exemplar, for every query."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import pad

from torchsynth.neighborhood import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Costs, Query

# A product with few queries is fastest when each block of candidates, and its costs, stay in the
# innermost caches: a fifth less time than one wide product, together with finding the minimum.
_BLOCK = 192
# Below this many candidates, one block is best: the number of calls is what counts.
_ONE_BLOCK = 2048


@dataclass(frozen=True)
class ExhaustiveState:
    """What is computed of the candidates, once. They are laid out in blocks of columns.

    Args:
        products: Minus twice the weighted candidates, and below them their weighted squared lengths,
            which a query's last 1 picks up: infinite in columns that pad the last block.
        squares: Their weighted squares, zero in those columns; None where every query is complete.
        exemplars: How many exemplars there are; the blocks of the first come first.
        workspace: Where costs are written, again and again: fresh memory for each of thousands of
            searches would cost a tenth of the time.
    """

    products: Float[Tensor, "blocks augmented columns"]
    squares: Float[Tensor, "blocks augmented columns"] | None
    exemplars: int
    workspace: Float[Tensor, " size"]

    @property
    def width(self) -> int:
        """How many costs a query has."""
        return len(self.products) // self.exemplars * self.products.shape[2]


class Exhaustive(Part):
    """Compare each query with every candidate; exact, and the reference for all faster searches.

    The squared distance is expanded, ``|q|^2 - 2 q.x + |x|^2``, so that a batch of queries costs one
    matrix product; ``|q|^2`` changes nothing and is left out. With the whole-number features of
    :mod:`torchsynth.neighborhood` this is exact, and equals ``torch.cdist`` squared. Memory for the
    costs is bounded by searching few queries at a time.

    Source: Wei & Levoy 2000, section 2.1.

    Example:
        >>> features = torch.tensor([[[0.0, 3.0], [1.0, 1.0]]])
        >>> index = Index(features, torch.tensor([0, 1]), torch.tensor([1, 1]))
        >>> state = Exhaustive().fit(index, complete=True)
        >>> cost = Exhaustive().search(state, Query(torch.tensor([[[0.0, 2.0, 1.0]]])))
        >>> (cost + 2.0**2).tolist()
        [[[[1.0, 2.0]]]]
    """

    kind: Literal["exhaustive"] = "exhaustive"

    def fit(self, index: Index, complete: bool) -> ExhaustiveState:
        """Prepare the candidates.

        Args:
            index: The candidates.
            complete: Whether every feature of every query will be readable.
        """
        candidates = index.features.transpose(1, 2)
        weighted = candidates * index.weights.to(candidates.dtype).unsqueeze(1)
        squares = weighted * candidates
        products = _in_blocks(
            torch.cat((weighted.mul_(-2), squares.sum(1, keepdim=True)), dim=1), last_row=float("inf")
        )
        exemplars = len(candidates)
        width = len(products) // exemplars * products.shape[2]
        capacity = max(1, MEMORY_BUDGET // (width * products.element_size()))
        return ExhaustiveState(
            products,
            None if complete else _in_blocks(pad(squares, (0, 0, 0, 1)), last_row=float("inf")),
            exemplars,
            products.new_empty(capacity * width),
        )

    def capacity(self, state: ExhaustiveState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        return len(state.workspace) // state.width

    def search(self, state: ExhaustiveState, query: Query) -> Costs:
        """What every candidate costs.

        Returns:
            ``(B, sites, blocks, columns)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite in the padding. Candidate ``i``
            of the index is column ``i`` counted through the blocks. Valid until the next search with
            the same state.
        """
        batch, sites, _ = query.features.shape
        out = state.workspace[: batch * sites * state.width]
        cost = _product(query.features, state.products, state.exemplars, out)
        if query.readable is not None and state.squares is not None:
            partial = ~query.readable.all(1)
            cost[:, partial] = _partial_cost(
                state, state.squares, query.features[:, partial], query.readable[partial]
            )
        return cost


def _partial_cost(
    state: ExhaustiveState,
    squares: Tensor,
    features: Float[Tensor, "batch sites augmented"],
    readable: Bool[Tensor, "sites features"],
) -> Costs:
    """Unreadable neighbors drop out of the candidates' lengths too, query by query."""
    there = pad(readable.to(features.dtype), (0, 1), value=1.0).expand(len(features), -1, -1)
    lengths = _product(there, squares, state.exemplars)
    linear = pad(features[..., :-1], (0, 1))  # without the 1 that would add the full lengths
    return lengths + _product(linear, state.products.nan_to_num(posinf=0.0), state.exemplars)


def _in_blocks(matrix: Tensor, last_row: float) -> Tensor:
    """Cut ``(E, rows, candidates)`` into contiguous blocks ``(E * blocks, rows, columns)``.

    Columns that fill up the last block are zero but for ``last_row``.
    """
    exemplars, rows, candidates = matrix.shape
    columns = candidates if candidates <= _ONE_BLOCK else _BLOCK
    padded = pad(matrix, (0, -candidates % columns))
    padded[:, -1, candidates:] = last_row
    return padded.view(exemplars, rows, -1, columns).transpose(1, 2).flatten(0, 1).contiguous()


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
