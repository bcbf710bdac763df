"""Does this recipe fit this exemplar, this size and this machine? Asked before any work starts."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace

import torch

from torchsynth._typing import Image, Region
from torchsynth.errors import ConfigError, InputError
from torchsynth.index import CHUNK, candidates
from torchsynth.initial import SeedPatch
from torchsynth.lattice import Shape
from torchsynth.neighborhood import (
    Layer,
    Plane,
    layer_weights,
    layers_at,
    neighbor_weights,
)
from torchsynth.pyramid import level_shapes
from torchsynth.recipe import Recipe
from torchsynth.schedule import OnionPeel, visited_rows
from torchsynth.search.base import MEMORY_BUDGET, Volume
from torchsynth.sweep import Sweep, group_size

# Up to here every whole number, and so every partial sum of whole numbers, is exact in each type.
_EXACT_FLOAT32 = 2**24
_EXACT_FLOAT64 = 2**53

_FALLBACK_MEMORY = 16 * 2**30


def matching_dtype(recipe: Recipe, channels: int) -> torch.dtype:
    """The narrowest float type in which every distance of the recipe is exact.

    Example:
        >>> from torchsynth import recipes
        >>> matching_dtype(recipes.wei_levoy(), channels=1), matching_dtype(recipes.wei_levoy(), channels=8)
        (torch.float32, torch.float64)
    """
    largest = channels * max(_weighted_features(sweep) * sweep.search.largest_term for sweep in recipe.sweeps)
    if largest > _EXACT_FLOAT64:
        raise ConfigError(
            "weights", "distances must be exact in float64", f"they can reach {largest:,}",
            "use smaller weights, or do without 'normalize'",
        )  # fmt: skip
    return torch.float32 if largest <= _EXACT_FLOAT32 else torch.float64


def check_candidates(recipe: Recipe, planes: Sequence[Plane]) -> None:
    """Every sweep must find at least one candidate at every level it runs on.

    Args:
        recipe: The recipe.
        planes: The exemplar's planes by level.

    Raises:
        InputError: If the exemplar, or the part of it that may be sampled, is too small.
    """
    for level in range(recipe.levels):
        for sweep in recipe.sweeps_at(level):
            layers = layers_at(sweep.layers, level, recipe.levels)
            if not bool(candidates(layers, planes, level).any()):
                raise _no_candidates(layers, planes, level)


def check_target(recipe: Recipe, given: bool) -> None:
    """A recipe follows a target exactly when there is one.

    Raises:
        InputError: If a recipe that follows none is given one, or the other way around.

    Example:
        >>> from torchsynth import recipes
        >>> check_target(recipes.wei_levoy(), given=False)
    """
    if given and not recipe.follows_target:
        raise InputError(
            "target", "must be given to a recipe that compares it",
            f"the recipe {recipe.name!r} has no layer on the target plane",
            "use torchsynth.recipes.with_target(recipe)",
        )  # fmt: skip
    if recipe.follows_target and not given:
        raise InputError(
            "target", f"must be given to the recipe {recipe.name!r}, which follows one", "there is none",
            "pass a picture of the output's size as the target",
        )  # fmt: skip


def check_rows(recipe: Recipe, size: Shape) -> None:
    """The sweeps of each level must visit all of its rows.

    Raises:
        InputError: If some would never be synthesized.

    Example:
        >>> from torchsynth import recipes
        >>> check_rows(recipes.wei_levoy(), (64, 64))
    """
    for level, (height, _) in enumerate(level_shapes(size, recipe.levels)):
        visited = torch.zeros(height, dtype=torch.bool)
        for sweep in recipe.sweeps_at(level):
            visited[visited_rows(sweep.rows, height)] = True
        if not bool(visited.all()):
            row = int((~visited).nonzero()[0])
            raise InputError(
                "recipe", f"must visit every row of level {level}", f"no sweep visits row {row}",
                "change the 'rows' of its sweeps",
            )  # fmt: skip


def check_growing(recipe: Recipe, known: Sequence[Region] | None) -> None:
    """A sweep that grows from what is known needs something known, at every level.

    Args:
        recipe: The recipe.
        known: What is known around a hole, level by level; None if there is no hole.

    Raises:
        InputError: If there is nothing to grow from.

    Example:
        >>> from torchsynth import recipes
        >>> check_growing(recipes.wei_levoy(), None)
    """
    for level in range(recipe.levels):
        growing = any(isinstance(sweep.order, OnionPeel) for sweep in recipe.sweeps_at(level))
        if not growing or (known is None and isinstance(recipe.initial, SeedPatch)):
            continue
        if known is None:
            raise InputError(
                "hole", f"must be given to the recipe {recipe.name!r}, which grows from what is known",
                "there is none", "fill a hole with it (torchsynth.fill), or let it start from a seed patch",
            )  # fmt: skip
        if not bool(known[level].any()):
            raise InputError(
                "hole", f"must leave something known at each of the {recipe.levels} levels",
                f"of level {level} nothing is", f"use {level} levels or fewer",
            )  # fmt: skip


def check_memory(recipe: Recipe, samples: Image, size: Shape, outputs: int) -> None:
    """What a run holds in memory at once must fit this machine.

    Raises:
        InputError: If it does not; the message says what it would take.
    """
    needed, available = memory_needed(recipe, samples, size, outputs), _machine_memory()
    if needed > available:
        raise InputError(
            "size", f"must fit the {_gibibytes(available)} of memory of this machine",
            f"{outputs} output(s) of {size[0]}x{size[1]} would take about {_gibibytes(needed)}",
            "ask for a smaller size, or fewer outputs at once",
        )  # fmt: skip


def check_training_memory(recipe: Recipe, samples: Image) -> None:
    """What training holds in memory at once must fit this machine.

    Raises:
        InputError: If it does not; the message says what it would take.

    Example:
        >>> from torchsynth import recipes
        >>> check_training_memory(recipes.wei_levoy_tsvq(), torch.rand(1, 1, 32, 32))
    """
    needed, available = memory_needed(recipe, samples, (1, 1), 1), _machine_memory()
    if needed > available:
        raise InputError(
            "exemplar", f"training on it must fit the {_gibibytes(available)} of memory of this machine",
            f"it would take about {_gibibytes(needed)}", "use a smaller exemplar or neighborhood",
        )  # fmt: skip


def outputs_that_fit(recipe: Recipe, samples: Image, size: Shape, wanted: int) -> int:
    """How many outputs this machine's memory holds at once: at most as many as wanted, at least one.

    Example:
        >>> from torchsynth import recipes
        >>> outputs_that_fit(recipes.wei_levoy(), torch.rand(1, 1, 32, 32), (64, 64), 8)
        8
    """
    available = _machine_memory()
    fitting = (n for n in range(1, wanted + 1) if memory_needed(recipe, samples, size, n) <= available)
    return max(fitting, default=1)


def memory_needed(recipe: Recipe, samples: Image, size: Shape, outputs: int) -> int:
    """About how many bytes a run takes at its peak, beyond the libraries themselves.

    Example:
        >>> from torchsynth import recipes
        >>> memory_needed(recipes.wei_levoy(), torch.rand(1, 1, 128, 128), (256, 256), 1) < 300 * 2**20
        True
    """
    exemplars, channels, height, width = samples.shape
    item = 4 if matching_dtype(recipe, channels) == torch.float32 else 8
    # Per output pixel: noise twice in float64; start, picture and matching values per channel; the
    # source twice as int64, a draw, the cost. And once for all outputs: the order, and frames.
    pixel = channels * (16 + 2 * samples.element_size() + item) + 76
    shared = 160
    fitted = _fitted_bytes(recipe, samples, item)
    features = channels * max(_neighbors(sweep) for sweep in recipe.sweeps)
    # Positions as int64, vectors, and copies of both while they are put together.
    group = group_size(outputs, features) * outputs * features * (16 + 4 * item)
    # A pyramid holds 4/3 of its finest level.
    output = math.prod(size) * (outputs * pixel + shared) * 4 // 3
    # Per exemplar pixel: copies for the pyramid, in float64 while it is made, picture and matching values.
    # And once for all exemplars: sites, where windows begin, and the coordinates these come from.
    example = height * width * (exemplars * channels * (40 + item) + 100) * 4 // 3
    return output + example + fitted + group + 3 * MEMORY_BUDGET + 8 * CHUNK


def _fitted_bytes(recipe: Recipe, samples: Image, item: int) -> int:
    """What searchers make of all candidates, where that is most: tables too large for one level are not kept."""
    exemplars, channels, height, width = samples.shape
    most = 0
    for level, shape in enumerate(level_shapes((height, width), recipe.levels)):
        for sweep in recipe.sweeps_at(level):
            layers = layers_at(sweep.layers, level, recipe.levels)
            painted = any(layer.plane == "target" for layer in layers)
            complete = recipe.boundary == "torus" and sweep.unknown == "read" and not painted
            volume = Volume(exemplars, math.prod(shape), channels, item, layers, complete)
            most = max(most, sweep.search.memory(volume))
    return most


def _neighbors(sweep: Sweep) -> int:
    return sum(len(layer.template.offsets()) for layer in sweep.layers)


def _weighted_features(sweep: Sweep) -> int:
    weights = neighbor_weights(sweep.layers, layer_weights(sweep.layers, sweep.normalize))
    return sum(int(one.sum()) for one in weights)


def _no_candidates(layers: Sequence[Layer], planes: Sequence[Plane], level: int) -> InputError:
    height, width = planes[level].shape
    open_planes = [replace(plane, valid=None) for plane in planes]
    if bool(candidates(layers, open_planes, level).any()):
        return InputError(
            "what may be sampled", f"must hold at least one whole neighborhood at level {level}",
            "none lies inside it", "mark a larger region or a smaller hole, sample farther from it, or use fewer levels or a smaller neighborhood",
        )  # fmt: skip
    templates = " + ".join(f"{layer.template.size}x{layer.template.size} {layer.plane}" for layer in layers)
    fewer = f"levels <= {level}, " if level else ""
    return InputError(
        "exemplar", f"the {templates} neighborhood must fit inside level {level}",
        f"that level is only {height}x{width}",
        f"use {fewer}a smaller neighborhood or a larger exemplar",
    )  # fmt: skip


def _machine_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not every system can say
        return _FALLBACK_MEMORY


def _gibibytes(amount: int) -> str:
    # Integers have no limit, so that a size with a hundred digits gets here; floats have one.
    return f"{amount / 2**30:,.1f} GiB" if amount < 2**90 else "more than a quintillion GiB"
