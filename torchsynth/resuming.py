"""Going on from an earlier output: its source map as the start of every level."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from torchsynth._typing import SourceMap, Sources
from torchsynth.errors import InputError
from torchsynth.lattice import Shape

_SUBJECT = "initial_source"
_REMEDY = "pass the source map of a result for the same exemplar and size"


def check_initial_source(source: object, initial: object) -> None:
    """A source map to start from is a whole-numbered tensor of two planes, and the only start.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_initial_source(torch.zeros(2, 8, 8, dtype=torch.int64), None)
    """
    if source is None:
        return
    if not isinstance(source, Tensor):
        raise InputError(_SUBJECT, "must be a torch.Tensor", f"it is a {type(source).__name__}", _REMEDY)
    if source.is_floating_point() or source.is_complex() or source.dtype == torch.bool:
        raise InputError(_SUBJECT, "must hold whole numbers", f"its dtype is {source.dtype}", _REMEDY)
    if source.ndim not in (3, 4) or source.shape[-3] != 2:
        raise InputError(
            _SUBJECT, "must be (2, OH, OW) or (B, 2, OH, OW)", f"its shape is {tuple(source.shape)}", _REMEDY
        )
    if initial is not None:
        raise InputError(
            _SUBJECT, "must be the only start", "there is an initial picture as well", "leave one of them out"
        )


def fitting_source(source: Tensor, exemplar: Shape, size: Shape, outputs: int) -> SourceMap:
    """A source map to start from, as one for each output.

    Args:
        source: What the user passed.
        exemplar: Height and width of the exemplar.
        size: Height and width of the outputs.
        outputs: How many there are.

    Raises:
        InputError: If it is not of the output's size, or names no exemplar pixel somewhere.

    Example:
        >>> fitting_source(torch.zeros(2, 3, 4, dtype=torch.int32), (9, 9), (3, 4), 2).shape
        torch.Size([2, 2, 3, 4])
    """
    batch = source.detach().long().view(-1, *source.shape[-3:])
    if tuple(batch.shape[-2:]) != size or len(batch) not in (1, outputs):
        raise InputError(
            _SUBJECT, f"must be of the output's height and width {size}, one or one for each of {outputs}",
            f"its shape is {tuple(source.shape)}", _REMEDY,
        )  # fmt: skip
    limits = torch.tensor(exemplar, device=batch.device).view(2, 1, 1)
    if bool(((batch < 0) | (batch >= limits)).any()):
        raise InputError(
            _SUBJECT, f"must name a pixel of the exemplar, {exemplar[0]}x{exemplar[1]}, everywhere",
            f"it goes from {int(batch.min())} to {int(batch.max())}", _REMEDY,
        )  # fmt: skip
    return batch.expand(outputs, -1, -1, -1)


def sources_by_level(source: SourceMap, exemplars: Sequence[Shape], shapes: Sequence[Shape]) -> list[Sources]:
    """The same map on every level, as flat positions in the exemplar's level: every second pixel, halved.

    Args:
        source: The finest level's map.
        exemplars: Height and width of the exemplar's levels, the finest first.
        shapes: The same of the output.

    Example:
        >>> source = torch.tensor([[[[4, 4], [5, 5]], [[6, 7], [6, 7]]]])
        >>> [rows.tolist() for rows in sources_by_level(source, [(8, 8), (4, 4)], [(2, 2), (1, 1)])]
        [[[38, 39, 46, 47]], [[11]]]
    """
    levels = []
    for (height, width), (rows, columns) in zip(exemplars, shapes, strict=True):
        here = source[..., :rows, :columns]
        # Sides round down: what came from the last row of an odd level comes from the last one here.
        row, column = here[:, 0].clamp(max=height - 1), here[:, 1].clamp(max=width - 1)
        levels.append((row * width + column).flatten(1))
        source = source[..., ::2, ::2] // 2
    return levels
