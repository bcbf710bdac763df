"""How much memory a run takes, asked before any work starts."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace

from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.feasibility import matching_dtype
from torchsynth.index import CHUNK
from torchsynth.lattice import Shape
from torchsynth.neighborhood import Layer, layers_at
from torchsynth.pyramid import level_shapes
from torchsynth.recipe import Recipe
from torchsynth.search.base import MEMORY_BUDGET, Volume
from torchsynth.visits import group_size

_FALLBACK_MEMORY = 16 * 2**30


def check_memory(recipe: Recipe, exemplar: Exemplar, size: Shape, outputs: int) -> None:
    """What a run holds in memory at once must fit this machine.

    Raises:
        InputError: If it does not; the message says what it would take.
    """
    needed, available = memory_needed(recipe, exemplar, size, outputs), _machine_memory()
    if needed > available:
        raise InputError(
            "size", f"must fit the {_gibibytes(available)} of memory of this machine",
            f"{outputs} output(s) of {size[0]}x{size[1]} would take about {_gibibytes(needed)}",
            "ask for a smaller size, or fewer outputs at once",
        )  # fmt: skip


def check_training_memory(recipe: Recipe, exemplar: Exemplar) -> None:
    """What training holds in memory at once must fit this machine.

    Raises:
        InputError: If it does not; the message says what it would take.

    Example:
        >>> import torch
        >>> from torchsynth import recipes
        >>> check_training_memory(recipes.wei_levoy_tsvq(), Exemplar(torch.rand(1, 32, 32)))
    """
    needed, available = memory_needed(recipe, exemplar, (1, 1), 1), _machine_memory()
    if needed > available:
        raise InputError(
            "exemplar", f"training on it must fit the {_gibibytes(available)} of memory of this machine",
            f"it would take about {_gibibytes(needed)}", "use a smaller exemplar or neighborhood",
        )  # fmt: skip


def outputs_that_fit(recipe: Recipe, exemplar: Exemplar, size: Shape, wanted: int) -> int:
    """How many outputs this machine's memory holds at once: at most as many as wanted, at least one.

    Example:
        >>> import torch
        >>> from torchsynth import recipes
        >>> outputs_that_fit(recipes.wei_levoy(), Exemplar(torch.rand(1, 32, 32)), (64, 64), 8)
        8
    """
    available = _machine_memory()
    fitting = (n for n in range(1, wanted + 1) if memory_needed(recipe, exemplar, size, n) <= available)
    return max(fitting, default=1)


def memory_needed(recipe: Recipe, exemplar: Exemplar, size: Shape, outputs: int) -> int:
    """About how many bytes a run takes at its peak, beyond the libraries themselves.

    Example:
        >>> import torch
        >>> from torchsynth import recipes
        >>> memory_needed(recipes.wei_levoy(), Exemplar(torch.rand(1, 128, 128)), (256, 256), 1) < 300 * 2**20
        True
    """
    if recipe.structure is not None:
        return _needed_with_structure(recipe, recipe.structure.recipe, exemplar, size, outputs)
    samples, guides = exemplar.samples, exemplar.guides
    exemplars, channels, height, width = samples.shape
    guide_channels = 0 if guides is None else guides.shape[1]
    item = matching_dtype(recipe, channels, guide_channels).itemsize
    # Per output pixel: noise twice in float64; start, picture and matching values per channel; the
    # source twice as int64, a draw, the cost. And once for all outputs: the order, and frames.
    pixel = channels * (16 + 2 * samples.element_size() + item) + 76
    # A guide's picture, in float64 while its pyramid is made, and matching values.
    pixel += guide_channels * (8 + samples.element_size() + item)
    shared = 160
    if recipe.patches is not None:
        patches = recipe.patches.memory((exemplars, channels, height, width), size, recipe.boundary, outputs)
        return math.prod(size) * outputs * pixel + samples.numel() * (8 + item) + patches
    fitted = _fitted_bytes(recipe, exemplar, item)
    features = max(_features(sweep.layers, channels, guide_channels) for sweep in recipe.sweeps)
    # Positions as int64, vectors, and copies of both while they are put together.
    group = group_size(outputs, features) * outputs * features * (16 + 4 * item)
    # A pyramid holds 4/3 of its finest level.
    output = math.prod(size) * (outputs * pixel + shared) * 4 // 3
    # Per exemplar pixel: copies for the pyramid, in float64 while it is made, picture and matching values.
    # And once for all exemplars: sites, where windows begin, and the coordinates these come from.
    every = exemplars * (channels + guide_channels)
    example = height * width * (every * (40 + item) + 100) * 4 // 3
    return output + example + fitted + group + 3 * MEMORY_BUDGET + 8 * CHUNK


def _needed_with_structure(
    recipe: Recipe, inner: Recipe, exemplar: Exemplar, size: Shape, outputs: int
) -> int:
    """The structure is kept while the output is made: its exemplar, start, picture, source and cost."""
    samples = exemplar.samples
    pixel = samples.shape[1] * 2 * samples.element_size() + 24
    kept = (math.prod(size) * outputs * pixel + 2 * samples.numel() * samples.element_size()) * 4 // 3
    guided = replace(exemplar, guide=samples)
    return kept + max(
        memory_needed(inner, exemplar, size, outputs),
        memory_needed(recipe.changed(structure=None), guided, size, outputs),
    )


def _fitted_bytes(recipe: Recipe, exemplar: Exemplar, item: int) -> int:
    """What searchers make of all candidates, where that is most: tables too large for one level are not kept."""
    exemplars, channels, height, width = exemplar.samples.shape
    guide_channels = 0 if exemplar.guides is None else exemplar.guides.shape[1]
    most = 0
    for level, shape in enumerate(level_shapes((height, width), recipe.levels)):
        for sweep in recipe.sweeps_at(level):
            layers = layers_at(sweep.layers, level, recipe.levels)
            painted = any(layer.plane == "target" for layer in layers)
            complete = recipe.boundary == "torus" and sweep.unknown == "read" and not painted
            volume = Volume(exemplars, math.prod(shape), channels, item, layers, complete, guide_channels)
            most = max(most, sweep.search.memory(volume))
    return most


def _features(layers: Sequence[Layer], channels: int, guide_channels: int) -> int:
    return sum(
        len(layer.template.offsets()) * (guide_channels if layer.is_guide else channels) for layer in layers
    )


def _machine_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not every system can say
        return _FALLBACK_MEMORY


def _gibibytes(amount: int) -> str:
    # Integers have no limit, so that a size with a hundred digits gets here; floats have one.
    return f"{amount / 2**30:,.1f} GiB" if amount < 2**90 else "more than a quintillion GiB"
