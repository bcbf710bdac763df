"""Wei & Levoy 2000, and its acceleration."""

from __future__ import annotations

from collections.abc import Sequence

from torchsynth.lattice import Boundary
from torchsynth.recipe import Recipe
from torchsynth.recipes.building import causal_layers, per_level
from torchsynth.search import TSVQ
from torchsynth.sweep import Sweep


def wei_levoy(
    *,
    levels: int = 4,
    neighborhood: int | Sequence[int] = 9,
    parent: int | Sequence[int] = 5,
    boundary: Boundary = "torus",
) -> Recipe:
    """Wei & Levoy's multi-resolution synthesis with exhaustive search.

    How the paper's sections map to parts: the Gaussian pyramid (2.3) to ``levels``; the causal L-shape
    and the parent square (2.2, 2.3) to two layers; histogram-matched noise (2.1) to ``Noise``; raster
    order with toroidal wrap (2.1) to ``Scanline``; the best match to ``Exhaustive`` and ``Best``.

    Args:
        levels: Pyramid levels, 1 or more. Each one more doubles the largest structure that is held
            together, as long as the coarsest exemplar level still has many candidates.
        neighborhood: Side of the causal square in pixels, odd, 3 or more; one number, or one for each
            level, the coarsest first. Larger keeps larger structures and takes longer.
        parent: Side of the square on the next coarser level, odd; one number, or one for each level
            but the coarsest, coarse to fine.
        boundary: ``torus`` for output that tiles left to right (and, less perfectly, top to bottom),
            ``open`` for output with borders.

    Raises:
        ConfigError: If the numbers of levels and sizes do not agree.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        L.-Y. Wei and M. Levoy, *Fast texture synthesis using tree-structured vector quantization*,
        SIGGRAPH 2000. The report writes the sizes as {9x9}, {9x9, 5x5}, ...: causal, then parent.

    Example:
        >>> [len(layer.template.offsets()) for layer in wei_levoy().sweeps[0].layers]
        [40, 25]
        >>> len(wei_levoy(levels=3, neighborhood=(9, 9, 5), parent=(5, 3)).sweeps)
        3
    """
    return Recipe(
        name="wei_levoy",
        description="Wei & Levoy 2000, multi-resolution, exhaustive search",
        levels=levels,
        boundary=boundary,
        sweeps=_causal_sweeps(levels, neighborhood, parent),
    )


def wei_levoy_single(*, neighborhood: int = 11, boundary: Boundary = "torus") -> Recipe:
    """Wei & Levoy's single-resolution synthesis with exhaustive search.

    Args:
        neighborhood: Side of the causal square in pixels, odd, 3 or more. It has to be as large as the
            largest regular structure of the texture, which soon gets slow: see :func:`wei_levoy`.
        boundary: ``torus`` or ``open``.

    Raises:
        pydantic.ValidationError: If the size is even or too small.

    Source:
        Wei & Levoy 2000, section 2.1.

    Example:
        >>> wei_levoy_single().levels
        1
    """
    return Recipe(
        name="wei_levoy_single",
        description="Wei & Levoy 2000, single resolution, exhaustive search",
        levels=1,
        boundary=boundary,
        sweeps=_causal_sweeps(1, neighborhood, ()),
    )


def wei_levoy_tsvq(
    *,
    levels: int = 4,
    neighborhood: int | Sequence[int] = 9,
    parent: int | Sequence[int] = 5,
    depth: int | None = None,
    beam: int = 1,
    boundary: Boundary = "torus",
) -> Recipe:
    """Wei & Levoy's multi-resolution synthesis, accelerated by tree-structured vector quantization.

    All of :func:`wei_levoy`, with its search replaced (section 4 of the paper): a tree of centroids is
    trained for each level, and each pixel descends it. This pays for large exemplars.

    Args:
        levels: As for :func:`wei_levoy`.
        neighborhood: As for :func:`wei_levoy`.
        parent: As for :func:`wei_levoy`.
        depth: Depth of the trees; None goes down to leaves of up to 64 candidates. Deeper ones are faster
            to search and farther from the best match.
        beam: How many nodes a search keeps at each depth. More come closer to the best match, in
            proportion to the time.
        boundary: ``torus`` or ``open``.

    Raises:
        ConfigError: If the numbers of levels and sizes do not agree.
        pydantic.ValidationError: If a size is even or too small, or depth or beam below 1.

    Source:
        Wei & Levoy 2000, section 4.

    Example:
        >>> wei_levoy_tsvq(depth=10).sweeps[0].search.depth
        10
    """
    plain = wei_levoy(levels=levels, neighborhood=neighborhood, parent=parent, boundary=boundary)
    search = TSVQ(depth=depth, beam=beam)
    return Recipe(
        name="wei_levoy_tsvq",
        description="Wei & Levoy 2000, multi-resolution, accelerated by TSVQ",
        levels=levels,
        boundary=boundary,
        sweeps=tuple(sweep.model_copy(update={"search": search}) for sweep in plain.sweeps),
    )


def _causal_sweeps(
    levels: int, neighborhood: int | Sequence[int], parent: int | Sequence[int]
) -> tuple[Sweep, ...]:
    """One sweep for all levels, or one for each where the sizes differ."""
    if isinstance(neighborhood, int) and isinstance(parent, int):
        return (Sweep(layers=causal_layers(neighborhood, parent)),)
    causal = per_level("neighborhood", neighborhood, levels)
    square = per_level("parent", parent, levels - 1)
    if levels == 1:
        return (Sweep(layers=causal_layers(causal[0], None)),)
    parents = (None, *square)
    return tuple(
        Sweep(layers=causal_layers(side, above), levels=(levels - 1 - steps,))
        for steps, (side, above) in enumerate(zip(causal, parents, strict=True))
    )
