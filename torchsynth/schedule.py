"""In which order pixels are visited, and which of them can be visited together.

Pixel-based synthesis is defined one pixel at a time. Done literally, that leaves a tensor library
idle. But a pixel only reads a small window, so most pixels never notice which of two others came
first. An *order* is therefore given as a rank map (lower rank, earlier visit; equal ranks are visited
at once), and this module derives *batches* from it: groups of pixels that are matched together and
written together, **with exactly the result of the literal order**, pixel for pixel.

Two rules make batches exact. Let ``q`` come after ``p`` in the order.

* If ``q`` reads ``p``, then ``q`` is in a later batch: it has to see the new value.
* If ``p`` reads ``q``, then ``q`` is not in an earlier batch: ``p`` has to see the old value. The same
  batch is fine, because a batch gathers everything before it writes anything.

**A scanline on a torus.** Plain raster order has no parallelism there: the first pixel of a row reads
the last pixels of the row above. So each row starts at its own column, ``h`` further right than the
row above, where ``h`` is how far a neighborhood reaches sideways, and goes once around its ring. The
pixel that is number ``i`` of its row ``r`` is in batch ``(2h + 1) r + i``. With h = 1 and 8 columns::

    the batch of each pixel                  batch 6, and what its pixels read (o)
      0   1   2   3   4   5   6   7            .   .   .   o   o   o   6   .
     10   3   4   5   6   7   8   9            .   o   o   o   6   .   .   .
     12  13   6   7   8   9  10  11            .   o   6   .   .   .   .   .

Why it is exact: take pixels of rows ``r`` and ``r + k`` whose columns differ by ``d``, ``|d| <= h``.
Their numbers within the row then differ by ``d - k h`` (going round the ring only adds), so their
batches differ by at least ``k (2h + 1) - h - k h = k (h + 1) - h``, which is 1 or more: the lower row
is always later, for every height, width and wrap-around, and within a row no batch repeats. Both
rules hold, whatever part of its window a pixel reads. The number of batches falls from ``H W`` to
``W + (2h + 1)(H - 1)``.

**A scanline with an open border** needs no shift: batch ``(h + 1) r + c`` by the same argument.

**Any other permutation** is taken in rounds: every pixel that comes first among the waiting pixels of
its window goes into the next batch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, TypeAlias

import torch
from jaxtyping import Int64, UInt8
from pydantic import Field
from torch import Tensor

from torchsynth._typing import Grid, Region, Sites
from torchsynth.lattice import Boundary, Shape
from torchsynth.part import Part

Reach: TypeAlias = tuple[int, int]
"""How far a neighborhood reads on the level that is being written: up or down, and sideways."""

Rows: TypeAlias = tuple[int | None, int | None]
"""A range of rows as in a Python slice: ``(0, -2)`` is all but the last two. And ``(-2, 2)`` is the last
two and then the first two: the range goes around the torus."""

_DONE = torch.iinfo(torch.int32).min

_EIGHT = 8
"""How many neighbors a pixel of a square lattice touches."""


class Scanline(Part):
    """Row by row from the top, left to right; on a torus each row starts where it can run in parallel.

    Convention:
        On a torus row ``r`` starts at column ``r * h`` (modulo the width), where ``h`` is the sideways
        reach, and goes once around. In plain raster order every row starts at column 0; the pictures
        are equally good, and one row does not have to wait for the whole row above.

    Source: Wei & Levoy 2000, section 2.

    Example:
        >>> Scanline().rank((2, 4), reach=(1, 1), boundary="torus").tolist()
        [[0, 1, 2, 3], [7, 4, 5, 6]]
    """

    kind: Literal["scanline"] = "scanline"

    def rank(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """The place of each pixel in the literal order."""
        rows, steps = self._steps(shape, reach, boundary)
        return rows * shape[1] + steps

    def batches(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """The batch of each pixel, in closed form."""
        rows, steps = self._steps(shape, reach, boundary)
        lag = 2 * reach[1] + 1 if boundary == "torus" else reach[1] + 1
        return rows * lag + steps

    def _steps(self, shape: Shape, reach: Reach, boundary: Boundary) -> tuple[Grid, Grid]:
        """The row of each pixel, and how many pixels of its row come before it."""
        rows, columns = torch.meshgrid(*map(torch.arange, shape), indexing="ij")
        if boundary == "torus":
            columns = (columns - rows * reach[1]) % shape[1]
        return rows, columns


class Shuffle(Part):
    """A random permutation of all pixels, the same for every sample of a batch.

    Args:
        seed: Which permutation. It is separate from the samples' seeds: the order is shared by a
            batch, so a sample comes out the same alone and in company.

    Source: Wei & Levoy 2001, *Texture synthesis over arbitrary manifold surfaces*, as the random order.

    Example:
        >>> sorted(Shuffle(seed=3).rank((2, 2), (1, 1), "torus").flatten().tolist())
        [0, 1, 2, 3]
    """

    kind: Literal["shuffle"] = "shuffle"
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0

    def rank(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """The place of each pixel in the literal order."""
        generator = torch.Generator().manual_seed(self.seed)
        return torch.randperm(shape[0] * shape[1], generator=generator).view(shape)

    def batches(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """The batch of each pixel, by rounds."""
        return batches_of(self.rank(shape, reach, boundary), reach, boundary)


class Simultaneous(Part):
    """All pixels at once: every one reads the picture as it was before.

    Example:
        >>> Simultaneous().batches((1, 3), (0, 1), "open").tolist()
        [[0, 0, 0]]
    """

    kind: Literal["simultaneous"] = "simultaneous"

    def rank(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """Zero everywhere: nobody is first."""
        return torch.zeros(shape, dtype=torch.int64)

    def batches(self, shape: Shape, reach: Reach, boundary: Boundary) -> Grid:
        """Zero everywhere: one batch."""
        return self.rank(shape, reach, boundary)


class OnionPeel(Part):
    """From what is known inwards (or outwards), layer by layer.

    A layer is every pixel that is not known yet but has one of its eight neighbors known, as it is when
    the layer begins. Within it, pixels with more known neighbors come first. What lies beyond an open
    border is unknown. Since a layer depends on which pixels the one before it could fill, layers are
    scheduled one at a time.

    Args:
        seed: In which order pixels with equally many known neighbors come: a random permutation, the same
            for every sample of a batch.

    Source: Efros & Leung 1999, section 2.2, in the order of the GrowImage notes on it.

    Example:
        >>> known = torch.zeros(3, 4, dtype=torch.bool)
        >>> known[:, 0] = True
        >>> OnionPeel().layer(known, ~known, "open").nonzero()[:, 1].tolist()
        [1, 1, 1]
    """

    kind: Literal["onion_peel"] = "onion_peel"
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0

    def layer(self, known: Region, waiting: Region, boundary: Boundary) -> Grid:
        """The rank of each pixel of the next layer, from 1; 0 for all other pixels.

        Args:
            known: The pixels to grow from.
            waiting: The pixels that are to be visited at all, and have not been.
            boundary: Whether neighbors wrap around.
        """
        neighbors = _known_neighbors(known, boundary)
        ties = _ties(self.seed, known.shape[0], known.shape[1])
        rank = (_EIGHT - neighbors.long()).mul_(known.numel()).add_(ties).add_(1)
        return rank.masked_fill_(~(waiting & (neighbors > 0)), 0)


@lru_cache(maxsize=4)
def _ties(seed: int, height: int, width: int) -> Grid:
    """The permutation that an onion's layers share; nobody writes to it."""
    with torch.inference_mode(mode=False):
        return Shuffle(seed=seed).rank((height, width), (0, 0), "open")


FixedOrder: TypeAlias = Scanline | Shuffle | Simultaneous
"""An order that does not depend on what has been filled."""

Order: TypeAlias = Annotated[FixedOrder | OnionPeel, Field(discriminator="kind")]
"""Any order; the ``kind`` field tells them apart in YAML."""


@dataclass(frozen=True)
class Group:
    """Consecutive pieces of batches, gathered together as far as nothing in them can change.

    Args:
        sites: The sites of all pieces, piece after piece.
        sizes: How many sites each piece has.
        ends_batch: Whether the piece is the last of its batch. Nothing is written before that.
    """

    sites: Sites
    sizes: list[int]
    ends_batch: list[bool]


@dataclass(frozen=True)
class Schedule:
    """The batches of one sweep.

    Args:
        sites: All sites to visit, batch after batch.
        sizes: The size of each batch.
        batch: For every site of the level the batch it is in; past the last for sites not visited, and
            for the empty pixel behind them all.
    """

    sites: Sites
    sizes: list[int]
    batch: Int64[Tensor, " positions"]

    @classmethod
    def of(cls, batch: Grid, visited: Region) -> Schedule:
        """The schedule that visits some pixels of a level, given the batch of each."""
        never = int(batch.max()) + 1
        batches = torch.cat((batch.masked_fill(~visited, never).flatten(), torch.tensor([never])))
        sites = visited.flatten().nonzero().squeeze(1)
        # There are no more batches than pixels; 32 bits are sorted in half the time of 64.
        ascending, order = batches[sites].int().sort(stable=True)
        sizes = ascending.unique_consecutive(return_counts=True)[1].tolist()
        return cls(sites[order], sizes, batches)

    def among(self, kept: Region) -> Schedule:
        """The same, visiting only some of its pixels.

        Example:
            >>> schedule(Scanline(), (1, 3), (0, 1), "open").among(torch.tensor([[True, False, True]])).sites
            tensor([0, 2])
        """
        batch = self.batch[:-1].view(kept.shape)
        return Schedule.of(batch, kept & (batch < self.batch[-1]))

    def done_before(self, read: Int64[Tensor, "sites neighbors"], sites: Sites) -> Tensor:
        """Whether each neighbor is visited before the pixel that reads it, in the literal order.

        Batches can tell: a pixel that reads another is never in the same batch as an earlier one.
        """
        return self.batch[read] < self.batch[sites].unsqueeze(1)

    def groups(self, piece: int, group: int) -> Iterator[Group]:
        """Cut the batches into pieces of at most ``piece`` sites, and pack these into groups.

        Args:
            piece: The most sites to be matched at once; larger batches are cut.
            group: The most sites in a group, unless one piece alone has more.
        """
        sizes: list[int] = []
        ends: list[bool] = []
        start = stop = 0
        for batch in self.sizes:
            for left in range(batch, 0, -piece):
                size = min(left, piece)
                if sizes and stop - start + size > group:
                    yield Group(self.sites[start:stop], sizes, ends)
                    sizes, ends, start = [], [], stop
                sizes.append(size)
                ends.append(left <= piece)
                stop += size
        if sizes:
            yield Group(self.sites[start:stop], sizes, ends)


def schedule(
    order: FixedOrder,
    shape: Shape,
    reach: Reach | None,
    boundary: Boundary,
    rows: Rows | None = None,
    waiting: Region | None = None,
) -> Schedule:
    """Put the sites of a level into batches that give the result of the literal order.

    Args:
        order: Who comes first.
        shape: Height and width of the level.
        reach: How far the level itself is read while it is written; None if it is not read at all, in
            which case no pixel depends on another and there is only one batch.
        boundary: Whether neighborhoods wrap around.
        rows: The first row to visit and the one to stop before, as in a Python slice; None means all.
        waiting: Which pixels of these rows to visit; None means all.

    Example:
        >>> schedule(Scanline(), (64, 64), (4, 4), "torus").sizes[-1]
        1
        >>> len(schedule(Scanline(), (64, 64), (4, 4), "torus").sizes)
        631
    """
    batch = torch.zeros(shape, dtype=torch.int64)
    if reach is not None:
        batch = order.batches(shape, reach, boundary)
    chosen = visited_rows(rows, shape[0])
    if goes_around(rows):
        # On a torus the order may as well begin at another row.
        batch = batch.roll(chosen[0], 0)
    visited = torch.zeros(shape, dtype=torch.bool)
    visited[chosen] = True
    return Schedule.of(batch, visited if waiting is None else visited & waiting)


def schedule_layer(rank: Grid, reach: Reach, boundary: Boundary) -> Schedule:
    """Put the pixels of one layer into batches that give the result of visiting them one by one.

    Args:
        rank: Their ranks, from 1 and all different; 0 where a pixel is not in the layer.
        reach: How far the level itself is read.
        boundary: Whether neighborhoods wrap around.

    Example:
        >>> schedule_layer(torch.tensor([[2, 0, 0, 3, 1]]), (0, 1), "open").sizes
        [2, 1]
    """
    rows, columns = (rank.any(axis).nonzero().squeeze(1) for axis in (1, 0))
    # What lies outside the layer's bounding box has no say, unless it is crossed on the way around.
    box = tuple(slice(int(one[0]), int(one[-1]) + 1) for one in (rows, columns))
    box = box if boundary == "open" else (slice(None), slice(None))
    batch = torch.zeros_like(rank)
    batch[box] = _rounds(rank[box], reach, boundary)
    return Schedule.of(batch, rank > 0)


def goes_around(rows: Rows | None) -> bool:
    """Whether a range of rows leaves the last one for the first.

    Example:
        >>> goes_around((-2, 2)), goes_around((-2, None))
        (True, False)
    """
    start, stop = rows or (None, None)
    return start is not None and start < 0 and stop is not None and stop > 0


def visited_rows(rows: Rows | None, height: int) -> list[int]:
    """The rows of a range, in order, none twice.

    Example:
        >>> visited_rows((-2, 2), 8), visited_rows((0, -2), 8), visited_rows((-2, 2), 3)
        ([6, 7, 0, 1], [0, 1, 2, 3, 4, 5], [1, 2, 0])
    """
    start, stop = rows or (None, None)
    everything = list(range(height))
    if not goes_around(rows):
        return everything[start:stop]
    last = everything[start:]
    return last + [row for row in everything[:stop] if row not in last]


def batches_of(rank: Grid, reach: Reach, boundary: Boundary) -> Grid:
    """Derive exact batches from any rank map.

    A map without equal ranks is taken in rounds of window-wise first pixels. Equal ranks are visited
    at once and see each other's old values, which rounds cannot promise; a map that has any gets one
    batch for each rank.

    Example:
        >>> batches_of(torch.tensor([[0, 3, 1, 2]]), reach=(0, 1), boundary="open").tolist()
        [[0, 1, 0, 1]]
    """
    ranks, inverse = rank.unique(return_inverse=True)
    batch: Grid = inverse
    if len(ranks) < rank.numel():
        return batch
    return _rounds(rank - rank.min() + 1, reach, boundary)


def _rounds(rank: Grid, reach: Reach, boundary: Boundary) -> Grid:
    """The round in which each pixel comes first among the waiting ones of its window; 0 also for rank 0."""
    # Turned around, so that the first is the largest; done pixels no longer hold anyone up.
    waiting = (-rank).int().masked_fill_(rank == 0, _DONE)
    batch = torch.zeros_like(rank)
    number = 0
    while bool((waiting > _DONE).any()):
        first = (waiting == _window_maximum(waiting, reach, boundary)) & (waiting > _DONE)
        batch.masked_fill_(first, number)
        waiting.masked_fill_(first, _DONE)
        number += 1
    return batch


def _known_neighbors(known: Region, boundary: Boundary) -> UInt8[Tensor, "_height _width"]:
    """How many of its eight neighbors are known, for each pixel."""
    counts = known.to(torch.uint8)
    for axis, length in enumerate(known.shape):
        around = torch.arange(-1, length + 1)
        padded = counts.index_select(axis, around % length)
        if boundary == "open":
            padded.select(axis, 0).zero_()
            padded.select(axis, -1).zero_()
        counts = sum((padded.narrow(axis, step, length) for step in (1, 2)), padded.narrow(axis, 0, length))
    return counts - known.to(torch.uint8)


def _window_maximum(values: Tensor, reach: Reach, boundary: Boundary) -> Tensor:
    """The largest value in the window around each pixel: along columns, then along rows."""
    for axis, side in enumerate(reach):
        length = values.shape[axis]
        around = torch.arange(-side, length + side)
        if boundary == "torus":
            padded = values.index_select(axis, around % length)
        else:
            # Repeating the border pixels adds nothing that is not in the window anyway.
            padded = values.index_select(axis, around.clamp(0, length - 1))
        values = _running_maximum(padded, axis, 2 * side + 1)
    return values


def _running_maximum(values: Tensor, axis: int, width: int) -> Tensor:
    """The maximum of each run of ``width`` values, from runs of half the width, and so on."""
    covered = 1
    while covered < width:
        step = min(covered, width - covered)
        count = values.shape[axis] - step
        values = torch.maximum(values.narrow(axis, 0, count), values.narrow(axis, step, count))
        covered += step
    return values
