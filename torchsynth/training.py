"""Training: the trees of a recipe, grown for an exemplar ahead of any synthesis."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth.codebook import Codebook, PackedTree, digest, trainings
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.exemplar_levels import ExemplarLevels
from torchsynth.feasibility import check_candidates, matching_dtype
from torchsynth.index import Index
from torchsynth.memory import check_training_memory
from torchsynth.recipe import Recipe
from torchsynth.synthesis import exact_arithmetic

TrainingProgress: TypeAlias = Callable[[int, int, int], None]
"""``(level, done, total)``: the level whose tree is next or was last trained, and how many exemplar pixels,
counted over all trees, are done and how many there are. An exception raised in it cancels the training
and reaches the caller."""


@torch.no_grad()
def train(
    exemplar: Tensor | Exemplar, recipe: Recipe, *, progress: TrainingProgress | None = None
) -> Codebook:
    """Train the trees that a recipe searches, to use them in many syntheses.

    Args:
        exemplar: As for :func:`torchsynth.synthesize`.
        recipe: One with at least one search of kind ``tsvq``. The codebook serves every recipe that
            compares the same neighbors and grows the same trees at the same levels, whatever its beam,
            order, start and boundary.
        progress: Called before and after each tree as ``progress(level, done, total)``; see
            :data:`torchsynth.training.TrainingProgress`.

    Returns:
        The trees of all levels; see :class:`torchsynth.Codebook`.

    Raises:
        InputError: If anything is wrong with the input, before any work.

    Source:
        Wei & Levoy 2000, section 4.

    Example:
        >>> import torchsynth as ts
        >>> codebook = ts.train(torch.rand(1, 16, 16), ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5))
        >>> len(codebook.trees)
        2
    """
    checks.check_type(recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.wei_levoy_tsvq()")
    exemplar = exemplar if isinstance(exemplar, Exemplar) else Exemplar(exemplar)
    needed = trainings(recipe)
    if not needed:
        raise InputError(
            "recipe", "must search with trees to be trained", f"{recipe.name!r} has no tsvq search",
            "use e.g. torchsynth.recipes.wei_levoy_tsvq()",
        )  # fmt: skip
    samples, guides = exemplar.samples, exemplar.guides
    if recipe.follows_guide and guides is None:
        raise InputError(
            "guide", f"must lie upon the exemplar for the recipe {recipe.name!r}", "there is none",
            "pass Exemplar(image, guide=...)",
        )  # fmt: skip
    check_training_memory(recipe, exemplar)
    dtype = matching_dtype(recipe, samples.shape[1], 0 if guides is None else guides.shape[1])
    planes = ExemplarLevels.of(exemplar, recipe, dtype).planes
    check_candidates(recipe, planes)

    shapes = [planes.result[training.level].shape for training in needed]
    total = sum(map(math.prod, shapes))
    done, trees = 0, {}
    for training, shape in zip(needed, shapes, strict=True):
        if progress is not None:
            progress(training.level, done, total)
        with exact_arithmetic(samples.device.type):
            index = Index.of(training.layers, training.weights, planes, training.level)
            trees[training] = PackedTree.of(training.search.grow(index))
        done += math.prod(shape)
    if progress is not None:
        progress(needed[-1].level, done, total)
    return Codebook(digest(exemplar), trees)
