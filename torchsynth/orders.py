"""What a job asks for, made of what its files hold: exemplar, size, controls and recipe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Region, SourceMap
from torchsynth.analogy import Analogy, plan_analogy
from torchsynth.codecs import Depth
from torchsynth.completion import Plan, plan_extension, plan_filling, plan_tiling
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.inputs import Inputs
from torchsynth.io import Picture
from torchsynth.lattice import Shape
from torchsynth.recipe import Recipe
from torchsynth.records import Job, words_of
from torchsynth.source_map import SavedSource
from torchsynth.wishes import controls_from, hole_word, white


@dataclass(frozen=True)
class Order:
    """All that :func:`torchsynth.synthesize` is given, but for the seeds.

    Args:
        exemplar: Where pixels are copied from.
        size: Of the output.
        controls: What is pinned down of it.
        recipe: How it is made.
        picture: The picture file that the output is stored like.
        alpha: The output's alpha channel, where it took no part in the work: in what was filled, opaque.
    """

    exemplar: Exemplar
    size: Shape
    controls: Controls
    recipe: Recipe
    picture: Picture
    alpha: Tensor | None = None

    @classmethod
    def of(cls, job: Job, files: Inputs) -> Order:
        """Put together what a job asks for.

        Args:
            job: What was asked for.
            files: What its files hold.

        Raises:
            InputError: If something does not fit.
        """
        inputs = files.pictures
        valid = white(inputs["valid"]) if "valid" in inputs else None
        if job.completion.task == "synthesize":
            exemplar = Exemplar(inputs["exemplar"].image, valid)
            size = checks.check_size(job.size or _usual_size(files))
            controls = controls_from(inputs, words_of(job), len(exemplar.image), size)
            if files.source is not None:
                controls = replace(controls, initial_source=_fitting(files.source, exemplar.shape))
            assert job.recipe is not None, "only completions have a usual recipe"  # noqa: S101 (for the type checker)
            return cls(exemplar, size, controls, job.recipe, inputs["exemplar"])
        if job.completion.task == "analogy":
            found = _analogy(job, inputs, valid)
            return cls(found.exemplar, found.size, found.controls, found.recipe, inputs["exemplar"])
        picture = inputs.get("image", inputs["exemplar"])
        image, hole = _image_and_hole(picture, inputs.get("hole"), job.completion.hole)
        plan = _plan(job, image, hole, inputs, valid)
        alpha = None if len(image) == len(picture.image) else _opaque(picture.image[-1:], hole)
        return cls(plan.exemplar, plan.size, plan.controls, plan.fitting(job.recipe), picture, alpha)

    @property
    def depth(self) -> Depth:
        """In which the output is stored: as the picture, but means of black and white are gray."""
        copied = self.recipe.has_sources and self.recipe.blur_seams is None
        return "8-bit" if self.picture.depth == "1-bit" and not copied else self.picture.depth

    def finished(self, image: Tensor) -> Tensor:
        """The output's pictures, with the alpha channel that is theirs."""
        if self.alpha is None:
            return image
        return torch.cat((image, self.alpha.expand(len(image), -1, -1, -1)), dim=1)


def _analogy(job: Job, inputs: Mapping[str, Picture], valid: Region | None) -> Analogy:
    for name, subject in (("guide", "A"), ("output_guide", "B")):
        if name not in inputs:
            raise InputError(subject, "must be given for an analogy", "there is none", "pass A, A' and B")
    a, b = (inputs[name].image for name in ("guide", "output_guide"))
    labels = job.completion.labels
    return plan_analogy(a, inputs["exemplar"].image, b, job.recipe, labels=labels, valid=valid)


def _plan(
    job: Job, image: Tensor, hole: Region | None, inputs: Mapping[str, Picture], valid: Region | None
) -> Plan:
    wanted = job.completion
    if wanted.task == "tile":
        if valid is not None:
            raise InputError(
                "sample-from", "is for filling and extending", "the task is to tile", "leave it out"
            )
        return plan_tiling(image, wanted.width, hole)
    if wanted.task == "extend":
        if job.size is None:
            raise InputError("size", "must be given to extend a picture", "there is none", "give HxW")
        return plan_extension(image, job.size, wanted.at, valid)
    if hole is None:
        raise InputError(
            "hole", "must be given to fill a picture", "there is none", "mark it, e.g. in a file"
        )
    other = inputs["exemplar"].image if "image" in inputs else None
    if other is not None and len(other) == len(image) + 1 and len(other) in _WITH_ALPHA:
        other = other[:-1]
    return plan_filling(image, hole, other, valid, wanted.within)


# Numbers of channels of which the last is the alpha channel.
_WITH_ALPHA = (2, 4)


def _image_and_hole(
    picture: Picture, marked: Picture | None, word: str | None
) -> tuple[Tensor, Region | None]:
    """The picture's colors, and where its hole is: from a file, its own alpha channel, or a color."""
    image = picture.image
    if marked is not None:
        return image, white(marked)
    if word is None:
        return image, None
    return hole_word(image, word)


def _opaque(alpha: Tensor, hole: Region | None) -> Tensor:
    """The alpha channel, with what was filled made opaque."""
    return alpha if hole is None else torch.where(hole, 1.0, alpha)


def _fitting(saved: SavedSource, exemplar: Shape) -> SourceMap:
    """The source map of an output that was made of this exemplar."""
    if saved.exemplar != exemplar:
        raise InputError(
            "source map", f"must be that of an output of this exemplar, {exemplar[0]}x{exemplar[1]}",
            f"it belongs to one of {saved.exemplar[0]}x{saved.exemplar[1]}", "pass the exemplar it was made with",
        )  # fmt: skip
    return saved.source


def _usual_size(files: Inputs) -> Shape:
    """That of the output to be refined, or the target's, or else twice the exemplar's."""
    if files.source is not None:
        height, width = files.source.source.shape[-2:]
        return height, width
    if "target" in files.pictures:
        height, width = files.pictures["target"].image.shape[1:]
        return height, width
    height, width = files.pictures["exemplar"].image.shape[1:]
    return 2 * height, 2 * width
