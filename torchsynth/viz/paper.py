"""White paper that pictures are laid on, pixel by pixel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.lattice import Shape

GAP = 8
"""Pixels between two things on a paper, and around all of them."""

_READABLE = 256
_GRAY, _GRAY_ALPHA, _RGB, _RGB_ALPHA = 1, 2, 3, 4


@dataclass(frozen=True)
class Laid:
    """A picture on paper.

    Args:
        picture: ``(3, H, W)``, values in [0, 1].
        row: Where its first pixel lies.
        column: Where its first pixel lies.
    """

    picture: Float[Tensor, "3 height width"]
    row: int
    column: int


def shown(image: Image) -> Float[Tensor, "batch 3 height width"]:
    """Pictures as they are looked at: gray as color, and what is transparent on white.

    Of pictures that are neither gray nor RGB, with or without alpha, the first channel is shown as gray.

    Example:
        >>> shown(torch.tensor([[[[0.5]], [[0.25]]]])).flatten().tolist()  # gray, a quarter opaque
        [0.875, 0.875, 0.875]
    """
    channels = image.shape[1]
    colors = image[:, :3] if channels in (_RGB, _RGB_ALPHA) else image[:, :1]
    if channels in (_GRAY_ALPHA, _RGB_ALPHA):
        colors = 1 - image[:, -1:] * (1 - colors)
    return colors.expand(-1, 3, -1, -1)


def paper(shape: Shape, laid: Iterable[Laid]) -> Float[Tensor, "3 height width"]:
    """White paper with pictures on it; later ones cover earlier ones.

    Example:
        >>> paper((2, 3), [Laid(torch.zeros(3, 1, 1), 1, 2)])[0].tolist()
        [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]
    """
    white = torch.ones(3, *shape)
    for one in laid:
        height, width = one.picture.shape[1:]
        white[:, one.row : one.row + height, one.column : one.column + width] = one.picture
    return white


def stacked(pages: Sequence[Tensor]) -> Image:
    """Papers of one width as a batch: the shorter ones are white below.

    Example:
        >>> stacked([torch.zeros(3, 1, 2), torch.zeros(3, 2, 2)])[0, 0].tolist()
        [[0.0, 0.0], [1.0, 1.0]]
    """
    height = max(page.shape[1] for page in pages)
    return torch.stack([paper((height, page.shape[2]), [Laid(page, 0, 0)]) for page in pages])


def block(color: Sequence[float], shape: Shape) -> Float[Tensor, "3 height width"]:
    """A rectangle of one color.

    Example:
        >>> block((1.0, 0.5, 0.0), (2, 4)).shape
        torch.Size([3, 2, 4])
    """
    return torch.tensor(color).view(3, 1, 1).expand(3, *shape)


def enlarged(picture: Tensor, factor: int) -> Tensor:
    """A picture with every pixel as a square of so many pixels.

    Example:
        >>> enlarged(torch.tensor([[[0.0, 1.0]]]), 2).tolist()
        [[[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]]]
    """
    return picture.repeat_interleave(factor, dim=-2).repeat_interleave(factor, dim=-1)


def factor_for(shapes: Iterable[Sequence[int]]) -> int:
    """By how much small pictures are enlarged so that words beside them are not larger: all by the same.

    Example:
        >>> factor_for([(32, 64), (16, 16)]), factor_for([(300, 20)])
        (4, 1)
    """
    return max(1, _READABLE // max(max(shape[-2:]) for shape in shapes))


def stretched(image: Image, shape: Shape) -> Image:
    """Pictures enlarged to a given size, without new values.

    Example:
        >>> stretched(torch.tensor([[[[0.0, 1.0]]]]), (1, 4)).flatten().tolist()
        [0.0, 0.0, 1.0, 1.0]
    """
    return torch.nn.functional.interpolate(image, shape, mode="nearest-exact")
