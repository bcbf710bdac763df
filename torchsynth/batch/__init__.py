"""Many outputs at once: a grid of exemplars, recipes, sizes and seeds, made in shared batches.

Each output is written with its record as soon as it is finished, and a manifest says what is there. So the work can
be stopped at any moment, and started again without making anything twice.
"""

from __future__ import annotations

from torchsynth.batch.engines import Engine, in_process, on_ray
from torchsynth.batch.grid import Grid, load_grid
from torchsynth.batch.manifest import Manifest
from torchsynth.batch.running import BatchProgress, Report, run_batch
from torchsynth.batch.work import Failure

__all__ = [
    "BatchProgress",
    "Engine",
    "Failure",
    "Grid",
    "Manifest",
    "Report",
    "in_process",
    "load_grid",
    "on_ray",
    "run_batch",
]
