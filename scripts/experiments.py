"""The experiments of the papers, repeated on every picture of a folder.

    python scripts/experiments.py first --textures DIR --out DIR
    python scripts/experiments.py second --textures DIR --out DIR
    python scripts/experiments.py timing --textures DIR --out DIR

``first`` compares Wei-Levoy (WL: four levels, 9x9 and 5x5), Ashikhmin (the recipe's 5x5 on one level) and the
improvements of Wei-Levoy: weighting (W), non-causal passes (W+N), morphology (W+N+M); outputs are as large
as the exemplar. ``second`` compares image quilting, graph-cut textures and W+N+M, with outputs of twice ``--size``.
Both write a contact sheet for each texture, one table of all measures, and ``index.html``, which shows
everything. ``timing`` writes tables of seconds, ours beside the reported ones.

Each picture is made gray (the mean of its colors), shrunk by half, or by less if it would become smaller than
``--size`` (128), and cropped to its middle; smaller pictures are used as they are, and those below 64x64 are left
out. Pyramids have four levels, or as many as leave 16 pixels a side.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import arguments
import comparison_report
import timings
import torch
from comparison import Method, Outcome, Task, first_set, run_all, second_set
from exemplars import Texture, gathered
from report_page import page, paragraph, table, write_csv

import torchsynth as ts

BLOCK = 42
"""The block that the paper has for most textures; it should be about as large as their structures."""

FIRST_NOTES = (
    "For each texture there are the exemplar, Wei and Levoy's algorithm (WL), Ashikhmin's, and WL with "
    "weighted matching (W), with non-causal passes too (W+N), and with morphology and an analogy too (W+N+M). "
    "Below each other are outputs of different seeds.",
    "Outputs are as large as the exemplar. WL and its improvements compare 9x9 causal neighborhoods and 5x5 of the "
    "coarser level; Ashikhmin's algorithm is the one of his paper, 5x5 on one level.",
)
SECOND_NOTES = (
    "For each texture there are the exemplar, image quilting, graph-cut textures, and the improved "
    "Wei-Levoy algorithm with all of its modifications (W+N+M).",
    "Patches are copied verbatim, and so are close to the exemplar by nature. Only the outputs of W+N+M tile: "
    "the seams of the others are those of any picture with borders.",
)


def main() -> None:
    """Run what was asked for."""
    parser = _parser()
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        check_folder(options.out, options.overwrite)
        textures, left_out = gathered(
            options.textures, options.size, only=options.only, without=options.without
        )
        for line in left_out:
            print(line)
        options.out.mkdir(parents=True, exist_ok=True)
        options.run(textures, options)


def first(textures: list[Texture], options: argparse.Namespace) -> None:
    """The paper's first set: what each improvement brings."""
    outcomes = compared(textures, first_set(), None, options)
    pairs = (("W+N+M", "WL"), ("W+N", "WL"), ("W+N+M", "W+N"), ("W+N+M", "Ashikhmin"))
    _report(outcomes, options.out, "First set: what each improvement brings", FIRST_NOTES, pairs)


def second(textures: list[Texture], options: argparse.Namespace) -> None:
    """The paper's second set: the improved algorithm beside those that copy patches."""
    check_block(options.block, textures)
    side = 2 * options.size
    outcomes = compared(textures, second_set(options.block), (side, side), options)
    pairs = (("W+N+M", "quilting"), ("W+N+M", "graph cut"))
    notes = (*SECOND_NOTES, f"Outputs are {side}x{side}; quilting has blocks of {options.block} pixels.")
    _report(outcomes, options.out, "Second set: beside algorithms that copy patches", notes, pairs)


def timing(textures: list[Texture], options: argparse.Namespace) -> None:
    """The reported times and ours."""
    fitting = [one for one in textures if min(one.image.shape[1:]) >= options.size]
    if not fitting:
        raise ts.InputError(
            "--textures", f"must hold a picture of {options.size}x{options.size} or more", "all are smaller",
            "give a larger one",
        )  # fmt: skip
    texture = fitting[0]
    torch.set_num_threads(1)
    tables = {
        "reported": timings.reported_table(_timed(timings.reported_cases(), texture, options.repeats)),
        "sets": timings.set_table(_timed(timings.set_cases(options.block), texture, options.repeats)),
    }
    captions = ("Reported times, and ours (of trees: growing + searching)", "128x128 to 256x256")
    shown = [
        table(caption, lines, words=True) for caption, lines in zip(captions, tables.values(), strict=True)
    ]
    about = (
        f"PyTorch {torch.__version__}, one thread, the best of {options.repeats}; parts of {texture.name}."
    )
    path = options.out / comparison_report.PAGE
    path.write_text(
        page("Times", [paragraph(about), *map(paragraph, timings.NOTES), *shown]), encoding="utf-8"
    )
    for name, lines in tables.items():
        write_csv(lines, options.out / f"{name}.csv")
    print(path)


def compared(
    textures: list[Texture],
    methods: tuple[Method, ...],
    shape: tuple[int, int] | None,
    options: argparse.Namespace,
) -> list[Outcome]:
    """Run all methods on all textures; each sheet is written as soon as it is there."""
    seeds = tuple(range(options.seeds))
    tasks = []
    for texture in textures:
        height, width = texture.image.shape[1:]
        recipes = {method.name: method.recipe(texture.levels) for method in methods}
        tasks.append(Task(texture, recipes, shape or (height, width), seeds))
    outcomes = []
    for number, outcome in enumerate(run_all(tasks, options.jobs), 1):
        path = comparison_report.save_sheet(outcome, options.out)
        print(f"{number} of {len(tasks)}: {outcome.texture.caption}: {path}", flush=True)
        outcomes.append(outcome)
    return outcomes


def check_block(block: int, textures: list[Texture]) -> None:
    """A block has to lie in every exemplar: better said before hours of work than after."""
    for texture in textures:
        if min(texture.image.shape[1:]) < block:
            raise ts.InputError(
                "--block", f"must fit inside {texture.caption}", f"it is {block}",
                "choose a smaller one, or leave the picture out with --without",
            )  # fmt: skip


def _timed(cases: list[timings.Case], texture: Texture, repeats: int) -> list[timings.Timing]:
    found = []
    for case in cases:
        found.append(timings.timed(case, texture.image, repeats))
        print(f"{case.name}, {case.exemplar} to {case.output}: {found[-1].shown} s", flush=True)
    return found


def check_folder(folder: Path, overwrite: bool) -> None:
    """What is in a folder is overwritten only if that is wanted."""
    if folder.exists() and not folder.is_dir():
        raise ts.InputError("--out", "must be a folder", f"{folder} is a file", "give another name")
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise ts.InputError(
            "--out", "must be a new or empty folder", f"there is something in {folder}",
            "give another folder, or --overwrite",
        )  # fmt: skip


def _report(
    outcomes: list[Outcome],
    folder: Path,
    title: str,
    notes: tuple[str, ...],
    pairs: tuple[tuple[str, str], ...],
) -> None:
    for path in comparison_report.write(outcomes, folder, title, notes, pairs):
        print(path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    experiments = parser.add_subparsers(required=True, metavar="{first,second,timing}")
    count = arguments.whole_number(1)
    for run in (first, second, timing):
        one = experiments.add_parser(run.__name__, help=run.__doc__, description=run.__doc__)
        one.set_defaults(run=run, size=timings.SIDE, seeds=1)
        one.add_argument("--textures", type=Path, required=True, metavar="DIR", help="the folder of pictures")
        one.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to write to")
        one.add_argument("--overwrite", action="store_true", help="write even if there is something in it")
        one.add_argument("--only", nargs="+", metavar="NAME", help="these pictures, without their suffix")
        one.add_argument("--without", nargs="+", default=[], metavar="NAME", help="leave these pictures out")
        if run is timing:
            one.add_argument(
                "--repeats", type=count, default=2, help="runs, of which the best counts; default: 2"
            )
        else:
            one.add_argument("--size", type=arguments.whole_number(16), default=128, help=_SIZE)
            one.add_argument("--seeds", type=count, default=3, help="outputs of each method; default: 3")
            one.add_argument("--jobs", type=count, default=1, help="textures at once; default: 1")
        if run is not first:
            one.add_argument("--block", type=arguments.whole_number(3), default=BLOCK, help=_BLOCK)
    return parser


_SIZE = "the most pixels a side of an exemplar: larger pictures are shrunk, by half at most, and cropped; default: 128"
_BLOCK = (
    f"quilting's block in pixels, about as large as the structures (the paper: 30 to 66); default: {BLOCK}"
)


if __name__ == "__main__":
    main()
