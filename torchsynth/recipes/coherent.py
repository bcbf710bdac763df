"""Ashikhmin 2001: coherent candidates."""

from __future__ import annotations

from typing import Literal

from torchsynth.following import with_target
from torchsynth.initial import RandomSource
from torchsynth.lattice import Boundary
from torchsynth.neighborhood import Layer
from torchsynth.recipe import Recipe
from torchsynth.recipes.building import causal_layers
from torchsynth.search import Coherence
from torchsynth.sweep import Sweep
from torchsynth.template import Causal, Square


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
        spare_bottom: Take candidates near the exemplar's bottom less often. Visible effect: features there
            are repeated less, and patches are smaller.
        blur_seams: Blur the finished picture along the boundaries of its patches, with a kernel of so many
            pixels, e.g. 3. None leaves every pixel a copy.
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
        layers=causal_layers(neighborhood, None),
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
        layers=causal_layers(neighborhood, None),
        search=Coherence(template=Causal(size=neighborhood)),
        unknown=unknown,
        levels="coarsest",
    )
    finer = Sweep(
        layers=causal_layers(neighborhood, parent),
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
