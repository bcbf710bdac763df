"""Gaussian pyramids of images and of white noise. Level 0 is the finest, the image itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import torch
from kornia.contrib import histogram_matching
from kornia.filters import filter2d_separable
from kornia.geometry import pyrdown
from torch import Tensor

from torchsynth._typing import Image, Region
from torchsynth.lattice import Boundary, Shape

Border: TypeAlias = Literal["circular", "reflect"]
"""What the blur sees beyond the border: the other side, or the mirrored picture."""

# kornia's circular padding of 2 needs a side of 2, its reflecting one a side of 3.
_MINIMUM_SIDE = 3

# Blurring adds 8 bits and sampling 2: with 24 to begin with, float64 has room to spare.
_GRID = 2**24


def border_of(boundary: Boundary) -> Border:
    """The blur's border for an output of this boundary: a torus is blurred around the edge."""
    return "circular" if boundary == "torus" else "reflect"


def level_shapes(shape: Shape, levels: int) -> tuple[Shape, ...]:
    """Height and width of each level, the finest first.

    Convention:
        Each level's sides are half the finer one's, rounded down as in ``kornia.geometry.pyrdown``
        (OpenCV rounds up), but never below one pixel.

    Example:
        >>> level_shapes((37, 128), 3)
        ((37, 128), (18, 64), (9, 32))
    """
    shapes = [shape]
    for _ in range(levels - 1):
        height, width = shapes[-1]
        shapes.append((max(1, height // 2), max(1, width // 2)))
    return tuple(shapes)


def gaussian_pyramid(image: Image, levels: int, border: Border) -> tuple[Image, ...]:
    """Blur and halve an image ``levels - 1`` times.

    Convention:
        kornia's ``pyrdown``: the 5x5 binomial kernel, then bilinear sampling at half the size. Values
        are rounded to multiples of 2**-24 before each step, in float64 and one channel at a time: for
        even sizes all sums are then exact, and results do not depend on batches, threads or machines.

    Args:
        image: Values in [0, 1].
        levels: How many levels to return, 1 or more; the first is the image itself.
        border: ``circular`` for pictures that tile, ``reflect`` for photographs.

    Example:
        >>> [tuple(level.shape[-2:]) for level in gaussian_pyramid(torch.rand(1, 3, 9, 8), 3, "reflect")]
        [(9, 8), (4, 4), (2, 2)]
    """
    planes = _on_grid(image.double().flatten(0, 1))
    pyramid = [image]
    for _ in range(levels - 1):
        planes = _on_grid(torch.cat([_halve(plane[None, None], border)[0] for plane in planes]))
        pyramid.append(planes.view(*image.shape[:2], *planes.shape[1:]).to(image.dtype))
    return tuple(pyramid)


def whole_regions(region: Region, levels: int, border: Border) -> tuple[Region, ...]:
    """Where the levels of a picture are wholly made of a region.

    A coarse pixel is, only if every finer pixel that was blended into it is: else what lies outside of the
    region would bleed into the matching through the pyramid.

    Example:
        >>> region = torch.ones(8, 8, dtype=torch.bool)
        >>> region[0, 0] = False
        >>> [int(one.sum()) for one in whole_regions(region, 2, "reflect")]
        [63, 12]
    """
    regions = [region]
    for _ in range(levels - 1):
        one = regions[-1].double()[None, None]
        share = gaussian_pyramid(one, 2, border)[1]
        whole = gaussian_pyramid(torch.ones_like(one), 2, border)[1]
        # A pixel outside takes away 2**-10 of a blend, or less, about that by the side, where a side is odd.
        regions.append((share > whole - 2**-22)[0, 0])
    return tuple(regions)


def masked_pyramid(
    image: Image, region: Region, levels: int, border: Border
) -> tuple[tuple[Image, Region], ...]:
    """The pyramid of a picture that is known in a region only: nothing from outside comes in.

    A coarse pixel is known if at least half of what is blended into it is; it is the mean of that.

    Args:
        image: Values in [0, 1]; those outside the region do not matter.
        region: Where the picture is known.
        levels: How many levels to return.
        border: As in :func:`gaussian_pyramid`.

    Returns:
        Picture and region of each level, the finest first.

    Example:
        >>> image, region = torch.rand(1, 1, 8, 8), torch.zeros(8, 8, dtype=torch.bool)
        >>> region[:, :4] = True
        >>> masked_pyramid(image, region, 2, "reflect")[1][1][0].tolist()
        [True, True, False, False]
    """
    pyramid = [(image, region)]
    for _ in range(levels - 1):
        finer, known = pyramid[-1]
        weight = known.to(torch.float64)[None, None]
        share = gaussian_pyramid(weight, 2, border)[1]
        blend = gaussian_pyramid(finer.double() * weight, 2, border)[1]
        coarse = (blend / share.clamp(min=2**-20)).clamp(0, 1)
        pyramid.append((coarse.to(image.dtype), share[0, 0] >= 1 / 2))
    return tuple(pyramid)


@dataclass(frozen=True)
class Stretch:
    """For each level of a pyramid how its values are stretched to the range of the finest level.

    Each sample and channel by itself, by its smallest and largest value; a level of one value stays as it
    is. Blurred levels have a smaller range, so that differences between their pixels count for less.

    Args:
        ranges: The smallest and the largest value of each level, ``(E, C, 1, 1)`` each.

    Source:
        The improved Wei-Levoy algorithm, section 4.3 and figure 6.

    Example:
        >>> levels = torch.tensor([[[[0.0, 1.0]]]]), torch.tensor([[[[0.25, 0.5]]]])
        >>> Stretch.of(levels).apply(levels)[1].tolist()
        [[[[0.0, 1.0]]]]
    """

    ranges: tuple[tuple[Tensor, Tensor], ...]

    @classmethod
    def of(cls, levels: Sequence[Image]) -> Stretch:
        """What stretches the levels of a pyramid to the range of its first."""
        extremes = [level.double().flatten(2).aminmax(dim=2) for level in levels]
        return cls(tuple((low[..., None, None], high[..., None, None]) for low, high in extremes))

    def apply(self, levels: Sequence[Image]) -> tuple[Image, ...]:
        """The levels of this pyramid, or of another of the same channels, stretched; within [0, 1]."""
        low, high = self.ranges[0]
        stretched = [levels[0]]
        for level, (least, most) in zip(levels[1:], self.ranges[1:], strict=True):
            values = level.double()
            wide = (values - least) * (high - low) / (most - least) + low
            wide = torch.where(most == least, values, wide).clamp(0, 1)
            stretched.append(wide.to(level.dtype))
        return tuple(stretched)


def match_histogram(image: Image, reference: Image) -> Image:
    """Give each sample and channel the histogram of the reference's.

    Convention:
        kornia's ``histogram_matching``: between two values of the reference it interpolates, so that a
        reference of few values, such as black and white, also gives the grays between them.

    Args:
        image: What to recolor.
        reference: Where the distribution comes from: as many samples as the image, or one for all.

    Returns:
        The image with its values moved to the same quantiles of the reference.

    Example:
        >>> match_histogram(torch.tensor([[[[0.1, 0.9]]]]), torch.tensor([[[[0.2, 0.4]]]])).tolist()
        [[[[0.20000000298023224, 0.4000000059604645]]]]
    """
    # kornia's function treats all it is given as one histogram: hence one call a plane.
    reference = reference.expand(len(image), -1, -1, -1)
    planes = zip(image.flatten(0, 1), reference.flatten(0, 1), strict=True)
    return torch.stack([histogram_matching(*pair) for pair in planes]).reshape(image.shape)


def blur(image: Image, size: int, border: Border) -> Image:
    """Blur with a binomial kernel of the given odd size, exactly as on any other machine.

    Example:
        >>> blur(torch.tensor([[[[0.0, 0.0, 1.0, 0.0, 0.0]]]]), 3, "circular")[0, 0, 0].tolist()
        [0.0, 0.25, 0.5, 0.25, 0.0]
    """
    weights = [math.comb(size - 1, place) / 2 ** (size - 1) for place in range(size)]
    kernel = torch.tensor([weights], dtype=torch.float64, device=image.device)
    half = size // 2
    # Smaller pictures than half a kernel are repeated: padding needs more.
    down, across = (-(-(half + 1) // side) for side in image.shape[2:])
    planes = _on_grid(image.double().flatten(0, 1).repeat(1, down, across))
    blurred = torch.cat(
        [filter2d_separable(plane[None, None], kernel, kernel, border)[0] for plane in planes]
    )
    height, width = image.shape[2:]
    return blurred[:, :height, :width].reshape(image.shape).to(image.dtype)


def _on_grid(planes: Tensor) -> Tensor:
    return (planes * _GRID).round() / _GRID


def _halve(image: Image, border: Border) -> Image:
    """``pyrdown`` for any size: a side under 3 pixels is repeated first, since the padding needs more.

    Repeating changes nothing else: one or two pixels look the same mirrored as wrapped around.
    """
    height, width = image.shape[-2:]
    down, across = (4 // side if side < _MINIMUM_SIDE else 1 for side in (height, width))
    half = pyrdown(image.repeat(1, 1, down, across), border_type=border)
    return half[..., : max(1, height // 2), : max(1, width // 2)]
