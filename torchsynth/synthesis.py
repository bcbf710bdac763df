"""The entry point: an exemplar, a size and a recipe in, a result out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeAlias

import torch
from torch import Tensor

from torchsynth import checks, field
from torchsynth._typing import Frames, Image
from torchsynth.canvas import Canvas
from torchsynth.codebook import Codebook
from torchsynth.controls import Controls
from torchsynth.course import to_visit
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.feasibility import (
    check_candidates,
    check_growing,
    check_memory,
    check_rows,
    check_target,
    matching_dtype,
)
from torchsynth.lattice import Boundary, Shape
from torchsynth.neighborhood import Plane, output_plane, quantize
from torchsynth.pyramid import blur, border_of, gaussian_pyramid, masked_pyramid
from torchsynth.recipe import Recipe
from torchsynth.result import Level, Result, breaks, check_straight
from torchsynth.surroundings import Surroundings, surroundings_of
from torchsynth.sweep import Fitted, run_sweep

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
    codebook: Codebook | None = None,
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
        codebook: Trees that :func:`torchsynth.train` trained for this exemplar and recipe, used in place
            of training them: the same bytes, sooner.
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
    if codebook is not None:
        checks.check_type(codebook, Codebook, "codebook", "pass torchsynth.Codebook.load(file)")
    exemplar = exemplar if isinstance(exemplar, Exemplar) else Exemplar(exemplar)
    controls = controls or Controls()
    samples = exemplar.samples
    size = checks.check_size(size)
    seeds = checks.check_seeds(seed, len(samples) if len(samples) > 1 else None)
    initial = _picture_for("initial", controls.initial, samples, size, len(seeds))
    target = _picture_for("target", controls.target, samples, size, len(seeds))
    _check_fields(controls, size)
    if recipe.blur_seams is not None:
        check_straight("blur_seams", controls.distorts)
    if recipe.channels == "separate" and samples.shape[1] > 1:
        return _channel_by_channel(exemplar, size, recipe, controls, seeds, codebook, progress)
    check_target(recipe, target is not None)
    check_memory(recipe, samples, size, len(seeds))
    check_rows(recipe, size)
    surroundings = None
    if controls.hole is not None and initial is not None:
        surroundings = surroundings_of(initial, controls.hole, controls.exemplar_at, recipe)
    check_growing(recipe, None if surroundings is None else [one.known for one in surroundings])

    images = exemplar.images(recipe.levels)
    planes = exemplar_planes(exemplar, images, matching_dtype(recipe, samples.shape[1]))
    check_candidates(recipe, planes)
    if len(samples) > 1 and recipe.refuses:
        # Outputs with exemplars of their own part company at the first refusal: better at once.
        return Result.joined(
            [
                synthesize(one, size, recipe, controls=some, seed=alone, codebook=codebook, progress=progress)
                for one, some, alone in zip(exemplar.split(), controls.split(len(seeds)), seeds, strict=True)
            ]
        )
    if codebook is not None:
        codebook.check(exemplar, recipe, planes)

    generators = [torch.Generator().manual_seed(one) for one in seeds]
    if initial is None or surroundings is not None:
        starts = recipe.initial.start(images, size, recipe.boundary, generators)
    else:
        starts = gaussian_pyramid(initial, recipe.levels, border_of(recipe.boundary))
    targets = _target_planes(target, controls.target_region, recipe, planes[0].values.dtype)
    canvases = []
    for level, start in enumerate(starts):
        frames = _frames(controls, (start.shape[2], start.shape[3]), samples.device)
        around = None if surroundings is None else surroundings[level]
        canvases.append(_canvas(start, images[level], planes[level], recipe, targets[level], frames, around))
    # Inference mode spares each of many thousand small operations some bookkeeping: an eighth of the time
    # of coherent search. Canvases are made outside of it, so that results are ordinary tensors.
    with exact_arithmetic(samples.device.type), torch.inference_mode():
        begins = initial is not None and surroundings is None
        begun = _run(recipe, canvases, planes, generators, begins, codebook, progress)
    levels = list(map(_finished, canvases, begun))
    if recipe.blur_seams is not None:
        levels[0] = _with_blurred_seams(levels[0], recipe.blur_seams, recipe.boundary, controls.hole)
    return Result(tuple(levels), recipe, tuple(seeds), controls.distorts)


def _channel_by_channel(
    exemplar: Exemplar,
    size: Shape,
    recipe: Recipe,
    controls: Controls,
    seeds: Sequence[int],
    codebook: Codebook | None,
    progress: Progress | None,
) -> Result:
    """Every channel as a picture of its own, with the same random numbers."""
    number = exemplar.samples.shape[1]
    results = []
    for channel in range(number):

        def told(
            level: int, sweep: int, done: int, total: int, preview: Callable[[], Image], turn: int = channel
        ) -> None:
            if progress is not None:
                progress(level, sweep, turn * total + done, number * total, preview)

        results.append(
            synthesize(
                exemplar.channel(channel), size, recipe, controls=controls.channel(channel), seed=seeds,
                codebook=codebook, progress=told,
            )
        )  # fmt: skip
    return Result.of_channels(results, recipe)


@contextmanager
def exact_arithmetic(device: str) -> Iterator[None]:
    """Keep the caller's settings from making products of whole numbers inexact.

    Example:
        >>> with exact_arithmetic("cpu"):
        ...     torch.get_float32_matmul_precision()
        'highest'
    """
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
    given: bool,
    codebook: Codebook | None,
    progress: Progress | None,
) -> list[Image]:
    """All sweeps of all levels, coarse to fine; returns the picture each level started from.

    ``given`` says that the coarsest level starts from the user's picture.
    """
    passes = [
        (level, number, sweep)
        for level in reversed(range(recipe.levels))
        for number, sweep in enumerate(recipe.sweeps_at(level))
    ]
    total = sum(to_visit(canvases[level], sweep.rows) for level, _, sweep in passes)
    done = 0
    begun = [canvas.start for canvas in canvases]
    fitted: Fitted | None = None
    for level, number, sweep in passes:
        canvas = canvases[level]
        if number == 0 or fitted is None or not fitted.serves(sweep):
            fitted = None  # before the next one takes its memory
            tree = None if codebook is None else codebook.tree(sweep, level, recipe.levels)
            fitted = Fitted.to(sweep, level, canvases, planes, tree)
        fitted = replace(fitted, sweep=sweep)
        coarser = canvases[level + 1] if level + 1 < recipe.levels else None
        if number == 0 and (coarser is not None or not given):
            before = to_visit(canvas, None)
            recipe.initial.sow(canvas, coarser, fitted.sites, generators)
            done += len(recipe.sweeps_at(level)) * (before - to_visit(canvas, None))
            with torch.inference_mode(mode=False):
                begun[level] = canvas.image() if recipe.initial.inherits else canvas.start

        def advance(pixels: int, level: int = level, number: int = number) -> None:
            nonlocal done
            done += pixels
            if progress is not None:
                with torch.inference_mode(mode=False):
                    progress(level, number, done, total, canvases[level].image)

        draws = [torch.randint(2**62, (math.prod(canvas.shape),), generator=one) for one in generators]
        advance(0)
        run_sweep(fitted, level, canvases, torch.stack(draws).to(canvas.source.device), advance)
    return begun


def exemplar_planes(exemplar: Exemplar, images: Sequence[Image], dtype: torch.dtype) -> tuple[Plane, ...]:
    """The matching side of each level of the exemplar; it never wraps around.

    Example:
        >>> exemplar = Exemplar(torch.rand(1, 8, 6))
        >>> [plane.shape for plane in exemplar_planes(exemplar, exemplar.images(2), torch.float32)]
        [(8, 6), (4, 3)]
    """
    regions = exemplar.valid_regions(len(images))
    return tuple(
        Plane(quantize(image, dtype), (image.shape[2], image.shape[3]), "open", valid)
        for image, valid in zip(images, regions, strict=True)
    )


def _target_planes(
    target: Image | None, region: Tensor | None, recipe: Recipe, dtype: torch.dtype
) -> Sequence[Plane | None]:
    """What neighborhoods read of the target, level by level."""
    if target is None:
        return [None] * recipe.levels
    border = border_of(recipe.boundary)
    if region is None:
        images = gaussian_pyramid(target, recipe.levels, border)
        return [output_plane(image, dtype, recipe.boundary) for image in images]
    painted = masked_pyramid(target, region.to(target.device), recipe.levels, border)
    return [output_plane(image, dtype, recipe.boundary, known) for image, known in painted]


def _picture_for(
    subject: str, picture: Tensor | None, samples: Image, size: Shape, outputs: int
) -> Image | None:
    """A picture of the user's as a batch, if there is one and it fits the output."""
    if picture is None:
        return None
    batch = picture.detach() if picture.ndim == 4 else picture.detach().unsqueeze(0)
    wanted = (samples.shape[1], *size)
    if tuple(batch.shape[1:]) != wanted or len(batch) not in (1, outputs):
        raise InputError(
            subject, f"must have the output's channels, height and width {wanted}",
            f"its shape is {tuple(picture.shape)}",
            "convert it to the exemplar's channels" if batch.shape[1] != wanted[0] and batch.shape[2:] == size
            else "resize it, and see that its channels are the exemplar's; a batch needs one, or one for each output",
        )  # fmt: skip
    return batch.to(samples).expand(outputs, -1, -1, -1)


def _check_fields(controls: Controls, size: Shape) -> None:
    """Fields must have a value for every pixel of the output."""
    for name in ("angle", "scale"):
        given = getattr(controls, name)
        if isinstance(given, Tensor) and tuple(given.shape) != size:
            raise InputError(
                name, f"must have the output's height and width {size}",
                f"its shape is {tuple(given.shape)}", "resize it, or pass one number",
            )  # fmt: skip


def _canvas(
    start: Image,
    image: Image,
    plane: Plane,
    recipe: Recipe,
    target: Plane | None,
    frames: Frames | None,
    around: Surroundings | None,
) -> Canvas:
    """The canvas of a level, with what is given around its hole, if it has one."""
    if around is None:
        return Canvas.blank(start, image, plane, recipe.boundary, target, frames)
    start = torch.where(around.known, around.picture, start)
    canvas = Canvas.blank(start, image, plane, recipe.boundary, target, frames)
    around.give(canvas)
    return canvas


def _frames(controls: Controls, shape: Shape, device: torch.device) -> Frames | None:
    """How the pixels of a level see their surroundings turned and scaled, if they do."""
    if not controls.distorts:
        return None
    fields = [
        field.at_level(given.detach().double().cpu(), shape)
        if isinstance(given, Tensor)
        else field.constant(shape, default if given is None else float(given))
        for given, default in ((controls.angle, 0.0), (controls.scale, 1.0))
    ]
    return field.frames(*fields).to(device)


def _with_blurred_seams(level: Level, size: int, boundary: Boundary, hole: Tensor | None) -> Level:
    """The level with its picture blurred on both sides of every patch's boundary, inside a hole only."""
    below, right = breaks(level.source, boundary)
    beside = below | below.roll(1, 1) | right | right.roll(1, 2)
    if hole is not None:
        beside &= hole.to(beside.device)
    blurred = blur(level.image, size, border_of(boundary))
    return replace(level, image=torch.where(beside.unsqueeze(1), blurred, level.image))


def _finished(canvas: Canvas, begun: Image) -> Level:
    return Level(canvas.exemplar, begun, canvas.image(), canvas.source_map(), canvas.cost_map())
