"""Fields of angle and scale: how an output turns and stretches the texture from place to place.

An angle is in degrees, positive counter-clockwise as the picture is displayed; a scale of 2 makes
structures twice as large. The built-in makers give such fields for an output of any size; a field of
your own is any tensor of the output's height and width.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from torchsynth._typing import FieldMap, Frames
from torchsynth.errors import InputError
from torchsynth.lattice import Shape

# Frames are rounded to this grid, so that distorted offsets are the same on every machine.
_GRID = 2**20


def constant(shape: Shape, value: float) -> FieldMap:
    """The same value everywhere.

    Args:
        shape: Height and width of the output.
        value: The value.

    Raises:
        InputError: If a side is less than 1, or the value is not finite.

    Example:
        >>> constant((1, 3), 30.0).tolist()
        [[30.0, 30.0, 30.0]]
    """
    _check("constant", shape, value=value)
    return torch.full(shape, float(value), dtype=torch.float64)


def swirl(shape: Shape, degrees: float) -> FieldMap:
    """An angle that grows towards the middle, like a whirlpool: none at the corners, all in the center.

    Args:
        shape: Height and width of the output.
        degrees: The angle in the center.

    Raises:
        InputError: If a side is less than 1, or the angle is not finite.

    Example:
        >>> swirl((3, 3), 90.0).round().tolist()
        [[0.0, 26.0, 0.0], [26.0, 90.0, 26.0], [0.0, 26.0, 0.0]]
    """
    _check("swirl", shape, degrees=degrees)
    rows, columns = _centered(shape)
    return degrees * (1 - torch.hypot(rows, columns) / math.sqrt(2)).clamp(min=0)


def radial(shape: Shape, degrees: float = 0.0) -> FieldMap:
    """An angle that follows the direction from the center: what points right in the exemplar points outward.

    Args:
        shape: Height and width of the output.
        degrees: Added everywhere: with 90, what points right runs around the center.

    Raises:
        InputError: If a side is less than 1, or the angle is not finite.

    Example:
        >>> radial((3, 3)).tolist()[1]
        [180.0, 0.0, 0.0]
    """
    _check("radial", shape, degrees=degrees)
    rows, columns = _centered(shape)
    return torch.rad2deg(torch.atan2(0 - rows * shape[0], columns * shape[1])) + degrees


def zoom(shape: Shape, left: float, right: float) -> FieldMap:
    """A scale that changes by equal factors from the left border to the right one.

    Args:
        shape: Height and width of the output.
        left: The scale at the left border.
        right: The scale at the right border.

    Raises:
        InputError: If one of them is not more than 0, or not finite, or a side is less than 1.

    Example:
        >>> zoom((1, 3), 0.5, 2.0).round(decimals=9).tolist()
        [[0.5, 1.0, 2.0]]
    """
    _check("zoom", shape, left=left, right=right)
    if not (left > 0 and right > 0):
        raise InputError(
            "zoom", "must go from a factor above 0 to another", f"it goes from {left:g} to {right:g}",
            "use e.g. 0.5 to make structures smaller",
        )  # fmt: skip
    _, columns = _centered(shape)
    share = (columns + 1) / 2
    return left ** (1 - share) * right**share


def wave(shape: Shape, amplitude: float, periods: float = 2.0, middle: float = 0.0) -> FieldMap:
    """A sine wave along the rows.

    Args:
        shape: Height and width of the output.
        amplitude: How far the value swings to either side.
        periods: How many waves the width holds.
        middle: What it swings around.

    Raises:
        InputError: If a side is less than 1, or one of the numbers is not finite.

    Example:
        >>> wave((1, 5), 20.0, 1.0).round().tolist()
        [[0.0, 19.0, 12.0, -12.0, -19.0]]
    """
    _check("wave", shape, amplitude=amplitude, periods=periods, middle=middle)
    columns = torch.arange(shape[1], dtype=torch.float64) / shape[1]
    return (middle + amplitude * torch.sin(2 * math.pi * periods * columns)).expand(shape)


MAKERS: dict[str, Callable[..., FieldMap]] = {
    "constant": constant,
    "swirl": swirl,
    "radial": radial,
    "zoom": zoom,
    "wave": wave,
}
"""The built-in makers by name."""


def frames(angle: FieldMap, scale: FieldMap) -> Frames:
    """For each pixel the matrix that turns and scales the offsets of its neighborhood.

    Args:
        angle: Degrees.
        scale: Factors.

    Returns:
        Matrices for offsets ``(dy, dx)``, rounded to multiples of 2**-20.

    Example:
        >>> frames(constant((1, 1), 90.0), constant((1, 1), 2.0))[0].tolist()
        [[0.0, -2.0], [2.0, 0.0]]
    """
    turn = torch.deg2rad(angle.double().flatten())
    sine, cosine = turn.sin(), turn.cos()
    matrices = torch.stack((torch.stack((cosine, -sine), 1), torch.stack((sine, cosine), 1)), 1)
    matrices = matrices * scale.double().flatten().view(-1, 1, 1)
    # Adding zero turns the minus zero of a rounding into a plain one.
    return (matrices * _GRID).round() / _GRID + 0.0


def at_level(field: FieldMap, shape: Shape) -> FieldMap:
    """A field as a coarser level sees it: the value in the middle of what each coarse pixel covers.

    Example:
        >>> at_level(torch.tensor([[1.0, 2.0, 3.0, 4.0]]), (1, 2)).tolist()
        [[2.0, 4.0]]
    """
    rows, columns = (
        ((torch.arange(small) * 2 + 1) * large // (2 * small)).to(field.device)
        for small, large in zip(shape, field.shape, strict=True)
    )
    return field[rows][:, columns]


def _check(maker: str, shape: Shape, **numbers: float) -> None:
    """Fields have pixels, and their numbers an end."""
    if min(shape) < 1:
        raise InputError(
            maker, "must be made for an output of at least 1x1", f"the shape is {shape[0]}x{shape[1]}",
            "pass (height, width)",
        )  # fmt: skip
    for name, number in numbers.items():
        if not math.isfinite(number):
            raise InputError(maker, f"{name} must be finite", f"it is {number:g}", "pass a plain number")


def _centered(shape: Shape) -> tuple[Tensor, Tensor]:
    """Rows and columns from -1 to 1 across the picture; 0 where there is only one."""
    sides = [
        torch.linspace(-1, 1, side, dtype=torch.float64) if side > 1 else torch.zeros(1, dtype=torch.float64)
        for side in shape
    ]
    rows, columns = torch.meshgrid(*sides, indexing="ij")
    return rows, columns
