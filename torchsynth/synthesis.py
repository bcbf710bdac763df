"""The entry point: an exemplar, a size and a recipe in, a result out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeAlias

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Image
from torchsynth.canvas import Canvas
from torchsynth.codebook import Codebook
from torchsynth.controls import Controls
from torchsynth.course import to_visit
from torchsynth.covering import cover
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.lattice import Boundary, Shape
from torchsynth.memory import check_memory
from torchsynth.pyramid import blur, border_of, level_shapes
from torchsynth.recipe import Recipe
from torchsynth.result import Level, Result, breaks
from torchsynth.schedule import visited_rows
from torchsynth.sweep import Fitted
from torchsynth.task import Task, check_pictures
from torchsynth.visits import run_sweep

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
            :data:`torchsynth.synthesis.Progress`.

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
    size = checks.check_size(size)
    exemplars = len(exemplar.samples)
    seeds = checks.check_seeds(seed, exemplars if exemplars > 1 else None)
    if recipe.structure is not None:
        return _with_structure(exemplar, size, recipe, controls, seeds, codebook, progress)
    if recipe.channels == "separate" and exemplar.samples.shape[1] > 1:
        check_pictures(exemplar, size, controls, len(seeds))
        return _channel_by_channel(exemplar, size, recipe, controls, seeds, codebook, progress)
    task = Task.of(exemplar, size, recipe, controls, seeds, codebook)
    if exemplars > 1 and recipe.refuses:
        # Outputs with exemplars of their own part company at the first refusal: better at once.
        return Result.joined(
            [
                synthesize(one, size, recipe, controls=some, seed=alone, codebook=codebook, progress=progress)
                for one, some, alone in zip(exemplar.split(), controls.split(len(seeds)), seeds, strict=True)
            ]
        )
    generators = [torch.Generator().manual_seed(one) for one in seeds]
    canvases = task.canvases(generators)
    # Inference mode spares each of many thousand small operations some bookkeeping: an eighth of the time
    # of coherent search. Canvases are made outside of it, so that results are ordinary tensors.
    with exact_arithmetic(exemplar.samples.device.type), torch.inference_mode():
        begun = _run(task, canvases, generators, progress)
    levels = list(map(_finished, canvases, begun))
    if recipe.blur_seams is not None:
        levels[0] = _with_blurred_seams(levels[0], recipe.blur_seams, recipe.boundary, controls.hole)
    return Result(tuple(levels), recipe, tuple(seeds), controls.distorts)


def _with_structure(
    exemplar: Exemplar,
    size: Shape,
    recipe: Recipe,
    controls: Controls,
    seeds: Sequence[int],
    codebook: Codebook | None,
    progress: Progress | None,
) -> Result:
    """First a texture of the exemplar with wide edges, then the output, guided by it."""
    _check_structure(exemplar, recipe, controls, codebook)
    check_memory(recipe, exemplar, size, len(seeds))
    if len(exemplar.samples) > 1:
        # Each of them may need another operation.
        return Result.joined(
            [
                synthesize(one, size, recipe, controls=some, seed=alone, progress=progress)
                for one, some, alone in zip(exemplar.split(), controls.split(len(seeds)), seeds, strict=True)
            ]
        )
    assert recipe.structure is not None, "the reason to be here"  # noqa: S101 (for the type checker)
    structure = recipe.structure.settled(exemplar.samples, exemplar.valid)
    inner, outer = structure.recipe, recipe.changed(structure=None)
    wide = Exemplar(structure.widen(exemplar.samples, exemplar.valid), exemplar.valid)
    guided = replace(exemplar, guide=wide.image)
    blank = exemplar.samples.new_zeros(1, exemplar.samples.shape[1], *size)
    Task.of(guided, size, outer, replace(controls, guide=blank), seeds)  # before any work
    shares = [_visits(one, size, exemplar.samples.shape[1]) for one in (inner, outer)]

    def told(before: int) -> Progress | None:
        if progress is None:
            return None
        return lambda level, sweep, done, _, preview: progress(
            level, sweep, before + done, sum(shares), preview
        )

    initial = None
    if controls.initial is not None:
        initial = structure.widen(controls.initial.view(-1, *controls.initial.shape[-3:]))
    begun = replace(controls, initial=initial)
    made = synthesize(wide, size, inner, controls=begun, seed=seeds, progress=told(0))
    controls = replace(controls, guide=made.image)
    result = synthesize(guided, size, outer, controls=controls, seed=seeds, progress=told(shares[0]))
    return replace(result, recipe=recipe.changed(structure=structure), structure=made)


def _check_structure(
    exemplar: Exemplar, recipe: Recipe, controls: Controls, codebook: Codebook | None
) -> None:
    """What a recipe that makes its own guide cannot be given."""
    refused = {
        "guide": controls.guide is not None or exemplar.guide is not None,
        "hole": controls.hole is not None,
        "codebook": codebook is not None,
    }
    for subject, given in refused.items():
        if given:
            raise InputError(
                subject, "cannot be given to a recipe that makes its own guide",
                f"the recipe {recipe.name!r} has a structure",
                "use a recipe without, e.g. torchsynth.recipes.improved_wl(morphology=False)",
            )  # fmt: skip
    side = None if recipe.structure is None else recipe.structure.size
    if isinstance(side, int) and side > min(exemplar.shape):
        raise InputError(
            "structure", f"edges must be widened by a square that fits the exemplar, {exemplar.shape[0]}x{exemplar.shape[1]}",
            f"its side is {side}", "use a smaller size, or 'auto'",
        )  # fmt: skip


def _visits(recipe: Recipe, size: Shape, channels: int) -> int:
    """How many pixels all sweeps of all levels visit, of each channel that is made by itself."""
    turns = channels if recipe.channels == "separate" else 1
    if recipe.patches is not None:
        return turns * math.prod(size) * recipe.patches.sweeps
    return turns * sum(
        len(visited_rows(sweep.rows, height)) * width
        for level, (height, width) in enumerate(level_shapes(size, recipe.levels))
        for sweep in recipe.sweeps_at(level)
    )


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
    task: Task,
    canvases: Sequence[Canvas],
    generators: Sequence[torch.Generator],
    progress: Progress | None,
) -> list[Image]:
    """All sweeps of all levels, coarse to fine; returns the picture each level started from."""
    recipe, codebook = task.recipe, task.codebook
    if recipe.patches is not None:
        cover(canvases[0], recipe, generators, progress)
        return [canvases[0].start]
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
            tree = None if codebook is None else codebook.tree(sweep, level, recipe)
            fitted = Fitted.to(sweep, level, canvases, task.levels.planes, tree)
        fitted = replace(fitted, sweep=sweep)
        coarser = canvases[level + 1] if level + 1 < recipe.levels else None
        if number == 0 and task.is_sown(coarsest=coarser is None):
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
