"""Every recipe on some textures, measured: the tables of docs/choosing.md.

    python scripts/choosing.py --exemplars sample:brick sample:grass

Pictures are made gray, shrunk and cropped as those of ``experiments.py``. There are three jobs, and each recipe does
those it is made for, with its default parameters where they fit the picture:

- *texture*: a new one, as large as the exemplar;
- *hole*: a rectangle a third as wide and a third as high, toward the upper left corner, is filled, and only that is
  measured. ``edge`` says how sharp its border is, best at 1. The line ``truth`` measures what was there before;
- *following*: the exemplar upside down and blurred is the target, or the guide. ``followed`` is the correlation of
  the output, blurred as much, with it: 1 is followed exactly.

The tables are Markdown: the patch distance of each picture, and the means of other measures and of the seconds
(of one thread, for one output) over all of them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import arguments
import torch
from comparison import MEASURES, Row, mean, rows_of
from exemplars import Texture, exemplar

import torchsynth as ts
from torchsynth.lattice import Boundary

BLUR = 7
"""Side of the square over which a target is the mean."""

SMALLEST = 3 * ts.metrics.SMALLEST_SIDE
"""Pictures have to have so many pixels a side: the hole of a third is measured."""

TRUTH = "truth"
"""What stands for a recipe where the measures are those of the picture itself."""


class Piece(NamedTuple):
    """What is measured.

    Args:
        image: ``(1, 1, H, W)``.
        source: Where its pixels are from.
        boundary: That of the recipe.
        extra: What else its job is judged by.
    """

    image: torch.Tensor
    source: torch.Tensor
    boundary: Boundary
    extra: float | None = None


@dataclass(frozen=True)
class Job:
    """Something to do with a texture.

    Args:
        name: What it is called.
        recipes: The names of those that do it.
        work: How: from a texture, the name of a recipe and a seed.
        shown: The measures of its table, beside the patch distance.
        extra: The heading of its own measure.
    """

    name: str
    recipes: tuple[str, ...]
    work: Callable[[Texture, str, int], Piece]
    shown: tuple[str, ...]
    extra: str | None = None


def texture_of(file: str, side: int) -> Texture:
    """A picture as the experiments have theirs, under the name of its file or sample."""
    image = exemplar(ts.read_image(file), side)
    height, width = image.shape[1:]
    if min(height, width) < SMALLEST:
        raise ts.InputError(
            file,
            f"must have at least {SMALLEST} pixels a side",
            f"it is {height}x{width}",
            "give a larger one",
        )
    return Texture(Path(file.rpartition(":")[2]).stem, image)


def new_texture(texture: Texture, name: str, seed: int) -> Piece:
    """More of it."""
    height, width = texture.image.shape[1:]
    result = ts.synthesize(texture.image, (height, width), fitting(name, texture), seed=seed)
    return Piece(result.image, result.source, result.recipe.boundary)


def hole(texture: Texture, name: str, seed: int) -> Piece:
    """A part of it, filled with the rest."""
    picture = texture.image
    height, width = picture.shape[1:]
    inside = tuple(slice(side // 8, side // 8 + side // 3) for side in (height, width))
    missing = torch.zeros(height, width, dtype=torch.bool)
    missing[inside] = True
    if name == TRUTH:
        grid = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        image, source = picture[None], torch.stack(grid)[None]
    else:
        result = ts.fill(picture, missing, recipe=fitting(name, texture), seed=seed)
        image, source = result.image, result.source
    edge = float(ts.metrics.edge_ratio(image, missing))
    return Piece(image[:, :, *inside].contiguous(), source[:, :, *inside], "open", edge)


def following(texture: Texture, name: str, seed: int) -> Piece:
    """The same texture, laid out as the blurred picture upside down."""
    picture, recipe = texture.image, fitting(name, texture)
    wanted = blurred(picture.flip(1))
    if recipe.follows_guide:
        result = ts.analogy(blurred(picture), picture, wanted, recipe, seed=seed)
    else:
        height, width = picture.shape[1:]
        controls = ts.Controls(target=wanted)
        result = ts.synthesize(picture, (height, width), recipe, controls=controls, seed=seed)
    both = torch.stack((blurred(result.image[0]).flatten(), wanted.flatten()))
    return Piece(result.image, result.source, result.recipe.boundary, float(both.corrcoef()[0, 1]))


def blurred(picture: torch.Tensor) -> torch.Tensor:
    """The mean of each pixel's square."""
    margin = [BLUR // 2] * 4
    padded = torch.nn.functional.pad(picture, margin, mode="reflect")
    return torch.nn.functional.avg_pool2d(padded, BLUR, stride=1).clamp(0, 1)


def fitting(name: str, texture: Texture) -> ts.Recipe:
    """A recipe with its defaults, or with fewer levels and smaller blocks for a small picture."""
    usual = ts.recipes.RECIPES[name]()
    half = min(texture.image.shape[1:]) // 2
    if isinstance(usual.patches, ts.Quilting) and usual.patches.block > half:
        return ts.load_recipe(name, [f"block={half}"])
    levels = usual.structure.recipe.levels if usual.structure else usual.levels
    if levels > texture.levels:
        return ts.load_recipe(name, [f"levels={texture.levels}"])
    return usual


JOBS = (
    Job(
        "texture",
        (
            "wei_levoy", "wei_levoy_single", "wei_levoy_tsvq", "improved_wl", "random_order", "distorted",
            "efros_leung", "ashikhmin", "ashikhmin_multires", "quilting", "graphcut",
        ),
        new_texture,
        ("sharpness", "verbatim", "repetition", "seam top-bottom"),
    ),
    Job(
        "hole", (TRUTH, "coherent_fill", "wei_levoy_fill", "efros_leung"), hole, ("sharpness", "verbatim"), "edge"
    ),
    Job(
        "following", ("ashikhmin_target", "quilting_transfer", "analogy"), following, ("sharpness", "verbatim"),
        "followed",
    ),
)  # fmt: skip
"""What is done; every recipe of the library is in it."""


@dataclass(frozen=True)
class Outcome:
    """What a recipe did with a texture, in the mean of all seeds.

    Args:
        row: The measures.
        seconds: Of the processor, for one output: beside other work it takes no more of them.
        extra: The job's own measure.
    """

    row: Row
    seconds: float
    extra: float | None


def outcome_of(job: Job, name: str, texture: Texture, seeds: int) -> Outcome:
    """Do a job with some seeds, and measure what comes of it."""
    started = time.process_time()
    pieces = [job.work(texture, name, seed) for seed in range(seeds)]
    seconds = (time.process_time() - started) / seeds
    rows = [rows_of(one.image, texture.image, one.source, one.boundary)[0] for one in pieces]
    extras = [one.extra for one in pieces if one.extra is not None]
    return Outcome(mean(rows), seconds, sum(extras) / seeds if extras else None)


def table(job: Job, textures: Sequence[Texture], seeds: int) -> str:
    """A job's table in Markdown."""
    names = [one.name for one in MEASURES]
    extra = [job.extra] if job.extra else []
    lines = [[job.name, *(one.name for one in textures), *job.shown, *extra, "seconds"]]
    lines.append(["---"] * len(lines[0]))
    for name in job.recipes:
        found = [outcome_of(job, name, texture, seeds) for texture in textures]
        middle = mean([one.row for one in found])
        figures = [one.row[names.index("patch distance")] for one in found]
        figures += [middle[names.index(one)] for one in job.shown]
        figures += [sum(one.extra or 0 for one in found) / len(found)] * len(extra)
        seconds = sum(one.seconds for one in found) / len(found)
        lines.append([name, *(f"{one:.2f}" for one in figures), "-" if name == TRUTH else f"{seconds:.1f}"])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    samples = [f"sample:{name}" for name in ("brick", "grass", "gravel", "pebbles")]
    jobs = {job.name: job for job in JOBS}
    parser.add_argument("--exemplars", nargs="+", default=samples, metavar="FILE", help="pictures")
    parser.add_argument("--jobs", nargs="+", default=list(jobs), choices=jobs, help="default: all")
    parser.add_argument("--size", type=arguments.whole_number(SMALLEST), default=128, help=_SIZE)
    parser.add_argument("--seeds", type=arguments.whole_number(1), default=2, help="default: 2")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        textures = [texture_of(one, options.size) for one in options.exemplars]
        torch.set_num_threads(1)
        for name in options.jobs:
            print(f"\n{table(jobs[name], textures, options.seeds)}", flush=True)


_SIZE = "the most pixels a side: larger pictures are shrunk, by half at most, and cropped; default: 128"


if __name__ == "__main__":
    main()
