"""Algorithms that copy patches: Efros & Freeman 2001, and Kwatra et al. 2003."""

from __future__ import annotations

from torchsynth.lattice import Boundary
from torchsynth.patches import GraphCut, Quilting
from torchsynth.recipe import Recipe


def quilting(
    *,
    block: int = 36,
    overlap: int | None = None,
    tolerance: float = 0.1,
    verbatim: bool = False,
    boundary: Boundary = "open",
) -> Recipe:
    """Efros & Freeman's image quilting: square blocks, cut where they differ least.

    Args:
        block: Side of the blocks in pixels, 3 or more. It should hold the texture's structures; larger
            blocks copy more of the exemplar verbatim. Each has to lie in the exemplar as a whole.
        overlap: How far blocks overlap, less than half a block; None means a sixth of it.
        tolerance: How much worse than the best a block may fit, as a share of its error. Larger values
            repeat less and show more seams.
        verbatim: Whether a block that continues its neighbors perfectly leaves no choice, as in the paper:
            then whole regions are copied.
        boundary: ``open`` for output with borders; ``torus`` for output that tiles, of a block's side or more.

    Raises:
        pydantic.ValidationError: If the block is too small, the overlap too wide, or the tolerance below 0.

    Source:
        A. Efros and W. Freeman, *Image quilting for texture synthesis and transfer*, SIGGRAPH 2001, section 2.
        That outputs tile is no part of the paper.

    Example:
        >>> quilting(block=30).patches.sides()
        ((30, 5),)
    """
    return Recipe(
        name="quilting",
        description="Efros & Freeman 2001, blocks cut where they differ least",
        levels=1,
        boundary=boundary,
        patches=Quilting(block=block, overlap=overlap, tolerance=tolerance, verbatim=verbatim),
    )


def quilting_transfer(
    *,
    passes: int = 3,
    block: int = 36,
    overlap: int | None = None,
    tolerance: float = 0.1,
    boundary: Boundary = "open",
) -> Recipe:
    """Efros & Freeman's texture transfer: a picture rendered in the texture of the exemplar.

    The blocks follow the target's light and color as far as the exemplar has them, first of all where they
    lie, and from pass to pass more how they fit each other.

    Args:
        passes: From 1 to 20, each with blocks a third smaller than the one before.
        block: Side of the first pass's blocks in pixels.
        overlap: How far those overlap, less than half a block; None means a sixth of it.
        tolerance: As for :func:`quilting`.
        boundary: ``open`` or ``torus``.

    Raises:
        pydantic.ValidationError: If a block is smaller than 3 in any pass, the overlap too wide, or the
            tolerance below 0.

    Source:
        Efros & Freeman 2001, section 3. The target itself is compared, not another map of it.

    Example:
        >>> quilting_transfer(block=27).patches.sides()
        ((27, 4), (18, 3), (12, 2))
    """
    return Recipe(
        name="quilting_transfer",
        description="Efros & Freeman 2001, texture transfer to a target",
        levels=1,
        boundary=boundary,
        patches=Quilting(block=block, overlap=overlap, tolerance=tolerance, passes=passes),
    )


def graphcut(
    *,
    patch: int | None = None,
    overlap: float = 0.25,
    k: float = 0.01,
    refinements: int = 12,
    boundary: Boundary = "open",
) -> Recipe:
    """Kwatra et al.'s graph-cut textures: large patches with seams of any shape.

    It needs SciPy: ``pip install "torchsynth-textures[graphcut]"``.

    Args:
        patch: Side of the patches in pixels, 3 or more; None means the whole exemplar, which holds most together.
            Time grows faster than a patch's area: set it for exemplars of more than about 200 pixels.
        overlap: Share of a patch that has to lie on what is covered already, up to 0.9.
        k: How choosy patches are about their place, from 0.001 (the best one) to 1 (nearly any).
        refinements: How many further patches mend the worst seams.
        boundary: ``open`` or ``torus``.

    Raises:
        pydantic.ValidationError: If one of them is out of range.

    Source:
        V. Kwatra, A. Schoedl, I. Essa, G. Turk and A. Bobick, *Graphcut textures: image and video synthesis
        using graph cuts*, SIGGRAPH 2003: sections 3 and 3.1 for the seams, 4 for the places, 5 for the
        cost of a seam.

    Example:
        >>> graphcut(patch=64).patches.patch
        64
    """
    return Recipe(
        name="graphcut",
        description="Kwatra et al. 2003, large patches cut along minimal seams",
        levels=1,
        boundary=boundary,
        patches=GraphCut(patch=patch, overlap=overlap, k=k, refinements=refinements),
    )
