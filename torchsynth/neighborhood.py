"""Neighborhoods as feature vectors: layers, planes, and gathering from the output.

What is compared is a list of *layers*. A layer says which template is laid on which *plane*, and how
much it counts. The same list is gathered from the exemplar (:mod:`torchsynth.index`), for candidates, and
from the output, for the pixels whose turn it is; both give vectors with the same meaning at every place.

Matching is done on whole numbers: each channel is rounded to 256 steps around zero. Sums of products
of whole numbers below 2**24 are exact in float32, whatever the order of summation, so that results
do not depend on batch sizes, threads or machines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import torch
from jaxtyping import Int64
from pydantic import Field, model_validator
from torch import Tensor

from torchsynth._typing import Cells, Features, Frames, Image, Region, Values
from torchsynth.lattice import Boundary, Reads, Shape, distorted, only, parents, read
from torchsynth.part import Part
from torchsynth.template import Template

STEPS = 255
"""Matching distinguishes this many steps between black and white."""

# A Gaussian falloff is rounded to so many steps.
_GAUSSIAN_STEPS = 1024


class Layer(Part):
    """One template laid on one plane.

    Args:
        plane: ``result`` is the level being synthesized (the exemplar's same level on the other side);
            ``coarse`` is a finished coarser level, read around the pixel's parent; ``target`` is the
            picture that the output should follow, where it was painted; ``guide`` is a second picture
            that lies upon the exemplar, and one like it that lies upon the output; ``coarse_guide`` a
            coarser level of these.
        template: Which neighbors are compared.
        weight: How much each of their squared differences counts, a whole number. Visible effect: a
            heavier coarse layer keeps more of the coarse structure, a heavier result layer is smoother.
        up: For the coarse planes: how many levels up, 1 if not given. A layer that would read above the coarsest level is
            left out there, so the coarsest level is matched on ``result`` alone.
        sigma: Standard deviation, in pixels, of a Gaussian by which neighbors count less the farther they
            are; None lets all count the same. Visible effect: a small one follows fine structure, a
            large one holds larger structures together. Source: Efros & Leung 1999, section 2.1.

    Example:
        >>> from torchsynth.template import Causal
        >>> Layer(plane="result", template=Causal(size=9)).weight
        1
    """

    plane: Literal["result", "coarse", "target", "guide", "coarse_guide"]
    template: Template
    weight: Annotated[int, Field(ge=1, le=1000)] = 1
    up: Annotated[int, Field(ge=1)] | None = None
    sigma: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None

    @model_validator(mode="after")
    def _up_needs_coarse(self) -> Layer:
        if self.up is not None and not self.is_coarse:
            raise ValueError(f"'up' is for the coarse planes; a {self.plane} layer reads its own level")
        return self

    @property
    def is_coarse(self) -> bool:
        """Whether the layer reads coarser levels than the one that is synthesized."""
        return self.plane in ("coarse", "coarse_guide")

    @property
    def is_guide(self) -> bool:
        """Whether the layer reads guides."""
        return self.plane in ("guide", "coarse_guide")

    @property
    def steps_up(self) -> int:
        """How many levels above the synthesized one the layer reads."""
        return (self.up or 1) if self.is_coarse else 0


@dataclass(frozen=True)
class Plane:
    """A picture that neighborhoods are read from.

    Args:
        values: Whole numbers from -128 to 127, one row for each pixel; on the output's side there is
            one row more, of zeros, for every neighbor that does not exist, and behind it one of ones.
        shape: Height and width.
        boundary: What a neighborhood finds beyond the border.
        valid: Where it may be read at all; None means everywhere.
    """

    values: Values
    shape: Shape
    boundary: Boundary
    valid: Region | None = None


@dataclass(frozen=True)
class Planes:
    """The exemplar's side: what neighborhoods read at each level, the finest first.

    Args:
        result: The exemplar itself.
        guide: The guide that lies upon it; empty if there is none.
    """

    result: tuple[Plane, ...]
    guide: tuple[Plane, ...] = ()

    def of(self, layer: Layer, level: int) -> Plane:
        """What a layer reads for candidates of a level."""
        planes = self.guide if layer.is_guide else self.result
        return planes[level + layer.steps_up]

    def everywhere(self) -> Planes:
        """The same planes, as if they might be read anywhere."""
        return Planes(
            *(tuple(replace(plane, valid=None) for plane in planes) for planes in (self.result, self.guide))
        )


def quantize(image: Image, dtype: torch.dtype) -> Values:
    """Round a picture to the whole numbers -128..127 that matching works on.

    Example:
        >>> quantize(torch.tensor([[[[0.0, 0.5, 1.0]]]]), torch.float32).flatten().tolist()
        [-128.0, 0.0, 127.0]
    """
    steps = (image * STEPS).round().clamp(0, STEPS) - (STEPS + 1) // 2
    return steps.flatten(2).transpose(1, 2).to(dtype).contiguous()


def dequantize(values: Values) -> Values:
    """Whole numbers of matching as values in [0, 1].

    Example:
        >>> dequantize(torch.tensor([[[-128.0], [127.0]]])).flatten().tolist()
        [0.0, 1.0]
    """
    return (values + (STEPS + 1) // 2) / STEPS


def layers_at(layers: Sequence[Layer], level: int, levels: int) -> tuple[Layer, ...]:
    """The layers that exist at a level: those that read no higher than the coarsest one."""
    return tuple(layer for layer in layers if level + layer.steps_up < levels)


def layer_weights(layers: Sequence[Layer], normalize: bool) -> tuple[int, ...]:
    """What each squared difference of each layer counts.

    With ``normalize``, a layer's weight is shared out among its neighbors, so that two layers of
    weight 1 count the same whatever their templates; the shares are scaled up to whole numbers.

    Example:
        >>> from torchsynth.template import Causal, Square
        >>> causal = Layer(plane="result", template=Causal(size=9))
        >>> square = Layer(plane="coarse", template=Square(size=5))
        >>> layer_weights((causal, square), normalize=True)
        (5, 8)
    """
    if not normalize:
        return tuple(layer.weight for layer in layers)
    counts = [len(layer.template.offsets()) for layer in layers]
    common = math.lcm(*counts)
    shares = [layer.weight * common // count for layer, count in zip(layers, counts, strict=True)]
    return tuple(share // math.gcd(*shares) for share in shares)


def neighbor_weights(
    layers: Sequence[Layer], weights: Sequence[int]
) -> tuple[Int64[Tensor, " neighbors"], ...]:
    """What the squared difference of each neighbor of each layer counts.

    Weights stay whole numbers: where any layer has a Gaussian falloff, all are scaled up and rounded.

    Args:
        layers: The layers.
        weights: What each of them counts; see :func:`layer_weights`.

    Example:
        >>> from torchsynth.template import Square
        >>> layer = Layer(plane="result", template=Square(size=3, center=False), sigma=1.0)
        >>> neighbor_weights((layer,), (1,))[0].tolist()
        [377, 621, 377, 621, 621, 377, 621, 377]
    """
    scale = 1 if all(layer.sigma is None for layer in layers) else _GAUSSIAN_STEPS
    counts = []
    for layer, weight in zip(layers, weights, strict=True):
        distances = layer.template.offsets().square().sum(1).double()
        falloff = torch.ones_like(distances)
        if layer.sigma is not None:
            falloff = torch.exp(-distances / (2 * layer.sigma**2))
        counts.append((falloff * scale * weight).round().long())
    return tuple(counts)


def output_plane(image: Image, dtype: torch.dtype, boundary: Boundary, valid: Region | None = None) -> Plane:
    """A plane of the output's side: behind its last pixel the empty one, and one of ones.

    Example:
        >>> output_plane(torch.ones(1, 1, 1, 2), torch.float32, "open").values.flatten().tolist()
        [127.0, 127.0, 0.0, 1.0]
    """
    height, width = image.shape[2:]
    values = torch.nn.functional.pad(quantize(image, dtype), (0, 0, 0, 2))
    values[:, -1] = 1
    return Plane(values, (height, width), boundary, valid)


def gather(plane: Plane, positions: Int64[Tensor, "batch sites features"]) -> Features:
    """Read the neighborhoods of some sites from an output plane.

    Args:
        plane: What to read.
        positions: Where all their features lie; see :func:`feature_positions`.
    """
    return plane.values.take(positions)


def feature_positions(
    plane: Plane, positions: Int64[Tensor, "sites neighbors"]
) -> Int64[Tensor, "batch sites features"]:
    """Where all channels of some pixels lie in a plane's memory, sample after sample.

    Example:
        >>> plane = output_plane(torch.rand(2, 3, 1, 2), torch.float32, "open")
        >>> feature_positions(plane, torch.tensor([[0, 2]])).tolist()
        [[[0, 1, 2, 6, 7, 8]], [[12, 13, 14, 18, 19, 20]]]
    """
    return in_memory(positions, *plane.values.shape)


def in_memory(
    positions: Int64[Tensor, "sites neighbors"], batch: int, pixels: int, channels: int
) -> Int64[Tensor, "batch sites entries"]:
    """Where the channels of some pixels lie in the memory of a batch of so many pixels each."""
    found = positions
    if channels > 1:
        places = torch.arange(channels, device=positions.device)
        found = (positions.unsqueeze(2) * channels + places).flatten(1)
    samples = torch.arange(batch, device=positions.device) * (pixels * channels)
    return found + samples.view(-1, 1, 1)


def reads_of(layer: Layer, plane: Plane, cells: Cells, frames: Frames | None) -> Reads:
    """Where a layer reads an output plane for the given cells of the synthesized level.

    Args:
        layer: Which neighbors.
        plane: What is read; where it is not valid, there is nothing to read.
        cells: The pixels whose turn it is.
        frames: How each of them sees its surroundings distorted; None if it does not.
    """
    offsets = layer.template.offsets().to(cells.device)
    turned = offsets if frames is None else distorted(offsets, frames)
    reads = read(parents(cells, layer.steps_up), turned, plane.shape, plane.boundary)
    if plane.valid is None:
        return reads
    valid = torch.nn.functional.pad(plane.valid.flatten(), (0, 1))
    return only(reads, valid[reads.positions], plane.shape)
