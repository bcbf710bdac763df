"""Image analogies: what B would look like, if it were to it as A' is to A."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.exemplar_levels import ExemplarLevels
from torchsynth.feasibility import check_candidates
from torchsynth.lattice import Shape
from torchsynth.recipe import Recipe
from torchsynth.recipes import analogy as analogy_recipe
from torchsynth.result import Result
from torchsynth.synthesis import Progress, synthesize

MOST_LABELS = 64
"""The most labels of a map; pictures with more colors are no maps."""

_WHOLE = (torch.uint8, torch.int8, torch.int16, torch.int32, torch.int64)


@dataclass(frozen=True)
class Analogy:
    """An analogy that is ready to be synthesized.

    Args:
        exemplar: A', with A as its guide.
        controls: B, as the guide of the output.
        recipe: How it is made.
    """

    exemplar: Exemplar
    controls: Controls
    recipe: Recipe

    @property
    def size(self) -> Shape:
        """Height and width of B, and so of the output."""
        assert self.controls.guide is not None, "an analogy has one"  # noqa: S101 (for the type checker)
        height, width = self.controls.guide.shape[-2:]
        return height, width


def analogy(
    a: Tensor,
    a_prime: Tensor,
    b: Tensor,
    recipe: Recipe | None = None,
    *,
    labels: bool = False,
    valid: Tensor | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Make B': A is to A' as B is to B'.

    With a picture as A and the same picture filtered as A', the filter is carried over to B. With a map of the
    parts of a texture as A and the texture as A', textures are painted by numbers: B is another map.

    Args:
        a: The picture that belongs to A', ``(G, H, W)``, float in [0, 1], or a map of whole numbers ``(H, W)``.
        a_prime: The picture that pixels are copied from, ``(C, H, W)``, of the same height and width.
        b: The picture that belongs to the output, ``(G, OH, OW)`` or ``(OH, OW)``, of the same kind as A.
        recipe: One that compares guides. None takes :func:`torchsynth.recipes.analogy`, with fewer levels if
            A is too small for them.
        labels: Take A and B for maps, in which each color is a label of its own and none is nearer to another.
            Maps of whole numbers always are.
        valid: ``(H, W)``, True where A and A' may be used; None means everywhere.
        seed: One whole number, or one for each output.
        progress: As for :func:`torchsynth.synthesize`.

    Returns:
        The output, of B's height and width; every pixel is copied from A'.

    Raises:
        InputError: If A and A' differ in size, A and B in kind; if B shows a label that A does not; if A is
            too small for the neighborhoods.

    Source:
        A. Hertzmann et al., *Image analogies*, SIGGRAPH 2001.

    Example:
        >>> import torch, torchsynth as ts
        >>> a, b = torch.rand(1, 32, 32), torch.rand(1, 24, 40)
        >>> inverted = ts.analogy(a, 1 - a, b)
        >>> tuple(inverted.image.shape)
        (1, 1, 24, 40)
    """
    plan = plan_analogy(a, a_prime, b, recipe, labels=labels, valid=valid)
    return synthesize(
        plan.exemplar, plan.size, plan.recipe, controls=plan.controls, seed=seed, progress=progress
    )


def plan_analogy(
    a: Tensor,
    a_prime: Tensor,
    b: Tensor,
    recipe: Recipe | None = None,
    *,
    labels: bool = False,
    valid: Tensor | None = None,
) -> Analogy:
    """How an analogy will be made; the arguments are those of :func:`torchsynth.analogy`.

    Raises:
        InputError: As for :func:`torchsynth.analogy`.

    Example:
        >>> plan = plan_analogy(torch.tensor([[4, 7]]).repeat(16, 8), torch.rand(1, 16, 16), torch.tensor([[7]]))
        >>> plan.exemplar.guide.shape, plan.controls.guide.flatten().tolist()
        (torch.Size([2, 16, 16]), [0.0, 1.0])
    """
    checks.check_image(a_prime, "A'")
    for subject, picture in (("A", a), ("B", b)):
        checks.check_type(picture, Tensor, subject, "pass a picture as a tensor")
    if (a.dtype in _WHOLE) != (b.dtype in _WHOLE):
        raise InputError(
            "A and B", "must both be pictures, or both be maps of whole numbers",
            f"their dtypes are {a.dtype} and {b.dtype}", "convert one of them",
        )  # fmt: skip
    if labels or a.dtype in _WHOLE:
        a, b = label_channels(a, b)
    for subject, picture in (("A", a), ("B", b)):
        checks.check_image(picture, subject)
    checks.check_aligned(a, a_prime, "A", "A'")
    if a.shape[-3] != b.shape[-3]:
        raise InputError(
            "B", f"must have the {a.shape[-3]} channel(s) of A", f"it has {b.shape[-3]}",
            "convert one of them",
        )  # fmt: skip
    exemplar = Exemplar(a_prime, valid, a)
    fitting = _usual(exemplar) if recipe is None else recipe
    checks.check_type(fitting, Recipe, "recipe", "pass e.g. torchsynth.recipes.analogy()")
    return Analogy(exemplar, Controls(guide=b), fitting)


def label_channels(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """Two maps as pictures with one channel for each label: 1 where it is, 0 elsewhere.

    Args:
        a: ``(H, W)``, or ``(G, H, W)`` whose colors are the labels.
        b: Likewise, of another size perhaps.

    Raises:
        InputError: If they are no maps, or B has a label that A has not.

    Example:
        >>> label_channels(torch.tensor([[5, 9]]), torch.tensor([[9]]))[1].tolist()
        [[[0.0]], [[1.0]]]
    """
    maps = [one.unsqueeze(0) if one.ndim == 2 else one for one in (a, b)]
    for subject, one in zip(("A", "B"), maps, strict=True):
        if one.ndim != 3 or one.numel() == 0:
            raise InputError(
                subject, "a map must have shape (H, W) or (C, H, W)", f"its shape is {tuple(one.shape)}",
                "pass one map",
            )  # fmt: skip
    if len(maps[0]) != len(maps[1]):
        raise InputError(
            "B", f"must have the {len(maps[0])} channel(s) of A", f"it has {len(maps[1])}",
            "convert one of them",
        )  # fmt: skip
    colors, in_a = maps[0].flatten(1).T.unique(dim=0, return_inverse=True)
    if len(colors) > MOST_LABELS:
        raise InputError(
            "A", f"a map must have at most {MOST_LABELS} labels", f"it has {len(colors)} colors",
            "is it a photo, or saved as .jpg? use it without labels",
        )  # fmt: skip
    shown, in_b = maps[1].flatten(1).T.unique(dim=0, return_inverse=True)
    same = (shown.unsqueeze(1) == colors).all(2)
    unknown = (~same.any(1)).nonzero().flatten()
    if len(unknown):
        color = ", ".join(f"{value:g}" for value in shown[unknown[0]].tolist())
        number = int((in_b == unknown[0]).sum())
        raise InputError(
            "B", "must show labels of A only", f"{number} of its pixel(s) have the label ({color})",
            "repaint them, without smoothing or .jpg, in a color of A",
        )  # fmt: skip
    found = [
        torch.nn.functional.one_hot(rows, len(colors)).T.float().view(-1, *one.shape[1:])
        for rows, one in zip((in_a, same.long().argmax(1)[in_b]), maps, strict=True)
    ]
    return found[0], found[1]


def _usual(exemplar: Exemplar) -> Recipe:
    """The usual recipe, with as many levels as the exemplar has candidates for."""
    most = analogy_recipe().levels
    for levels in range(most, 1, -1):
        recipe = analogy_recipe(levels=levels)
        try:
            check_candidates(recipe, ExemplarLevels.of(exemplar, recipe, torch.float64).planes)
        except InputError:
            continue
        return recipe
    return analogy_recipe(levels=1)
