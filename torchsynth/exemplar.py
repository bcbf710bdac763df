"""The exemplar: the sample picture that every output pixel is copied from."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Image, Region
from torchsynth.lattice import Shape
from torchsynth.pyramid import gaussian_pyramid, whole_regions


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

    def split(self) -> list[Exemplar]:
        """Each sample by itself."""
        return [Exemplar(one, self.valid) for one in self.samples]

    def channel(self, number: int) -> Exemplar:
        """One of its channels as a gray picture."""
        return Exemplar(self.image[..., number : number + 1, :, :], self.valid)

    def images(self, levels: int) -> tuple[Image, ...]:
        """The Gaussian pyramid of the image, the finest first.

        What lies outside ``valid`` is covered with pixels from inside, so that it makes no difference
        whatsoever what color it has.
        """
        samples = self.samples
        if self.valid is not None and not bool(self.valid.all()):
            inside = self.valid.flatten().nonzero().squeeze(1).to(samples.device)
            outside = (~self.valid).flatten().nonzero().squeeze(1).to(samples.device)
            pixels = samples.flatten(2).clone()
            pixels[:, :, outside] = pixels[:, :, inside[torch.arange(len(outside)) % len(inside)]]
            samples = pixels.view(samples.shape)
        return gaussian_pyramid(samples, levels, "reflect")

    def valid_regions(self, levels: int) -> tuple[Region | None, ...]:
        """Where each level may be sampled; see :func:`torchsynth.pyramid.whole_regions`."""
        if self.valid is None:
            return (None,) * levels
        return whole_regions(self.valid, levels, "reflect")
