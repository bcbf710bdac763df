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
_BLOCK = 128
# Below this many candidates, one block is best: the number of calls is what counts.
_ONE_BLOCK = 2048


@dataclass(frozen=True)
class ExhaustiveState:
    """What is computed of the candidates, once. They are laid out in blocks of columns.

    Args:
        products: Minus twice the weighted candidates, and below them their weighted squared lengths,
            which a query's last 1 picks up: infinite in columns that pad the last block.
        squares: Their weighted squares, zero in those columns; None where every query is complete.
        workspace: Where costs are written, again and again: fresh memory for each of thousands of
            searches would cost a tenth of the time.
    """

    products: Float[Tensor, "exemplars blocks features+1 columns"]
    squares: Float[Tensor, "exemplars blocks features+1 columns"] | None
    workspace: Float[Tensor, " size"]


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
        products = torch.cat((weighted.mul_(-2), squares.sum(1, keepdim=True)), dim=1)
        columns = candidates.shape[2]
        capacity = max(1, MEMORY_BUDGET // (columns * products.element_size()))
        return ExhaustiveState(
            _in_blocks(products, last_row=float("inf")),
            None if complete else _in_blocks(pad(squares, (0, 0, 0, 1)), last_row=float("inf")),
            products.new_empty(capacity * (columns + -columns % _BLOCK)),
        )

    def capacity(self, state: ExhaustiveState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        _, blocks, _, columns = state.products.shape
        return len(state.workspace) // (blocks * columns)

    def search(self, state: ExhaustiveState, query: Query) -> Costs:
        """What every candidate costs.

        Returns:
            ``(B, sites, blocks, columns)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite in the padding. Candidate ``i``
            of the index is column ``i`` counted through the blocks. Valid until the next search with
            the same state.
        """
        cost = _product(query.features, state.products, state.workspace)
        if query.readable is not None and state.squares is not None:
            partial = ~query.readable.all(1)
            cost[:, partial] = self._partial_cost(
                state.products, state.squares, query.features[:, partial], query.readable[partial]
            )
        return cost

    def _partial_cost(
        self,
        products: Tensor,
        squares: Tensor,
        features: Float[Tensor, "batch sites features+1"],
        readable: Bool[Tensor, "sites features"],
    ) -> Costs:
        """Unreadable neighbors drop out of the candidates' lengths too, query by query."""
        lengths = pad(readable.to(features.dtype), (0, 1), value=1.0).expand(len(features), -1, -1)
        linear = pad(features[..., :-1], (0, 1))  # without the 1 that would add the full lengths
        return _product(lengths, squares) + _product(linear, products.nan_to_num(posinf=0.0))


def _in_blocks(matrix: Tensor, last_row: float) -> Tensor:
    """Cut ``(E, rows, candidates)`` into contiguous blocks ``(E, blocks, rows, columns)``.

    Columns that fill up the last block are zero but for ``last_row``.
    """
    exemplars, rows, candidates = matrix.shape
    columns = candidates if candidates <= _ONE_BLOCK else _BLOCK
    padded = pad(matrix, (0, -candidates % columns))
    padded[:, -1, candidates:] = last_row
    return padded.view(exemplars, rows, -1, columns).transpose(1, 2).contiguous()


def _product(queries: Tensor, candidates: Tensor, workspace: Tensor | None = None) -> Costs:
    """The product of each query with each column: ``(B, sites, blocks, columns)``."""
    batch, sites, features = queries.shape
    exemplars, blocks, _, columns = candidates.shape
    # One exemplar for all samples: their queries go into one product. Else each has its own.
    grouped = queries.reshape(exemplars, 1, -1, features).expand(-1, blocks, -1, -1)
    out = None
    if workspace is not None:
        out = workspace[: batch * sites * blocks * columns].view(exemplars * blocks, -1, columns)
    cost = torch.bmm(grouped.flatten(0, 1), candidates.flatten(0, 1), out=out)
    return cost.view(exemplars, blocks, -1, columns).transpose(1, 2).view(batch, sites, blocks, columns)
