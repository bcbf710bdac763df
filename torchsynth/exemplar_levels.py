"""The exemplar, level by level: its pictures, and what neighborhoods read of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from torchsynth._typing import Image, Region
from torchsynth.exemplar import Exemplar
from torchsynth.neighborhood import Plane, Planes, quantize
from torchsynth.pyramid import Stretch
from torchsynth.recipe import Recipe


@dataclass(frozen=True)
class ExemplarLevels:
    """The pyramids of an exemplar and of its guide, as a recipe wants them.

    Args:
        images: The exemplar's levels, the finest first.
        planes: The same, as they are matched; with the guide's, if there is one.
        stretch: How the levels were stretched to one range, if they were.
        guide_stretch: How the guide's levels were.

    Example:
        >>> from torchsynth.recipes import wei_levoy
        >>> levels = ExemplarLevels.of(Exemplar(torch.rand(1, 8, 6)), wei_levoy(levels=2), torch.float32)
        >>> [plane.shape for plane in levels.planes.result]
        [(8, 6), (4, 3)]
    """

    images: tuple[Image, ...]
    planes: Planes
    stretch: Stretch | None = None
    guide_stretch: Stretch | None = None

    @classmethod
    def of(cls, exemplar: Exemplar, recipe: Recipe, dtype: torch.dtype) -> ExemplarLevels:
        """The levels of an exemplar.

        Args:
            exemplar: The exemplar.
            recipe: How many levels it has, and whether they are stretched.
            dtype: In which distances are exact; see :func:`torchsynth.feasibility.matching_dtype`.
        """
        regions = exemplar.valid_regions(recipe.levels)
        images, stretch = _stretched(exemplar.images(recipe.levels), recipe)
        guides, guide_stretch = _stretched(exemplar.guide_images(recipe.levels), recipe)
        planes = Planes(_planes(images, regions, dtype), _planes(guides, regions, dtype))
        return cls(images, planes, stretch, guide_stretch)


def stretched(levels: Sequence[Image], stretch: Stretch | None) -> tuple[Image, ...]:
    """A pyramid of the output's side, with the ranges of the exemplar's levels."""
    return tuple(levels) if stretch is None else stretch.apply(levels)


def _stretched(levels: tuple[Image, ...], recipe: Recipe) -> tuple[tuple[Image, ...], Stretch | None]:
    if recipe.dynamic_range == "own" or not levels:
        return levels, None
    stretch = Stretch.of(levels)
    return stretch.apply(levels), stretch


def _planes(
    images: Sequence[Image], regions: Sequence[Region | None], dtype: torch.dtype
) -> tuple[Plane, ...]:
    """The matching side of each level; the exemplar never wraps around."""
    return tuple(
        Plane(quantize(image, dtype), (image.shape[2], image.shape[3]), "open", valid)
        for image, valid in zip(images, regions, strict=False)
    )
