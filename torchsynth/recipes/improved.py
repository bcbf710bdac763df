"""The improved Wei-Levoy algorithm: weighting, non-causal passes, and morphology with an analogy."""

from __future__ import annotations

from typing import Literal

from torchsynth.lattice import Boundary
from torchsynth.morphology import Operation
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe, Structure
from torchsynth.recipes.building import causal_layers
from torchsynth.sweep import Sweep
from torchsynth.template import Causal, Square


def improved_wl(
    *,
    weighting: bool = True,
    noncausal: bool = True,
    morphology: bool = True,
    levels: int = 4,
    neighborhood: int = 9,
    parent: int = 5,
    operation: Literal[Operation, "auto"] = "auto",
    size: int | Literal["auto"] = "auto",
    boundary: Boundary = "torus",
) -> Recipe:
    """Wei & Levoy's algorithm, improved for textures of many similar, irregular objects.

    How the paper's sections map to parts: morphology and analogy (4.1, M) to ``Structure`` and a sweep that
    compares guides; non-causal neighborhoods (4.2, N) to two more sweeps for each level; weighted matching
    (4.3, W) to the weight of the coarse layer and ``dynamic_range``.

    Args:
        weighting: Count the coarser level twice, and stretch all levels to one dynamic range. Visible effect:
            structures laid out on coarse levels are kept.
        noncausal: Let the last rows of a level see its first ones, and these the last; then visit all pixels
            again with the square around them. Visible effect: outputs that tile top to bottom, and fewer stray
            pixels. That the first rows are visited again before the rest, and once more after
            ``morphology``, is no part of the paper.
        morphology: Synthesize the exemplar with widened edges first, and be guided by that. Visible effect:
            objects with thin joints, such as the stones of a wall, stay whole.
        levels: Pyramid levels, 1 or more.
        neighborhood: Side of the causal square, and of the square around a pixel, odd, 3 or more.
        parent: Side of the square on the next coarser level, odd.
        operation: For ``morphology``: ``erode`` widens dark edges, ``dilate`` bright ones, ``auto`` the thinner
            of both.
        size: For ``morphology``: the side of the square; the paper has 5 for all textures.
        boundary: ``torus`` or ``open``.

    Raises:
        pydantic.ValidationError: If a size is even or too small.

    Source:
        *An improved texture synthesis algorithm using morphological processing with image analogy*, sections
        4 and 5.

    Example:
        >>> improved_wl().structure.recipe.dynamic_range
        'finest'
        >>> len(improved_wl(weighting=False, morphology=False).sweeps)
        3
    """
    switches = {"W": weighting, "N": noncausal, "M": morphology}
    letters = "+".join(letter for letter, on in switches.items() if on) or "plain"
    description = f"Wei & Levoy 2000, improved ({letters})"
    plain = Recipe(
        name="structure",
        levels=levels,
        boundary=boundary,
        dynamic_range="finest" if weighting else "own",
        sweeps=_sweeps(neighborhood, parent, 2 if weighting else 1, noncausal, boundary),
    )
    if not morphology:
        return plain.changed(name="improved_wl", description=description)
    structure = Structure(operation=operation, size=size, recipe=plain)
    sweeps = _guided_sweeps(neighborhood, tileable=noncausal and boundary == "torus")
    return Recipe(
        name="improved_wl",
        description=description,
        levels=1,
        boundary=boundary,
        structure=structure,
        sweeps=sweeps,
    )


def _guided_sweeps(neighborhood: int, tileable: bool) -> tuple[Sweep, ...]:
    """The analogy: a causal sweep; or one that leaves the last rows to another, which sees the first ones.

    That goes on to the first rows: else the analogy would undo what the structure has of a seam that fits.
    """
    guide = Layer(plane="guide", template=Square(size=neighborhood))
    first = Sweep(layers=(Layer(plane="result", template=Causal(size=neighborhood)), guide))
    if not tileable:
        return (first,)
    rim = neighborhood // 2
    around = Layer(plane="result", template=Square(size=neighborhood, center=False))
    mending = Sweep(layers=(around, guide), rows=(-rim, rim), unknown="skip")
    return first.model_copy(update={"rows": (0, -rim)}), mending


def _sweeps(
    neighborhood: int, parent: int, weight: int, noncausal: bool, boundary: Boundary
) -> tuple[Sweep, ...]:
    """A causal sweep; or one that leaves the last rows to another, which sees the first, and one over all."""
    causal, coarse = causal_layers(neighborhood, parent)
    coarse = coarse.model_copy(update={"weight": weight})
    first = Sweep(layers=(causal, coarse))
    if not noncausal:
        return (first,)
    around = Layer(plane="result", template=Square(size=neighborhood, center=False))
    again = Sweep(layers=(around, coarse))
    if boundary == "open":
        return first, again
    rim = neighborhood // 2
    # It goes on to the first rows: they met noise where the last ones are now, and else both would have to
    # give way in the sweep over all.
    last = again.model_copy(update={"rows": (-rim, rim), "unknown": "skip"})
    return first.model_copy(update={"rows": (0, -rim)}), last, again
