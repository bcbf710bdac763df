"""Drawings with one value for every output pixel: patches, sources, costs, and the field that distorted them."""

from __future__ import annotations

import torch
from torch import Tensor

from torchsynth import field
from torchsynth._typing import FieldMap, Image
from torchsynth.lattice import Shape
from torchsynth.result import Result, check_sources
from torchsynth.viz.lettering import BAR, LINE, caption, scale, shades
from torchsynth.viz.paper import GAP, Laid, enlarged, factor_for, paper, shown

_CELL = 12
_COSTS = "difference to the match: root of the mean square"


def draw_patches(result: Result) -> Image:
    """The result with the boundaries of its patches in white.

    Source: Ashikhmin 2001, figure 5.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16) / 2, (8, 8), ts.recipes.ashikhmin())
        >>> bool((draw_patches(result).amax(1) == 1).equal(result.seams()))
        True
    """
    return torch.where(result.seams().unsqueeze(1), 1.0, shown(result.image))


def draw_sources(result: Result) -> Image:
    """The source map in color: red grows with the exemplar's columns, green with its rows.

    Pixels without source are black.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (8, 8), ts.recipes.ashikhmin())
        >>> int((draw_sources(result)[0, 0, 0, 0] * 15).round()) == int(result.source[0, 1, 0, 0])
        True
    """
    height, width = result.levels[0].exemplar.shape[-2:]
    check_sources(result.recipe, "sources")
    rows, columns = result.source.double().unbind(1)
    rows, columns = rows / max(1, height - 1), columns / max(1, width - 1)
    colors = torch.stack((columns, rows, 1 - (rows + columns) / 2), dim=1)
    return colors.masked_fill((result.source[:, :1] < 0), 0).to(result.image.dtype)


def draw_cost(result: Result) -> Image:
    """What each pixel's match cost, from dark (it fits perfectly) to light, beside the key to the colors.

    The cost is shown as the root of the mean squared difference between a pixel's neighborhood and its match.
    Small outputs are enlarged. Each output has a scale of its own, up to its worst pixel.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (64, 64), ts.recipes.ashikhmin())
        >>> draw_cost(result)[0, :, -100:, 8:100].unique().numel() > 10  # enlarged by 4
        True
    """
    return torch.stack([_cost_page(cost.cpu().sqrt()) for cost in result.cost])


def _cost_page(distance: FieldMap) -> Tensor:
    largest = float(distance.max())
    top = largest or 1.0
    colored = enlarged(shades(distance / top), factor_for([distance.shape]))
    height, width = colored.shape[1:]
    key = scale(max(height, 4 * LINE), [(at, f"{at * top:.2g}") for at in (0.0, 0.5, 1.0)])
    words = caption(_COSTS, max(width + GAP + BAR, 3 * BAR))
    below = 2 * GAP + words.shape[1]
    shape = (below + key.shape[1] + GAP, 2 * GAP + words.shape[2])
    return paper(shape, [Laid(words, GAP, GAP), Laid(colored, below, GAP), Laid(key, below, 2 * GAP + width)])


def draw_field(angle: Tensor | float | None, scale: Tensor | float | None, shape: Shape) -> Image:
    """A field of angles and scales as strokes: what is horizontal in the exemplar lies along them.

    A stroke is as long as the scale says. Paper is white where the scale is 1, bluish where structures
    are made smaller, and reddish where they are made larger.

    Args:
        angle: Degrees, a number or ``(OH, OW)``; None is 0.
        scale: Factors, a number or ``(OH, OW)``; None is 1.
        shape: Height and width of the output.

    Example:
        >>> draw_field(90.0, None, (24, 24)).shape
        torch.Size([1, 3, 24, 24])
    """
    angles, scales = _whole(angle, 0.0, shape), _whole(scale, 1.0, shape)
    rows, columns = ((torch.arange(side, dtype=torch.float64) % _CELL) - (_CELL - 1) / 2 for side in shape)
    # Every pixel looks at the middle of its cell.
    middle = [(torch.arange(side) // _CELL * _CELL + _CELL // 2).clamp(max=side - 1) for side in shape]
    turn = torch.deg2rad(angles[middle[0]][:, middle[1]])
    size = scales[middle[0]][:, middle[1]]
    along = columns * turn.cos() - rows.unsqueeze(1) * turn.sin()
    across = columns * turn.sin() + rows.unsqueeze(1) * turn.cos()
    half = (_CELL / 4 * size).clamp(1, _CELL / 2 - 1)
    stroke = (across.abs() < 0.75) & (along.abs() <= half)
    tint = (scales.log2() / 2).clamp(-1, 1) * 0.6
    paper = torch.stack((1 + tint.clamp(max=0), 1 - tint.abs(), 1 - tint.clamp(min=0)))
    return torch.where(stroke, 0.0, paper).float().unsqueeze(0)


def _whole(given: Tensor | float | None, default: float, shape: Shape) -> FieldMap:
    if isinstance(given, Tensor):
        return given.detach().double().cpu()
    return field.constant(shape, default if given is None else float(given))
