"""What each level of the output shows before synthesis starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import torch

from torchsynth._typing import Image
from torchsynth.lattice import Boundary, Shape
from torchsynth.part import Part
from torchsynth.pyramid import border_of, gaussian_pyramid, match_histogram


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


Initial: TypeAlias = Noise
"""Any initialiser; the ``kind`` field tells them apart in YAML."""
