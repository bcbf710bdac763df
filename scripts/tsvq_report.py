"""How much of exhaustive search TSVQ finds, how fast, and what a small codebook costs.

    python scripts/tsvq_report.py --exemplar sample:brick --out report.json
    python scripts/tsvq_report.py --large photo.png

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

The third table has whole runs. With ``--large``, the same for the middle 512x512 pixels of a picture:
TSVQ is run; exhaustive search is only timed on a sample of each level's neighborhoods from that run, and
multiplied by the number of pixels.
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

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

import torchsynth as ts
from torchsynth.accept import Best
from torchsynth.feasibility import matching_dtype
from torchsynth.lattice import to_cells
from torchsynth.neighborhood import (
    Index,
    Layer,
    Plane,
    feature_positions,
    gather,
    gather_candidates,
    layer_weights,
    layers_at,
    output_plane,
    quantize,
    reads_of,
)
from torchsynth.schedule import schedule
from torchsynth.search import Query

Searcher: TypeAlias = ts.Exhaustive | ts.TSVQ

REPEATS = 3
LONG = 2.0  # seconds after which nothing is repeated
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
DEEPEST = 30
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


def level_of(result: ts.Result, level: int, count: int) -> Level:
    """Gather the candidates of a level, and the neighborhoods of some of its pixels."""
    recipe = result.recipe
    dtype = matching_dtype(ts.recipes.wei_levoy_tsvq(), result.image.shape[1])
    exemplar = [_exemplar_plane(one.exemplar, dtype) for one in result.levels]
    output = [output_plane(one.image, dtype, recipe.boundary) for one in result.levels]
    sweep = recipe.sweeps_at(level)[0]
    layers = layers_at(sweep.layers, level, recipe.levels)
    index = gather_candidates(layers, layer_weights(layers, sweep.normalize), exemplar, level)
    offsets = torch.cat([one.template.offsets() for one in layers if one.plane == "result"])
    vertical, horizontal = offsets.abs().amax(0).tolist()
    shape, boundary = output[level].shape, recipe.boundary
    rank = sweep.order.rank(shape, (vertical, horizontal), boundary).flatten()
    waves = schedule(sweep.order, shape, (vertical, horizontal), boundary).sizes
    sites = _already_there(layers, output[level], rank)
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
        costs = [Best().choose(search.search(state, Query(wave)).cost).cost for wave in waves]
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
    number = level.index.features.shape[1]
    return Row("exhaustive", prepared, number, 1.0, 1.0, 0.0, best.us_per_query), best


def tree_rows(name: str, searches: Sequence[ts.TSVQ], level: Level, best: Answers) -> list[Row]:
    """Rows of searches that share a tree, and differ in how it is descended."""
    started = time.perf_counter()
    state = searches[0].fit(level.index, complete=True)
    trained = time.perf_counter() - started
    leaves = int((state.tree.children < 0).sum())
    share = leaves / level.index.features.shape[1]
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
    number = level.index.features.shape[1]
    search = ts.TSVQ(depth=DEEPEST, codewords=max(2, round(share * number)), leaf="central")
    started = time.perf_counter()
    state = search.fit(level.index, complete=True)
    trained = time.perf_counter() - started
    found = answered(search, state, level)
    members = state.tree.members
    features, sites = level.index.features[:, members], level.index.sites[members]
    codebook = replace(level.index, features=features, sites=sites)
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


def whole_runs(exemplar: Tensor, size: tuple[int, int], result: ts.Result, seconds: float) -> Table:
    """Training all levels, and whole runs, against the exhaustive run that was timed already."""
    table = Table("depth", "training, all levels, s", "whole run, s", "exhaustive run, s")
    levels = [level_of(result, number, 1) for number in range(len(result.levels))]
    for depth in RUN_DEPTHS:
        recipe = ts.recipes.wei_levoy_tsvq(depth=depth)
        started = time.perf_counter()
        for level in levels:
            ts.TSVQ(depth=depth).fit(level.index, complete=True)
        trained = time.perf_counter() - started
        started = time.perf_counter()
        ts.synthesize(exemplar, size, recipe, seed=0)
        table.add_row(
            _named(depth), f"{trained:.2f}", f"{time.perf_counter() - started:.2f}", f"{seconds:.2f}"
        )
    return table


def _named(depth: int | None) -> str:
    return "to leaves of 64" if depth is None else f"{depth}"


def large_run(picture: Path, size: tuple[int, int], depth: int | None) -> Table:
    """TSVQ on a large exemplar, and what exhaustive search would take for the same."""
    image = ts.read_image(picture)
    height, width = image.shape[1:]
    if min(height, width) < LARGE:
        raise SystemExit(f"{picture}: at least {LARGE}x{LARGE} pixels are needed, it has {height}x{width}")
    top, left = (height - LARGE) // 2, (width - LARGE) // 2
    exemplar = image[:, top : top + LARGE, left : left + LARGE].contiguous()
    started = time.perf_counter()
    result = ts.synthesize(exemplar, size, ts.recipes.wei_levoy_tsvq(depth=depth), seed=0)
    run = time.perf_counter() - started
    estimated, trained = 0.0, 0.0
    for number in range(len(result.levels)):
        level = level_of(result, number, LARGE_QUERIES)
        started = time.perf_counter()
        ts.TSVQ(depth=depth).fit(level.index, complete=True)
        trained += time.perf_counter() - started
        row, _ = exhaustive_row(level)
        estimated += row.train_s + row.us_per_query * 1e-6 * level.pixels
    table = Table("exemplar", "depth", "training, s", "whole run, s", "exhaustive, estimated, s", "ratio")
    table.add_row(
        f"{LARGE}x{LARGE}", _named(depth), f"{trained:.1f}", f"{run:.1f}", f"{estimated:.0f}",
        f"{estimated / run:.1f}",
    )  # fmt: skip
    return table


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


def main() -> None:
    """Make the tables and print them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--exemplar", default="sample:brick")
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--depths", nargs="+", type=int, default=[4, 6, 8, 10, 12])
    parser.add_argument("--beams", nargs="+", type=int, default=[1, 2, 4])
    parser.add_argument("--queries", type=int, default=2000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--large", type=Path, help="a picture of 512x512 pixels or more")
    parser.add_argument("--large-depth", type=int)
    parser.add_argument("--out", type=Path, help="also write the figures here, as JSON")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    height, width = map(int, options.size.split("x"))
    console = Console(width=140)

    exemplar = ts.read_image(options.exemplar)
    ts.synthesize(exemplar, (16, 16), ts.recipes.wei_levoy(), seed=0)  # to warm up
    started = time.perf_counter()
    result = ts.synthesize(exemplar, (height, width), ts.recipes.wei_levoy(), seed=0)
    seconds = time.perf_counter() - started
    level = level_of(result, 0, options.queries)
    _, number, features = level.index.features.shape
    console.print(
        f"{options.exemplar}, {options.size}, finest level: {number} vectors of {features} features, "
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
    console.print(whole_runs(exemplar, (height, width), result, seconds))
    if options.large:
        console.print(large_run(options.large, (height, width), options.large_depth))
    if options.out:
        about = {"torch": torch.__version__, "python": platform.python_version()}
        found = {"versions": about, "rows": [asdict(one) for one in rows + codebooks]}
        options.out.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
