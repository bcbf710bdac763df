"""The best match, unless a coherent candidate is nearly as good."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import torch
from jaxtyping import Float
from pydantic import Field, model_validator
from torch import Tensor

from torchsynth.accept import first_minimum
from torchsynth.index import Index
from torchsynth.part import Part
from torchsynth.search.base import Proposals, Query, Volume
from torchsynth.search.coherence import Coherence, CoherenceState
from torchsynth.search.exhaustive import Exhaustive
from torchsynth.search.tree import Tree
from torchsynth.search.tsvq import TSVQ
from torchsynth.template import Template


@dataclass(frozen=True)
class PreferCoherentState:
    """What is computed of the candidates, once.

    Args:
        best: What the search for the best match made of them.
        coherence: What the coherent search did.
        weights: How much each feature's squared difference counts.
    """

    best: Any
    coherence: CoherenceState
    weights: Float[Tensor, " features"]


class PreferCoherent(Part):
    """Search for the best match, but take a continuation of a patch that is not much worse.

    The best match by the numbers is not always the one that looks best: it changes from pixel to pixel, which
    blurs. A candidate that continues the patch of a neighbor wins if its squared distance is at most
    ``1 + kappa`` times the best one's.

    Args:
        best: How the best match is found.
        template: Which neighbors propose their continuations; those without one propose nothing.
        kappa: How much worse, as a share, a continuation may be. 0 is the plain search. Visible effect: the
            larger, the larger the patches: sharper and with more seams; 0.5 to 5 for filters, 5 to 25 for
            textures.

    Source:
        A. Hertzmann et al., *Image analogies*, SIGGRAPH 2001, section 3.1.

    Example:
        >>> from torchsynth.template import Causal
        >>> PreferCoherent(template=Causal(size=5), kappa=1.0).best.kind
        'exhaustive'
    """

    kind: Literal["prefer_coherent"] = "prefer_coherent"

    takes_chances: ClassVar[bool] = False
    """Whether each offer needs a random number."""

    has_sources: ClassVar[bool] = True
    """Whether what it proposes are exemplar pixels."""

    best: Annotated[Exhaustive | TSVQ, Field(discriminator="kind")] = Exhaustive()
    template: Template
    kappa: Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _both_have_sources(self) -> PreferCoherent:
        if not self.best.has_sources:
            raise ValueError(
                "patches are continued where every pixel is a copy, but leaves propose centroids"
            )
        return self

    @property
    def largest_term(self) -> int:
        """The most that one feature adds to a sum."""
        return max(self.best.largest_term, Coherence.largest_term)

    @property
    def tree_search(self) -> TSVQ | None:
        """The search whose trees a codebook may hold."""
        return self.best.tree_search

    @property
    def _coherence(self) -> Coherence:
        return Coherence(template=self.template)

    def wants(self) -> Template:
        """The neighbors whose sources have to be known."""
        return self.template

    def fit(self, index: Index, complete: bool) -> PreferCoherentState:
        """Prepare the candidates for both searches.

        Args:
            index: The candidates.
            complete: Whether every feature of every query will be readable.
        """
        return self._state(index, self.best.fit(index, complete), complete)

    def prepare(self, index: Index, tree: Tree) -> PreferCoherentState:
        """The same with a tree of these candidates that is there already."""
        assert isinstance(self.best, TSVQ), "only trees are prepared"  # noqa: S101 (for the type checker)
        return self._state(index, self.best.prepare(index, tree), complete=False)

    def _state(self, index: Index, best: object, complete: bool) -> PreferCoherentState:
        coherence = self._coherence.fit(index, complete)
        return PreferCoherentState(best, coherence, index.weights.to(index.dtype))

    def memory(self, volume: Volume) -> int:
        """About how many bytes fitting takes, and at most so many."""
        return self.best.memory(volume) + self._coherence.memory(volume)

    def capacity(self, state: PreferCoherentState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        return min(self.best.capacity(state.best), self._coherence.capacity(state.coherence))

    def search(self, state: PreferCoherentState, query: Query) -> Proposals:
        """Propose one candidate: the best match, or the best continuation if that is good enough.

        Returns:
            Its cost ``(B, sites, 1)``: the weighted squared distance less the query's own squared length.
        """
        matched = self.best.search(state.best, query)
        match = first_minimum(matched.cost)
        continued, source = _first_best(self._coherence.continued(state.coherence, query))
        common = query.features[..., :-1].square() @ state.weights
        # Whole numbers, but for the factor.
        limit = (match.cost + common).double() * (1 + self.kappa)
        prefers = (continued + common).double() <= limit
        cost = torch.where(prefers, continued.to(match.cost), match.cost)
        candidates = state.coherence.index.sites
        source = torch.where(prefers, source, matched.source_at(match.place, candidates))
        return Proposals(cost.unsqueeze(2), source.unsqueeze(2))


def _first_best(proposed: Proposals) -> tuple[Tensor, Tensor]:
    """The smallest cost of each query, and the first position of that cost."""
    assert proposed.source is not None, "coherent candidates are given by position"  # noqa: S101 (for the type checker)
    smallest = proposed.cost.amin(2, keepdim=True)
    source = proposed.source.masked_fill(proposed.cost > smallest, torch.iinfo(torch.int64).max)
    return smallest.squeeze(2), source.amin(2)
