"""From a grid to batches of work, and the jobs that cannot be done."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from torchsynth.batch.grid import Grid
from torchsynth.batch.work import Failure, Output, Work
from torchsynth.config import load_recipe
from torchsynth.errors import TorchsynthError
from torchsynth.inputs import Inputs
from torchsynth.lattice import Shape
from torchsynth.memory import outputs_that_fit
from torchsynth.orders import Order
from torchsynth.recipe import Recipe
from torchsynth.records import Job
from torchsynth.versions import versions

AT_ONCE = 16
"""Outputs made together: more gain little, and more is lost when the work is stopped."""


@dataclass(frozen=True)
class Plan:
    """All the work of a grid.

    Args:
        work: The batches, those of one exemplar side by side.
        failures: The jobs that cannot be done, whose files cannot be read.
    """

    work: tuple[Work, ...]
    failures: tuple[Failure, ...]

    @property
    def outputs(self) -> list[Output]:
        """All outputs of all batches."""
        return [output for work in self.work for output in work.outputs]


def plan(grid: Grid) -> Plan:
    """Read every exemplar and recipe once, and put together what is to be made.

    Args:
        grid: What is wanted; what is wanted twice is made once.

    Example:
        >>> found = plan(Grid(exemplars=["sample:brick", "none.png"], recipes=["ashikhmin"], seeds="0..19"))
        >>> [len(work.outputs) for work in found.work], [failure.outputs for failure in found.failures]
        ([16, 4], [20])
    """
    works: list[Work] = []
    failures: list[Failure] = []
    recipes = {name: _attempted(load_recipe, name) for name in dict.fromkeys(grid.recipes)}
    each = len(set(grid.seeds)) * len(set(grid.sizes or (None,)))
    for failed, error in ((name, one) for name, one in recipes.items() if isinstance(one, TorchsynthError)):
        failures.append(Failure(failed, each * len(set(grid.exemplars)), str(error)))
    usable = {name: one for name, one in recipes.items() if isinstance(one, Recipe)}
    for exemplar in dict.fromkeys(grid.exemplars):
        inputs = _attempted(Inputs.read, Job(exemplar, None, None, ()))
        if isinstance(inputs, TorchsynthError):
            failures.append(Failure(exemplar, each * len(usable), str(inputs)))
            continue
        for name, size in product(usable, dict.fromkeys(grid.sizes or (None,))):
            job = Job(exemplar, usable[name], size, tuple(dict.fromkeys(grid.seeds)))
            try:
                works.extend(_batches(job, name, inputs, grid))
            except TorchsynthError as error:
                failures.append(Failure(f"{exemplar}, {name}", len(job.seeds), str(error)))
    return Plan(tuple(_once(works)), tuple(failures))


def _once(works: Sequence[Work]) -> list[Work]:
    """The batches without outputs that another one makes already: of one file under two paths, for one."""
    seen: set[str] = set()
    left = []
    for work in works:
        new = [output for output in work.outputs if output.key not in seen]
        seen |= {output.key for output in new}
        if new:
            left.append(work.of(new))
    return left


def _batches(job: Job, name: str, inputs: Inputs, grid: Grid) -> list[Work]:
    """The outputs of one exemplar, recipe and size, some at a time."""
    assert job.recipe is not None, "it was loaded"  # noqa: S101 (for the type checker)
    order = Order.of(job, inputs)
    decisive = {
        "names": [_plain(job.exemplar), _plain(name)],  # they are in the files' names
        "recipe": job.recipe.plain(),
        "inputs": inputs.digests,
        "size": list(order.size),
        "versions": versions(),
        "format": grid.format,
        "source_maps": grid.source_maps,
        "figures": sorted(set(grid.figures)),
    }
    outputs = [_output(job.exemplar, name, order.size, decisive | {"seed": seed}) for seed in job.seeds]
    at_once = outputs_that_fit(job.recipe, order.exemplar, order.size, min(AT_ONCE, len(outputs)))
    return [
        _work(job, inputs, outputs[start : start + at_once], grid)
        for start in range(0, len(outputs), at_once)
    ]


def _work(job: Job, inputs: Inputs, outputs: Sequence[Output], grid: Grid) -> Work:
    some = Job(job.exemplar, job.recipe, job.size, tuple(output.seed for output in outputs))
    return Work(some, inputs, tuple(outputs), f".{grid.format}", grid.source_maps, grid.figures, versions())


def _output(exemplar: str, recipe: str, size: Shape, decisive: dict[str, Any]) -> Output:
    """One output, with the key that all that decides its bytes makes."""
    seed = decisive["seed"]
    key = hashlib.sha256(json.dumps(decisive, sort_keys=True).encode()).hexdigest()
    stem = "-".join((_plain(exemplar), _plain(recipe), f"{size[0]}x{size[1]}", str(seed), key[:8]))
    return Output(key, seed, stem, {"exemplar": exemplar, "recipe": recipe, "size": list(size), "seed": seed})


def _plain(name: str) -> str:
    """A file's name, or a sample's, without what a file name should not hold."""
    return re.sub(r"[^\w.]+", "_", Path(name.removeprefix("sample:")).stem).strip("._") or "unnamed"


def _attempted(read: Any, what: Any) -> Any:  # noqa: ANN401 (whatever is read)
    """What is read, or why it cannot be."""
    try:
        return read(what)
    except TorchsynthError as error:
        return error
