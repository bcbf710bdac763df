"""Names for the tensors that travel through the library; jaxtyping checks them in the tests.

A dimension whose name begins with an underscore may differ between the arguments of one function: an
exemplar and an output have the same channels but not the same size.
"""

from __future__ import annotations

from typing import TypeAlias

from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

Image: TypeAlias = Float[Tensor, "_batch channels _height _width"]
"""Pictures with values in [0, 1]."""

SourceMap: TypeAlias = Int64[Tensor, "_batch 2 _height _width"]
"""Row and column of the exemplar pixel that each output pixel was copied from."""

CostMap: TypeAlias = Float[Tensor, "_batch _height _width"]
"""Mean squared difference, per compared value, between an output neighborhood and its match."""

Grid: TypeAlias = Int64[Tensor, "_height _width"]
"""One whole number for each pixel: its rank in an order, or the batch it belongs to."""

Region: TypeAlias = Bool[Tensor, "_height _width"]
"""One truth value for each pixel."""

FieldMap: TypeAlias = Float[Tensor, "_height _width"]
"""One number for each pixel: an angle in degrees, or a scale."""

Offsets: TypeAlias = Int64[Tensor, "_neighbors 2"]
"""The ``(dy, dx)`` of a template: neighbor = p + offset."""

Frames: TypeAlias = Float64[Tensor, "_sites 2 2"]
"""For each output pixel how an offset ``(dy, dx)`` of its neighborhood is turned and scaled."""

Sites: TypeAlias = Int64[Tensor, " _sites"]
"""Output pixels by flat position, row * width + column."""

Cells: TypeAlias = Int64[Tensor, "_sites 2"]
"""The same as (row, column) pairs."""

Features: TypeAlias = Float[Tensor, "_batch _sites _features"]
"""Neighborhoods as integer-valued vectors, one for each site."""

Values: TypeAlias = Float[Tensor, "_batch _pixels channels"]
"""A picture laid out for gathering: flat positions by channels."""

Sources: TypeAlias = Int64[Tensor, "_batch _sites"]
"""Which exemplar pixel each site is copied from: a flat position."""

Draws: TypeAlias = Int64[Tensor, "_batch _sites"]
"""Random whole numbers from 0 to 2**62 - 1, one for each site."""
