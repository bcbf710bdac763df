"""Which parts of the exemplar were copied, and how often."""

from __future__ import annotations

import torch
from jaxtyping import Int64
from torch import Tensor

from torchsynth._typing import Image, Region
from torchsynth.result import Result, check_sources
from torchsynth.viz.lettering import BAR, LINE, caption, scale, shades
from torchsynth.viz.paper import GAP, Laid, enlarged, factor_for, paper, shown

_TICKS = 5


def copies(result: Result, hole: Region | None = None) -> Int64[Tensor, "batch height width"]:
    """How often each exemplar pixel was copied into each output.

    Args:
        result: The finished synthesis.
        hole: ``(OH, OW)``: only pixels of the output where it is True are counted; None counts all.

    Returns:
        ``(B, H, W)`` of the exemplar's height and width; the numbers of one output add up to its pixels that
        have a source and are counted.

    Raises:
        InputError: If the recipe makes values of its own.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (12, 10), ts.recipes.ashikhmin())
        >>> int(copies(result).sum())
        120
    """
    check_sources(result.recipe, "coverage")
    height, width = result.levels[0].exemplar.shape[-2:]
    counts = []
    for source in result.source:
        counted = source[0] >= 0 if hole is None else (source[0] >= 0) & hole.to(source.device)
        site = (source[0] * width + source[1])[counted]
        counts.append(site.bincount(minlength=height * width).view(height, width))
    return torch.stack(counts)


def draw_coverage(result: Result, hole: Region | None = None) -> Image:
    """The exemplar, and beside it how often each of its pixels was copied: never is darkest.

    The colors go by powers of two. Small exemplars are enlarged. Each output has a scale of its own.

    Args:
        result: The finished synthesis.
        hole: What was filled, if it was a hole: only copies into it are counted.

    Raises:
        InputError: If the recipe makes values of its own, or matplotlib is missing.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (12, 10), ts.recipes.ashikhmin())
        >>> draw_coverage(result).shape[:2]
        torch.Size([1, 3])
    """
    exemplars = shown(result.levels[0].exemplar.cpu())
    counts = copies(result, hole).cpu()
    return torch.stack(list(map(_page, exemplars.expand(len(counts), -1, -1, -1), counts)))


def _page(exemplar: Tensor, count: Tensor) -> Tensor:
    most, factor = max(1, int(count.max())), factor_for([count.shape])
    colored = enlarged(shades(_logarithmic(count) / _logarithmic(torch.tensor(most))), factor)
    height, width = colored.shape[1:]
    used = float((count > 0).double().mean())
    column = max(width, 2 * BAR)
    second, below = 2 * GAP + column, 2 * GAP + 2 * LINE
    key = scale(max(height, _TICKS * LINE), _ticks(most))
    laid = [
        Laid(caption("exemplar", column), GAP + LINE, GAP),
        Laid(caption("copies of each pixel", column), GAP, second),
        Laid(caption(f"{used:.0%} were copied", column), GAP + LINE, second),
        Laid(enlarged(exemplar, factor), below, GAP),
        Laid(colored, below, second),
        Laid(key, below, second + column + GAP),
    ]
    return paper((below + key.shape[1] + GAP, second + column + 2 * GAP + BAR), laid)


def _logarithmic(count: Tensor) -> Tensor:
    return (1 + count.double()).log2()


def _ticks(most: int) -> list[tuple[float, str]]:
    """Never, once, most often, and some numbers between them that leave room for each other."""
    top = float(_logarithmic(torch.tensor(most)))
    steps = {round(2 ** (top * step / (_TICKS - 1))) - 1 for step in range(_TICKS)}
    return [(float(_logarithmic(torch.tensor(one))) / top, str(one)) for one in sorted(steps)]
