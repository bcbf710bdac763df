"""Covering an output with patches, instead of sweeping over its pixels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import torch

from torchsynth._typing import Image
from torchsynth.canvas import Canvas
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.recipe import Recipe

Told: TypeAlias = Callable[[int, int, int, int, Callable[[], Image]], None]
"""``(level, sweep, done, total, preview)``, as for any synthesis."""


def check_plain(recipe: Recipe, controls: Controls, has_codebook: bool) -> None:
    """Patches are copied as they are, from the first one on.

    Args:
        recipe: The recipe.
        controls: What is pinned down of the output.
        has_codebook: Whether there is one.

    Raises:
        InputError: If there is a hole, a picture to start from, a guide, a field, or a codebook.

    Example:
        >>> from torchsynth import recipes
        >>> check_plain(recipes.quilting(), Controls(), has_codebook=False)
    """
    copies = f"the recipe {recipe.name!r} copies whole patches"
    if controls.hole is not None:
        raise InputError(
            "hole", "must be filled by a recipe that goes pixel by pixel", copies, "use e.g. coherent_fill"
        )
    if controls.initial is not None:
        raise InputError(
            "initial", "must be given to a recipe that starts from a picture", copies, "use e.g. wei_levoy"
        )
    if controls.guide is not None:
        raise InputError(
            "guide", "must be given to a recipe that compares guides", copies, "use the recipe analogy"
        )
    if controls.distorts:
        raise InputError(
            "angle and scale", "must be given to a recipe that turns and scales what it compares", copies,
            "use the recipe distorted",
        )  # fmt: skip
    if has_codebook:
        raise InputError(
            "codebook", "must be given to a recipe that searches with trees", copies, "leave it out"
        )


def cover(
    canvas: Canvas, recipe: Recipe, generators: Sequence[torch.Generator], progress: Told | None
) -> None:
    """Cover a canvas with patches.

    Args:
        canvas: It is written.
        recipe: One with patches.
        generators: One for each output.
        progress: Told as for any synthesis.
    """
    patches = recipe.patches
    assert patches is not None, "others sweep"  # noqa: S101 (for the type checker)
    total = math.prod(canvas.shape) * patches.sweeps
    done = 0

    def advance(pixels: int, sweep: int) -> None:
        nonlocal done
        done += pixels
        if progress is not None:
            with torch.inference_mode(mode=False):
                progress(0, sweep, done // len(generators), total, canvas.image)

    advance(0, 0)
    patches.write(canvas, generators, advance)
