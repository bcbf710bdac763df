"""What is known around a hole, level by level."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from torchsynth._typing import Image, Region
from torchsynth.canvas import UNSET, Canvas
from torchsynth.exemplar_levels import stretched
from torchsynth.lattice import to_cells
from torchsynth.pyramid import Stretch, border_of, gaussian_pyramid, whole_regions
from torchsynth.recipe import Recipe


@dataclass(frozen=True)
class Surroundings:
    """What is known of one level.

    Args:
        picture: The level of the picture; where it is not known it does not matter.
        known: Where it is known, wholly: nothing of the hole was blended into it.
        exemplar_at: Where the exemplar's first pixel lies in it; None if it lies nowhere, or between pixels.
    """

    picture: Image
    known: Region
    exemplar_at: tuple[int, int] | None

    def give(self, canvas: Canvas) -> None:
        """Declare the known pixels of a level given, with the exemplar pixels that they show."""
        sites = self.known.flatten().nonzero().squeeze(1)
        source = torch.full((len(self.picture), len(sites)), UNSET, device=sites.device)
        if self.exemplar_at is not None:
            height, width = canvas.exemplar.shape[-2:]
            cells = to_cells(sites, canvas.shape[1]) - torch.tensor(self.exemplar_at, device=sites.device)
            inside = ((cells >= 0) & (cells < torch.tensor((height, width), device=sites.device))).all(1)
            there = (cells[:, 0] * width + cells[:, 1]).where(inside, 0)
            shown = canvas.exemplar.flatten(2)[:, :, there] == self.picture.flatten(2)[:, :, sites]
            source = torch.where(shown.all(1) & inside, there, UNSET)
        canvas.give(sites, source)


def surroundings_of(
    picture: Image,
    hole: Region,
    exemplar_at: tuple[int, int] | None,
    recipe: Recipe,
    stretch: Stretch | None = None,
) -> list[Surroundings]:
    """What is known around a hole at each level, the finest first.

    Levels are stretched like the exemplar's.

    Example:
        >>> from torchsynth.recipes import ashikhmin
        >>> hole = torch.zeros(4, 4, dtype=torch.bool)
        >>> hole[0] = True
        >>> [int(one.known.sum()) for one in surroundings_of(torch.rand(1, 1, 4, 4), hole, None, ashikhmin())]
        [12]
    """
    border = border_of(recipe.boundary)
    hole = hole.to(picture.device)
    pictures = stretched(gaussian_pyramid(picture.masked_fill(hole, 0), recipe.levels, border), stretch)
    regions = whole_regions(~hole, recipe.levels, border)
    levels = []
    for level, (image, known) in enumerate(zip(pictures, regions, strict=True)):
        at = exemplar_at
        if at is not None:
            at = None if any(one % 2**level for one in at) else (at[0] >> level, at[1] >> level)
        levels.append(Surroundings(image, known, at))
    return levels
