"""Time and memory of the recipes, against the cost of their bare matrix products.

    python scripts/benchmark.py --sizes 128x128 256x256 --out benchmark.json

Each measurement runs in a process of its own, which reports

* CPU and wall seconds of one synthesis, the best of ``--repeats``, after a small one to warm up;
* microseconds of wall time per output pixel;
* peak memory over that of the bare imports, in MB (the first synthesis, before anything else);
* the *floor*: the wall seconds that the multiply-adds of an exhaustive search take as bare matrix products,
  512 queries at a time into memory that is reused, measured in the same process between the repeats; and
  the ratio to it, which is below 1 for searches that try fewer candidates.

Machines differ and are rarely quiet: compare ratios measured in one run, not seconds.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import re
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import arguments
import torch
from rich.console import Console
from rich.table import Table

import torchsynth as ts
from torchsynth.exemplar_levels import ExemplarLevels
from torchsynth.feasibility import matching_dtype
from torchsynth.index import candidates
from torchsynth.lattice import Shape
from torchsynth.neighborhood import layers_at
from torchsynth.pyramid import level_shapes

QUERIES = 512
STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class Case:
    """One measurement to make."""

    recipe: str
    exemplar: str
    size: str
    batch: int
    threads: int
    repeats: int


def measure(case: Case) -> dict[str, float]:
    """Run one case in this process."""
    torch.set_num_threads(case.threads)
    exemplar = ts.read_image(case.exemplar)
    recipe = ts.load_recipe(case.recipe)
    height, width = arguments.size(case.size)
    seeds = list(range(case.batch))
    ramp = torch.linspace(0, 1, width).expand(len(exemplar), height, width)
    controls = ts.Controls(target=ramp) if recipe.follows_target else None
    imports = _peak_megabytes()
    seconds, cpu, floors = [], [], []
    for repeat in range(case.repeats):
        started, used = time.perf_counter(), time.process_time()
        ts.synthesize(exemplar, (height, width), recipe, controls=controls, seed=seeds)
        seconds.append(time.perf_counter() - started)
        cpu.append(time.process_time() - used)
        if repeat == 0:
            peak = _peak_megabytes() - imports
        floors.append(floor(exemplar, recipe, (height, width), case.batch))
    return {
        "wall_s": min(seconds),
        "cpu_s": min(cpu),
        "us_per_pixel": min(seconds) / (height * width * case.batch) * 1e6,
        "peak_mb": peak,
        "floor_s": min(floors),
        # Patches are not matched by such products.
        "ratio": min(seconds) / min(floors) if min(floors) > 0 else math.nan,
    }


def floor(exemplar: torch.Tensor, recipe: ts.Recipe, size: Shape, batch: int) -> float:
    """Seconds that the multiply-adds of an exhaustive synthesis take as bare matrix products."""
    dtype = matching_dtype(recipe, len(exemplar))
    planes = ExemplarLevels.of(ts.Exemplar(exemplar), recipe, dtype).planes
    total = 0.0
    for level, (height, width) in enumerate(level_shapes(size, recipe.levels)):
        for sweep in recipe.sweeps_at(level):
            layers = layers_at(sweep.layers, level, recipe.levels)
            features = len(exemplar) * sum(len(layer.template.offsets()) for layer in layers)
            found = int(candidates(layers, planes, level).sum())
            total += _product_seconds(height * width * batch, features, found, dtype)
    return total


def _product_seconds(queries: int, features: int, found: int, dtype: torch.dtype) -> float:
    left = torch.randint(-128, 128, (QUERIES, features)).to(dtype)
    right = torch.randint(-128, 128, (features, found)).to(dtype)
    out = torch.empty(QUERIES, found, dtype=dtype)
    torch.mm(left, right, out=out)
    started = time.perf_counter()
    for start in range(0, queries, QUERIES):
        count = min(QUERIES, queries - start)
        torch.mm(left[:count], right, out=out[:count])
    return time.perf_counter() - started


def _peak_megabytes() -> float:
    if STATUS.exists():
        # On Linux ru_maxrss is no less than what the process that started this one had.
        found = re.search(r"^VmHWM:\s*(\d+) kB$", STATUS.read_text(), re.MULTILINE)
        if found:
            return int(found[1]) / 2**10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def _in_own_process(case: Case) -> dict[str, float]:
    command = [sys.executable, __file__, "--case", json.dumps(asdict(case))]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode != 0:  # it has said why, in one line if the input was wrong
        sys.stderr.write(done.stderr)
        sys.exit(done.returncode)
    measured: dict[str, float] = json.loads(done.stdout)
    return measured


def _table(rows: list[dict[str, object]]) -> Table:
    table = Table(
        "recipe",
        "exemplar",
        "size",
        "batch",
        "threads",
        "wall s",
        "CPU s",
        "us/pixel",
        "peak MB",
        "floor s",
        "ratio",
    )
    for row in rows:
        names = [str(row[name]) for name in ("recipe", "exemplar", "size", "batch", "threads")]
        figures = [
            f"{row[name]:.2f}" for name in ("wall_s", "cpu_s", "us_per_pixel", "peak_mb", "floor_s", "ratio")
        ]
        table.add_row(*names, *figures)
    return table


def cases(options: argparse.Namespace) -> list[Case]:
    """Every combination that was asked for; what they name is there."""
    for recipe in options.recipes:
        ts.load_recipe(recipe)
    for exemplar in options.exemplars:
        ts.read_image(exemplar)
    sizes = [f"{height}x{width}" for height, width in options.sizes]
    wanted = product(options.recipes, options.exemplars, sizes, options.batches, options.threads)
    return [Case(*one, options.repeats) for one in wanted]


def report(wanted: Sequence[Case], out: Path | None) -> None:
    """Measure the cases one after the other, print a table, and write the figures."""
    rows = [asdict(case) | _in_own_process(case) for case in wanted]
    Console(width=140).print(_table(rows))
    if out:
        about = {
            "torch": torch.__version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
        }
        out.write_text(json.dumps({"versions": about, "rows": rows}, indent=2))


def main() -> None:
    """Measure what was asked for; with ``--case``, one case in this process."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    count = arguments.whole_number(1)
    parser.add_argument("--recipes", nargs="+", default=sorted(ts.recipes.RECIPES))
    parser.add_argument("--exemplars", nargs="+", default=["sample:brick"])
    parser.add_argument("--sizes", nargs="+", type=arguments.size, default=[(128, 128), (256, 256)])
    parser.add_argument("--batches", nargs="+", type=count, default=[1])
    parser.add_argument("--threads", nargs="+", type=count, default=[1, 2])
    parser.add_argument("--repeats", type=count, default=3)
    parser.add_argument("--out", type=arguments.file_to_write, help="also write the figures here, as JSON")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        if options.case:
            print(json.dumps(measure(Case(**json.loads(options.case)))))
        else:
            report(cases(options), options.out)


if __name__ == "__main__":
    main()
