"""The kinds of drawings by name, and what each of them asks for."""

from __future__ import annotations

from torchsynth._typing import Image
from torchsynth.codebook import Codebook, trainings
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.recipe import Recipe
from torchsynth.result import Result, check_sources, check_straight
from torchsynth.viz.coverage import draw_coverage
from torchsynth.viz.lettering import check_matplotlib
from torchsynth.viz.maps import draw_cost, draw_field, draw_patches, draw_sources
from torchsynth.viz.sheet import draw_sheet
from torchsynth.viz.strip import draw_pyramid
from torchsynth.viz.tree import draw_tree
from torchsynth.yaml_text import suggestion

KINDS = ("patches", "sources", "field", "cost", "coverage", "pyramid", "tree", "sheet", "animation")
"""What can be drawn; an animation is recorded with :class:`torchsynth.viz.Recorder`."""

OF_OUTPUT_SIZE = ("patches", "sources", "field")
"""Drawings that have the output's height and width."""

_WITH_WORDS = ("cost", "coverage", "tree", "sheet")
_WITH_SOURCES = ("patches", "sources", "coverage")


def draw(kind: str, result: Result, controls: Controls, codebook: Codebook | None = None) -> Image:
    """Draw one of :data:`torchsynth.viz.kinds.KINDS`.

    Args:
        kind: Which drawing.
        result: The finished synthesis.
        controls: What was pinned down of it.
        codebook: For ``tree``: the trees that were searched.

    Returns:
        ``(B, 3, H, W)``, one drawing for each output.

    Raises:
        InputError: If there is no such drawing, or it cannot be drawn of this result.

    Example:
        >>> import torch, torchsynth as ts
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (8, 8), ts.recipes.ashikhmin())
        >>> draw("sources", result, ts.Controls()).shape
        torch.Size([1, 3, 8, 8])
    """
    check_drawable(kind, result.recipe, controls)
    simple = {"patches": draw_patches, "sources": draw_sources, "cost": draw_cost, "pyramid": draw_pyramid}
    if kind in simple:
        return simple[kind](result)
    if kind == "coverage":
        return draw_coverage(result, controls.hole)
    if kind == "sheet":
        return draw_sheet(result, controls)
    outputs, _, height, width = result.image.shape
    if kind == "field":
        drawing = draw_field(controls.angle, controls.scale, (height, width))
        return drawing.expand(outputs, -1, -1, -1)
    if kind == "tree" and codebook is not None:
        return _drawn_tree(result, codebook)
    missing = "no codebook is given" if kind == "tree" else "the synthesis is finished"
    raise InputError(
        f"figure {kind}", "needs more than the result", missing,
        "pass codebook=ts.train(...)" if kind == "tree" else "pass ts.viz.Recorder() as its progress",
    )  # fmt: skip


def check_drawable(kind: str, recipe: Recipe, controls: Controls) -> None:
    """There must be such a drawing, and something to draw.

    Args:
        kind: Which drawing.
        recipe: How the output is made.
        controls: What is pinned down of it.

    Raises:
        InputError: If there is not, or if matplotlib is missing and needed.

    Example:
        >>> from torchsynth import recipes
        >>> check_drawable("patches", recipes.ashikhmin(), Controls())
    """
    if kind not in KINDS:
        raise InputError(
            "figure", f"must be one of {', '.join(KINDS)}", f"it is {kind!r}", suggestion(kind, KINDS)
        )
    if kind == "patches":
        check_straight("figure patches", controls.distorts)
    if kind in _WITH_SOURCES:
        check_sources(recipe, f"figure {kind}")
    if kind == "field" and not controls.distorts:
        raise InputError(
            "figure", "field can be drawn where there is one", "neither angle nor scale is given",
            "give one of them, or draw something else",
        )  # fmt: skip
    if kind == "tree":
        _check_tree(recipe)
    if kind in _WITH_WORDS:
        check_matplotlib(f"figure {kind}")


def _check_tree(recipe: Recipe) -> None:
    fact = None
    if not trainings(recipe):
        fact = f"the recipe {recipe.name!r} has no tsvq search"
    elif recipe.structure is not None:
        fact = f"the recipe {recipe.name!r} makes its own guide, and its trees with it"
    elif recipe.channels == "separate":
        fact = f"the recipe {recipe.name!r} has other trees for each channel"
    if fact is not None:
        raise InputError("figure", "tree can be drawn of one tree of TSVQ", fact, "use e.g. wei_levoy_tsvq")


def _drawn_tree(result: Result, codebook: Codebook) -> Image:
    """The tree of the finest level that has one."""
    level = trainings(result.recipe)[0].level
    drawing = draw_tree(codebook, level, channels=result.image.shape[1])
    return drawing if len(drawing) > 1 else drawing.expand(len(result.image), -1, -1, -1)
