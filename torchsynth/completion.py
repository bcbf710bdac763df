"""Completing pictures: filling holes, extending beyond the borders, making a picture tile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from pydantic import ValidationError
from torch import Tensor

from torchsynth import checks
from torchsynth.controls import Controls
from torchsynth.errors import ConfigError, InputError
from torchsynth.exemplar import Exemplar
from torchsynth.exemplar_levels import ExemplarLevels
from torchsynth.feasibility import check_candidates, check_growing
from torchsynth.lattice import Boundary, Shape
from torchsynth.memory import check_memory
from torchsynth.morphology import grown
from torchsynth.pyramid import border_of, whole_regions
from torchsynth.recipe import Recipe
from torchsynth.recipes import coherent_fill
from torchsynth.result import Result
from torchsynth.synthesis import Progress, synthesize

# A strip along the border is this share of the shorter side, if nothing else is asked for.
_STRIP = 8

# Pixels coincide with those of so many levels: all that the usual recipe has.
_ALIGNMENT = 2 ** (coherent_fill().levels - 1)


@dataclass(frozen=True)
class Plan:
    """What is to be completed, and from what.

    Args:
        exemplar: Where pixels are copied from.
        size: Of the output.
        controls: The picture with its hole.
        boundary: Whether the output tiles.
    """

    exemplar: Exemplar
    size: Shape
    controls: Controls
    boundary: Boundary

    def run(
        self, recipe: Recipe | None, seed: int | Sequence[int], progress: Progress | None = None
    ) -> Result:
        """Complete the picture; the recipe's boundary is made to fit."""
        return synthesize(
            self.exemplar,
            self.size,
            self.fitting(recipe),
            controls=self.controls,
            seed=seed,
            progress=progress,
        )

    def fitting(self, recipe: Recipe | None) -> Recipe:
        """The recipe with this boundary; None means the usual one, with as many levels as there can be."""
        if recipe is not None:
            checks.check_type(recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.efros_leung()")
            return self._bounded(recipe)
        most = coherent_fill().levels
        for levels in range(most, 1, -1):
            usual = coherent_fill(levels=levels).changed(boundary=self.boundary)
            try:
                self.check(usual)
            except InputError:
                continue  # too coarse for this picture
            return usual
        return coherent_fill(levels=1).changed(boundary=self.boundary)

    def _bounded(self, recipe: Recipe) -> Recipe:
        try:
            return recipe.changed(boundary=self.boundary)
        except ValidationError as error:
            fact = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise ConfigError(
                recipe.name, f"must work with the boundary {self.boundary!r} to complete this picture", fact,
                "choose another recipe",
            ) from None  # fmt: skip

    def check(self, recipe: Recipe) -> None:
        """Whether a recipe fits the picture.

        Raises:
            InputError: If some level has nothing known, or nothing to sample.
        """
        picture, hole = self.controls.initial, self.controls.hole
        assert picture is not None and hole is not None, "a plan has both"  # noqa: S101, PT018 (for the type checker)
        check_growing(recipe, whole_regions(~hole, recipe.levels, border_of(recipe.boundary)))
        check_candidates(recipe, ExemplarLevels.of(self.exemplar, recipe, picture.dtype).planes)


def plan_filling(
    image: Tensor,
    hole: Tensor,
    exemplar: Tensor | None = None,
    valid: Tensor | None = None,
    within: int | None = None,
) -> Plan:
    """How a hole will be filled; the arguments are those of :func:`torchsynth.fill`.

    Raises:
        InputError: As for :func:`torchsynth.fill`.

    Example:
        >>> hole = torch.zeros(8, 8, dtype=torch.bool)
        >>> hole[2:5, 2:5] = True
        >>> plan = plan_filling(torch.rand(3, 8, 8), hole, within=2)
        >>> plan.exemplar.shape, plan.controls.exemplar_at
        ((8, 8), (0, 0))
    """
    checks.check_image(image, "image")
    checks.check_type(hole, Tensor, "hole", "pass a boolean tensor (H, W)")
    checks.check_hole(hole, image)
    shape = _shape(image)
    if exemplar is not None:
        checks.check_image(exemplar, "exemplar")
        if exemplar.ndim == 4:
            raise InputError(
                "exemplar", "must be one picture (C, H, W)", f"its shape is {tuple(exemplar.shape)}",
                "fill with one exemplar at a time",
            )  # fmt: skip
        if exemplar.shape[-3] != image.shape[-3]:
            raise InputError(
                "exemplar", f"must have the picture's {image.shape[-3]} channel(s)",
                f"it has {exemplar.shape[-3]}", "convert it",
            )  # fmt: skip
        if within is not None:
            raise InputError(
                "within", "counts pixels around the hole, in the picture itself", "another exemplar is given",
                "drop one of them",
            )  # fmt: skip
        controls = Controls(initial=image, hole=hole)
        return Plan(Exemplar(exemplar, valid), shape, controls, "open")
    known = ~hole
    if valid is not None:
        checks.check_region(valid, shape, "valid")
        known = known & valid
    if within is not None:
        checks.check_positive(within, "within")
        known = known & grown(hole, within)
    if not bool(known.any()):
        raise InputError(
            "hole",
            "must leave something to sample from",
            "none of it is known",
            "sample from a larger region",
        )
    controls = Controls(initial=image, hole=hole, exemplar_at=(0, 0))
    return Plan(Exemplar(image, known), shape, controls, "open")


def fill(
    image: Tensor,
    hole: Tensor,
    *,
    recipe: Recipe | None = None,
    exemplar: Tensor | None = None,
    valid: Tensor | None = None,
    within: int | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Fill the holes of a picture with the texture around them, or with another one.

    An object is removed by marking it as the hole.

    Args:
        image: ``(C, H, W)``, or ``(B, C, H, W)`` for several pictures; values in [0, 1].
        hole: ``(H, W)``, True where the picture is to be filled, in any number of pieces of any shape; or
            ``(B, H, W)``, for each picture its own. What the picture shows there makes no difference;
            outside, every value stays as it is.
        recipe: One that fills: ``coherent_fill``, ``efros_leung``, ``wei_levoy_fill``, or any other. None
            means ``coherent_fill``, with fewer levels if the picture is too small for its usual ones.
        exemplar: Another picture ``(C, H', W')`` to sample from; None means the picture itself.
        valid: Where that may be sampled, True at each usable pixel; None means everything known.
        within: Sample only pixels that are at most so far from the hole, along rows and columns. It makes
            large photos faster and smaller in memory.
        seed: One whole number, or one for each output. One picture is filled once for each seed;
            several pictures take ``seed, seed + 1, ...``.
        progress: See :data:`torchsynth.synthesis.Progress`.

    Returns:
        The result; its image is the whole picture, filled.

    Raises:
        InputError: If picture, hole or region do not fit each other, nothing is left to sample from, or the
            recipe cannot be used, before any work.

    Source:
        Efros & Leung 1999, section 5, on constrained synthesis.

    Example:
        >>> import torch, torchsynth as ts
        >>> image = torch.rand(3, 24, 24)
        >>> hole = torch.zeros(24, 24, dtype=torch.bool)
        >>> hole[8:16, 8:16] = True
        >>> result = ts.fill(image, hole)
        >>> bool(result.image[0][:, ~hole].equal(image[:, ~hole]))
        True
    """
    checks.check_image(image, "image")
    if image.ndim == 3:
        return plan_filling(image, hole, exemplar, valid, within).run(recipe, seed, progress)
    seeds = checks.check_seeds(seed, len(image))
    plans = [
        plan_filling(*one, exemplar, valid, within)
        for one in zip(image, _each(hole, len(image)), strict=True)
    ]
    return Result.joined([plan.run(recipe, one, progress) for plan, one in zip(plans, seeds, strict=True)])


def plan_extension(
    image: Tensor, size: tuple[int, int], at: tuple[int, int] | None = None, valid: Tensor | None = None
) -> Plan:
    """How a picture will be extended; the arguments are those of :func:`torchsynth.extend`.

    Raises:
        InputError: As for :func:`torchsynth.extend`.

    Example:
        >>> plan_extension(torch.rand(1, 8, 8), (10, 13)).controls.exemplar_at
        (1, 2)
    """
    checks.check_image(image, "image")
    size = checks.check_size(size)
    shape = _shape(image)
    spare = (size[0] - shape[0], size[1] - shape[1])
    if min(spare) < 0 or max(spare) == 0:
        raise InputError(
            "size", f"must be larger than the picture's, {shape[0]}x{shape[1]}", f"it is {size[0]}x{size[1]}",
            "ask for more, or crop the result",
        )  # fmt: skip
    check_memory(coherent_fill(levels=1), Exemplar(image), size, 1)
    if at is not None:
        checks.check_place(at, "at")
    top, left = (_aligned(one // 2) for one in spare) if at is None else at
    if not (0 <= top <= spare[0] and 0 <= left <= spare[1]):
        raise InputError(
            "at", f"must leave the picture inside: from (0, 0) to {spare}", f"it is {(top, left)}",
            "place it further up or left",
        )  # fmt: skip
    picture = image.new_zeros(*image.shape[:-2], *size)
    picture[..., top : top + shape[0], left : left + shape[1]] = image
    hole = torch.ones(size, dtype=torch.bool, device=image.device)
    hole[top : top + shape[0], left : left + shape[1]] = False
    controls = Controls(initial=picture, hole=hole, exemplar_at=(top, left))
    return Plan(Exemplar(image, valid), size, controls, "open")


def extend(
    image: Tensor,
    size: tuple[int, int],
    *,
    at: tuple[int, int] | None = None,
    recipe: Recipe | None = None,
    valid: Tensor | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Extend a picture beyond its borders.

    Args:
        image: ``(C, H, W)``, or ``(B, C, H, W)`` for several pictures; values in [0, 1].
        size: Height and width of the result; neither may be smaller than the picture's.
        at: Row and column of the result where the picture's first pixel goes; None puts it in the middle, or
            up to three pixels above and left of it, where the pixels of coarser levels coincide.
        recipe: As for :func:`torchsynth.fill`.
        valid: ``(H, W)``, where the picture may be sampled; None means everywhere.
        seed: As for :func:`torchsynth.fill`.
        progress: See :data:`torchsynth.synthesis.Progress`.

    Returns:
        The result; the picture in it is unchanged.

    Raises:
        InputError: If the size is not larger than the picture, or the picture does not lie inside.

    Source:
        Efros & Leung 1999, section 5 and figure 6; the GrowImage notes.

    Example:
        >>> import torch, torchsynth as ts
        >>> image = torch.rand(1, 20, 20)
        >>> result = ts.extend(image, (20, 26), at=(0, 0))
        >>> bool(result.image[0, :, :, :20].equal(image))
        True
    """
    checks.check_image(image, "image")
    if image.ndim == 3:
        return plan_extension(image, size, at, valid).run(recipe, seed, progress)
    seeds = checks.check_seeds(seed, len(image))
    plans = [plan_extension(one, size, at, valid) for one in image]
    return Result.joined([plan.run(recipe, one, progress) for plan, one in zip(plans, seeds, strict=True)])


def plan_tiling(image: Tensor, width: int | None = None, hole: Tensor | None = None) -> Plan:
    """How a picture will be made to tile; the arguments are those of :func:`torchsynth.tile`.

    Raises:
        InputError: As for :func:`torchsynth.tile`.

    Example:
        >>> int(plan_tiling(torch.rand(1, 32, 32), width=4).controls.hole.sum())
        240
    """
    checks.check_image(image, "image")
    height, across = _shape(image)
    chosen = max(2, min(height, across) // _STRIP) if width is None else width
    checks.check_positive(chosen, "width")
    if chosen >= min(height, across):
        raise InputError(
            "width", f"must be less than the picture's shorter side, {min(height, across)}",
            f"it is {chosen}", "choose a narrower strip",
        )  # fmt: skip
    before, after = chosen // 2, chosen - chosen // 2
    strip = torch.ones(height, across, dtype=torch.bool, device=image.device)
    strip[after : height - before, after : across - before] = False
    if hole is None:
        controls = Controls(initial=image, hole=strip, exemplar_at=(0, 0))
        return Plan(Exemplar(image), (height, across), controls, "torus")
    checks.check_hole(hole, image)
    both = strip | hole
    checks.check_hole(both, image, "hole and strip")
    controls = Controls(initial=image, hole=both, exemplar_at=(0, 0))
    return Plan(Exemplar(image, ~hole), (height, across), controls, "torus")


def tile(
    image: Tensor,
    *,
    width: int | None = None,
    hole: Tensor | None = None,
    recipe: Recipe | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Make a picture tile, by synthesizing a strip along its border anew and changing nothing else.

    Args:
        image: ``(C, H, W)``, or ``(B, C, H, W)`` for several pictures; values in [0, 1].
        width: Width of the strip in pixels, half of it at each of two opposite borders; None means an
            eighth of the shorter side. Visible effect: a wider strip leaves more room to join the two sides.
        hole: ``(H, W)`` or ``(B, H, W)``, True where the picture is to be filled as well.
        recipe: As for :func:`torchsynth.fill`.
        seed: As for :func:`torchsynth.fill`.
        progress: See :data:`torchsynth.synthesis.Progress`.

    Returns:
        The result, of the picture's size.

    Raises:
        InputError: If the strip is as wide as the picture, or nothing is left to sample from.

    Source:
        Efros & Leung 1999 for the order; Ashikhmin 2001, section 3, for tiling.

    Example:
        >>> import torch, torchsynth as ts
        >>> image = torch.rand(1, 24, 24)
        >>> result = ts.tile(image, width=4)
        >>> bool(result.image[0, :, 2:-2, 2:-2].equal(image[:, 2:-2, 2:-2]))
        True
    """
    checks.check_image(image, "image")
    if image.ndim == 3:
        return plan_tiling(image, width, hole).run(recipe, seed, progress)
    seeds = checks.check_seeds(seed, len(image))
    plans = [
        plan_tiling(*one) for one in zip(image, [width] * len(image), _each(hole, len(image)), strict=True)
    ]
    return Result.joined([plan.run(recipe, one, progress) for plan, one in zip(plans, seeds, strict=True)])


def _each(hole: Tensor | None, pictures: int) -> Sequence[Any]:
    """The hole of each picture, where there may be one for all of them."""
    if not isinstance(hole, Tensor) or hole.ndim != 3:
        return [hole] * pictures
    if len(hole) != pictures:
        raise InputError(
            "hole", f"must be one for all, or one for each of the {pictures} pictures",
            f"there are {len(hole)}", "pass (H, W) or (B, H, W)",
        )  # fmt: skip
    return list(hole)


def _aligned(offset: int) -> int:
    """An offset at which coarser levels coincide, if that is not to move the picture to the border."""
    return offset // _ALIGNMENT * _ALIGNMENT or offset


def _shape(image: Tensor) -> Shape:
    return image.shape[-2], image.shape[-1]
