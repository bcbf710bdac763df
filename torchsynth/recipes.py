"""The recipes: one short function for each published algorithm, in terms of the library's parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from torchsynth.errors import ConfigError
from torchsynth.following import with_target as with_target
from torchsynth.initial import Noise, RandomSource
from torchsynth.lattice import Boundary
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe
from torchsynth.schedule import Shuffle, Simultaneous
from torchsynth.search import TSVQ, Coherence, Exhaustive, Search
from torchsynth.sweep import Sweep
from torchsynth.template import Causal, Square


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


def ashikhmin(
    *,
    neighborhood: int = 5,
    noise: bool = True,
    tileable: bool = True,
    spare_bottom: bool = False,
    blur_seams: int | None = None,
    boundary: Boundary = "torus",
) -> Recipe:
    """Ashikhmin's synthesis of natural textures: patches of the exemplar, grown pixel by pixel.

    How the paper's sections map to parts: the array of original positions (3) to ``RandomSource``; the
    shifted candidates to ``Coherence``; the L-shape to one causal layer; tileability to one more sweep,
    over the last rows and then once more over the first.

    Args:
        neighborhood: Side of the causal square in pixels, odd, 3 or more. Larger ones tell candidates
            better apart, which smoother textures need: 9 or more.
        noise: Whether pixels that are not synthesized yet are compared, as the noise they are, and offer
            candidates: as in the paper. Without noise they are left out: the first rows are then clean, but
            one large copy from the exemplar.
        tileable: Whether the last rows see the first ones, and the first ones are visited again; an
            open boundary never tiles.
        spare_bottom: See :class:`torchsynth.Coherence`.
        blur_seams: See :class:`torchsynth.Recipe`.
        boundary: ``torus`` or ``open``.

    Raises:
        pydantic.ValidationError: If the size is even or too small.

    Source:
        M. Ashikhmin, *Synthesizing natural textures*, I3D 2001, section 3.

    Example:
        >>> [sweep.rows for sweep in ashikhmin(neighborhood=5).sweeps]
        [(0, -2), (-2, 2)]
    """
    first = Sweep(
        layers=_causal_layers(neighborhood, None),
        search=Coherence(template=Causal(size=neighborhood), spare_bottom=spare_bottom),
        unknown="read" if noise else "skip",
    )
    return Recipe(
        name="ashikhmin",
        description="Ashikhmin 2001, coherent candidates",
        levels=1,
        boundary=boundary,
        initial=RandomSource(),
        sweeps=_tileable(first, neighborhood) if tileable and boundary == "torus" else (first,),
        blur_seams=blur_seams,
    )


def ashikhmin_multires(
    *,
    levels: int = 3,
    neighborhood: int = 5,
    parent: int = 3,
    noise: bool = True,
    boundary: Boundary = "torus",
) -> Recipe:
    """Ashikhmin's synthesis on several levels, each beginning with the sources of the coarser one.

    Smoother textures gain from it: the coarse levels hold the large structures, and the sources that
    every pixel inherits from its parent are candidates too.

    Args:
        levels: Pyramid levels, 1 or more.
        neighborhood: Side of the causal square in pixels, odd, 3 or more.
        parent: Side of the square on the next coarser level, odd.
        noise: As for :func:`ashikhmin`.
        boundary: ``torus`` or ``open``.

    Raises:
        pydantic.ValidationError: If a size is even or too small.

    Source:
        Ashikhmin 2001, section 3; the report on both algorithms, section 2.2 e.

    Example:
        >>> [sweep.levels for sweep in ashikhmin_multires(levels=3).sweeps]
        ['coarsest', 'finer']
    """
    unknown: Literal["read", "skip"] = "read" if noise else "skip"
    coarsest = Sweep(
        layers=_causal_layers(neighborhood, None),
        search=Coherence(template=Causal(size=neighborhood)),
        unknown=unknown,
        levels="coarsest",
    )
    finer = Sweep(
        layers=_causal_layers(neighborhood, parent),
        search=Coherence(template=Square(size=neighborhood)),
        unknown=unknown,
        levels="finer",
    )
    return Recipe(
        name="ashikhmin_multires",
        description="Ashikhmin 2001, on several levels",
        levels=levels,
        boundary=boundary,
        initial=RandomSource(),
        sweeps=(coarsest, finer),
    )


def ashikhmin_target(
    *, passes: int = 1, neighborhood: int = 5, noise: bool = True, boundary: Boundary = "torus"
) -> Recipe:
    """Ashikhmin's user control: a texture that follows a painted target.

    Args:
        passes: From 1 to 20. More passes come closer to the target, and flatten its areas of one color.
        neighborhood: Side of the square in pixels, odd, 3 or more.
        noise: As for :func:`ashikhmin`.
        boundary: ``torus`` or ``open``.

    Raises:
        ConfigError: If there are fewer than 1 or more than 20 passes.
        pydantic.ValidationError: If the size is even or too small.

    Source:
        Ashikhmin 2001, section 4.

    Example:
        >>> [layer.plane for layer in ashikhmin_target().sweeps[0].layers]
        ['result', 'target']
    """
    plain = ashikhmin(neighborhood=neighborhood, noise=noise, tileable=False, boundary=boundary)
    named = {"name": "ashikhmin_target", "description": "Ashikhmin 2001, following a painted target"}
    return with_target(plain, passes=passes).changed(**named)


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
    searches: dict[str, Search] = {
        "exhaustive": Exhaustive(),
        "tsvq": TSVQ(),
        "coherence": Coherence(template=Square(size=neighborhood)),
    }
    if search not in searches:
        raise ConfigError(
            "search", f"must be one of {', '.join(searches)}", f"it is {search!r}", "choose one of them"
        )
    chosen = searches[search]
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


RECIPES: dict[str, Callable[[], Recipe]] = {
    "wei_levoy": wei_levoy,
    "wei_levoy_single": wei_levoy_single,
    "wei_levoy_tsvq": wei_levoy_tsvq,
    "ashikhmin": ashikhmin,
    "ashikhmin_multires": ashikhmin_multires,
    "ashikhmin_target": ashikhmin_target,
    "random_order": random_order,
    "distorted": distorted,
}
"""The recipes by name, with their default parameters."""


def _causal_sweeps(
    levels: int, neighborhood: int | Sequence[int], parent: int | Sequence[int]
) -> tuple[Sweep, ...]:
    """One sweep for all levels, or one for each where the sizes differ."""
    if isinstance(neighborhood, int) and isinstance(parent, int):
        return (Sweep(layers=_causal_layers(neighborhood, parent)),)
    causal = _per_level("neighborhood", neighborhood, levels)
    square = _per_level("parent", parent, levels - 1)
    if levels == 1:
        return (Sweep(layers=_causal_layers(causal[0], None)),)
    parents = (None, *square)
    return tuple(
        Sweep(layers=_causal_layers(side, above), levels=(levels - 1 - steps,))
        for steps, (side, above) in enumerate(zip(causal, parents, strict=True))
    )


def _tileable(first: Sweep, neighborhood: int) -> tuple[Sweep, ...]:
    """Leave the last rows to a sweep that sees the first ones, and visits those again."""
    rim = neighborhood // 2
    square = Square(size=neighborhood, center=False)
    coherent = first.search.model_copy(update={"template": square})
    around = {
        "layers": (Layer(plane="result", template=square),),
        "search": coherent,
        "unknown": "skip",
        "rows": (-rim, rim),
    }
    return first.model_copy(update={"rows": (0, -rim)}), first.model_copy(update=around)


def _causal_layers(neighborhood: int, parent: int | None) -> tuple[Layer, ...]:
    causal = Layer(plane="result", template=Causal(size=neighborhood))
    if parent is None:
        return (causal,)
    return causal, Layer(plane="coarse", template=Square(size=parent))


def _per_level(name: str, sizes: int | Sequence[int], levels: int) -> tuple[int, ...]:
    sides = (sizes,) * levels if isinstance(sizes, int) else tuple(sizes)
    if len(sides) != levels:
        raise ConfigError(
            name, f"must be one size, or {levels}: one for each level it is used on",
            f"there are {len(sides)}", "list them from the coarsest level to the finest",
        )  # fmt: skip
    return sides
