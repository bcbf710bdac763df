"""Drawings of what a synthesis did: its patches, its sources, and the field that distorted it.

Each is a picture ``(B, 3, OH, OW)`` with values in [0, 1], to be looked at or written like any other.
"""

from __future__ import annotations

import torch
from torch import Tensor

from torchsynth import field
from torchsynth._typing import FieldMap, Image
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.lattice import Shape
from torchsynth.result import Result, check_sources, check_straight

KINDS = ("patches", "sources", "field")
"""What can be drawn."""

_CELL = 12


def draw(kind: str, result: Result, controls: Controls) -> Image:
    """Draw one of :data:`KINDS`.

    Args:
        kind: Which drawing.
        result: The finished synthesis.
        controls: What was pinned down of it.

    Raises:
        InputError: If there is no such drawing, or no field to be drawn.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (8, 8), ts.recipes.ashikhmin())
        >>> draw("sources", result, ts.Controls()).shape
        torch.Size([1, 3, 8, 8])
    """
    check_drawable(kind, controls)
    if kind == "patches":
        return draw_patches(result)
    if kind == "sources":
        return draw_sources(result)
    height, width = result.image.shape[-2:]
    return draw_field(controls.angle, controls.scale, (height, width)).expand(len(result.image), -1, -1, -1)


def check_drawable(kind: str, controls: Controls) -> None:
    """There must be such a drawing, and something to draw.

    Raises:
        InputError: If there is not.

    Example:
        >>> check_drawable("patches", Controls())
    """
    if kind not in KINDS:
        raise InputError("figure", f"must be one of {', '.join(KINDS)}", f"it is {kind!r}", "choose one")
    if kind == "patches":
        check_straight("figure patches", controls.distorts)
    if kind == "field" and not controls.distorts:
        raise InputError(
            "figure", "field can be drawn where there is one", "neither angle nor scale is given",
            "give one of them, or draw something else",
        )  # fmt: skip


def draw_patches(result: Result) -> Image:
    """The result with the boundaries of its patches in white.

    Source: Ashikhmin 2001, figure 5.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16) / 2, (8, 8), ts.recipes.ashikhmin())
        >>> bool((draw_patches(result).amax(1) == 1).equal(result.seams()))
        True
    """
    image = result.image
    colors = image[:, :3] if image.shape[1] in (3, 4) else image[:, :1]  # alpha is no color
    return torch.where(result.seams().unsqueeze(1), 1.0, colors.expand(-1, 3, -1, -1))


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
