"""The canvas: everything that changes while one pyramid level is synthesized."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from torchsynth._typing import CostMap, Frames, Image, Sites, SourceMap, Sources, Values
from torchsynth.lattice import Boundary, Shape
from torchsynth.neighborhood import Plane, dequantize, output_plane

UNSET = -1
"""The source of a pixel that still shows what the level started from."""


@dataclass(frozen=True)
class Canvas:
    """One level of the output while it grows; its tensors are written in place.

    Only the initialisers (which make it) and the sweep loop (through :meth:`write`) change it. Color
    and source are written together, so ``image == exemplar[source]`` wherever a source is set.

    Args:
        plane: The matching side: whole numbers, what neighborhoods read.
        source: Flat position in the exemplar level that each pixel was copied from, or ``UNSET``; like
            the plane it has an empty pixel behind the last. A pixel may also be given a value of its own,
            which comes from no source.
        cost: Mean squared difference, per compared value, between each pixel's neighborhood and its
            match, in squared units of [0, 1].
        start: The picture the level started from.
        known: Which pixels are synthesized or given, rather than merely started from, the same in all
            samples; it changes between sweeps.
        given: Which pixels are given, and never written.
        exemplar: The exemplar level the pixels are copied from.
        exemplar_plane: The same, as its matching side.
        target: The picture the output should follow, valid where it was painted.
        guide: What lies upon the output, to be compared with what lies upon the exemplar.
        frames: How each pixel sees its surroundings turned and scaled; None if it does not.
    """

    plane: Plane
    source: Int64[Tensor, "batch positions"]
    cost: Float[Tensor, "batch pixels"]
    known: Bool[Tensor, " positions"]
    given: Bool[Tensor, " positions"]
    start: Image
    exemplar: Image
    exemplar_plane: Plane
    target: Plane | None = None
    guide: Plane | None = None
    frames: Frames | None = None

    @classmethod
    def blank(
        cls,
        start: Image,
        exemplar: Image,
        exemplar_plane: Plane,
        boundary: Boundary,
        target: Plane | None = None,
        guide: Plane | None = None,
        frames: Frames | None = None,
    ) -> Canvas:
        """A canvas that shows the picture a level starts from, with no source set."""
        batch, _, height, width = start.shape
        plane = output_plane(start, exemplar_plane.values.dtype, boundary)
        source = torch.full((batch, height * width + 1), UNSET, device=start.device)
        cost = plane.values.new_zeros(batch, height * width)
        known = torch.zeros_like(source[0], dtype=torch.bool)
        given = known.clone()
        return cls(plane, source, cost, known, given, start, exemplar, exemplar_plane, target, guide, frames)

    @property
    def shape(self) -> Shape:
        """Height and width."""
        return self.plane.shape

    def give(self, sites: Sites, source: Sources) -> None:
        """Declare some pixels given: they keep what the level starts with.

        Args:
            sites: Which.
            source: The exemplar pixel that each of them shows; ``UNSET`` if it shows none.
        """
        self.source.index_copy_(1, sites, source)
        self.given[sites] = True
        self.known[sites] = True

    def resume(self, source: Sources) -> None:
        """Begin with an earlier output, as synthesized: where each pixel was copied from."""
        self.write(torch.arange(source.shape[1], device=source.device), source)
        self.known[:-1] = True

    def sample(self, number: int) -> Canvas:
        """One of the outputs, by itself: written there, it is written here, but for what is known."""
        one = slice(number, number + 1)
        shared = len(self.exemplar) == 1
        return replace(
            self,
            plane=replace(self.plane, values=self.plane.values[one]),
            source=self.source[one],
            cost=self.cost[one],
            known=self.known.clone(),
            start=self.start[one],
            exemplar=self.exemplar if shared else self.exemplar[one],
            exemplar_plane=self.exemplar_plane
            if shared
            else replace(self.exemplar_plane, values=self.exemplar_plane.values[one]),
            target=None if self.target is None else replace(self.target, values=self.target.values[one]),
            guide=None if self.guide is None else replace(self.guide, values=self.guide.values[one]),
        )

    def write(self, sites: Sites, source: Sources, own: Values | None = None) -> None:
        """Copy exemplar pixels, by their flat positions, to the given sites of every output.

        Args:
            sites: Where to.
            source: Where from.
            own: Values to write instead, which come from no pixel.
        """
        if own is not None:
            self.plane.values.index_copy_(1, sites, own)
            self.source.index_fill_(1, sites, UNSET)
            return
        self.plane.values.index_copy_(1, sites, _pick(self.exemplar_plane.values, source))
        self.source.index_copy_(1, sites, source)

    def write_cost(self, sites: Sites, cost: Float[Tensor, "batch sites"]) -> None:
        """Note what the matches of the given sites cost; nothing reads it during a sweep."""
        self.cost.index_copy_(1, sites, cost)

    def image(self) -> Image:
        """The picture as it stands: exemplar values where a source is set.

        A given pixel is as it was given. Elsewhere the picture shows what the level started from, or values
        of a search's own, in the steps of matching.
        """
        batch, channels = self.start.shape[:2]
        values = self.exemplar.flatten(2).transpose(1, 2)
        source = self.source[:, :-1]
        copied = _pick(values, source.clamp(min=0)).transpose(1, 2)
        stepped = dequantize(self.plane.values[:, :-2]).to(copied.dtype).transpose(1, 2)
        own = torch.where(self.given[:-1], self.start.flatten(2), stepped)
        image = torch.where((source == UNSET).unsqueeze(1), own, copied)
        return image.reshape(batch, channels, *self.shape)

    def source_map(self) -> SourceMap:
        """The sources as (row, column); -1 where there is none."""
        width = self.exemplar.shape[-1]
        source = self.source[:, :-1]
        cells = torch.stack((source // width, torch.where(source == UNSET, -1, source % width)), dim=1)
        return cells.view(len(cells), 2, *self.shape)

    def cost_map(self) -> CostMap:
        """The costs, as a picture."""
        return self.cost.view(len(self.cost), *self.shape)


def _pick(values: Tensor, source: Tensor) -> Tensor:
    """``values[source]`` for one exemplar shared by all outputs, or for one each."""
    if values.shape[0] == values.shape[2] == 1:
        return values.take(source).unsqueeze(2)
    if values.shape[0] == 1:
        return values.index_select(1, source.reshape(-1)).view(*source.shape, values.shape[2])
    return values.gather(1, source.unsqueeze(2).expand(-1, -1, values.shape[2]))
