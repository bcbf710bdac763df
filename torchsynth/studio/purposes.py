"""What a recipe is for, in terms of the page: some of them need more than a sample."""

from __future__ import annotations

from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.exemplar_levels import ExemplarLevels
from torchsynth.feasibility import check_candidates, check_growing
from torchsynth.recipe import Recipe
from torchsynth.recipes import distorted
from torchsynth.studio.visitor import Sample


def check_purpose(recipe: Recipe, controls: Controls) -> None:
    """Whether a recipe can make an output of a sample and what is pinned down.

    Args:
        recipe: The recipe.
        controls: What is pinned down.

    Raises:
        InputError: If it needs something that is given elsewhere; it says where.

    Example:
        >>> from torchsynth import recipes
        >>> check_purpose(recipes.wei_levoy_fill(), Controls())
        Traceback (most recent call last):
        torchsynth.errors.InputError: recipe 'wei_levoy_fill': must need no more than the sample here, but it fills
        holes; use the Fill tab, or choose another recipe
    """
    need = _need(recipe, controls)
    if need is not None:
        raise InputError(
            f"recipe {recipe.name!r}", "must need no more than the sample here", need[0],
            f"{need[1]}, or choose another recipe",
        )  # fmt: skip


def _need(recipe: Recipe, controls: Controls) -> tuple[str, str] | None:
    """What else it needs, and where that is given."""
    if recipe.follows_guide and recipe.structure is None:
        return "it needs pictures A and B", "use 'torchsynth analogy' on the command line"
    if recipe.follows_target and controls.target is None:
        return "it follows a target", "use the Target tab"
    try:
        check_growing(recipe, None)
    except InputError:
        return "it fills holes", "use the Fill tab"
    return None


def distorted_as_fits(sample: Sample) -> Recipe:
    """The recipe for fields, with as many levels as the sample has room for.

    Example:
        >>> from torchsynth.studio.work import read_sample
        >>> distorted_as_fits(read_sample("sample:brick", "brick")).levels
        3
    """
    image = sample.picture.image
    for levels in range(distorted().levels, 1, -1):
        recipe = distorted(levels=levels)
        try:
            check_candidates(recipe, ExemplarLevels.of(Exemplar(image), recipe, image.dtype).planes)
        except InputError:
            continue  # its coarsest level would be too small
        return recipe
    return distorted(levels=1)
