"""What single measures are given: one picture, or a batch of them."""

from __future__ import annotations

from torch import Tensor

from torchsynth._typing import Image
from torchsynth.errors import InputError

_PICTURE, _BATCH = 3, 4


def batch_of(image: Tensor, subject: str) -> Image:
    """One picture ``(C, H, W)`` as a batch of one; a batch as it is.

    Raises:
        InputError: If it is neither.

    Example:
        >>> import torch
        >>> batch_of(torch.zeros(1, 2, 3), "image").shape
        torch.Size([1, 1, 2, 3])
    """
    if image.ndim not in (_PICTURE, _BATCH):
        raise InputError(
            subject, "must have shape (C, H, W) or (B, C, H, W)",
            f"its shape is {tuple(image.shape)}", "add or drop dimensions: channels come first",
        )  # fmt: skip
    return image if image.ndim == _BATCH else image.unsqueeze(0)
