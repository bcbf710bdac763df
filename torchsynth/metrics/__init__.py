"""Measures of outputs: numbers for what the eye looks for."""

from torchsynth.metrics.copying import (
    copied,
    coverage,
    matched_windows,
    repetition,
    run_length,
    source_windows,
)
from torchsynth.metrics.report import SMALLEST_SIDE, Measures, measure
from torchsynth.metrics.seams import edge_ratio, seam_ratio
from torchsynth.metrics.sharpness import gradient_distance, sharpness
from torchsynth.metrics.statistics import patch_distance, patch_distances

__all__ = [
    "SMALLEST_SIDE",
    "Measures",
    "copied",
    "coverage",
    "edge_ratio",
    "gradient_distance",
    "matched_windows",
    "measure",
    "patch_distance",
    "patch_distances",
    "repetition",
    "run_length",
    "seam_ratio",
    "sharpness",
    "source_windows",
]
