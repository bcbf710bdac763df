"""What each level of the output shows before synthesis starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, TypeAlias

import torch
from pydantic import Field

from torchsynth._typing import Image, Sites, Sources
from torchsynth.canvas import Canvas
from torchsynth.lattice import Boundary, Shape, to_cells
from torchsynth.part import Part
from torchsynth.pyramid import border_of, gaussian_pyramid, level_shapes, match_histogram
from torchsynth.template import Side


class Noise(Part):
    """White noise, blurred into a pyramid whose levels take the exemplar's colors.

    Uniform noise is drawn for the finest level and blurred down, so that the levels agree with each
    other; then each level, sample and channel gets the histogram of the exemplar's same level. Source:
    Wei & Levoy 2000, section 2.2, with the histograms matched at every level of the pyramid.

    Example:
        >>> levels = (torch.rand(1, 3, 8, 8), torch.rand(1, 3, 4, 4))
        >>> draws = [torch.Generator().manual_seed(5)]
        >>> [tuple(image.shape) for image in Noise().start(levels, (6, 10), "torus", draws)]
        [(1, 3, 6, 10), (1, 3, 3, 5)]
    """

    kind: Literal["noise"] = "noise"

    inherits: ClassVar[bool] = False
    """Whether levels begin with what is known from the coarser one."""

    def start(
        self,
        exemplar: Sequence[Image],
        shape: Shape,
        boundary: Boundary,
        generators: Sequence[torch.Generator],
    ) -> tuple[Image, ...]:
        """The starting picture of every level, the finest first.

        Args:
            exemplar: The exemplar's pyramid.
            shape: Height and width of the output.
            boundary: Whether the noise is blurred around the edges.
            generators: One for each sample; each is advanced by ``C * H * W`` draws.
        """
        finest = exemplar[0]
        noise = torch.stack(
            [
                torch.rand(finest.shape[1], *shape, generator=draws, dtype=torch.float64)
                for draws in generators
            ]
        ).to(finest.device)
        levels = gaussian_pyramid(noise, len(exemplar), border_of(boundary))
        return tuple(
            match_histogram(image, like.double()).to(like.dtype)
            for image, like in zip(levels, exemplar, strict=True)
        )

    def sow(
        self, canvas: Canvas, coarser: Canvas | None, usable: Sites, generators: Sequence[torch.Generator]
    ) -> None:
        """Nothing: no pixel of the noise comes from the exemplar."""


class RandomSource(Part):
    """Random exemplar pixels; on finer levels the children of those of the coarser level.

    The coarsest level begins with a random candidate at each pixel: noise that has sources. On every
    other level a pixel begins as a copy of what its parent was copied from, at twice the position plus
    its own place among the parent's children, and counts as synthesized.

    Source: Ashikhmin 2001, section 3; several levels as in the report on both algorithms, section 2.2 e.

    Example:
        >>> levels = (torch.rand(1, 3, 8, 8), torch.rand(1, 3, 4, 4))
        >>> [tuple(image.shape) for image in RandomSource().start(levels, (6, 10), "torus", [])]
        [(0, 3, 6, 10), (0, 3, 3, 5)]
    """

    kind: Literal["random_source"] = "random_source"

    inherits: ClassVar[bool] = True
    """Whether levels begin with what is known from the coarser one."""

    def start(
        self,
        exemplar: Sequence[Image],
        shape: Shape,
        boundary: Boundary,  # noqa: ARG002 (initialisers share one signature)
        generators: Sequence[torch.Generator],
    ) -> tuple[Image, ...]:
        """Black pictures: :meth:`sow` covers them.

        Args:
            exemplar: The exemplar's pyramid.
            shape: Height and width of the output.
            boundary: Not needed here.
            generators: One for each sample; not advanced.
        """
        shapes = level_shapes(shape, len(exemplar))
        return tuple(
            like.new_zeros(len(generators), like.shape[1], *size)
            for like, size in zip(exemplar, shapes, strict=True)
        )

    def sow(
        self, canvas: Canvas, coarser: Canvas | None, usable: Sites, generators: Sequence[torch.Generator]
    ) -> None:
        """Set the source of every pixel at the start of a level, but for those that are given.

        Args:
            canvas: The level.
            coarser: The finished level above it, if there is one.
            usable: The candidates of the level's first sweep.
            generators: One for each sample; at the coarsest level each is advanced by a draw a pixel.
        """
        sites = (~canvas.given[:-1]).nonzero().squeeze(1)
        if coarser is not None:
            canvas.write(sites, _children(canvas, coarser, sites))
            canvas.known[:-1] = True
            return
        pixels = math.prod(canvas.shape)
        draws = torch.stack(
            [torch.rand(pixels, generator=draws, dtype=torch.float64) for draws in generators]
        ).to(usable.device)
        canvas.write(sites, usable[(draws[:, sites] * len(usable)).long()])


class SeedPatch(Part):
    """A small random patch of the exemplar in the middle of the output, to be grown from.

    The patch is given: no sweep changes it. Where the user has given pixels, there is no patch: the output
    grows from those.

    Args:
        size: Its side in pixels, odd.

    Source: Efros & Leung 1999, section 2.2.

    Example:
        >>> levels = (torch.rand(1, 3, 8, 8),)
        >>> [tuple(image.shape) for image in SeedPatch().start(levels, (6, 10), "open", [])]
        [(0, 3, 6, 10)]
    """

    kind: Literal["seed_patch"] = "seed_patch"
    size: Side = 3

    inherits: ClassVar[bool] = False
    """Whether levels begin with what is known from the coarser one."""

    def start(
        self,
        exemplar: Sequence[Image],
        shape: Shape,
        boundary: Boundary,
        generators: Sequence[torch.Generator],
    ) -> tuple[Image, ...]:
        """Black pictures: everything but the patch is unknown.

        Args:
            exemplar: The exemplar's pyramid.
            shape: Height and width of the output.
            boundary: Not needed here.
            generators: One for each sample; not advanced.
        """
        return RandomSource().start(exemplar, shape, boundary, generators)

    def sow(
        self, canvas: Canvas, coarser: Canvas | None, usable: Sites, generators: Sequence[torch.Generator]
    ) -> None:
        """Copy a patch around a random candidate into the middle of a level.

        Args:
            canvas: The level.
            coarser: Not needed here.
            usable: The candidates of the level's first sweep.
            generators: One for each sample; each is advanced by one draw.
        """
        del coarser
        centers = torch.stack([torch.rand(1, generator=draws, dtype=torch.float64) for draws in generators])
        if bool(canvas.given.any()):
            return
        height, width = canvas.exemplar.shape[-2:]
        half = self.size // 2
        around = torch.cartesian_prod(*(torch.arange(-half, half + 1, device=usable.device),) * 2)
        middle = torch.tensor([side // 2 for side in canvas.shape], device=usable.device)
        cells = middle + around
        last = torch.tensor(canvas.shape, device=usable.device)
        chosen = to_cells(usable[(centers.to(usable.device) * len(usable)).long()].view(-1), width)
        origins = chosen.unsqueeze(1) + around
        limits = torch.tensor((height, width), device=usable.device)
        inside = ((cells >= 0) & (cells < last)).all(1) & ((origins >= 0) & (origins < limits)).all(2).all(0)
        sites = cells[inside, 0] * canvas.shape[1] + cells[inside, 1]
        source = origins[:, inside, 0] * width + origins[:, inside, 1]
        canvas.write(sites, source)
        canvas.give(sites, source)


Initial: TypeAlias = Annotated[Noise | RandomSource | SeedPatch, Field(discriminator="kind")]
"""Any initialiser; the ``kind`` field tells them apart in YAML."""


def _children(canvas: Canvas, coarser: Canvas, sites: Sites) -> Sources:
    """Where the pixels of a level come from, given where their parents do."""
    cells = to_cells(sites, canvas.shape[1])
    # Sides round down, so the last row or column of an odd level joins the family before it.
    last = torch.tensor(coarser.shape, device=sites.device) - 1
    parents = (cells // 2).minimum(last)
    source = coarser.source[:, parents[:, 0] * coarser.shape[1] + parents[:, 1]]
    height, width = canvas.exemplar.shape[-2:]
    half = coarser.exemplar.shape[-1]
    place = cells - 2 * parents
    rows = (2 * (source // half) + place[:, 0]).clamp(max=height - 1)
    columns = (2 * (source % half) + place[:, 1]).clamp(max=width - 1)
    return rows * width + columns
