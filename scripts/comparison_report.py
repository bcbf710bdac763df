"""The report of a comparison: a contact sheet for each texture, tables of the measures, and a page with all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from comparison import MEASURES, Outcome, Row, duels, mean, winners, wins
from exemplars import Texture
from layout import Pixels, framed, in_a_column, in_a_row, labelled, shown
from PIL import Image
from report_page import heading, listing, page, paragraph, picture, table, write_csv

SHEETS = "sheets"
TABLE = "measures.csv"
PAGE = "index.html"

_SEAM = [one.name for one in MEASURES].index("seam top-bottom")
_SEAM_CAPTION = (
    "Seam from top to bottom: mean of the seeds (largest). Exemplar's rows: what nine of ten pairs of its own "
    "neighboring rows stay below, if they are measured like a seam"
)
_ENLARGED = 2


def sheet(outcome: Outcome) -> Pixels:
    """The exemplar and the outputs beside it; below each output those of the other seeds."""
    heights = [len(images[0, 0]) for images in outcome.images.values()]
    first = _tile(
        framed(shown(outcome.texture.image), max(heights), outcome.texture.image.shape[2]), "exemplar"
    )
    columns = [in_a_column([first, *[np.ones_like(first)] * (len(next(iter(outcome.images.values()))) - 1)])]
    for name, images in outcome.images.items():
        columns.append(in_a_column([_tile(shown(image), name) for image in images]))
    return in_a_row(columns)


def save_sheet(outcome: Outcome, folder: Path) -> Path:
    """Write the contact sheet of a texture as PNG."""
    path = folder / SHEETS / f"{outcome.texture.name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((sheet(outcome) * 255).round().astype(np.uint8)).save(path)
    return path


def rows_table(rows: dict[str, Row]) -> list[list[str]]:
    """A line for each method, under a line of headings."""
    lines = [["", *(one.name for one in MEASURES)]]
    return lines + [[name, *(f"{value:.2f}" for value in row)] for name, row in rows.items()]


def best_cells(rows: dict[str, Row]) -> set[tuple[int, int]]:
    """Where such a table has the best value of its column."""
    best = winners(rows)
    return {
        (number, place + 1)
        for number, name in enumerate(rows, 1)
        for place in range(len(MEASURES))
        if name in best[place]
    }


def all_rows(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """The means of each texture and method, under a line of headings, and those over all textures."""
    lines = [["texture", "method", *(one.name for one in MEASURES)]]
    for outcome in outcomes:
        for name, row in outcome.means.items():
            lines.append([outcome.texture.name, name, *(f"{value:.4f}" for value in row)])
    for name, row in overall(outcomes).items():
        lines.append(["mean", name, *(f"{value:.4f}" for value in row)])
    return lines


def overall(outcomes: Sequence[Outcome]) -> dict[str, Row]:
    """The mean of each method over all textures."""
    return {name: mean([outcome.means[name] for outcome in outcomes]) for name in outcomes[0].rows}


def seam_table(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """The seam from top to bottom: the mean of each texture and method, and the largest of all seeds."""
    names = list(outcomes[0].rows)
    lines = [["texture", "exemplar's rows", *names]]
    for outcome in outcomes:
        cells = []
        for name in names:
            values = [row[_SEAM] for row in outcome.rows[name]]
            cells.append(f"{sum(values) / len(values):.2f} ({max(values):.2f})")
        lines.append([outcome.texture.name, f"{usual_seam(outcome.texture.image):.2f}", *cells])
    return lines


def usual_seam(image: torch.Tensor) -> float:
    """What nine of ten pairs of neighboring rows of a picture stay below: seams of its own.

    A picture with a strong line, or with rows unlike each other, has perfect seams above 1.
    """
    steps = image.diff(dim=1).abs().mean((0, 2))
    return float(steps.quantile(0.9) / steps.mean().clamp(min=1e-12))


def duel_table(outcomes: Sequence[Outcome], one: str, other: str) -> list[list[str]]:
    """On which textures a method is better than another, and where it is not, for each measure."""
    lines = [["measure", f"{one} is better on", f"{other} is better on"]]
    for measure, pair in zip(MEASURES, duels(outcomes, one, other), strict=True):
        cells = [f"{len(names)}: {', '.join(names)}" if names else "0" for names in pair]
        lines.append([measure.name, *cells])
    return lines


def write(
    outcomes: Sequence[Outcome],
    folder: Path,
    title: str,
    notes: Sequence[str],
    pairs: Sequence[tuple[str, str]],
) -> list[Path]:
    """Write table and page; the sheets are there already.

    Args:
        outcomes: What to show.
        folder: Where to.
        title: Of the page.
        notes: What is compared, in some lines.
        pairs: The methods that are compared with each other one to one.

    Returns:
        The files.
    """
    parts = [*map(paragraph, notes), listing([f"{one.name}: {one.about}" for one in MEASURES])]
    means, won = overall(outcomes), wins(outcomes)
    count = len(outcomes)
    parts += [
        heading("All textures"),
        table(f"Means over {count} textures; the best is bold", rows_table(means), best_cells(means)),
        table(
            f"On how many of {count} textures each is best",
            [rows_table(means)[0], *([name, *map(str, row)] for name, row in won.items())],
        ),
        *(
            table(f"{one} against {other}", duel_table(outcomes, one, other), words=True)
            for one, other in pairs
        ),
        table(_SEAM_CAPTION, seam_table(outcomes)),
        *(part for outcome in outcomes for part in _section(outcome)),
    ]
    write_csv(all_rows(outcomes), folder / TABLE)
    (folder / PAGE).write_text(page(title, parts), encoding="utf-8")
    return [folder / TABLE, folder / PAGE]


def _section(outcome: Outcome) -> list[str]:
    texture: Texture = outcome.texture
    about = f"{texture.name} and what was made of it"
    return [
        heading(texture.caption),
        *(paragraph(f"{name}: {chosen}") for name, chosen in outcome.chosen.items()),
        picture(f"{SHEETS}/{texture.name}.png", about),
        table("Means of the seeds", rows_table(outcome.means), best_cells(outcome.means)),
    ]


def _tile(pixels: Pixels, text: str) -> Pixels:
    large = pixels.repeat(_ENLARGED, axis=0).repeat(_ENLARGED, axis=1)
    return labelled(large, text)
