"""One synthesis that has been asked for: all checks of the input, and the canvases it starts with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from torchsynth import field
from torchsynth._typing import Frames, Image, Region, SourceMap, Sources
from torchsynth.canvas import Canvas
from torchsynth.codebook import Codebook
from torchsynth.controls import Controls
from torchsynth.covering import check_plain
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.exemplar_levels import ExemplarLevels, stretched
from torchsynth.feasibility import (
    check_candidates,
    check_growing,
    check_guide,
    check_rows,
    check_target,
    matching_dtype,
)
from torchsynth.initial import RandomSource
from torchsynth.lattice import Shape
from torchsynth.memory import check_memory
from torchsynth.neighborhood import Plane, output_plane
from torchsynth.pyramid import border_of, gaussian_pyramid, level_shapes, masked_pyramid
from torchsynth.recipe import Recipe
from torchsynth.result import check_straight
from torchsynth.resuming import fitting_source, sources_by_level
from torchsynth.surroundings import Surroundings, surroundings_of


@dataclass(frozen=True)
class Task:
    """A synthesis whose input has been found to fit together.

    Args:
        recipe: How.
        size: Height and width of the outputs.
        controls: What is pinned down of them.
        codebook: Trees to be used, if there are any.
        levels: The exemplar's side.
        initial: The picture that synthesis starts from, for each output, if there is one.
        source: The source map that it starts from instead, likewise.
        target: The picture to follow, likewise.
        guide: What lies upon the output, likewise.
        surroundings: What is known around a hole at each level, if there is one.
    """

    recipe: Recipe
    size: Shape
    controls: Controls
    codebook: Codebook | None
    levels: ExemplarLevels
    initial: Image | None
    source: SourceMap | None
    target: Image | None
    guide: Tensor | None
    surroundings: list[Surroundings] | None

    @classmethod
    def of(
        cls,
        exemplar: Exemplar,
        size: Shape,
        recipe: Recipe,
        controls: Controls,
        seeds: Sequence[int],
        codebook: Codebook | None = None,
    ) -> Task:
        """Check everything.

        Args:
            exemplar: The exemplar.
            size: Height and width of the outputs.
            recipe: How they are made.
            controls: What is pinned down of them.
            seeds: One for each.
            codebook: Trees that were trained for this exemplar and recipe.

        Raises:
            InputError: If anything does not fit.

        Example:
            >>> from torchsynth.recipes import wei_levoy
            >>> recipe = wei_levoy(levels=1)
            >>> Task.of(Exemplar(torch.rand(1, 9, 9)), (4, 4), recipe, Controls(), (0,)).initial is None
            True
        """
        initial, target, guide = check_pictures(exemplar, size, controls, len(seeds))
        source = _source(exemplar, size, controls, len(seeds))
        if recipe.blur_seams is not None:
            check_straight("blur_seams", controls.distorts)
        if recipe.patches is not None:
            check_plain(recipe, controls, codebook is not None)
        check_target(recipe, target is not None)
        check_guide(recipe, exemplar.guides, guide)
        check_memory(recipe, exemplar, size, len(seeds))
        check_rows(recipe, size)
        guide_channels = 0 if guide is None else guide.shape[1]
        dtype = matching_dtype(recipe, exemplar.samples.shape[1], guide_channels)
        levels = ExemplarLevels.of(exemplar, recipe, dtype)
        around = None
        if controls.hole is not None and initial is not None:
            around = surroundings_of(initial, controls.hole, controls.exemplar_at, recipe, levels.stretch)
        check_growing(recipe, None if around is None else [one.known for one in around])
        check_candidates(recipe, levels.planes)
        if recipe.patches is not None:
            recipe.patches.check(levels.planes.result[0], size, recipe.boundary)
        if codebook is not None:
            codebook.check(exemplar, recipe, levels.planes)
        return cls(recipe, size, controls, codebook, levels, initial, source, target, guide, around)

    def is_sown(self, coarsest: bool) -> bool:
        """Whether the recipe says what a level shows before its first sweep, rather than the user.

        Args:
            coarsest: Whether it is the coarsest level.
        """
        if self.source is not None:
            return False
        return not coarsest or self.initial is None or self.surroundings is not None

    def canvases(self, generators: Sequence[torch.Generator]) -> list[Canvas]:
        """A canvas for each level, the finest first.

        Args:
            generators: One for each output; advanced by what the start draws.
        """
        recipe, images, planes = self.recipe, self.levels.images, self.levels.planes.result
        if self.source is not None:
            starts = tuple(map(_shown, images, self._sources(), level_shapes(self.size, recipe.levels)))
        elif self.initial is None or self.surroundings is not None:
            # Patches cover all there is: it begins black.
            initial = RandomSource() if recipe.patches is not None else recipe.initial
            starts = initial.start(images, self.size, recipe.boundary, generators)
        else:
            starts = stretched(self._pyramid(self.initial), self.levels.stretch)
        canvases = []
        for level, (start, target, guide) in enumerate(
            zip(starts, self._targets(), self._guides(), strict=True)
        ):
            around = None if self.surroundings is None else self.surroundings[level]
            if around is not None:
                start = torch.where(around.known, around.picture, start)
            frames = _frames(self.controls, (start.shape[2], start.shape[3]), start.device)
            canvas = Canvas.blank(start, images[level], planes[level], recipe.boundary, target, guide, frames)
            if around is not None:
                around.give(canvas)
            canvases.append(canvas)
        for canvas, source in zip(canvases, self._sources(), strict=False):
            canvas.resume(source)
        return canvases

    def _sources(self) -> list[Sources]:
        """What every level of an earlier output was copied from, if one is to be gone on from."""
        if self.source is None:
            return []
        exemplars = [(image.shape[2], image.shape[3]) for image in self.levels.images]
        return sources_by_level(self.source, exemplars, level_shapes(self.size, self.recipe.levels))

    def _pyramid(self, image: Image) -> tuple[Image, ...]:
        return gaussian_pyramid(image, self.recipe.levels, border_of(self.recipe.boundary))

    def _targets(self) -> Sequence[Plane | None]:
        """What neighborhoods read of the target, level by level."""
        recipe, region = self.recipe, self.controls.target_region
        if self.target is None:
            return [None] * recipe.levels
        dtype = self.levels.planes.result[0].values.dtype
        images: Sequence[Image] = self._pyramid(self.target)
        known: Sequence[Region | None] = [None] * recipe.levels
        if region is not None:
            region = region.to(self.target.device)
            painted = masked_pyramid(self.target, region, recipe.levels, border_of(recipe.boundary))
            images, known = [image for image, _ in painted], [there for _, there in painted]
        return [
            output_plane(image, dtype, recipe.boundary, there)
            for image, there in zip(stretched(images, self.levels.stretch), known, strict=True)
        ]

    def _guides(self) -> Sequence[Plane | None]:
        """What they read of the guide."""
        if self.guide is None:
            return [None] * self.recipe.levels
        dtype = self.levels.planes.result[0].values.dtype
        images = stretched(self._pyramid(self.guide), self.levels.guide_stretch)
        return [output_plane(image, dtype, self.recipe.boundary) for image in images]


def check_pictures(
    exemplar: Exemplar, size: Shape, controls: Controls, outputs: int
) -> tuple[Image | None, Image | None, Tensor | None]:
    """The user's pictures as batches: initial, target and guide, and fields, must fit the output.

    Raises:
        InputError: If they do not.

    Example:
        >>> check_pictures(Exemplar(torch.rand(1, 9, 9)), (4, 4), Controls(), 1)
        (None, None, None)
    """
    samples, guides = exemplar.samples, exemplar.guides
    initial = _batch_of("initial", controls.initial, samples, size, outputs)
    target = _batch_of("target", controls.target, samples, size, outputs)
    # Without one on the exemplar, its channels are no concern yet.
    like = controls.guide if guides is None else guides
    guide = None if like is None else _batch_of("guide", controls.guide, _batch(like), size, outputs)
    _check_fields(controls, size)
    return initial, target, guide


def _source(exemplar: Exemplar, size: Shape, controls: Controls, outputs: int) -> SourceMap | None:
    """The source map to go on from as a batch, if there is one and it fits."""
    if controls.initial_source is None:
        return None
    source = fitting_source(controls.initial_source, exemplar.shape, size, outputs).to(exemplar.image.device)
    valid = exemplar.valid
    if valid is not None and not bool(valid.to(source.device)[source[:, 0], source[:, 1]].all()):
        raise InputError(
            "initial_source", "must name valid pixels of the exemplar only", "it names others, too",
            "pass the source map of a result for the same valid region",
        )  # fmt: skip
    return source


def _shown(exemplar: Image, source: Sources, shape: Shape) -> Image:
    """The picture that a level's sources make of the exemplar."""
    sites = source.unsqueeze(1).expand(-1, exemplar.shape[1], -1)
    return exemplar.flatten(2).expand(len(source), -1, -1).gather(2, sites).view(len(source), -1, *shape)


def _batch(picture: Tensor) -> Tensor:
    return picture.detach() if picture.ndim == 4 else picture.detach().unsqueeze(0)


def _batch_of(
    subject: str, picture: Tensor | None, samples: Tensor, size: Shape, outputs: int
) -> Tensor | None:
    """A picture of the user's as a batch, if there is one and it fits the output."""
    if picture is None:
        return None
    batch = _batch(picture)
    wanted = (samples.shape[1], *size)
    if tuple(batch.shape[1:]) != wanted or len(batch) not in (1, outputs):
        raise InputError(
            subject, f"must have the output's channels, height and width {wanted}",
            f"its shape is {tuple(picture.shape)}",
            "convert it to the exemplar's channels" if batch.shape[1] != wanted[0] and batch.shape[2:] == size
            else "resize it, and see that its channels are the exemplar's; a batch needs one, or one for each output",
        )  # fmt: skip
    return batch.to(samples).expand(outputs, -1, -1, -1)


def _check_fields(controls: Controls, size: Shape) -> None:
    """Fields must have a value for every pixel of the output."""
    for name in ("angle", "scale"):
        given = getattr(controls, name)
        if isinstance(given, Tensor) and tuple(given.shape) != size:
            raise InputError(
                name, f"must have the output's height and width {size}",
                f"its shape is {tuple(given.shape)}", "resize it, or pass one number",
            )  # fmt: skip


def _frames(controls: Controls, shape: Shape, device: torch.device) -> Frames | None:
    """How the pixels of a level see their surroundings turned and scaled, if they do."""
    if not controls.distorts:
        return None
    fields = [
        field.at_level(given.detach().double().cpu(), shape)
        if isinstance(given, Tensor)
        else field.constant(shape, default if given is None else float(given))
        for given, default in ((controls.angle, 0.0), (controls.scale, 1.0))
    ]
    return field.frames(*fields).to(device)
