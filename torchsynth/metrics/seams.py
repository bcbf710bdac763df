"""Seams: between copies of a picture laid side by side, and around what was filled."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth.metrics.batches import batch_of


def seam_ratio(image: Tensor) -> Float[Tensor, "batch 2"]:
    """How sharp the seams are when copies of a picture are laid side by side.

    The mean difference between neighbors across the border, over that between neighbors inside. Around
    1 the seam does not stand out; a ratio of 2 is easily seen. It fails where the texture itself has a
    strong line at the border, or varies much from row to row: then a perfect seam can be above 1 too.

    Args:
        image: The picture, or a batch of them, two pixels or more in each direction.

    Returns:
        ``(B, 2)``: the ratio from bottom to top, and from right to left. A picture without any
        differences has 1.

    Example:
        >>> seam_ratio(torch.tensor([[[[0.0, 1.0, 2.0, 3.0]] * 2]])).tolist()
        [[1.0, 3.0]]
    """
    ratios, image = [], batch_of(image, "image")
    for axis in (2, 3):
        steps = (image.roll(-1, axis) - image).double().abs()
        across = steps.select(axis, -1).mean((1, 2))
        inside = steps.narrow(axis, 0, image.shape[axis] - 1).mean((1, 2, 3))
        ratio = across / inside.clamp(min=1e-12)
        ratios.append(torch.where((across == 0) & (inside == 0), 1.0, ratio))
    return torch.stack(ratios, dim=1)


def edge_ratio(image: Tensor, hole: Tensor) -> Tensor:
    """How sharp the edge of a filled hole is, in terms of the picture's own gradients.

    The mean absolute difference of neighboring pixels of which one was filled, over that of neighboring
    pixels that were both known. About 1 for an edge that cannot be seen.

    Args:
        image: ``(C, H, W)`` or ``(B, C, H, W)``, the filled picture.
        hole: ``(H, W)``, True where it was filled.

    Returns:
        One number for each picture; infinite if what is known is of one color and the edge is not.

    Example:
        >>> import torch
        >>> image = torch.tensor([[[0.0, 0.2, 0.8, 0.6]]])
        >>> edge_ratio(image, torch.tensor([[False, False, True, True]]))
        tensor([3.])
    """
    batch = image if image.ndim == 4 else image.unsqueeze(0)
    across, known = [], []
    for axis in (0, 1):
        length = hole.shape[axis] - 1
        steps = batch.diff(dim=axis + 2).abs().mean(1).flatten(1)
        first, second = hole.narrow(axis, 0, length), hole.narrow(axis, 1, length)
        across.append(steps[:, (first != second).flatten()])
        known.append(steps[:, (~first & ~second).flatten()])
    return torch.cat(across, dim=1).mean(1) / torch.cat(known, dim=1).mean(1)
