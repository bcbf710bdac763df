"""The exemplar: the sample picture that every output pixel is copied from, and what lies upon it."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
        guide: A second picture that lies upon it, ``(G, H, W)`` or one for each sample, of any number of
            channels: what the exemplar shows before a filter, or a map of its parts. Recipes with a layer
            on a guide plane compare it with ``Controls.guide``.

    Raises:
        InputError: If the image or the guide has another rank, dtype or range, or NaN or infinite values;
            if ``valid`` has another shape or is nowhere True; if the guide is of another size.

    Example:
        >>> import torch
        >>> Exemplar(torch.rand(3, 16, 12)).shape
        (16, 12)
    """

    image: Tensor
    valid: Tensor | None = None
    guide: Tensor | None = None

    def __post_init__(self) -> None:
        checks.check_image(self.image, "exemplar")
        if self.valid is not None:
            checks.check_region(self.valid, self.shape, "valid")
        if self.guide is not None:
            checks.check_image(self.guide, "guide")
            checks.check_aligned(self.guide, self.image, "guide", "the exemplar")

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

    @property
    def guides(self) -> Tensor | None:
        """The guides as a batch ``(E, G, H, W)``, one for each sample, if there are any."""
        if self.guide is None:
            return None
        guide = self.guide.detach().to(self.image)
        guide = guide if guide.ndim == 4 else guide.unsqueeze(0)
        return guide.expand(len(self.samples), -1, -1, -1)

    def split(self) -> list[Exemplar]:
        """Each sample by itself."""
        guides = [None] * len(self.samples) if self.guides is None else list(self.guides)
        return [
            replace(self, image=one, guide=guide) for one, guide in zip(self.samples, guides, strict=True)
        ]

    def channel(self, number: int) -> Exemplar:
        """One of its channels as a gray picture; the guide stays whole."""
        return replace(self, image=self.image[..., number : number + 1, :, :])

    def images(self, levels: int) -> tuple[Image, ...]:
        """The Gaussian pyramid of the image, the finest first.

        What lies outside ``valid`` is covered with pixels from inside, so that it makes no difference
        whatsoever what color it has.
        """
        return gaussian_pyramid(self._covered(self.samples), levels, "reflect")

    def guide_images(self, levels: int) -> tuple[Image, ...]:
        """The Gaussian pyramid of the guide, likewise; empty if there is none."""
        guides = self.guides
        return () if guides is None else gaussian_pyramid(self._covered(guides), levels, "reflect")

    def _covered(self, samples: Image) -> Image:
        if self.valid is None or bool(self.valid.all()):
            return samples
        inside = self.valid.flatten().nonzero().squeeze(1).to(samples.device)
        outside = (~self.valid).flatten().nonzero().squeeze(1).to(samples.device)
        pixels = samples.flatten(2).clone()
        pixels[:, :, outside] = pixels[:, :, inside[torch.arange(len(outside)) % len(inside)]]
        return pixels.view(samples.shape)

    def valid_regions(self, levels: int) -> tuple[Region | None, ...]:
        """Where each level may be sampled; see :func:`torchsynth.pyramid.whole_regions`."""
        if self.valid is None:
            return (None,) * levels
        return whole_regions(self.valid, levels, "reflect")
