"""Searchers: for each query neighborhood, the candidates of the exemplar and what each would cost."""

from __future__ import annotations

from typing import TypeAlias

from torchsynth.search.base import Costs, Query
from torchsynth.search.exhaustive import Exhaustive, ExhaustiveState

Search: TypeAlias = Exhaustive
"""Any searcher; the ``kind`` field tells them apart in YAML."""

__all__ = ["Costs", "Exhaustive", "ExhaustiveState", "Query", "Search"]
