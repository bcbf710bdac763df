"""Searchers: for each query neighborhood, the candidates of the exemplar and what each would cost."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from torchsynth.search.base import Costs, Offers, Proposals, Query, chance, draw_at, scatter_draws, spare
from torchsynth.search.coherence import Coherence, CoherenceState
from torchsynth.search.exhaustive import Exhaustive, ExhaustiveState
from torchsynth.search.preference import PreferCoherent, PreferCoherentState
from torchsynth.search.tree import Tree
from torchsynth.search.tsvq import TSVQ, TSVQState

Search: TypeAlias = Annotated[Exhaustive | TSVQ | Coherence | PreferCoherent, Field(discriminator="kind")]
"""Any searcher; the ``kind`` field tells them apart in YAML."""

__all__ = [
    "TSVQ",
    "Coherence",
    "CoherenceState",
    "Costs",
    "Exhaustive",
    "ExhaustiveState",
    "Offers",
    "PreferCoherent",
    "PreferCoherentState",
    "Proposals",
    "Query",
    "Search",
    "TSVQState",
    "Tree",
    "chance",
    "draw_at",
    "scatter_draws",
    "spare",
]
