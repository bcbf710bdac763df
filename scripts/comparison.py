"""Algorithms compared on a texture: their outputs, measured, and which of them does best."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field

import torch
from exemplars import Texture

import torchsynth as ts
from torchsynth.lattice import Boundary


@dataclass(frozen=True)
class Measure:
    """One of the columns of the tables.

    Args:
        name: Its heading.
        about: What it says, and what is good.
        fault: How bad a value is: the least wins.
    """

    name: str
    about: str
    fault: Callable[[float], float]


MEASURES = (
    Measure(
        "patch distance",
        "how far the patches of all scales are from the exemplar's; 1 is as close as two halves of it, less "
        "is no merit, and copies of large pieces are close by nature",
        lambda value: value,
    ),
    Measure("sharpness", "the mean gradient over the exemplar's; best at 1", lambda value: abs(value - 1)),
    Measure("gradient distance", "how far the gradients' distribution is; best at 0", lambda value: value),
    Measure("verbatim", "share of 11x11 windows that are one copy; best at 0", lambda value: value),
    Measure("repetition", "share of such windows that come twice; best at 0", lambda value: value),
    Measure("coverage", "how much of the exemplar is used; best at 1", lambda value: -value),
    Measure("seam top-bottom", "best at 1 or less; 2 is easily seen", lambda value: max(value, 1.0)),
    Measure("seam left-right", "the same from side to side", lambda value: max(value, 1.0)),
)
"""What is compared. Equal values share a win."""

Row = tuple[float, ...]
"""A value for each of the measures."""


@dataclass(frozen=True)
class Method:
    """An algorithm of a comparison.

    Args:
        name: What it is called in tables.
        recipe: How it works, for a number of pyramid levels.
    """

    name: str
    recipe: Callable[[int], ts.Recipe]


@dataclass(frozen=True)
class Task:
    """What is made of one texture.

    Args:
        texture: The exemplar.
        recipes: By the names of the methods.
        shape: Height and width of the outputs.
        seeds: One for each output.
    """

    texture: Texture
    recipes: dict[str, ts.Recipe]
    shape: tuple[int, int]
    seeds: tuple[int, ...]


@dataclass(frozen=True)
class Outcome:
    """What came of one texture.

    Args:
        texture: The exemplar.
        images: ``(B, 1, OH, OW)``, by the names of the methods.
        rows: The measures of each output, likewise.
        chosen: What a method chose for this texture, in words, where it did.
    """

    texture: Texture
    images: dict[str, torch.Tensor]
    rows: dict[str, list[Row]]
    chosen: dict[str, str] = field(default_factory=dict)

    @property
    def means(self) -> dict[str, Row]:
        """The measures of each method over all seeds."""
        return {name: mean(rows) for name, rows in self.rows.items()}


def first_set() -> tuple[Method, ...]:
    """Wei-Levoy, Ashikhmin, and the improvements one by one."""
    improved = ts.recipes.improved_wl
    return (
        Method("WL", lambda levels: ts.recipes.wei_levoy(levels=levels)),
        Method("Ashikhmin", lambda _: ts.recipes.ashikhmin()),
        Method("W", lambda levels: improved(levels=levels, noncausal=False, morphology=False)),
        Method("W+N", lambda levels: improved(levels=levels, morphology=False)),
        Method("W+N+M", lambda levels: improved(levels=levels)),
    )


def second_set(block: int) -> tuple[Method, ...]:
    """Two algorithms that copy patches, and all improvements together."""
    return (
        Method("quilting", lambda _: ts.recipes.quilting(block=block)),
        Method("graph cut", lambda _: ts.recipes.graphcut()),
        Method("W+N+M", lambda levels: ts.recipes.improved_wl(levels=levels)),
    )


def run(task: Task) -> Outcome:
    """Synthesize and measure, on one thread: so it takes no longer beside others."""
    torch.set_num_threads(1)
    outcome = Outcome(task.texture, {}, {})
    for name, recipe in task.recipes.items():
        result = ts.synthesize(task.texture.image, task.shape, recipe, seed=task.seeds)
        outcome.images[name] = result.image
        outcome.rows[name] = measured(result, task.texture.image)
        structure = result.recipe.structure
        if structure is not None:
            outcome.chosen[name] = f"{structure.operation} {structure.size}x{structure.size}"
    return outcome


def run_all(tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """All outcomes, in order, from so many processes at once."""
    if jobs == 1:
        yield from map(run, tasks)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(run, tasks)


def measured(result: ts.Result, exemplar: torch.Tensor) -> list[Row]:
    """The measures of each output of a result."""
    return rows_of(result.image, exemplar, result.source, result.recipe.boundary)


def rows_of(
    image: torch.Tensor, exemplar: torch.Tensor, source: torch.Tensor, boundary: Boundary
) -> list[Row]:
    """The measures of each of some pictures; see :func:`torchsynth.metrics.measure` for the arguments."""
    found = ts.metrics.measure(image, exemplar, source, boundary=boundary)
    assert found.coverage is not None, "there is a source"  # noqa: S101 (for the type checker)
    columns = (
        found.patch_distance, found.sharpness, found.gradient_distance, found.copied, found.repetition,
        found.coverage, found.seam[:, 0], found.seam[:, 1],
    )  # fmt: skip
    return list(zip(*(column.tolist() for column in columns), strict=True))


def mean(rows: Sequence[Row]) -> Row:
    """The mean of each measure."""
    return tuple(sum(column) / len(column) for column in zip(*rows, strict=True))


def winners(rows: dict[str, Row]) -> list[set[str]]:
    """For each measure, who has the best value as it is shown, with two digits."""
    best = []
    for place, one in enumerate(MEASURES):
        faults = {name: one.fault(round(row[place], 2)) for name, row in rows.items()}
        least = min(faults.values())
        best.append({name for name, fault in faults.items() if fault <= least + 1e-9})
    return best


def wins(outcomes: Sequence[Outcome]) -> dict[str, list[int]]:
    """On how many textures each method has the best value of each measure."""
    best = [winners(outcome.means) for outcome in outcomes]
    names = outcomes[0].rows
    return {
        name: [sum(name in one[place] for one in best) for place in range(len(MEASURES))] for name in names
    }


def duels(outcomes: Sequence[Outcome], one: str, other: str) -> list[tuple[list[str], list[str]]]:
    """For each measure, the textures where the first method is better, and where the other is."""
    found = []
    for place in range(len(MEASURES)):
        better: tuple[list[str], list[str]] = ([], [])
        for outcome in outcomes:
            pair = {name: outcome.means[name] for name in (one, other)}
            best = winners(pair)[place]
            if best != set(pair):
                better[one not in best].append(outcome.texture.name)
        found.append(better)
    return found
