"""How long algorithms take, on one thread, beside the times that the papers report."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from comparison import first_set, second_set

import torchsynth as ts

SIDE = 192
"""Side of the exemplar of which all others are parts."""

NOTES = (
    "The report's times are those of Java on a Pentium III of 800 MHz. Its tables 4.1 and 4.2 give the same "
    "multi-resolution time for exemplars of 64x64 and of 96x96, and two times for a single resolution.",
    "Ashikhmin's are those of a 195 MHz R10000; where his text does not say of which size they are, they are "
    "taken for those of 500x500.",
)

_ASHIKHMIN = "Ashikhmin, section 5"
_REPORT = "report, table"


@dataclass(frozen=True)
class Case:
    """Something to time.

    Args:
        name: What it is.
        exemplar: The exemplar's side.
        output: The output's side.
        recipe: How it is made.
        reported: What a paper says of the same, in seconds.
        source: Where it says so.
        without: A recipe whose time is to be subtracted.
    """

    name: str
    exemplar: int
    output: int
    recipe: ts.Recipe
    reported: str = ""
    source: str = ""
    without: ts.Recipe | None = None


@dataclass(frozen=True)
class Timing:
    """How long a case took, the best of some runs.

    Args:
        case: What was timed.
        seconds: All of it.
        training: The part that grew trees, if there were any.
    """

    case: Case
    seconds: float
    training: float | None = None

    @property
    def shown(self) -> str:
        """The seconds in words."""
        if self.training is None:
            return f"{self.seconds:.2f}"
        return f"{self.seconds:.2f} ({self.training:.2f} + {self.seconds - self.training:.2f})"


def reported_cases() -> list[Case]:
    """What the report and Ashikhmin's paper have times for."""
    recipes = ts.recipes
    multi = recipes.wei_levoy(levels=3, neighborhood=5, parent=3)
    cases = []
    for side, number, seconds in ((64, "4.1", "6240"), (96, "4.2", "10240")):
        single = recipes.wei_levoy_single(neighborhood=19)
        source = f"{_REPORT} {number}"
        cases.append(Case("WL, one level, 19x19", side, 128, single, seconds, source))
        cases.append(Case("WL, {5x5}, {5x5,3x3}, {5x5,3x3}", side, 128, multi, "2190", source))
    trees = recipes.wei_levoy_tsvq(levels=3, neighborhood=5, parent=3, depth=8)
    several = recipes.ashikhmin_multires(levels=3, neighborhood=5, parent=3)
    small, middle = (recipes.ashikhmin(neighborhood=side) for side in (3, 9))
    plain = recipes.ashikhmin(tileable=False)
    once, twice = (recipes.ashikhmin_target(passes=passes) for passes in (1, 2))
    return [
        *cases,
        Case("the same with TSVQ of depth 8", 96, 128, trees, "161 (30 + 131)", f"{_REPORT} 4.2"),
        Case("Ashikhmin, one level, 3x3", 96, 128, small, "1", f"{_REPORT} 4.3"),
        Case("Ashikhmin, one level, 9x9", 96, 128, middle, "14", f"{_REPORT} 4.3"),
        Case("Ashikhmin, {5x5}, {5x5,3x3}, {5x5,3x3}", 96, 128, several, "12", f"{_REPORT} 4.3"),
        Case("WL with TSVQ, 9x9 on four levels", SIDE, 200, recipes.wei_levoy_tsvq(), "20 to 30", _ASHIKHMIN),
        Case("Ashikhmin, 5x5", SIDE, 200, plain),
        Case("Ashikhmin, 5x5", SIDE, 500, plain, "1.3", _ASHIKHMIN),
        Case("user control, first pass", SIDE, 200, once, "0.3", _ASHIKHMIN),
        Case("user control, first pass", SIDE, 500, once, "1.5", _ASHIKHMIN),
        Case("user control, each further pass", SIDE, 500, twice, "2.8", _ASHIKHMIN, once),
    ]


def set_cases(block: int) -> list[Case]:
    """The methods of the two sets of experiments; Wei-Levoy, which the others are compared with, is first."""
    methods = {method.name: method.recipe(4) for method in (*first_set(), *second_set(block))}
    return [Case(name, 128, 256, recipe) for name, recipe in methods.items()]


def timed(case: Case, texture: torch.Tensor, repeats: int) -> Timing:
    """Time a case, on one thread.

    Args:
        case: What.
        texture: A picture that holds its exemplar.
        repeats: How many times; the best counts.
    """
    exemplar = texture[:, : case.exemplar, : case.exemplar]
    if any(isinstance(sweep.search, ts.TSVQ) for sweep in case.recipe.sweeps):
        return _timed_with_trees(case, exemplar, repeats)
    seconds = best_of(repeats, lambda: _synthesize(exemplar, case.output, case.recipe))
    if case.without is not None:
        other = case.without
        seconds -= best_of(repeats, lambda: _synthesize(exemplar, case.output, other))
    return Timing(case, seconds)


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """The least seconds that some work takes."""
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def reported_table(timings: Sequence[Timing]) -> list[list[str]]:
    """Our times beside the reported ones."""
    lines = [["algorithm", "exemplar", "output", "seconds", "reported seconds", "source"]]
    for timing in timings:
        case = timing.case
        sizes = [f"{side}x{side}" for side in (case.exemplar, case.output)]
        lines.append([case.name, *sizes, timing.shown, case.reported or "-", case.source or "-"])
    return lines


def set_table(timings: Sequence[Timing]) -> list[list[str]]:
    """The times of the two sets, and how many times as long as the first each is."""
    lines = [["algorithm", "seconds", f"times {timings[0].case.name}"]]
    for timing in timings:
        ratio = timing.seconds / timings[0].seconds
        lines.append([timing.case.name, timing.shown, f"{ratio:.2f}"])
    return lines


def _synthesize(exemplar: torch.Tensor, side: int, recipe: ts.Recipe) -> None:
    ramp = torch.linspace(0, 1, side).expand(len(exemplar), side, side)
    controls = ts.Controls(target=ramp) if recipe.follows_target else None
    ts.synthesize(exemplar, (side, side), recipe, controls=controls, seed=0)


def _timed_with_trees(case: Case, exemplar: torch.Tensor, repeats: int) -> Timing:
    """Growing the trees, and searching them, one by one."""
    training = best_of(repeats, lambda: ts.train(exemplar, case.recipe))
    codebook = ts.train(exemplar, case.recipe)
    size = (case.output, case.output)
    searching = best_of(repeats, lambda: ts.synthesize(exemplar, size, case.recipe, codebook=codebook))
    return Timing(case, training + searching, training)
