"""The command that measures outputs: ``torchsynth measure``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from torch import Tensor

from torchsynth.errors import InputError
from torchsynth.io import read_image
from torchsynth.lattice import Shape
from torchsynth.metrics import Measures, measure
from torchsynth.metrics.copying import WINDOW
from torchsynth.metrics.report import Row, check_pictures, check_sources
from torchsynth.options import cancellable
from torchsynth.source_map import read_source_map

MEANINGS: dict[str, str] = {
    "patch_distance": "1: as close to the exemplar as two real crops are; more: farther",
    "patch_distances": "the same at each level, the finest first",
    "sharpness": "1: as sharp as the exemplar; less: blurred; more: noisy, or seams",
    "gradient_distance": "0: edges as strong, and as many, as in the exemplar",
    "copied": f"share of {WINDOW}x{WINDOW} windows that are verbatim copies; 0: nothing comes back as it is",
    "repetition": "share of windows that are copies and come more than once; 0: none",
    "run_length": "pixels; size of the pieces that were copied",
    "coverage": "share of the exemplar that is used; 1: all that can be",
    "seam": "top to bottom, left to right, if laid side by side; 1: cannot be seen",
}
"""What is good, for each measure."""


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command("measure")(measure_files)


def measure_files(
    outputs: Annotated[
        list[str], typer.Argument(metavar="OUTPUT...", help="The pictures to measure, or sample:NAME.")
    ],
    exemplar: Annotated[
        str,
        typer.Option(metavar="FILE", help="What they were made from, or sample:NAME.", show_default=False),
    ],
    source_map: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.npz",
            help="What 'synthesize --source-map' wrote; with several outputs once for each, in their order. "
            "Without it copies are looked for in the pictures.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure how good outputs are: closeness to the exemplar, sharpness, copying, repetition, seams."""
    maps = source_map or []
    if maps and len(maps) != len(outputs):
        raise InputError(
            "--source-map", f"must be given once for each output, {len(outputs)}",
            f"it is given {len(maps)} times", "give all of them, in the order of the outputs, or none",
        )  # fmt: skip
    with cancellable():
        sample = read_image(exemplar)
        paths: list[Path | None] = [*maps] or [None] * len(outputs)
        inputs = [_read(output, exemplar, sample, path) for output, path in zip(outputs, paths, strict=True)]
        measured = [measure(image, sample, source) for image, source in inputs]
    rows = [one.rows()[0] for one in measured]
    typer.echo(_as_json(exemplar, outputs, maps, rows) if as_json else _table(outputs, measured))


def _read(output: str, name: str, exemplar: Tensor, path: Path | None) -> tuple[Tensor, Tensor | None]:
    """A picture and its source map; all is checked before the first is measured."""
    image = read_image(output)
    check_pictures(image, exemplar, (output, name))
    if path is None:
        return image, None
    saved = read_source_map(path)
    source, size = saved.source, saved.exemplar
    _check_size(path, size, exemplar)
    check_sources(source, image.unsqueeze(0), exemplar.unsqueeze(0), str(path))
    return image, source


def _check_size(path: Path, size: Shape, exemplar: Tensor) -> None:
    height, width = exemplar.shape[1:]
    if size != (height, width):
        raise InputError(
            str(path), f"must lead into the exemplar, {height}x{width}",
            f"it was made for one of {size[0]}x{size[1]}", "pass the exemplar that the output was made from",
        )  # fmt: skip


def _as_json(exemplar: str, outputs: Sequence[str], maps: Sequence[Path], rows: Sequence[Row]) -> str:
    found: list[dict[str, Any]] = [
        {"output": output, "source_map": str(maps[item]) if maps else None, **row}
        for item, (output, row) in enumerate(zip(outputs, rows, strict=True))
    ]
    return json.dumps({"exemplar": exemplar, "outputs": found}, indent=2, allow_nan=False)


def _table(outputs: Sequence[str], measured: Sequence[Measures]) -> str:
    """One block for each output: a line for each measure, with what is good."""
    lines = []
    for output, one in zip(outputs, measured, strict=True):
        lines.append(output)
        cells = {name: _cell(value) for name, value in one.rows()[0].items()}
        width = max(map(len, cells.values()))
        for name, cell in cells.items():
            lines.append(f"  {name.replace('_', ' '):18} {cell:>{width}}   {MEANINGS[name]}")
    if measured[0].coverage is None:
        lines.append("Without --source-map copies were looked for in the pictures; - needs the source map.")
    return "\n".join(lines)


def _cell(value: float | list[float] | None) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else " ".join(f"{one:.3g}" for one in value)
