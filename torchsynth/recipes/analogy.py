"""Image analogies: a texture, filter or map is carried over from one pair of pictures to another."""

from __future__ import annotations

from typing import Literal

from torchsynth.initial import Noise, RandomSource
from torchsynth.lattice import Boundary
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe
from torchsynth.recipes.building import causal_layers, search_named
from torchsynth.search import TSVQ, Coherence, Exhaustive, PreferCoherent
from torchsynth.sweep import Sweep
from torchsynth.template import Causal, Square


def analogy(
    *,
    levels: int = 3,
    neighborhood: int = 5,
    parent: int = 3,
    guide: int = 5,
    coarse_guide: int | None = 3,
    kappa: float = 0.5,
    guide_weight: int = 1,
    search: Literal["exhaustive", "tsvq", "coherence"] = "exhaustive",
    boundary: Boundary = "open",
) -> Recipe:
    """Image analogies: A is to A' as B is to B', where B' is the output.

    How the paper's sections map to parts: A and B are guides, A' is the exemplar; the features (3.1) are four
    layers: A' and B' at this level, as far as they are synthesized, and one level up, A and B whole at both;
    ``BestApproximateMatch`` is the search, and ``BestCoherenceMatch`` with its factor ``PreferCoherent``.

    Args:
        levels: Pyramid levels, 1 or more; 1 is single resolution.
        neighborhood: Side of the causal square on B' and A', odd, 3 or more. Larger keeps larger structures of
            A', and takes longer.
        parent: Side of the square on their next coarser level, odd.
        guide: Side of the square on B and A, odd; 1 compares only the pixel itself, as for label maps.
        coarse_guide: Side of the square on their next coarser level, odd; None leaves it out.
        kappa: How strongly continued patches are preferred at the finest level; half as much with each
            coarser one. 0 does without. See :class:`torchsynth.PreferCoherent`.
        guide_weight: How much each squared difference of the guides counts. Visible effect: more follows B
            more closely, with less of the texture of A'.
        search: ``exhaustive``, ``tsvq`` (for large A), or ``coherence``, which tries continuations only: fast,
            but slow to find what B asks for.
        boundary: ``open``, as for photographs; ``torus`` if B tiles.

    Raises:
        ConfigError: If there is no such search.
        pydantic.ValidationError: If a size is even or too small.

    Source:
        A. Hertzmann, C. Jacobs, N. Oliver, B. Curless, D. Salesin, *Image analogies*, SIGGRAPH 2001. The
        paper's Gaussian weights of the neighbors are not used: all count the same.

    Example:
        >>> [layer.plane for layer in analogy().sweeps[0].layers]
        ['result', 'coarse', 'guide', 'coarse_guide']
    """
    upon = Layer(plane="guide", template=Square(size=guide), weight=guide_weight)
    layers: tuple[Layer, ...] = (*causal_layers(neighborhood, parent if levels > 1 else None), upon)
    if coarse_guide is not None and levels > 1:
        above = Layer(plane="coarse_guide", template=Square(size=coarse_guide), weight=guide_weight)
        layers = (*layers, above)
    chosen = search_named(search, coherence=Coherence(template=Causal(size=neighborhood)))
    if isinstance(chosen, Exhaustive | TSVQ):
        sweeps = _searching_sweeps(layers, chosen, neighborhood, levels, kappa)
    else:
        sweeps = _coherent_sweeps(layers, neighborhood, levels)
    return Recipe(
        name="analogy",
        description="Hertzmann et al. 2001, image analogies",
        levels=levels,
        boundary=boundary,
        initial=RandomSource() if isinstance(chosen, Coherence) else Noise(),
        sweeps=sweeps,
    )


def _coherent_sweeps(layers: tuple[Layer, ...], neighborhood: int, levels: int) -> tuple[Sweep, ...]:
    """Continuations only; on finer levels also of what a pixel inherits from its parent."""
    coarsest = Coherence(template=Causal(size=neighborhood))
    finer = Coherence(template=Square(size=neighborhood))
    first = Sweep(layers=layers, search=coarsest, levels="coarsest")
    return (first,) if levels == 1 else (first, Sweep(layers=layers, search=finer, levels="finer"))


def _searching_sweeps(
    layers: tuple[Layer, ...], search: Exhaustive | TSVQ, neighborhood: int, levels: int, kappa: float
) -> tuple[Sweep, ...]:
    """The search, with a preference that is halved with each coarser level."""
    if kappa == 0:
        return (Sweep(layers=layers, search=search),)
    template = Causal(size=neighborhood)
    return tuple(
        Sweep(
            layers=layers,
            search=PreferCoherent(best=search, template=template, kappa=kappa / 2**level),
            levels=(level,),
        )
        for level in reversed(range(levels))
    )
