"""The exemplar's side of neighborhoods: which pixels are candidates, and what surrounds them.

All candidates' vectors together are many times the exemplar, a gigabyte for a photo. So they are not kept
here, but read when they are asked for: the rows of a window are runs of the exemplar's memory, and copying
runs costs little more than the products that searchers make of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from torchsynth._typing import Features, Offsets, Region, Values
from torchsynth.lattice import Shape, parents, to_cells
from torchsynth.neighborhood import Layer, Plane, Planes, neighbor_weights
from torchsynth.template import Square

CHUNK = 2**22
"""Bytes of vectors that are read at once: they stay in the caches, or near them."""


@dataclass(frozen=True)
class Index:
    """The candidates of one level: where each of them lies, and its feature vector when it is asked for.

    Args:
        readings: What a vector is read from, part by part.
        sites: The flat exemplar position of each candidate, ascending.
        weights: How much each feature's squared difference counts: whole numbers.
        plane: The exemplar level that the positions refer to.

    Example:
        >>> from torchsynth.neighborhood import Layer
        >>> layer, picture = Layer(plane="result", template=Square(size=3)), torch.arange(12.0).view(1, 12, 1)
        >>> index = Index.of((layer,), (1,), Planes((Plane(picture, (3, 4), "open"),)), level=0)
        >>> index.sites.tolist()
        [5, 6]
        >>> index.at(torch.tensor([1])).tolist()
        [[1.0, 2.0, 3.0, 5.0, 6.0, 7.0, 9.0, 10.0, 11.0]]
    """

    readings: tuple[_Reading, ...]
    sites: Int64[Tensor, " candidates"]
    weights: Int64[Tensor, " features"]
    plane: Plane

    @classmethod
    def of(cls, layers: Sequence[Layer], weights: Sequence[int], planes: Planes, level: int) -> Index:
        """Find the candidates of a level, of exemplars whose planes are given by level.

        Args:
            layers: The layers that exist at this level.
            weights: What each of them counts; see :func:`torchsynth.neighborhood.layer_weights`.
            planes: The exemplars' side.
            level: Which level.
        """
        own = planes.result[level]
        sites = candidates(layers, planes, level).flatten().nonzero().squeeze(1)
        read = [planes.of(layer, level) for layer in layers]
        readings = [
            _Reading.of(layer, plane, sites, own.shape[1]) for layer, plane in zip(layers, read, strict=True)
        ]
        counts = [
            every.repeat_interleave(plane.values.shape[2])
            for every, plane in zip(neighbor_weights(layers, weights), read, strict=True)
        ]
        return cls(tuple(readings), sites, torch.cat(counts).to(sites.device), own)

    @classmethod
    def of_vectors(
        cls, vectors: Features, weights: Int64[Tensor, " features"], values: Values | None = None
    ) -> Index:
        """Candidates of any vectors: those of an exemplar of one row, whose pixels these are.

        Args:
            vectors: ``(E, candidates, features)``: one set for each exemplar.
            weights: How much each feature's squared difference counts.
            values: ``(E, candidates, C)``: the candidates without their neighborhoods; None if nobody asks.

        Example:
            >>> Index.of_vectors(torch.zeros(1, 9, 2), torch.tensor([1, 3])).shape
            (1, 9)
        """
        plane = Plane(vectors, (1, vectors.shape[1]), "open")
        sites = torch.arange(vectors.shape[1], device=vectors.device)
        layer = Layer(plane="result", template=Square(size=1))
        own = plane if values is None else Plane(values, plane.shape, "open")
        return cls((_Reading.of(layer, plane, sites, plane.shape[1]),), sites, weights, own)

    @property
    def exemplars(self) -> int:
        """How many exemplars there are; each has its own vectors at the same sites."""
        return len(self.plane.values)

    @property
    def dtype(self) -> torch.dtype:
        """The float type of the vectors."""
        return self.readings[0].runs.dtype

    @property
    def shape(self) -> Shape:
        """Height and width of the exemplar level that the positions refer to."""
        return self.plane.shape

    @property
    def values(self) -> Values:
        """``(E, candidates, C)``: the candidates themselves, without their neighborhoods."""
        return self.plane.values.index_select(1, self.sites)

    @property
    def features(self) -> Features:
        """``(E, candidates, features)``: the vectors of all candidates, which may be large."""
        every = self.readings[0].runs.new_empty(self.exemplars, len(self.sites), len(self.weights))
        for some in self.slices():
            every[:, some] = self.vectors(some)
        return every

    def slices(self, multiple: int = 1) -> Iterator[slice]:
        """Cut the candidates into slices whose vectors are small enough to be read at once.

        Args:
            multiple: The number of candidates in each but the last is one of this.
        """
        size = self.exemplars * len(self.weights) * self.dtype.itemsize
        step = max(1, CHUNK // (size * multiple)) * multiple
        for start in range(0, len(self.sites), step):
            yield slice(start, min(start + step, len(self.sites)))

    def vectors(self, some: slice) -> Features:
        """``(E, candidates, features)``: the vectors of a slice of the candidates."""
        rows = torch.arange(some.start, some.stop, device=self.sites.device)
        if self.exemplars > 1:
            firsts = torch.arange(self.exemplars, device=rows.device) * len(self.sites)
            rows = firsts.unsqueeze(1) + rows
        return self.at(rows).view(self.exemplars, some.stop - some.start, len(self.weights))

    def at(self, rows: Int64[Tensor, "*any"]) -> Float[Tensor, "*any features"]:
        """The vectors of any candidates: those of the second exemplar are counted on behind the first's."""
        flat = rows.reshape(-1)
        exemplar = None
        if self.exemplars > 1:
            exemplar, flat = flat // len(self.sites), flat % len(self.sites)
        parts = [part for reading in self.readings for part in reading.parts(flat, exemplar)]
        found = parts[0] if len(parts) == 1 else torch.cat(parts, dim=1)
        return found.reshape(*rows.shape, -1)


def candidates(layers: Sequence[Layer], planes: Planes, level: int) -> Region:
    """Which exemplar positions have every layer's neighborhood wholly inside, and valid.

    Args:
        layers: The layers that exist at this level.
        planes: The exemplar's side.
        level: The level whose positions are asked for.
    """
    height, width = planes.result[level].shape
    everywhere = torch.ones(height, width, dtype=torch.bool, device=planes.result[level].values.device)
    own = planes.result[level].valid
    usable = everywhere if own is None else own.clone()
    cells = to_cells(torch.arange(height * width, device=usable.device), width)
    for layer in layers:
        whole = _whole_neighborhoods(layer, planes.of(layer, level))
        if layer.steps_up == 0:  # every pixel is its own parent
            usable &= whole
            continue
        centers = parents(cells, layer.steps_up)
        # Sides round down, so the last row or column of an odd level has no parent.
        last = torch.tensor(whole.shape, device=centers.device) - 1
        has_parent = (centers <= last).all(1)
        rows, columns = centers.minimum(last).unbind(1)
        usable &= (whole[rows, columns] & has_parent).view(height, width)
    return usable


@dataclass(frozen=True)
class _Reading:
    """A layer's neighborhoods in the exemplar's memory, where each row of a window is a run of numbers.

    Args:
        runs: Of each pixel of all exemplars, the numbers in memory that begin there: as many as a row of
            the window has. They overlap: this is a view, as large as the exemplar.
        corners: For each candidate the upper left pixel of its window.
        steps: How far each row of the window is behind the first.
        spans: Which of the window's numbers belong to the template.
        pixels: How many pixels an exemplar has.
    """

    runs: Float[Tensor, "starts length"]
    corners: Int64[Tensor, " candidates"]
    steps: Int64[Tensor, " rows"]
    spans: tuple[slice, ...]
    pixels: int

    @classmethod
    def of(cls, layer: Layer, plane: Plane, sites: Int64[Tensor, " candidates"], width: int) -> _Reading:
        """Bind a layer to the plane it reads, for candidates at these sites of a level of this width."""
        box = _Box.of(layer, sites.device)
        exemplars, pixels, channels = plane.values.shape
        starts = max(0, exemplars * pixels - box.width + 1)
        runs = plane.values.contiguous().as_strided((starts, box.width * channels), (channels, 1))
        cells = parents(to_cells(sites, width), layer.steps_up) - torch.tensor(box.pixel, device=sites.device)
        corners = cells[:, 0] * plane.shape[1] + cells[:, 1]
        steps = torch.arange(box.height, device=sites.device) * plane.shape[1]
        return cls(runs, corners, steps, box.spans(channels), pixels)

    def parts(
        self, rows: Int64[Tensor, " rows"], exemplar: Int64[Tensor, " rows"] | None
    ) -> list[Float[Tensor, "rows numbers"]]:
        """The layer's share of the vectors of some candidates, cut where the template leaves pixels out."""
        starts = self.corners.index_select(0, rows)
        if exemplar is not None:
            starts = starts + exemplar * self.pixels
        starts = (starts.unsqueeze(1) + self.steps).view(-1)
        windows = self.runs.index_select(0, starts).view(len(rows), len(self.steps) * self.runs.shape[1])
        return [windows[:, span] for span in self.spans]


@dataclass(frozen=True)
class _Box:
    """The smallest box around a template and its pixel, and where these lie in it."""

    height: int
    width: int
    pixel: tuple[int, int]
    inside: Offsets

    @classmethod
    def of(cls, layer: Layer, device: torch.device) -> _Box:
        offsets = layer.template.offsets().to(device)
        reach = torch.cat((offsets, torch.zeros_like(offsets[:1])))
        corner = reach.amin(0)
        height, width = (reach.amax(0) - corner + 1).tolist()
        top, left = (-corner).tolist()
        return cls(height, width, (top, left), offsets - corner)

    def spans(self, channels: int) -> tuple[slice, ...]:
        """Which numbers of a box, read row by row, are the template's: a slice for each unbroken stretch."""
        places = self.inside[:, 0] * self.width + self.inside[:, 1]
        breaks = (places.diff() != 1).nonzero().squeeze(1)
        firsts = torch.cat((places[:1], places[breaks + 1])).tolist()
        lasts = torch.cat((places[breaks], places[-1:])).tolist()
        return tuple(
            slice(first * channels, (last + 1) * channels) for first, last in zip(firsts, lasts, strict=True)
        )


def _whole_neighborhoods(layer: Layer, plane: Plane) -> Region:
    """Where the layer's template lies inside the plane, on valid pixels only."""
    device = plane.values.device
    whole = torch.zeros(plane.shape, dtype=torch.bool, device=device)
    box = _Box.of(layer, device)
    height, width = plane.shape[0] - box.height + 1, plane.shape[1] - box.width + 1
    if height < 1 or width < 1:
        return whole
    top, left = box.pixel
    within = whole[top : top + height, left : left + width]
    within.fill_(True)
    if plane.valid is not None:
        for down, across in box.inside.tolist():
            within &= plane.valid[down : down + height, across : across + width]
    return whole
