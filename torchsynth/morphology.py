"""Regions that grow, and pictures whose edges are widened: dilation and erosion, by kornia's."""

from __future__ import annotations

from typing import Literal, TypeAlias

import torch
from kornia.morphology import dilation, erosion
from torch import Tensor

from torchsynth._typing import Image, Region
from torchsynth.neighborhood import STEPS
from torchsynth.pyramid import blur

Operation: TypeAlias = Literal["erode", "dilate"]
"""``erode`` widens what is dark, ``dilate`` what is bright."""

SIZES = (3, 5, 7)
"""The sides of structuring elements that :func:`chosen` chooses among."""

# The share of the edges from which on they are comparable to the objects.
_COMPARABLE = 1 / 4

# Parts of a picture into which no square of this side fits are thin.
_THIN = 5

# Side of the kernel that hides what is finer than any edge.
_GRAIN = 3


def grown(region: Region, pixels: int) -> Region:
    """A region and all that is at most so many pixels away from it, along rows and columns.

    Example:
        >>> region = torch.tensor([[False, False, False, True, False]])
        >>> grown(region, 1).tolist()
        [[False, False, True, True, True]]
    """
    pixels = min(pixels, max(region.shape))  # farther than the picture is large, there is nothing
    picture = _by_square(region.to(torch.float32)[None, None], "dilate", 2 * pixels + 1)
    grown_: Region = picture[0, 0] > 0
    return grown_


def widened(image: Image, operation: Operation, size: int, valid: Region | None = None) -> Image:
    """A picture whose dark (``erode``) or bright (``dilate``) parts are widened.

    Each channel takes the least or largest value of the square around each pixel, as far as that lies inside
    the picture.

    Args:
        image: The pictures.
        operation: Which.
        size: Side of the square, odd; 1 changes nothing. Parts grow by half of it on each side.
        valid: Where the picture counts; what it shows elsewhere makes no difference to this part.

    Source:
        The improved Wei-Levoy algorithm, section 4.1.

    Example:
        >>> widened(torch.tensor([[[[0.9, 0.9, 0.1, 0.9, 0.8]]]]), "erode", 3).tolist()[0][0]
        [[0.899..., 0.100..., 0.100..., 0.100..., 0.800...]]
    """
    if valid is not None:
        image = image.masked_fill(~valid.to(image.device), 1.0 if operation == "erode" else 0.0)
    return _by_square(image, operation, size)


def chosen(
    image: Image, operation: Operation | None, size: int | None, valid: Region | None = None
) -> tuple[Operation, int, float]:
    """Choose how to widen the edges of a picture, as far as that is left open.

    The histogram of the picture's grays (the mean of its channels) is parted in two by Otsu's threshold. The
    thinner part is taken for the edges: the one of which fewer pixels belong to a square of 5 pixels, once the
    picture's grain is blurred; if that is the dark one, it is eroded. Of the sizes, the smallest is taken with which the edges come to at least a
    quarter of the widened picture's histogram, parted anew: comparable with what is left of the objects, and no
    wider.

    Args:
        image: One picture.
        operation: The operation, if it is given.
        size: The size, if it is given.
        valid: Where the picture counts.

    Returns:
        The operation, the size, and the share of the edges then.

    Source:
        The improved Wei-Levoy algorithm, section 4.1, where this is a proposal; N. Otsu, *A threshold
        selection method from gray-level histograms*, 1979.

    Example:
        >>> picture = torch.ones(1, 1, 12, 12)
        >>> picture[..., ::6] = 0.0
        >>> chosen(picture, None, None)
        ('erode', 3, 0.416...)
    """
    grays = image.mean(1, keepdim=True)
    operation = operation or ("erode" if _dark_is_thinner(grays, valid) else "dilate")
    smallest = min(image.shape[-2:])
    shares = {}
    for side in [one for one in SIZES if one <= smallest] or [1] if size is None else [size]:
        dark = _dark_share(widened(grays, operation, side, valid), valid)
        shares[side] = dark if operation == "erode" else 1 - dark
        if shares[side] >= _COMPARABLE:
            break
    best = max(shares, key=lambda side: min(shares[side], _COMPARABLE))
    return operation, best, shares[best]


def _dark_is_thinner(grays: Image, valid: Region | None) -> bool:
    """Whether what is dark is thinner than what is bright: in parts as thin, whether it is less."""
    inside = (
        torch.ones_like(grays, dtype=torch.bool) if valid is None else valid.to(grays.device).expand_as(grays)
    )
    # Grain would make holes in what is wide: it is blurred away first, without what does not count.
    share = blur(inside.to(grays), _GRAIN, "reflect").clamp(min=2**-20)
    smooth = blur(grays * inside, _GRAIN, "reflect") / share
    dark = smooth <= _otsu(_counted(smooth, valid))
    measured = []
    for part in (dark & inside, ~dark & inside):
        # Opening leaves what a square fits into.
        wide = _by_square(_by_square(part.float(), "erode", _THIN), "dilate", _THIN)
        pixels = int(part.sum())
        measured.append((float(wide.sum()) / max(1, pixels), pixels))
    return measured[0] <= measured[1]


def _dark_share(grays: Image, valid: Region | None) -> float:
    """How many of the pixels that count are dark, by Otsu's threshold."""
    counted = _counted(grays, valid)
    return (counted <= _otsu(counted)).double().mean().item()


def _counted(grays: Image, valid: Region | None) -> Tensor:
    return grays.flatten() if valid is None else grays[0, 0][valid.to(grays.device)]


def _by_square(image: Image, operation: Operation, size: int) -> Image:
    """The operation with a square: a column and a row, for far fewer comparisons."""
    change = erosion if operation == "erode" else dilation
    for sides in ((size, 1), (1, size)):
        image = change(image, torch.ones(sides, device=image.device, dtype=image.dtype))
    return image


def _otsu(grays: Tensor) -> float:
    """The gray up to which a pixel is dark: it parts the grays so that the parts' means differ most."""
    counts = (grays.double() * STEPS).round().long().bincount(minlength=STEPS + 1).double()
    steps = torch.arange(STEPS + 1, dtype=torch.float64, device=counts.device)
    below, total = counts.cumsum(0), counts.sum()
    sums = (counts * steps).cumsum(0)
    above = total - below
    spread = (sums * total - sums[-1] * below).square() / (below * above).clamp(min=1)
    spread[(below == 0) | (above == 0)] = -1
    return (spread.argmax().item() + 1 / 2) / STEPS
