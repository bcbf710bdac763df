"""Searchers: for each query neighborhood, the candidates of the exemplar and what each would cost."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from torchsynth.search.base import Costs, Proposals, Query
from torchsynth.search.exhaustive import Exhaustive, ExhaustiveState
from torchsynth.search.tsvq import TSVQ, TSVQState

Search: TypeAlias = Annotated[Exhaustive | TSVQ, Field(discriminator="kind")]
"""Any searcher; the ``kind`` field tells them apart in YAML."""

__all__ = ["TSVQ", "Costs", "Exhaustive", "ExhaustiveState", "Proposals", "Query", "Search", "TSVQState"]
