"""The entry point: an exemplar, a size and a recipe in, a result out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeAlias

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Image
from torchsynth.canvas import Canvas
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.feasibility import check_candidates, check_memory, matching_dtype
from torchsynth.lattice import Shape
from torchsynth.neighborhood import Plane, quantize
from torchsynth.pyramid import border_of, gaussian_pyramid
from torchsynth.recipe import Recipe
from torchsynth.result import Level, Result
from torchsynth.sweep import run_sweep

Progress: TypeAlias = Callable[[int, int, int, int, Callable[[], Image]], None]
"""``(level, sweep, done, total, preview)``: the level being synthesized (0 the finest), the number of
the sweep within it, how many output pixels of the whole run (all levels and sweeps) are done and how
many there are, and a function that returns the level's picture as it stands. An exception raised in
it cancels the run and reaches the caller."""


@torch.no_grad()
def synthesize(
    exemplar: Tensor | Exemplar,
    size: tuple[int, int],
    recipe: Recipe,
    *,
    controls: Controls | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Make new texture that looks like the exemplar.

    Args:
        exemplar: The sample: ``(C, H, W)``, or ``(B, C, H, W)`` to give each output its own; float32
            or float64 in [0, 1]; any number of channels. An :class:`Exemplar` can restrict what is
            sampled.
        size: Height and width of the output in pixels, any from 1x1.
        recipe: The algorithm, from :mod:`torchsynth.recipes` or :func:`torchsynth.load_recipe`.
        controls: What is pinned down of the output.
        seed: One whole number, or one for each output. The same seed, recipe, exemplar and versions
            give the same bytes, alone or in a batch, on any number of threads. With a batch of
            exemplars, one number stands for ``seed, seed + 1, ...``.
        progress: Called now and then as ``progress(level, sweep, done, total, preview)``; see
            :data:`Progress`.

    Returns:
        Pictures, source map, costs and all levels; see :class:`Result`.

    Raises:
        InputError: If anything is wrong with the input, before any work.

    Source:
        Wei & Levoy 2000 for the frame; each recipe names its own.

    Example:
        >>> import torch, torchsynth as ts
        >>> exemplar = torch.rand(1, 20, 20)
        >>> result = ts.synthesize(exemplar, (24, 24), ts.recipes.wei_levoy(levels=1), seed=[1, 2])
        >>> tuple(result.image.shape)
        (2, 1, 24, 24)
    """
    checks.check_type(recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.wei_levoy()")
    checks.check_type(controls or Controls(), Controls, "controls", "pass torchsynth.Controls(...)")
    exemplar = exemplar if isinstance(exemplar, Exemplar) else Exemplar(exemplar)
    controls = controls or Controls()
    samples = exemplar.samples
    size = checks.check_size(size)
    seeds = checks.check_seeds(seed, len(samples) if len(samples) > 1 else None)
    initial = _initial_for(controls, samples, size, len(seeds))
    check_memory(recipe, samples, size, len(seeds))

    images = exemplar.images(recipe.levels)
    planes = _exemplar_planes(exemplar, images, matching_dtype(recipe, samples.shape[1]))
    check_candidates(recipe, planes)

    generators = [torch.Generator().manual_seed(one) for one in seeds]
    if initial is None:
        starts = recipe.initial.start(images, size, recipe.boundary, generators)
    else:
        starts = gaussian_pyramid(initial, recipe.levels, border_of(recipe.boundary))
    canvases = [
        Canvas.blank(start, image, plane, recipe.boundary)
        for start, image, plane in zip(starts, images, planes, strict=True)
    ]
    with _exact_arithmetic(samples.device.type):
        _run(recipe, canvases, planes, generators, progress)
    return Result(tuple(map(_finished, canvases)), recipe, tuple(seeds))


@contextmanager
def _exact_arithmetic(device: str) -> Iterator[None]:
    """Keep the caller's settings from making products of whole numbers inexact."""
    precision = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    try:
        with torch.autocast(device, enabled=False):
            yield
    finally:
        torch.set_float32_matmul_precision(precision)


def _run(
    recipe: Recipe,
    canvases: Sequence[Canvas],
    planes: Sequence[Plane],
    generators: Sequence[torch.Generator],
    progress: Progress | None,
) -> None:
    """All sweeps of all levels, coarse to fine."""
    passes = [
        (level, number, sweep)
        for level in reversed(range(recipe.levels))
        for number, sweep in enumerate(recipe.sweeps_at(level))
    ]
    total = sum(math.prod(canvases[level].shape) for level, _, _ in passes)
    done = 0
    for level, number, sweep in passes:
        canvas = canvases[level]

        def advance(pixels: int, level: int = level, number: int = number) -> None:
            nonlocal done
            done += pixels
            if progress is not None:
                progress(level, number, done, total, canvases[level].image)

        draws = [
            torch.rand(math.prod(canvas.shape), generator=generator, dtype=torch.float64)
            for generator in generators
        ]
        advance(0)
        run_sweep(sweep, level, canvases, planes, torch.stack(draws).to(canvas.source.device), advance)


def _exemplar_planes(exemplar: Exemplar, images: Sequence[Image], dtype: torch.dtype) -> tuple[Plane, ...]:
    """The matching side of each level of the exemplar; it never wraps around."""
    regions = exemplar.valid_regions(len(images))
    return tuple(
        Plane(quantize(image, dtype), (image.shape[2], image.shape[3]), "open", valid)
        for image, valid in zip(images, regions, strict=True)
    )


def _initial_for(controls: Controls, samples: Image, size: Shape, outputs: int) -> Image | None:
    """The user's starting picture as a batch, if there is one and it fits the output."""
    if controls.initial is None:
        return None
    initial = controls.initial.detach()
    initial = initial if initial.ndim == 4 else initial.unsqueeze(0)
    wanted = (samples.shape[1], *size)
    if tuple(initial.shape[1:]) != wanted or len(initial) not in (1, outputs):
        raise InputError(
            "initial", f"must have the output's channels, height and width {wanted}",
            f"its shape is {tuple(controls.initial.shape)}",
            "resize it; a batch needs one picture, or one for each output",
        )  # fmt: skip
    return initial.to(samples).expand(outputs, -1, -1, -1)


def _finished(canvas: Canvas) -> Level:
    return Level(canvas.exemplar, canvas.start, canvas.image(), canvas.source_map(), canvas.cost_map())
