"""Pictures side by side, at one scale, with words above them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Image
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.result import Result
from torchsynth.viz.lettering import BAR, caption, check_matplotlib
from torchsynth.viz.paper import GAP, Laid, block, enlarged, factor_for, paper, shown, stacked

_USUAL = 5
_MARK = (1.0, 0.0, 1.0)


def sheet(pictures: Mapping[str, Tensor], columns: int | None = None) -> Image:
    """A comparison sheet: pictures of any sizes at one scale, each under its name.

    Args:
        pictures: By what to write above them: ``(C, H, W)`` or ``(1, C, H, W)``, values in [0, 1]; gray or
            RGB, with or without alpha.
        columns: How many there are in a row; None puts up to five in one row, and more in rows of about
            equal length.

    Returns:
        ``(1, 3, H, W)``. If all pictures are small, all are enlarged by the same whole number.

    Raises:
        InputError: If there is no picture, one of them is none, or matplotlib is missing.

    Example:
        >>> import torchsynth as ts
        >>> brick = ts.read_image("sample:brick")
        >>> made = {f"seed {seed}": ts.synthesize(brick, (64, 64), ts.recipes.ashikhmin(), seed=seed).image
        ...         for seed in (1, 2)}
        >>> sheet({"sample": brick} | made).shape[:2]
        torch.Size([1, 3])
    """
    check_matplotlib("sheet")
    if not pictures:
        raise InputError("sheet", "must show at least one picture", "there is none", "pass some")
    if columns is not None:
        checks.check_positive(columns, "columns")
    prepared = {name: _prepared(name, picture) for name, picture in pictures.items()}
    factor = factor_for([picture.shape for picture in prepared.values()])
    cells = [_cell(name, enlarged(picture, factor)) for name, picture in prepared.items()]
    length = columns or math.ceil(len(cells) / math.ceil(len(cells) / _USUAL))
    return _arranged([cells[start : start + length] for start in range(0, len(cells), length)]).unsqueeze(0)


def draw_sheet(result: Result, controls: Controls | None = None) -> Image:
    """Each output beside its exemplar, at one scale, with recipe, size and seed.

    Args:
        result: The finished synthesis.
        controls: What was pinned down of it. If a hole was filled, the picture with the hole, in magenta, takes
            the exemplar's place.

    Raises:
        InputError: If matplotlib is missing.

    Example:
        >>> import torchsynth as ts
        >>> result = ts.synthesize(torch.rand(3, 64, 64), (96, 96), ts.recipes.ashikhmin())
        >>> draw_sheet(result).shape[:2]
        torch.Size([1, 3])
    """
    name, before = _before(result, controls or Controls())
    pages = []
    for number, (image, seed) in enumerate(zip(result.image, result.seeds, strict=True)):
        first = before[number if len(before) > 1 else 0]
        heads = (f"{name} {_size(first)}", f"{result.recipe.name} {_size(image)}, seed {seed}")
        pages.append(sheet(dict(zip(heads, (first, image), strict=True)))[0])
    return stacked(pages)


def _before(result: Result, controls: Controls) -> tuple[str, Image]:
    """What the output is compared with, and what to call it."""
    if controls.hole is None or controls.initial is None:
        return "exemplar", result.levels[0].exemplar
    given = shown(controls.initial.view(-1, *controls.initial.shape[-3:]))
    return "given", torch.where(controls.hole, block(_MARK, (1, 1)).to(given), given)


def _size(image: Tensor) -> str:
    return f"{image.shape[-2]}x{image.shape[-1]}"


def _prepared(name: str, picture: Tensor) -> Tensor:
    checks.check_image(picture, f"sheet {name!r}")
    batch = picture if picture.ndim == 4 else picture.unsqueeze(0)
    if len(batch) != 1:
        raise InputError(
            f"sheet {name!r}", "must be one picture", f"there are {len(batch)}", "give each its own name"
        )
    return shown(batch.detach().cpu().float())[0]


def _cell(name: str, picture: Tensor) -> tuple[Tensor, Tensor]:
    return caption(name, max(2 * BAR, picture.shape[2])), picture


def _arranged(rows: list[list[tuple[Tensor, Tensor]]]) -> Tensor:
    """The cells in their rows; pictures of a row begin at one height, and of a column at one place."""
    across = [
        max(row[number][0].shape[2] for row in rows if number < len(row)) for number in range(len(rows[0]))
    ]
    laid, top = [], GAP
    for row in rows:
        below = top + max(head.shape[1] for head, _ in row)
        left = GAP
        for (head, picture), width in zip(row, across, strict=False):
            # Words stand right above their picture, however many lines the others take.
            laid += [Laid(head, below - head.shape[1], left), Laid(picture, below, left)]
            left += width + GAP
        top = below + max(picture.shape[1] for _, picture in row) + GAP
    return paper((top, GAP + sum(width + GAP for width in across)), laid)
