"""The exemplar: the sample picture that every output pixel is copied from."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Image, Region
from torchsynth.lattice import Shape
from torchsynth.pyramid import gaussian_pyramid


@dataclass(frozen=True)
class Exemplar:
    """A sample picture, and optionally the part of it that may be sampled.

    Args:
        image: One sample ``(C, H, W)`` or a batch of them ``(E, C, H, W)``, float32 or float64, in
            [0, 1], any number of channels. A batch gives each output its own exemplar.
        valid: ``(H, W)``, True where the exemplar may be used. A neighborhood that touches anything
            else is never a candidate, at no pyramid level. None means all of it.

    Raises:
        InputError: If the image has another rank, dtype or range, or NaN or infinite values; if
            ``valid`` has another shape or is nowhere True.

    Example:
        >>> import torch
        >>> Exemplar(torch.rand(3, 16, 12)).shape
        (16, 12)
    """

    image: Tensor
    valid: Tensor | None = None

    def __post_init__(self) -> None:
        checks.check_image(self.image, "exemplar")
        if self.valid is not None:
            checks.check_region(self.valid, self.shape, "valid")

    @property
    def shape(self) -> Shape:
        """Height and width."""
        height, width = self.image.shape[-2:]
        return height, width

    @property
    def samples(self) -> Image:
        """The image as a batch ``(E, C, H, W)``, outside autograd."""
        image = self.image.detach()
        return image if image.ndim == 4 else image.unsqueeze(0)

    def images(self, levels: int) -> tuple[Image, ...]:
        """The Gaussian pyramid of the image, the finest first."""
        return gaussian_pyramid(self.samples, levels, "reflect")

    def valid_regions(self, levels: int) -> tuple[Region | None, ...]:
        """Where each level may be sampled.

        A coarse pixel is valid only if every finer pixel that was blended into it is: else what lies
        outside ``valid`` would bleed into the matching through the pyramid.
        """
        if self.valid is None:
            return (None,) * levels
        regions = [self.valid]
        for _ in range(levels - 1):
            share = gaussian_pyramid(regions[-1].double()[None, None], 2, "reflect")[1]
            # One invalid pixel takes away 2**-10 of a blend, or a little more where a side is odd.
            regions.append(share[0, 0] > 1 - 2**-12)
        return tuple(regions)
