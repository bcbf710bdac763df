"""The canvas: everything that changes while one pyramid level is synthesized."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from torchsynth._typing import CostMap, Image, Rows, Sites, SourceMap
from torchsynth.lattice import Boundary, Shape
from torchsynth.neighborhood import Plane, quantize

UNSET = -1
"""The source of a pixel that still shows what the level started from."""


@dataclass(frozen=True)
class Canvas:
    """One level of the output while it grows; its tensors are written in place.

    Only the initialisers (which make it) and the sweep loop (through :meth:`write`) change it. Color
    and source are written together, so ``image == exemplar[source]`` wherever a source is set.

    Args:
        plane: The matching side: whole numbers, what neighborhoods read.
        source: Flat position in the exemplar level that each pixel was copied from, or ``UNSET``.
        cost: Mean squared difference, per compared value, between each pixel's neighborhood and its
            match, in squared units of [0, 1].
        start: The picture the level started from.
        exemplar: The exemplar level the pixels are copied from.
        exemplar_plane: The same, as its matching side.
    """

    plane: Plane
    source: Int64[Tensor, "batch pixels"]
    cost: Float[Tensor, "batch pixels"]
    start: Image
    exemplar: Image
    exemplar_plane: Plane

    @classmethod
    def blank(cls, start: Image, exemplar: Image, exemplar_plane: Plane, boundary: Boundary) -> Canvas:
        """A canvas that shows the picture a level starts from, with no source set."""
        batch, _, height, width = start.shape
        values = quantize(start, exemplar_plane.values.dtype)
        source = torch.full((batch, height * width), UNSET, device=start.device)
        cost = torch.zeros_like(source, dtype=values.dtype)
        plane = Plane(values, (height, width), boundary)
        return cls(plane, source, cost, start, exemplar, exemplar_plane)

    @property
    def shape(self) -> Shape:
        """Height and width."""
        return self.plane.shape

    def write(self, sites: Sites, source: Rows) -> None:
        """Copy exemplar pixels, by their flat positions, to the given sites of every output."""
        self.plane.values.index_copy_(1, sites, _pick(self.exemplar_plane.values, source))
        self.source.index_copy_(1, sites, source)

    def write_cost(self, sites: Sites, cost: Float[Tensor, "batch sites"]) -> None:
        """Note what the matches of the given sites cost; nothing reads it during a sweep."""
        self.cost.index_copy_(1, sites, cost)

    def image(self) -> Image:
        """The picture as it stands: exemplar values where a source is set, the start elsewhere."""
        batch, channels = self.start.shape[:2]
        values = self.exemplar.flatten(2).transpose(1, 2)
        copied = _pick(values, self.source.clamp(min=0)).transpose(1, 2)
        started = self.start.flatten(2)
        image = torch.where((self.source == UNSET).unsqueeze(1), started, copied)
        return image.reshape(batch, channels, *self.shape)

    def source_map(self) -> SourceMap:
        """The sources as (row, column)."""
        width = self.exemplar.shape[-1]
        cells = torch.stack((self.source // width, self.source % width), dim=1)
        return cells.view(len(cells), 2, *self.shape)

    def cost_map(self) -> CostMap:
        """The costs, as a picture."""
        return self.cost.view(len(self.cost), *self.shape)


def _pick(values: Tensor, source: Tensor) -> Tensor:
    """``values[source]`` for one exemplar shared by all outputs, or for one each."""
    if len(values) == 1:
        return values.index_select(1, source.flatten()).view(*source.shape, -1)
    return values.gather(1, source.unsqueeze(2).expand(-1, -1, values.shape[2]))
