"""What the page can be asked to make, as the library is asked."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torchsynth import checks, config
from torchsynth._typing import Region
from torchsynth.codecs import pixels_in_header
from torchsynth.completion import fill
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.io import Picture, read_picture
from torchsynth.lattice import Shape
from torchsynth.memory import check_memory
from torchsynth.recipe import Recipe
from torchsynth.recipes import further_pass, with_target
from torchsynth.refining import refine
from torchsynth.result import Result
from torchsynth.studio.purposes import check_purpose
from torchsynth.studio.visitor import Sample
from torchsynth.synthesis import Progress, synthesize

MOST_PIXELS = 2**20
"""Samples and outputs in the page have at most so many pixels: 1024x1024."""


@dataclass(frozen=True)
class Work:
    """One thing to make.

    Args:
        sample: What it is made of.
        recipe: How.
        size: Of the output.
        make: Does it, and reports to what it is given.
        controls: What is pinned down.
        words: Fields that are given in words.
        painted: Whether something was painted or uploaded that no file holds.
    """

    sample: Sample
    recipe: Recipe
    size: Shape
    make: Callable[[Progress], Result]
    controls: Controls = field(default_factory=Controls)
    words: Mapping[str, str] = field(default_factory=dict)
    painted: bool = False


def read_sample(path: str, name: str) -> Sample:
    """Read a picture as a sample.

    Args:
        path: The file, or ``sample:NAME``.
        name: What it is called in messages.

    Raises:
        InputError: If it is no picture, or too large for the page.

    Example:
        >>> read_sample("sample:brick", "sample:brick").shape
        (128, 128)
    """
    picture = read_upload(path, name)
    checks.check_image(picture.image, name)
    sample = Sample(name, picture)
    check_pixels(sample.shape, name)
    return sample


def read_upload(path: str, name: str | None = None) -> Picture:
    """Read a picture; messages call it as the visitor does.

    Args:
        path: The file, or ``sample:NAME``.
        name: What it is called; None means by the file's own name.

    Raises:
        InputError: If it cannot be read.

    Example:
        >>> read_upload("sample:brick").depth
        '8-bit'
    """
    _check_header(path, name or upload_name(path))
    try:
        return read_picture(path)
    except InputError as error:  # where it was put tells a visitor nothing
        raise InputError(name or upload_name(path), error.expectation, error.fact, error.remedy) from None


def _check_header(path: str, name: str) -> None:
    """Refuse what is too large before it is decoded: a small file can hold gigabytes."""
    if not os.path.isfile(path):
        return  # a built-in sample
    with open(path, "rb") as file:
        pixels = pixels_in_header(file)
    if pixels is not None and pixels > MOST_PIXELS:
        raise InputError(
            name, f"the page works with up to {MOST_PIXELS:,} pixels", f"it has {pixels:,} or more",
            "use the command line for more",
        )  # fmt: skip


def recipe_from(data: Mapping[str, Any]) -> Recipe:
    """The recipe that the form holds.

    Raises:
        ConfigError: If it is none.

    Example:
        >>> recipe_from({"levels": 1, "sweeps": [{"layers": [{"plane": "result"}]}]}).levels
        Traceback (most recent call last):
        torchsynth.errors.ConfigError: ...
    """
    return config.parse_recipe(dict(data), "recipe")


def synthesis(
    sample: Sample, recipe: Recipe, size: Shape, seed: int, controls: Controls | None = None
) -> Work:
    """Plain synthesis, or with controls.

    Raises:
        InputError: If it is too large for the page, or for this machine, or the recipe needs more.
    """
    controls = controls or Controls()
    check_pixels(size, "size")
    check_purpose(recipe, controls)
    check_memory(recipe, Exemplar(sample.picture.image), size, 1)
    return Work(
        sample,
        recipe,
        size,
        lambda progress: synthesize(
            sample.picture.image, size, recipe, controls=controls, seed=seed, progress=progress
        ),
        controls,
    )


def distortion(
    sample: Sample, recipe: Recipe, size: Shape, seed: int, controls: Controls, words: Mapping[str, str], *,
    painted: bool,
) -> Work:  # fmt: skip
    """Synthesis turned and scaled by fields.

    Raises:
        InputError: If the fields do not fit, or it is too large.
    """
    work = synthesis(sample, recipe, size, seed, controls)
    return Work(sample, recipe, size, work.make, controls, words, painted)


def following(
    sample: Sample, recipe: Recipe, size: Shape, seed: int, controls: Controls, passes: int
) -> Work:
    """Synthesis that follows a painted target.

    Raises:
        ConfigError: If the recipe cannot follow one.
        InputError: If it is too large.
    """
    work = synthesis(sample, with_target(recipe, passes=passes), size, seed, controls)
    return Work(sample, work.recipe, size, work.make, controls, painted=True)


def one_more_pass(made: Result, sample: Sample, seed: int, controls: Controls) -> Work:
    """One more pass over an output.

    Args:
        made: The output.
        sample: What it was made from.
        seed: As before.
        controls: The target as it is now.

    Raises:
        ConfigError: If the recipe cannot have another pass.
    """
    height, width = made.image.shape[-2:]
    check_pixels((height, width), "size")
    recipe = further_pass(made.recipe if made.recipe.follows_target else with_target(made.recipe))
    return Work(
        sample,
        recipe,
        (height, width),
        lambda progress: refine(
            sample.picture.image, made, recipe, controls=controls, seed=seed, progress=progress
        ),
        controls,
        painted=True,
    )


def filling(picture: Sample, hole: Region, recipe: Recipe | None, seed: int) -> Work:
    """A hole of a picture filled from the rest of it.

    Args:
        picture: The picture, which is its own sample.
        hole: True where it is filled.
        recipe: How; None means as fits.
        seed: Which of many.

    Raises:
        InputError: If it is too large for the page.
    """
    check_pixels(picture.shape, "picture")
    image = picture.picture.image
    return Work(
        picture,
        recipe if recipe is not None else config.load_recipe("coherent_fill"),
        picture.shape,
        lambda progress: fill(image, hole, recipe=recipe, seed=seed, progress=progress),
        Controls(initial=image, hole=hole),
        painted=True,
    )


def check_pixels(size: Shape, subject: str) -> None:
    """Whether the page makes pictures of that size.

    Raises:
        InputError: If it does not.

    Example:
        >>> check_pixels((2000, 2000), "size")
        Traceback (most recent call last):
        torchsynth.errors.InputError: size: the page works with up to 1,048,576 pixels, but 2000x2000 are
        4,000,000; use the command line for more
    """
    height, width = checks.check_size(size)
    if height * width > MOST_PIXELS:
        raise InputError(
            subject, f"the page works with up to {MOST_PIXELS:,} pixels",
            f"{height}x{width} are {height * width:,}", "use the command line for more",
        )  # fmt: skip


def upload_name(path: str) -> str:
    """What an uploaded file is called.

    Example:
        >>> upload_name("/tmp/gradio/1234/stones.png")
        'stones.png'
    """
    return Path(path).name
