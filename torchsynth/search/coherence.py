"""Coherent candidates: where the neighbors were copied from, moved along by one neighbor's distance.

If a neighbor at ``p + offset`` was copied from the exemplar pixel ``s``, then ``s - offset`` is the pixel
that continues the same patch at ``p``. A dozen such candidates replace the search of all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from torchsynth._typing import Offsets
from torchsynth.neighborhood import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Proposals, Query
from torchsynth.template import Template


@dataclass(frozen=True)
class CoherenceState:
    """What is computed of the candidates, once.

    Args:
        continued: For each neighbor ``k``, and in one line with the others, which candidate continues a
            patch that has its neighbor ``k`` at ``source``: at ``k * (pixels + 1) + source + 1``; -1
            where there is none. The first of each neighbor's entries is for neighbors without source.
        lines: Where each neighbor's entries begin, for source 0.
        products: Minus twice each weighted candidate, and behind it its weighted squared length, which
            a query's last 1 picks up. All candidates of the first exemplar come first.
        partial: The same, and behind that minus its weighted squares, for the features that a query
            lacks; None where every query is complete.
        number: How many candidates an exemplar has.
        limits: For each candidate the chance above which it is replaced; None if none is.
    """

    continued: Int64[Tensor, " entries"]
    lines: Int64[Tensor, " neighbors"]
    products: Float[Tensor, "rows augmented"]
    partial: Float[Tensor, "rows extended"] | None
    number: int
    limits: Int64[Tensor, " candidates"] | None


class Coherence(Part):
    """Propose only continuations of the patches around a pixel; fast, and it keeps objects whole.

    A candidate whose neighborhood is not wholly inside the exemplar is replaced by a random one that
    is. The same candidate may be proposed by several neighbors: proposals cost nothing twice, so
    duplicates are not removed; the first of equally good ones wins.

    Args:
        template: Which neighbors propose a candidate, usually the ones that are compared. A template
            with center lets the pixel's present source compete, in a second pass or on a finer level.
        spare_bottom: Replace a candidate by a random one with the probability that the paper gives,
            certain at the exemplar's lowest row and zero at its highest. Visible effect: a feature at
            the exemplar's bottom is repeated less often, and patches are smaller.

    Source:
        M. Ashikhmin, *Synthesizing natural textures*, I3D 2001, section 3.

    Example:
        >>> from torchsynth.template import Causal
        >>> len(Coherence(template=Causal(size=5)).wants().offsets())
        12
    """

    kind: Literal["coherence"] = "coherence"

    largest_term: ClassVar[int] = 3 * 128**2
    """The most that one feature adds to a sum: ``|x|^2 - 2 q.x``, with both from -128 to 127."""

    has_sources: ClassVar[bool] = True
    """Whether what it proposes are exemplar pixels."""

    template: Template
    spare_bottom: bool = False

    def wants(self) -> Template:
        """The neighbors whose sources have to be known."""
        return self.template

    @property
    def takes_chances(self) -> bool:
        """Whether each offer needs a random number."""
        return self.spare_bottom

    def fit(self, index: Index, complete: bool) -> CoherenceState:
        """Prepare the candidates.

        Args:
            index: The candidates.
            complete: Whether every feature of every query will be readable.
        """
        vectors = index.features.flatten(0, 1)
        weights = index.weights.to(vectors.dtype)
        squares = vectors.square().mul_(weights)
        products = torch.cat((vectors * (-2 * weights), squares.sum(1, keepdim=True)), dim=1)
        continued = _continuations(index, self.template.offsets().to(vectors.device))
        lines = torch.arange(len(continued), device=vectors.device) * continued.shape[1] + 1
        return CoherenceState(
            continued=continued.flatten(),
            lines=lines,
            products=products,
            partial=None if complete else torch.cat((products, -squares), dim=1),
            number=len(index.sites),
            limits=_limits(index) if self.spare_bottom else None,
        )

    def copies(self, complete: bool) -> int:
        """How much memory fitting takes, in sizes of the candidates' vectors."""
        return 3 if complete else 5

    def beside(self, pixels: int) -> int:
        """How many bytes fitting takes for exemplars of so many pixels, beside those copies."""
        # The table of continuations, twice while it is put together.
        return 16 * len(self.template.offsets()) * pixels

    def capacity(self, state: CoherenceState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        row = len(state.lines) * state.products.shape[1] * state.products.element_size()
        return max(1, MEMORY_BUDGET // (2 * row))

    def search(self, state: CoherenceState, query: Query) -> Proposals:
        """Propose one candidate for each wanted neighbor.

        Returns:
            Costs ``(B, sites, neighbors)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite for neighbors that offer none.
        """
        offers = query.offers
        assert offers is not None, "the sweep reads what a search wants"  # noqa: S101 (for the type checker)
        rows = state.continued.take(offers.source + state.lines)
        rows = torch.where(rows < 0, offers.spares, rows)
        if state.limits is not None and offers.chances is not None:
            rows = torch.where(offers.chances > state.limits.take(rows), offers.spares, rows)
        cost = _costs(state, query, rows)
        if offers.missing is not None:
            cost.masked_fill_(offers.missing, float("inf"))
        return Proposals(cost, rows)


def _costs(state: CoherenceState, query: Query, rows: Tensor) -> Float[Tensor, "batch sites neighbors"]:
    """What the proposed candidates cost."""
    queries, table = query.features, state.products
    if query.extended is not None and state.partial is not None:
        queries, table = query.extended, state.partial
    height, features = table.shape
    if height > state.number:  # each sample has an exemplar of its own
        rows = rows + torch.arange(0, height, state.number, device=rows.device).view(-1, 1, 1)
    proposed = torch.embedding(table, rows).view(-1, rows.shape[2], features)
    return torch.bmm(proposed, queries.reshape(-1, features, 1)).view(rows.shape)


def _continuations(index: Index, offsets: Offsets) -> Int64[Tensor, "neighbors entries"]:
    """For each neighbor and each source it may have: the candidate that continues the patch, or -1."""
    height, width = index.shape
    reach = int(offsets.abs().max())
    padded = torch.full((height + 2 * reach, width + 2 * reach), -1, device=offsets.device)
    rows = torch.full((height * width,), -1, device=offsets.device)
    rows[index.sites] = torch.arange(len(index.sites), device=offsets.device)
    padded[reach : reach + height, reach : reach + width] = rows.view(height, width)
    continued = torch.full((len(offsets), height * width + 1), -1, device=offsets.device)
    # The window that begins at (reach - dy, reach - dx) shows every pixel its neighbor's continuation.
    for neighbor, (top, left) in enumerate((reach - offsets).tolist()):
        window = padded[top : top + height, left : left + width]
        continued[neighbor, 1:].view(height, width).copy_(window)
    return continued


def _limits(index: Index) -> Int64[Tensor, " candidates"]:
    """``rand**d > d`` exactly when ``rand > d**(1 / d)``, where d is how far above the lowest row one is."""
    rows = index.sites // index.shape[1]
    distance = (rows.max() - rows).double() / (rows.max() - rows.min()).clamp(min=1)
    limits: Tensor = distance ** (1 / distance.clamp(min=1e-9))
    if bool(rows.max() == rows.min()):
        limits = torch.ones_like(limits)  # no row is nearer to the bottom than another
    return (limits * 2**31).round().long()
