"""Names for the tensors that travel through the library; jaxtyping checks them in the tests."""

from __future__ import annotations

from typing import TypeAlias

from jaxtyping import Bool, Float, Int64
from torch import Tensor

Image: TypeAlias = Float[Tensor, "batch channels height width"]
"""Pictures with values in [0, 1]."""

SourceMap: TypeAlias = Int64[Tensor, "batch 2 height width"]
"""Row and column of the exemplar pixel that each output pixel was copied from."""

CostMap: TypeAlias = Float[Tensor, "batch height width"]
"""Mean squared difference, per compared value, between an output neighborhood and its match."""

Grid: TypeAlias = Int64[Tensor, "height width"]
"""One whole number for each pixel: its rank in an order, or the batch it belongs to."""

Region: TypeAlias = Bool[Tensor, "height width"]
"""One truth value for each pixel."""

Offsets: TypeAlias = Int64[Tensor, "neighbors 2"]
"""The ``(dy, dx)`` of a template: neighbor = p + offset."""

Sites: TypeAlias = Int64[Tensor, " sites"]
"""Output pixels by flat position, row * width + column."""

Cells: TypeAlias = Int64[Tensor, "sites 2"]
"""The same as (row, column) pairs."""

Features: TypeAlias = Float[Tensor, "batch sites features"]
"""Neighborhoods as integer-valued vectors, one for each site."""

Values: TypeAlias = Float[Tensor, "batch pixels channels"]
"""A picture laid out for gathering: flat positions by channels."""

Rows: TypeAlias = Int64[Tensor, "batch sites"]
"""Which candidate was chosen: a row of the index."""

Draws: TypeAlias = Float[Tensor, "batch sites"]
"""Uniform random numbers in [0, 1), one for each site."""
