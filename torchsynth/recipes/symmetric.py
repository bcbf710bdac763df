"""Random order and distorted synthesis, from the report on both algorithms."""

from __future__ import annotations

from typing import Literal

from torchsynth.initial import Noise, RandomSource
from torchsynth.lattice import Boundary
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe
from torchsynth.recipes.building import search_named
from torchsynth.schedule import Shuffle, Simultaneous
from torchsynth.search import Coherence
from torchsynth.sweep import Sweep
from torchsynth.template import Square


def random_order(
    *,
    levels: int = 4,
    neighborhood: int = 7,
    parent: int = 5,
    search: Literal["exhaustive", "tsvq", "coherence"] = "exhaustive",
    order_seed: int = 0,
    boundary: Boundary = "torus",
) -> Recipe:
    """Synthesis in random order, in two passes for each level.

    The first pass matches on the coarser level alone (the coarsest level on the noise), all pixels at
    once; the second visits them in random order, with the square neighborhood and the coarser level.
    No direction is favored, so it is the order for distorted synthesis.

    Args:
        levels: Pyramid levels, 1 or more.
        neighborhood: Side of the square neighborhood in pixels, odd, 3 or more.
        parent: Side of the square on the next coarser level, odd.
        search: How candidates are found.
        order_seed: Which random order; it is the same for all outputs of a batch.
        boundary: ``torus`` or ``open``.

    Raises:
        ConfigError: If there is no such search.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        The report on both algorithms, section 3; the order from Wei & Levoy 2001, *Texture synthesis
        over arbitrary manifold surfaces*.

    Example:
        >>> [sweep.order.kind for sweep in random_order().sweeps]
        ['simultaneous', 'simultaneous', 'shuffle']
    """
    coarse = Layer(plane="coarse", template=Square(size=parent))
    result = Layer(plane="result", template=Square(size=neighborhood, center=False))
    chosen = search_named(search, coherence=Coherence(template=Square(size=neighborhood)))
    on_noise = Sweep(layers=(result,), search=chosen, order=Simultaneous(), levels="coarsest")
    on_coarse = Sweep(layers=(coarse,), search=chosen, order=Simultaneous(), levels="finer")
    shuffled = Sweep(layers=(result, coarse), search=chosen, order=Shuffle(seed=order_seed))
    return Recipe(
        name="random_order",
        description="Random order in two passes for each level",
        levels=levels,
        boundary=boundary,
        initial=RandomSource() if search == "coherence" else Noise(),
        sweeps=(on_noise, on_coarse, shuffled),
    )


def distorted(
    *,
    levels: int = 3,
    neighborhood: int = 9,
    parent: int = 5,
    search: Literal["exhaustive", "tsvq", "coherence"] = "exhaustive",
    order_seed: int = 0,
    boundary: Boundary = "open",
) -> Recipe:
    """Random order with what suits a field of angles and scales: larger squares, an open boundary.

    The field itself is a control of the output, see :class:`torchsynth.Controls`: any recipe can be
    distorted, but causal ones favor a direction that the field then turns.

    Args:
        levels: As for :func:`random_order`; fewer, since coarse levels show less of the field.
        neighborhood: As for :func:`random_order`; larger, since a turned small square is a coarse one.
        parent: As for :func:`random_order`.
        search: As for :func:`random_order`.
        order_seed: As for :func:`random_order`.
        boundary: ``open``, as fields seldom tile; or ``torus``.

    Raises:
        ConfigError: If there is no such search.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        The report on both algorithms, section 3.1.

    Example:
        >>> distorted().boundary
        'open'
    """
    recipe = random_order(
        levels=levels, neighborhood=neighborhood, parent=parent, search=search, order_seed=order_seed,
        boundary=boundary,
    )  # fmt: skip
    return recipe.changed(name="distorted", description="Random order, for fields of angle and scale")
