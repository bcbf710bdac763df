"""Does this recipe fit this exemplar and this size? Asked before any work starts."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from torchsynth._typing import Image, Region
from torchsynth.errors import ConfigError, InputError
from torchsynth.index import candidates
from torchsynth.initial import SeedPatch
from torchsynth.lattice import Shape
from torchsynth.neighborhood import (
    STEPS,
    Layer,
    Planes,
    layer_weights,
    layers_at,
    neighbor_weights,
)
from torchsynth.pyramid import level_shapes
from torchsynth.recipe import Recipe
from torchsynth.schedule import OnionPeel, visited_rows
from torchsynth.sweep import Sweep

# Up to here every whole number, and so every partial sum of whole numbers, is exact in each type.
_EXACT_FLOAT32 = 2**24
_EXACT_FLOAT64 = 2**53


def matching_dtype(recipe: Recipe, channels: int, guide_channels: int = 0) -> torch.dtype:
    """The narrowest float type in which every distance of the recipe is exact.

    Args:
        recipe: The recipe.
        channels: How many channels the exemplar has.
        guide_channels: How many its guide has, if there is one.

    Example:
        >>> from torchsynth import recipes
        >>> matching_dtype(recipes.wei_levoy(), channels=1), matching_dtype(recipes.wei_levoy(), channels=8)
        (torch.float32, torch.float64)
    """
    # Patches are compared in float64; their pixels only have to be held exactly.
    largest = max(
        (
            _weighted_features(sweep, channels, guide_channels) * sweep.search.largest_term
            for sweep in recipe.sweeps
        ),
        default=channels * STEPS**2,
    )
    if largest > _EXACT_FLOAT64:
        raise ConfigError(
            "weights", "distances must be exact in float64", f"they can reach {largest:,}",
            "use smaller weights, or do without 'normalize'",
        )  # fmt: skip
    return torch.float32 if largest <= _EXACT_FLOAT32 else torch.float64


def check_candidates(recipe: Recipe, planes: Planes) -> None:
    """Every sweep must find at least one candidate at every level it runs on.

    Args:
        recipe: The recipe.
        planes: The exemplar's side.

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
    if given and recipe.patches is not None and not recipe.follows_target:
        raise InputError(
            "target", "must be given to a recipe that follows one",
            f"the recipe {recipe.name!r} covers the output with patches whatever they show",
            "use torchsynth.recipes.quilting_transfer(), or with_target(recipe) of a quilting recipe",
        )  # fmt: skip
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


def check_guide(recipe: Recipe, exemplar: Image | None, output: Image | None) -> None:
    """A recipe compares guides exactly when both sides have one, and these have the same channels.

    Args:
        recipe: The recipe.
        exemplar: The exemplar's guide.
        output: The output's.

    Raises:
        InputError: If they do not go together.

    Example:
        >>> from torchsynth import recipes
        >>> check_guide(recipes.wei_levoy(), None, None)
    """
    given = exemplar is not None or output is not None
    if given and not recipe.follows_guide:
        raise InputError(
            "guide", "must be given to a recipe that compares it",
            f"the recipe {recipe.name!r} has no layer on a guide plane", "use e.g. torchsynth.recipes.analogy()",
        )  # fmt: skip
    if recipe.follows_guide and (exemplar is None or output is None):
        missing = (
            "neither has one"
            if not given
            else "the exemplar has none"
            if exemplar is None
            else "the output has none"
        )
        raise InputError(
            "guide", f"must lie upon exemplar and output for the recipe {recipe.name!r}", missing,
            "use torchsynth.analogy(a, a_prime, b), or pass Exemplar(..., guide=) and Controls(guide=)",
        )  # fmt: skip
    if exemplar is not None and output is not None and exemplar.shape[1] != output.shape[1]:
        raise InputError(
            "guide", f"must have the {exemplar.shape[1]} channel(s) of the exemplar's guide",
            f"it has {output.shape[1]}", "convert one of them",
        )  # fmt: skip


def check_rows(recipe: Recipe, size: Shape) -> None:
    """The sweeps of each level must visit all of its rows.

    Raises:
        InputError: If some would never be synthesized.

    Example:
        >>> from torchsynth import recipes
        >>> check_rows(recipes.wei_levoy(), (64, 64))
    """
    if recipe.patches is not None:
        return
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


def _weighted_features(sweep: Sweep, channels: int, guide_channels: int) -> int:
    weights = neighbor_weights(sweep.layers, layer_weights(sweep.layers, sweep.normalize))
    return sum(
        int(one.sum()) * (guide_channels if layer.is_guide else channels)
        for layer, one in zip(sweep.layers, weights, strict=True)
    )


def _no_candidates(layers: Sequence[Layer], planes: Planes, level: int) -> InputError:
    height, width = planes.result[level].shape
    if bool(candidates(layers, planes.everywhere(), level).any()):
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
