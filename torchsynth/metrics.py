"""Measures of outputs: numbers for what the eye looks for."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth._typing import Image


def seam_ratio(image: Image) -> Float[Tensor, "batch 2"]:
    """How sharp the seams are when copies of a picture are laid side by side.

    The mean difference between neighbors across the border, over that between neighbors inside. Around
    1 the seam does not stand out; a ratio of 2 is easily seen. It fails where the texture itself has a
    strong line at the border, or varies much from row to row: then a perfect seam can be above 1 too.

    Args:
        image: The pictures, two pixels or more in each direction.

    Returns:
        ``(B, 2)``: the ratio from bottom to top, and from right to left. A picture without any
        differences has 1.

    Example:
        >>> seam_ratio(torch.tensor([[[[0.0, 1.0, 2.0, 3.0]] * 2]])).tolist()
        [[1.0, 3.0]]
    """
    ratios = []
    for axis in (2, 3):
        steps = (image.roll(-1, axis) - image).double().abs()
        across = steps.select(axis, -1).mean((1, 2))
        inside = steps.narrow(axis, 0, image.shape[axis] - 1).mean((1, 2, 3))
        ratio = across / inside.clamp(min=1e-12)
        ratios.append(torch.where((across == 0) & (inside == 0), 1.0, ratio))
    return torch.stack(ratios, dim=1)
