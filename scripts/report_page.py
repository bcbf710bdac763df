"""One page of HTML for a report: text, tables and pictures, that opens without a network or a program."""

from __future__ import annotations

import csv
from collections.abc import Collection, Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; background: #fff }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums }
caption { text-align: left; padding-bottom: .3rem; color: #555 }
th, td { padding: .15rem .7rem; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top }
th:first-child, td:first-child, .words td { text-align: left }
td.best { font-weight: bold; background: #eaf4ea }
img { max-width: 100%; display: block }
h2 { margin-top: 3rem; border-top: 2px solid #ddd; padding-top: 1rem }
"""


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page.

    Args:
        title: Its title and heading.
        parts: What is below that, as HTML.
    """
    head = f'<meta charset="utf-8"><title>{escape(title)}</title>'
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    body = "\n".join((f"<h1>{escape(title)}</h1>", *parts))
    start = f'<!DOCTYPE html>\n<html lang="en">\n<head>{head}{view}<style>{_STYLE}</style></head>'
    return f"{start}\n<body>\n{body}\n</body>\n</html>\n"


def heading(text: str) -> str:
    """A heading of a section."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def listing(lines: Sequence[str]) -> str:
    """A list of plain lines."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def picture(path: str, about: str) -> str:
    """A picture by its path from the page, which it also links to.

    Args:
        path: With slashes.
        about: What it shows, for those who cannot see it.
    """
    link = escape(quote(path))
    return f'<a href="{link}"><img src="{link}" alt="{escape(about)}" loading="lazy"></a>'


def table(
    caption: str,
    lines: Sequence[Sequence[str]],
    best: Collection[tuple[int, int]] = (),
    words: bool = False,
) -> str:
    """A table.

    Args:
        caption: What it shows.
        lines: The headings first.
        best: Line and column of the cells that stand out; line 1 is the first below the headings.
        words: Whether its cells are words, to be aligned left.
    """
    kind = ' class="words"' if words else ""
    rows = ["<tr>" + "".join(f"<th>{escape(cell)}</th>" for cell in lines[0]) + "</tr>"]
    for number, line in enumerate(lines[1:], 1):
        cells = [_cell(cell, (number, column) in best) for column, cell in enumerate(line)]
        rows.append("<tr>" + "".join(cells) + "</tr>")
    body = "\n".join(rows)
    return f"<table{kind}><caption>{escape(caption)}</caption>\n{body}\n</table>"


def write_csv(lines: Sequence[Sequence[str]], path: Path) -> None:
    """The same lines for programs."""
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)


def _cell(text: str, best: bool) -> str:
    kind = ' class="best"' if best else ""
    return f"<td{kind}>{escape(text)}</td>"
