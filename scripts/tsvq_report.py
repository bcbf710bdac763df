"""How much of exhaustive search TSVQ finds, how fast, and what a small codebook costs.

    python scripts/tsvq_report.py --exemplar sample:brick --out report.json
    python scripts/tsvq_report.py --large photo.png --size 256x256

One texture is made by ``wei_levoy`` with exhaustive search. Its finest level gives the candidates, and
the queries: the neighborhoods of random pixels of the finished level whose neighbors were all there when
the pixel's turn came. A causal neighborhood never changes after that, so these are vectors that the run
really searched for, without the noise at the seams. Each search then answers the same queries, in waves
as large as those of the run, and its first minimum is taken. Reported are

* seconds of training, the number of codewords (leaves), and their share of the number of vectors;
* *recall*: the share of queries whose match is as near as the nearest vector of all (ties count);
* *excess*: by how much the squared distance to the match is larger than to the nearest vector, in the
  mean, as a share of the mean squared distance to the nearest vector (that of random vectors is given
  for comparison);
* microseconds per query, with the choice of the minimum: the best of three runs through all queries, or
  the first alone if it takes long.

The second table limits the codewords, and searches nothing but the codebook (``leaf="central"``, each
codeword standing for the one vector nearest to it), as in the report, which found a codebook of less
than a tenth of the vectors to be enough. Its last column has the excess of an exhaustive search through
that codebook: this part of the loss is due to the codebook, the rest to the descent.

The third table has whole runs: seconds of training all trees (``ts.train``), of synthesis with them
(``ts.synthesize(codebook=...)``), of both, and of the same synthesis with exhaustive search; and how many
times longer the last takes than synthesis alone, which is what every further output costs, and than both.

With ``--large``, the same for the middle 512x512 pixels of a picture. Here exhaustive search is not run but
estimated: for each level, the time it takes to prepare the candidates, and the time per query times the
number of pixels. The queries are the neighborhoods of 300 random pixels of the finished output (of all, if
there are fewer), asked in whole waves of the mean size; exhaustive search takes as long for one query
as for another. What a run does besides, reading neighborhoods and writing pixels, is left out of the
estimate but not of the seconds of TSVQ: the ratios are rather too low than too high. Where both were tried,
the estimate was up to a fifth below the time that exhaustive search really took.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import arguments
import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

import torchsynth as ts
from torchsynth.accept import Best
from torchsynth.feasibility import matching_dtype
from torchsynth.index import Index
from torchsynth.lattice import Shape, to_cells
from torchsynth.neighborhood import (
    Layer,
    Plane,
    Planes,
    feature_positions,
    gather,
    layer_weights,
    layers_at,
    output_plane,
    quantize,
    reads_of,
)
from torchsynth.schedule import Scanline, schedule
from torchsynth.search import Query

Searcher: TypeAlias = ts.Exhaustive | ts.TSVQ

REPEATS = 3
LONG = 2.0  # seconds after which nothing is repeated
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
DEEPEST = 30
WIDEST = 64
RUN_DEPTHS = (None, 8, 10, 12)
LARGE = 512
LARGE_QUERIES = 300


@dataclass(frozen=True)
class Level:
    """One level of a finished run.

    Args:
        index: The candidates.
        queries: Neighborhoods that were met, ``(1, count, features + 1)``.
        wave: How many pixels the run matches at once, in the mean.
        pixels: How many pixels the level has.
    """

    index: Index
    queries: Tensor
    wave: int
    pixels: int


@dataclass(frozen=True)
class Row:
    """What one search makes of the queries; distances are squared."""

    name: str
    train_s: float
    codewords: int
    share: float
    recall: float
    excess: float
    us_per_query: float
    codebook_excess: float | None = None


@dataclass(frozen=True)
class Answers:
    """The squared distances of the accepted vectors, and the time it took to find them."""

    distance: Tensor
    us_per_query: float


@dataclass(frozen=True)
class Run:
    """The seconds of a whole run with trees, and of one with exhaustive search.

    Args:
        exemplar: Height and width.
        size: Of the output.
        depth: Of the trees; None for leaves of up to 64 vectors.
        training_s: Of the trees of all levels.
        synthesis_s: With these trees.
        exhaustive_s: The same synthesis with exhaustive search.
    """

    exemplar: Shape
    size: Shape
    depth: int | None
    training_s: float
    synthesis_s: float
    exhaustive_s: float

    @property
    def whole_s(self) -> float:
        """Training and synthesis."""
        return self.training_s + self.synthesis_s


def level_of(result: ts.Result, level: int, count: int, *, anywhere: bool = False) -> Level:
    """Gather the candidates of a level, and the neighborhoods of some of its pixels.

    Args:
        result: A finished run.
        level: Which level.
        count: How many neighborhoods, if there are as many.
        anywhere: Take those of any pixels. Some were never searched for, as a neighbor came after its
            pixel: enough to see how long a search takes, but not how near its matches are.
    """
    recipe = result.recipe
    dtype = matching_dtype(ts.recipes.wei_levoy_tsvq(), result.image.shape[1])
    exemplar = Planes(tuple(_exemplar_plane(one.exemplar, dtype) for one in result.levels))
    output = [output_plane(one.image, dtype, recipe.boundary) for one in result.levels]
    sweep = recipe.sweeps_at(level)[0]
    layers = layers_at(sweep.layers, level, recipe.levels)
    index = Index.of(layers, layer_weights(layers, sweep.normalize), exemplar, level)
    offsets = torch.cat([one.template.offsets() for one in layers if one.plane == "result"])
    vertical, horizontal = offsets.abs().amax(0).tolist()
    shape, boundary = output[level].shape, recipe.boundary
    order = Scanline()
    rank = order.rank(shape, (vertical, horizontal), boundary).flatten()
    waves = schedule(order, shape, (vertical, horizontal), boundary).sizes
    sites = torch.arange(len(rank)) if anywhere else _already_there(layers, output[level], rank)
    sites = sites[torch.randperm(len(sites), generator=torch.Generator().manual_seed(0))[:count]]
    cells = to_cells(sites, shape[1])
    planes = [(one, output[level + one.steps_up]) for one in layers]
    features = [
        gather(plane, feature_positions(plane, reads_of(one, plane, cells, None).positions))
        for one, plane in planes
    ]
    queries = torch.cat((*features, torch.ones(1, len(sites), 1, dtype=dtype)), dim=2)
    return Level(index, queries, round(len(rank) / len(waves)), len(rank))


def _exemplar_plane(image: Tensor, dtype: torch.dtype) -> Plane:
    return Plane(quantize(image, dtype), (image.shape[2], image.shape[3]), "open")


def _already_there(layers: Sequence[Layer], plane: Plane, rank: Tensor) -> Tensor:
    """The pixels whose neighbors on their own level all come before them."""
    sites = torch.arange(len(rank))
    cells = to_cells(sites, plane.shape[1])
    before = torch.ones_like(sites, dtype=torch.bool)
    for layer in layers:
        if layer.plane == "result":
            positions = reads_of(layer, plane, cells, None).positions
            before &= rank[positions].amax(1) < rank
    return sites[before]


def answered(search: Searcher, state: Any, level: Level, repeats: int = REPEATS) -> Answers:
    """Let a search answer a level's queries, wave after wave."""
    waves = level.queries.split(min(level.wave, search.capacity(state)), dim=1)
    seconds: list[float] = []
    while len(seconds) < repeats and sum(seconds) < LONG:
        started = time.perf_counter()
        costs = [Best().choose(search.search(state, Query(wave)).cost, None).cost for wave in waves]
        seconds.append(time.perf_counter() - started)
    plain = level.queries[..., :-1].double()
    lengths = (plain.square() * level.index.weights).sum(2)
    distance = torch.cat(costs, dim=1).double() + lengths
    return Answers(distance, min(seconds) / level.queries.shape[1] * 1e6)


def exhaustive_row(level: Level) -> tuple[Row, Answers]:
    """The search that all others are measured against."""
    search = ts.Exhaustive()
    started = time.perf_counter()
    state = search.fit(level.index, complete=True)
    prepared = time.perf_counter() - started
    best = answered(search, state, level)
    number = len(level.index.sites)
    return Row("exhaustive", prepared, number, 1.0, 1.0, 0.0, best.us_per_query), best


def tree_rows(name: str, searches: Sequence[ts.TSVQ], level: Level, best: Answers) -> list[Row]:
    """Rows of searches that share a tree, and differ in how it is descended."""
    started = time.perf_counter()
    state = searches[0].fit(level.index, complete=True)
    trained = time.perf_counter() - started
    leaves = int((state.tree.children < 0).sum())
    share = leaves / len(level.index.sites)
    rows = []
    for search in searches:
        found = answered(search, state, level)
        recall = float((found.distance == best.distance).double().mean())
        label = f"{name}, beam {search.beam}"
        row = Row(label, trained, leaves, share, recall, _excess(found, best), found.us_per_query)
        rows.append(row)
    return rows


def codebook_row(share: float, level: Level, best: Answers) -> Row:
    """A codebook of a share of the vectors, and nothing else, searched by descent and exhaustively."""
    number = len(level.index.sites)
    search = ts.TSVQ(depth=DEEPEST, codewords=max(2, round(share * number)), leaf="central")
    started = time.perf_counter()
    state = search.fit(level.index, complete=True)
    trained = time.perf_counter() - started
    found = answered(search, state, level)
    members = state.tree.members
    codebook = Index.of_vectors(level.index.at(members).unsqueeze(0), level.index.weights)
    whole = ts.Exhaustive().fit(codebook, complete=True)
    through = answered(ts.Exhaustive(), whole, level, repeats=1)
    recall = float((found.distance == best.distance).double().mean())
    return Row(
        f"codebook of {share:.0%}, depth {state.tree.depth}", trained, len(members), len(members) / number,
        recall, _excess(found, best), found.us_per_query, _excess(through, best),
    )  # fmt: skip


def random_excess(level: Level, best: Answers) -> float:
    """The excess of vectors taken at random: what knowing nothing would cost."""
    queries, vectors = level.queries[0, :, :-1], level.index.features[0]
    drawn = torch.randint(len(vectors), (len(queries),), generator=torch.Generator().manual_seed(0))
    difference = (vectors[drawn] - queries).double()
    distance = (difference.square() * level.index.weights).sum(1)
    return _excess(Answers(distance.unsqueeze(0), 0.0), best)


def _excess(found: Answers, best: Answers) -> float:
    return float((found.distance - best.distance).mean() / best.distance.mean())


def timed_run(exemplar: Tensor, size: Shape, depth: int | None) -> tuple[ts.Result, float, float]:
    """A texture made with trees, the seconds of training them, and those of using them."""
    recipe = ts.recipes.wei_levoy_tsvq(depth=depth)
    started = time.perf_counter()
    codebook = ts.train(exemplar, recipe)
    trained = time.perf_counter()
    result = ts.synthesize(exemplar, size, recipe, codebook=codebook, seed=0)
    return result, trained - started, time.perf_counter() - trained


def whole_runs(exemplar: Tensor, size: Shape, seconds: float) -> list[Run]:
    """Runs with trees of several depths, against the exhaustive run that was timed already."""
    shape = (exemplar.shape[1], exemplar.shape[2])
    return [Run(shape, size, depth, *timed_run(exemplar, size, depth)[1:], seconds) for depth in RUN_DEPTHS]


def middle_of(picture: Path) -> Tensor:
    """The middle of a large picture."""
    image = ts.read_image(picture)
    height, width = image.shape[1:]
    if min(height, width) < LARGE:
        raise ts.InputError(
            str(picture), f"must have at least {LARGE}x{LARGE} pixels", f"it has {height}x{width}",
            "take a larger one",
        )  # fmt: skip
    top, left = (height - LARGE) // 2, (width - LARGE) // 2
    return image[:, top : top + LARGE, left : left + LARGE].contiguous()


def large_run(exemplar: Tensor, size: Shape, depth: int | None) -> Run:
    """A run with trees on a large exemplar, and an estimate of what exhaustive search would take."""
    result, trained, used = timed_run(exemplar, size, depth)
    estimated = 0.0
    for number in range(len(result.levels)):
        level = level_of(result, number, LARGE_QUERIES, anywhere=True)
        # Whole waves only: what is left over takes far longer than its share of one.
        whole = max(1, level.queries.shape[1] // level.wave) * level.wave
        row, _ = exhaustive_row(replace(level, queries=level.queries[:, :whole]))
        estimated += row.train_s + row.us_per_query * 1e-6 * level.pixels
    return Run((exemplar.shape[1], exemplar.shape[2]), size, depth, trained, used, estimated)


def runs_table(title: str, runs: Sequence[Run]) -> Table:
    """Whole runs as a table to print."""
    table = Table(
        "exemplar", "output", "depth", "training s", "synthesis s", "both s", "exhaustive s",
        "ratio, synthesis", "ratio, both", title=title,
    )  # fmt: skip
    for run in runs:
        table.add_row(
            _sides(run.exemplar), _sides(run.size), "to leaves of 64" if run.depth is None else f"{run.depth}",
            f"{run.training_s:.2f}", f"{run.synthesis_s:.2f}", f"{run.whole_s:.2f}", f"{run.exhaustive_s:.2f}",
            f"{run.exhaustive_s / run.synthesis_s:.1f}", f"{run.exhaustive_s / run.whole_s:.1f}",
        )  # fmt: skip
    return table


def _sides(shape: Shape) -> str:
    return f"{shape[0]}x{shape[1]}"


def table_of(title: str, rows: Sequence[Row]) -> Table:
    """Rows as a table to print; the last column only where something has it."""
    table = Table("search", "train s", "codewords", "share", "recall", "excess", "us/query", title=title)
    with_codebook = any(row.codebook_excess is not None for row in rows)
    if with_codebook:
        table.add_column("excess of the codebook")
    for row in rows:
        cells = [
            row.name, f"{row.train_s:.2f}", f"{row.codewords}", f"{row.share:.2%}", f"{row.recall:.1%}",
            f"{row.excess:.1%}", f"{row.us_per_query:.0f}",
        ]  # fmt: skip
        if with_codebook:
            cells.append("" if row.codebook_excess is None else f"{row.codebook_excess:.1%}")
        table.add_row(*cells)
    return table


def report(options: argparse.Namespace, console: Console) -> dict[str, list[dict[str, Any]]]:
    """Make the tables and print them; returns their figures."""
    # Both pictures are read before the minutes of work, so that it does not end with one that is not there.
    exemplar = ts.read_image(options.exemplar)
    large = None if options.large is None else middle_of(options.large)
    level, seconds = searched_level(exemplar, options.size, options.queries)
    number, features = len(level.index.sites), len(level.index.weights)
    console.print(
        f"{options.exemplar}, {_sides(options.size)}, finest level: {number} vectors of {features} features, "
        f"{level.queries.shape[1]} queries in waves of {level.wave}, {options.threads} thread(s)"
    )
    row, best = exhaustive_row(level)
    console.print(f"excess of random vectors: {random_excess(level, best):.0%}")
    rows = [row]
    for depth in options.depths:
        nearest = [ts.TSVQ(depth=depth, beam=beam) for beam in options.beams]
        central = [ts.TSVQ(depth=depth, beam=beam, leaf="central") for beam in options.beams]
        rows += tree_rows(f"depth {depth}, nearest", nearest, level, best)
        rows += tree_rows(f"depth {depth}, central", central, level, best)
    console.print(table_of("Search of a tree", rows))
    codebooks = [codebook_row(share, level, best) for share in SHARES]
    console.print(table_of("Search of a codebook alone", codebooks))
    runs = whole_runs(exemplar, options.size, seconds)
    console.print(runs_table("Whole runs", runs))
    estimates = [] if large is None else [large_run(large, options.size, options.large_depth)]
    if estimates:
        console.print(runs_table("Whole run, exhaustive search estimated", estimates))
    return {
        "rows": [asdict(one) for one in rows + codebooks],
        "runs": [asdict(one) for one in runs],
        "estimated_runs": [asdict(one) for one in estimates],
    }


def searched_level(exemplar: Tensor, size: Shape, count: int) -> tuple[Level, float]:
    """The finest level of an exhaustive run, with queries of the run, and the seconds that it took."""
    ts.synthesize(exemplar, (16, 16), ts.recipes.wei_levoy(), seed=0)  # to warm up
    started = time.perf_counter()
    result = ts.synthesize(exemplar, size, ts.recipes.wei_levoy(), seed=0)
    seconds = time.perf_counter() - started
    level = level_of(result, 0, count)
    if level.queries.shape[1] == 0:
        raise ts.InputError(
            "--size", "must leave some pixel with all its neighbors before it", f"at {_sides(size)} there is none",
            "ask for a larger output, e.g. 64x64",
        )  # fmt: skip
    return level, seconds


def main() -> None:
    """Make the report that is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    count, depth, beam = (arguments.whole_number(*limits) for limits in ((1,), (1, DEEPEST), (1, WIDEST)))
    parser.add_argument("--exemplar", default="sample:brick")
    parser.add_argument("--size", type=arguments.size, default=(128, 128), help="of all outputs")
    parser.add_argument("--depths", nargs="+", type=depth, default=[4, 6, 8, 10, 12])
    parser.add_argument("--beams", nargs="+", type=beam, default=[1, 2, 4])
    parser.add_argument("--queries", type=count, default=2000)
    parser.add_argument("--threads", type=count, default=1)
    parser.add_argument("--large", type=Path, help=f"a picture of {LARGE}x{LARGE} pixels or more")
    parser.add_argument("--large-depth", type=depth, help="of the trees for it")
    parser.add_argument("--out", type=arguments.file_to_write, help="also write the figures here, as JSON")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with arguments.one_line_errors(parser):
        figures = report(options, Console(width=140))
        if options.out:
            about = {"torch": torch.__version__, "python": platform.python_version()}
            options.out.write_text(json.dumps({"versions": about} | figures, indent=2))


if __name__ == "__main__":
    main()
