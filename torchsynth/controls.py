"""What the user pins down of the output."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from torchsynth import checks


@dataclass(frozen=True)
class Controls:
    """Wishes about one particular output, beside the recipe.

    Args:
        initial: The picture that synthesis starts from in place of noise, ``(C, OH, OW)`` for all
            outputs or ``(B, C, OH, OW)``, in [0, 1]. Only what a neighborhood reads before it is
            overwritten matters: for a causal scanline the last rows and columns, at every level.

    Raises:
        InputError: If the picture has another rank, dtype or range.

    Example:
        >>> import torch
        >>> Controls(initial=torch.zeros(1, 8, 8)).initial.shape
        torch.Size([1, 8, 8])
    """

    initial: Tensor | None = None

    def __post_init__(self) -> None:
        if self.initial is not None:
            checks.check_image(self.initial, "initial")
