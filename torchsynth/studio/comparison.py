"""Two recipes side by side: how long each takes, and what the measures say of it."""

from __future__ import annotations

from collections.abc import Sequence

from torchsynth.errors import InputError
from torchsynth.metrics import SMALLEST_SIDE, Measures, measure
from torchsynth.result import Result, check_sources
from torchsynth.studio.visitor import Sample

ROWS = {
    "patch_distance": "patch distance (1: as close as two real crops)",
    "sharpness": "sharpness (1: as the sample)",
    "gradient_distance": "gradient distance (0: as the sample)",
    "copied": "copied (share of windows)",
    "repetition": "repetition (share of windows)",
    "run_length": "run length (pixels)",
    "coverage": "coverage (share of the sample)",
    "seam": "seam, top to bottom and left to right (1: none)",
}
"""The measures that are shown, and what is good."""


def rows(sample: Sample, results: Sequence[Result], seconds: Sequence[float]) -> dict[str, list[str]]:
    """A table's rows: the time, and each measure, one text for each output.

    Args:
        sample: What all were made of.
        results: The outputs.
        seconds: How long each took.

    Example:
        >>> import torchsynth as ts
        >>> from torchsynth.studio.work import read_sample
        >>> sample = read_sample("sample:brick", "brick")
        >>> made = ts.synthesize(sample.picture.image, (16, 16), ts.recipes.ashikhmin())
        >>> rows(sample, [made], [0.5])["time"]
        ['0.50 s']
    """
    found = {"time": [f"{one:.2f} s" for one in seconds]}
    height, width = results[0].image.shape[-2:]
    if min(height, width, *sample.shape) < SMALLEST_SIDE:
        return found | {"measures": [f"need {SMALLEST_SIDE} pixels a side"] * len(results)}
    measured = [_measured(sample, result).rows()[0] for result in results]
    return found | {label: [_cell(one[name]) for one in measured] for name, label in ROWS.items()}


def _measured(sample: Sample, result: Result) -> Measures:
    source = result.source if _is_copied(result) else None
    return measure(result.image, sample.picture.image, source, boundary=result.recipe.boundary)


def _is_copied(result: Result) -> bool:
    try:
        check_sources(result.recipe, "measures")
    except InputError:
        return False
    return bool((result.source >= 0).all()) and result.recipe.blur_seams is None


def _cell(value: float | list[float] | None) -> str:
    if value is None:
        return "\N{EN DASH}"
    return f"{value:.3g}" if isinstance(value, float) else ", ".join(f"{one:.3g}" for one in value)
