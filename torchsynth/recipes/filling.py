"""Growing from what is known: Efros & Leung 1999, and other ways to fill holes in the same order."""

from __future__ import annotations

from typing import Literal

from torchsynth.accept import WithinTolerance
from torchsynth.errors import ConfigError
from torchsynth.initial import Noise, SeedPatch
from torchsynth.lattice import Boundary
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe
from torchsynth.recipes.building import search_named
from torchsynth.schedule import OnionPeel
from torchsynth.search import Coherence
from torchsynth.sweep import Sweep
from torchsynth.template import Square

_WINDOWS_PER_SIGMA = 6.4


def efros_leung(
    *,
    window: int = 11,
    epsilon: float = 0.1,
    sigma: float | None = None,
    pick: Literal["uniform", "distance"] = "uniform",
    max_error: float | None = 0.3,
    growth: float = 1.1,
    seed_size: int = 3,
    order_seed: int = 0,
    channels: Literal["joint", "separate"] = "joint",
    boundary: Boundary = "open",
) -> Recipe:
    """Efros & Leung's non-parametric sampling: grown from a seed, or from what is known around a hole.

    How the paper's sections map to parts: the Gaussian-weighted window of known pixels (2.1, 2.2) to a
    square layer with ``sigma`` that skips what is unknown; all matches nearly as good as the best, one of
    them at random (2.1), to ``WithinTolerance``; layers outward from a 3x3 seed, or inward from a hole's
    edge (2.2), to ``SeedPatch`` and ``OnionPeel``.

    Args:
        window: Side of the window in pixels, odd, 3 or more; the paper's one important parameter. It
            should be as large as the largest regular feature: smaller gives more random textures, and
            time grows with its area.
        epsilon: How much worse than the best match one may be, as a share of its squared difference.
        sigma: Standard deviation of the window's weights in pixels; None means ``window / 6.4``.
        pick: ``uniform``, or ``distance`` to favor nearer matches.
        max_error: Mean squared difference from which on a pixel rather waits; None never waits.
        growth: By what that is multiplied when a whole layer waits.
        seed_size: Side of the random patch of the exemplar to grow from, where no hole is filled.
        order_seed: In which order pixels with equally many known neighbors come.
        channels: ``joint``, or ``separate`` to grow each channel by itself as in the notes.
        boundary: ``open``, or ``torus`` for outputs that tile.

    Raises:
        pydantic.ValidationError: If a size is even or too small, or a number out of its range.

    Source:
        A. Efros and T. Leung, *Texture synthesis by non-parametric sampling*, ICCV 1999; ``max_error`` and
        the order within a layer from the GrowImage notes on it.

    Example:
        >>> efros_leung(window=15).sweeps[0].layers[0].template.size
        15
    """
    falloff = window / _WINDOWS_PER_SIGMA if sigma is None else sigma
    grown = Sweep(
        layers=(Layer(plane="result", template=Square(size=window, center=False), sigma=falloff),),
        order=OnionPeel(seed=order_seed),
        accept=WithinTolerance(epsilon=epsilon, pick=pick, max_error=max_error, growth=growth),
        unknown="skip",
    )
    return Recipe(
        name="efros_leung",
        description="Efros & Leung 1999, grown from a seed or into a hole",
        levels=1,
        boundary=boundary,
        initial=SeedPatch(size=seed_size),
        sweeps=(grown,),
        channels=channels,
    )


def wei_levoy_fill(
    *,
    levels: int = 3,
    neighborhood: int = 9,
    parent: int = 5,
    search: Literal["exhaustive", "tsvq"] = "exhaustive",
    order_seed: int = 0,
    boundary: Boundary = "open",
) -> Recipe:
    """Wei & Levoy's constrained synthesis: a hole filled at several resolutions, coarse to fine.

    Each level is filled twice from the hole's edge inwards: first with what is known of the square
    neighborhood, then with all of it; both times with the coarser level. A coarse pixel is known only if
    nothing of the hole was blended into it.

    Args:
        levels: Pyramid levels, 1 or more. The picture must be known somewhere at each of them.
        neighborhood: Side of the square neighborhood in pixels, odd, 3 or more.
        parent: Side of the square on the next coarser level, odd.
        search: How matches are found.
        order_seed: In which order pixels with equally many known neighbors come.
        boundary: ``open`` for pictures with borders, ``torus`` for pictures that tile.

    Raises:
        ConfigError: If there is no such search.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        Wei & Levoy 2000, on constrained synthesis; the order is Efros & Leung's.

    Example:
        >>> [sweep.unknown for sweep in wei_levoy_fill().sweeps]
        ['skip', 'read']
    """
    first = Sweep(
        layers=(
            Layer(plane="result", template=Square(size=neighborhood, center=False)),
            Layer(plane="coarse", template=Square(size=parent)),
        ),
        search=search_named(search),
        order=OnionPeel(seed=order_seed),
        unknown="skip",
    )
    return Recipe(
        name="wei_levoy_fill",
        description="Wei & Levoy 2000, constrained: holes filled at several resolutions",
        levels=levels,
        boundary=boundary,
        initial=Noise(),
        sweeps=(first, first.model_copy(update={"unknown": "read"})),
    )


def coherent_fill(
    *,
    levels: int = 3,
    neighborhood: int = 7,
    parent: int = 3,
    passes: int = 2,
    order_seed: int = 0,
    boundary: Boundary = "open",
) -> Recipe:
    """Fill a hole by continuing the patches around it: fast, whatever the size of picture and hole.

    Ashikhmin's candidates in the onion's order: each pixel continues one of its neighbors' patches, of
    which those at the hole's edge are the surroundings themselves. The coarser level guides the finer
    one, at half the weight of its own level, so that seams do not gather at the hole's edge.

    Args:
        levels: Pyramid levels, 1 or more. The picture must be known somewhere at each of them. Visible
            effect: more carry larger structures, such as rows of bricks, further into the hole.
        neighborhood: Side of the square neighborhood in pixels, odd, 3 or more.
        parent: Side of the square on the next coarser level, odd.
        passes: How often each level is filled: once with what is known, then with all of it.
        order_seed: In which order pixels with equally many known neighbors come.
        boundary: ``open`` for pictures with borders, ``torus`` for pictures that tile.

    Raises:
        ConfigError: If there is no pass.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        Ashikhmin 2001, sections 3 and 4, in the order of Efros & Leung 1999, section 2.2.

    Example:
        >>> len(coherent_fill(passes=3).sweeps)
        3
    """
    if passes < 1:
        raise ConfigError("passes", "must be 1 or more", f"it is {passes}", "fill at least once")
    first = Sweep(
        layers=(
            Layer(plane="result", template=Square(size=neighborhood, center=False), weight=2),
            Layer(plane="coarse", template=Square(size=parent)),
        ),
        search=Coherence(template=Square(size=neighborhood, center=False)),
        order=OnionPeel(seed=order_seed),
        unknown="skip",
    )
    # A pixel's own source competes too, once it has one.
    again = first.model_copy(
        update={"search": Coherence(template=Square(size=neighborhood)), "unknown": "read"}
    )
    return Recipe(
        name="coherent_fill",
        description="Holes filled by continuing the patches around them; fast",
        levels=levels,
        boundary=boundary,
        initial=Noise(),
        sweeps=(first, *(again,) * (passes - 1)),
    )
