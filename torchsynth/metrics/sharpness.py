"""Sharpness: whether a picture has as many and as strong edges as the exemplar."""

from __future__ import annotations

import torch
from jaxtyping import Float64
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.metrics.batches import batch_of
from torchsynth.metrics.statistics import SMALLEST_SCALE, quantiles


def sharpness(image: Tensor, exemplar: Tensor) -> Float64[Tensor, " batch"]:
    """The mean gradient of pictures over that of the exemplar.

    Below 1 a picture is blurred, or flatter; above 1 it is noisy, or has seams. About 1 does not mean that
    all is well: blur and noise, or seams, may cancel out; :func:`gradient_distance` sees that.

    Args:
        image: The picture, or a batch of them, two pixels or more in each direction.
        exemplar: What they are compared with: one for all, or one for each.

    Returns:
        One number for each picture. A picture without any gradient has 1 if the exemplar has none either.

    Example:
        >>> exemplar = torch.rand(1, 1, 16, 16)
        >>> sharpness(exemplar / 2, exemplar).tolist()
        [0.5]
    """
    given = batch_of(image, "image"), batch_of(exemplar, "exemplar")
    found, usual = (gradients(one).mean((1, 2)) for one in given)
    flat = (found < SMALLEST_SCALE) & (usual < SMALLEST_SCALE)
    return torch.where(flat, 1.0, found / usual.clamp(min=SMALLEST_SCALE))


def gradient_distance(image: Tensor, exemplar: Tensor) -> Float64[Tensor, " batch"]:
    """How far the gradients of pictures are from those of the exemplar, as distributions.

    The Wasserstein distance of their magnitudes over the exemplar's mean one. It is never less than
    ``abs(sharpness - 1)``, and more where edges and flat parts are not in the same proportion.

    Args:
        image: The picture, or a batch of them, two pixels or more in each direction.
        exemplar: What they are compared with: one for all, or one for each.

    Returns:
        One number for each picture; 0 is the same distribution.

    Example:
        >>> exemplar = torch.rand(1, 1, 16, 16)
        >>> gradient_distance(exemplar.flip(2), exemplar).item() < 0.2
        True
    """
    found, usual = gradients(batch_of(image, "image")), gradients(batch_of(exemplar, "exemplar"))
    wanted = torch.stack([quantiles(one) for one in usual])
    apart = (torch.stack([quantiles(one) for one in found]) - wanted).abs().mean(1)
    return apart / usual.mean((1, 2)).clamp(min=SMALLEST_SCALE)


def gradients(image: Image) -> Float64[Tensor, "batch below right"]:
    """How much each pixel differs from those below and to the right of it, over all channels.

    Example:
        >>> gradients(torch.tensor([[[[0.0, 3.0], [4.0, 0.0]]]])).tolist()
        [[[5.0]]]
    """
    pixels = image.double()
    down, across = pixels.diff(dim=2)[..., :-1], pixels.diff(dim=3)[:, :, :-1]
    return (down.square() + across.square()).sum(1).sqrt()
