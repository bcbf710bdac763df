"""Closeness of patches: sliced Wasserstein distances at several scales, in units of the exemplar's own."""

from __future__ import annotations

from typing import TypeAlias

import torch
from jaxtyping import Float64
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.lattice import Shape
from torchsynth.metrics.batches import batch_of
from torchsynth.pyramid import gaussian_pyramid, level_shapes

PATCH = 7
"""Side of the patches that are compared, in pixels of each level."""

LEVELS = 4
"""The most pyramid levels that are compared."""

QUANTILES = 1024
"""How finely a distribution is known; so pictures of different sizes can be compared."""

SMALLEST_SCALE = 2.0**-10
"""A quarter of a step of 8 bits: nothing is measured in smaller units than that."""

_GRID = 2**24
_PAIRS = 48
_VALUES_SHARE = 0.25
_SMALLEST_UNIT = 0.01  # of the exemplar's contrast: the halves of an exact pattern are equal


Projections: TypeAlias = Float64[Tensor, "directions quantiles"]
"""The distribution of a picture's patches along each direction; the channels themselves come last."""


def patch_distance(image: Tensor, exemplar: Tensor) -> Float64[Tensor, " batch"]:
    """How far the patches of pictures are from those of the exemplar: the mean of all levels.

    See :func:`patch_distances`. A single number hides at which scale a picture went wrong.

    Args:
        image: The picture, or a batch of them, of any size from 7x7.
        exemplar: What they are compared with: one for all, or one for each; 14x14 or larger.

    Example:
        >>> exemplar = torch.rand(1, 1, 32, 32)
        >>> patch_distance(exemplar, exemplar).tolist()
        [0.0]
    """
    return patch_distances(image, exemplar).mean(1)


def patch_distances(image: Tensor, exemplar: Tensor) -> Float64[Tensor, "batch levels"]:
    """How far the patches of pictures are from those of the exemplar, at each level, the finest first.

    Patches of 7x7 pixels are projected on fixed directions: a difference of two of their values, wherever
    they are, and the values themselves, which make up a quarter. The sorted projections of both pictures
    are compared (the sliced Wasserstein distance), each in terms of how far it spreads in the exemplar. The
    unit is the same distance between the halves of the exemplar, so that 1 means: as close as two real crops
    are. 0 is a picture of the same patches. Being closer than 1 is no merit.

    Differences tell more than projections on dense directions: a sum of many values looks Gaussian in every
    texture, and so cannot tell a texture from noise of the same spectrum.

    It fails where the arrangement over longer distances matters: broken lines of text, or objects cut and
    joined, are made of fine patches, and can have less than 1. So can a tiled exemplar. What else it does not
    see is said in ``scripts/validate_measures.py`` of the project's repository.

    Convention:
        The directions are the same for every picture with as many channels. There are up to 4 levels: as
        many as have 14 pixels a side in the picture, and in the halves of the exemplar. So compare numbers
        of outputs of one size.

    Source: Rabin, Peyre, Delon and Bernot 2011, *Wasserstein barycenter and its application to texture
    mixing*, section 3; with patches at several levels as in Karras, Aila, Laine and Lehtinen 2018,
    *Progressive growing of GANs*, section 5.

    Args:
        image: The picture, or a batch of them, of any size from 7x7.
        exemplar: What they are compared with: one for all, or one for each; 14x14 or larger.

    Example:
        >>> exemplar = torch.rand(1, 3, 64, 64)
        >>> distances = patch_distances(exemplar.flip(3)[..., :40, :50], exemplar)
        >>> distances.shape
        torch.Size([1, 2])
    """
    images, exemplars = batch_of(image, "image"), batch_of(exemplar, "exemplar")
    levels = _levels((min(images.shape[2:]), min(exemplars.shape[2:]) // 2))
    references = [_reference(one.unsqueeze(0), levels) for one in exemplars]
    rows = []
    for item, one in enumerate(images):
        whole, unit = references[item if len(references) > 1 else 0]
        rows.append(_distances(_projections(one.unsqueeze(0), levels), whole, whole) / unit)
    return torch.stack(rows)


def quantiles(values: Tensor) -> Float64[Tensor, " quantiles"]:
    """The values in the middle of so many equal parts of a distribution, to 2**-24.

    Args:
        values: One number or more, of any shape, between -128 and 128.

    Example:
        >>> quantiles(torch.tensor([3.0, 1.0]))[[0, 511, 512, 1023]].tolist()
        [1.0, 1.0, 3.0, 3.0]
    """
    # Whole numbers are sorted several times as fast.
    ordered = (values.double().flatten() * _GRID).round().int().sort().values
    parts = 2 * torch.arange(QUANTILES, device=values.device) + 1
    return ordered[parts * len(ordered) // (2 * QUANTILES)].double() / _GRID


def pairs(channels: int) -> list[tuple[int, int]]:
    """Pairs of two different places in a patch: always the same ones.

    A place is a number: channel, row and column, as they follow each other in memory.

    Example:
        >>> len(pairs(3))
        48
    """
    generator, places = torch.Generator().manual_seed(0), channels * PATCH**2
    first = torch.randint(places, (_PAIRS,), generator=generator)
    apart = torch.randint(1, places, (_PAIRS,), generator=generator)
    return list(zip(first.tolist(), ((first + apart) % places).tolist(), strict=True))


def _levels(shape: Shape) -> int:
    """How many levels of a picture have room for more than a patch; one at least."""
    return 1 + sum(min(sides) >= 2 * PATCH for sides in level_shapes(shape, LEVELS)[1:])


def _reference(exemplar: Image, levels: int) -> tuple[list[Projections], Float64[Tensor, " levels"]]:
    """What pictures are compared with at each level, and the unit: how far halves are from each other."""
    whole = _projections(exemplar, levels)
    height, width = (side // 2 for side in exemplar.shape[2:])
    halves = (
        (exemplar[:, :, :height], exemplar[:, :, -height:]),
        (exemplar[..., :width], exemplar[..., -width:]),
    )
    apart = [_distances(_projections(a, levels), _projections(b, levels), whole) for a, b in halves]
    return whole, torch.stack(apart).mean(0).clamp(min=_SMALLEST_UNIT)


def _projections(image: Image, levels: int) -> list[Projections]:
    """Of each level; one direction after the other, so that memory does not grow with their number."""
    found = []
    for level in gaussian_pyramid(image.double(), levels, "reflect"):
        planes = [quantiles(_plane(level[0], a) - _plane(level[0], b)) for a, b in pairs(image.shape[1])]
        found.append(torch.stack([*planes, *map(quantiles, level[0])]))
    return found


def _plane(image: Tensor, place: int) -> Tensor:
    """One value of each patch, by its place: channel, row and column."""
    channel, row, column = place // PATCH**2, place // PATCH % PATCH, place % PATCH
    height, width = (side - PATCH + 1 for side in image.shape[1:])
    return image[channel, row : row + height, column : column + width]


def _distances(
    one: list[Projections], other: list[Projections], whole: list[Projections]
) -> Float64[Tensor, " levels"]:
    """At each level, the mean over directions; values and differences have a fixed share each."""
    means = []
    for a, b, scale in zip(one, other, whole, strict=True):
        spread = scale.std(1).clamp(min=SMALLEST_SCALE)
        apart = (a - b).abs().mean(1) / spread
        means.append((1 - _VALUES_SHARE) * apart[:_PAIRS].mean() + _VALUES_SHARE * apart[_PAIRS:].mean())
    return torch.stack(means)
