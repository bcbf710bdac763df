"""Algorithms that copy whole patches, and cut them where they meet."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from torchsynth.patches.graphcut import GraphCut
from torchsynth.patches.quilting import Quilting

Patches: TypeAlias = Annotated[Quilting | GraphCut, Field(discriminator="kind")]
"""Any of them; the ``kind`` field tells them apart in YAML."""

__all__ = ["GraphCut", "Patches", "Quilting"]
