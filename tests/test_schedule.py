"""The schedule's law: batches give the result of the literal order, whatever is read."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from torchsynth.lattice import read, to_cells
from torchsynth.schedule import (
    Scanline,
    Schedule,
    Shuffle,
    Simultaneous,
    batches_of,
    schedule,
)

shapes = st.tuples(st.integers(1, 9), st.integers(1, 14))
boundaries = st.sampled_from(["torus", "open"])
offsets = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=8, unique=True)


def _reach(reads):
    return max(abs(dy) for dy, _ in reads), max(abs(dx) for _, dx in reads)


def _visit(values, sites, reads, shape, boundary):
    """New values of some sites: any function of the old values of what they read will do."""
    found = read(to_cells(sites, shape[1]), torch.tensor(reads), shape, boundary)
    seen = torch.cat((values, torch.tensor([0])))[found.positions] + 1
    if found.inside is not None:
        seen = seen * found.inside
    weights = torch.arange(1, len(reads) + 1) * 7 + 3
    return (seen * weights).sum(1) % 1009 + sites


def _literal(rank, reads, shape, boundary):
    """Visit one rank after the other; equal ranks see each other's old values."""
    values = torch.arange(rank.numel()) * 31 % 1009
    flat = rank.flatten()
    for number in flat.unique():
        sites = (flat == number).nonzero().squeeze(1)
        values[sites] = _visit(values, sites, reads, shape, boundary)
    return values


def _batched(batch, reads, shape, boundary):
    return _literal(batch, reads, shape, boundary)


@given(shapes, offsets, boundaries)
def test_scanline_batches_equal_the_literal_order(shape, reads, boundary):
    reach = _reach(reads)
    rank = Scanline().rank(shape, reach, boundary)
    batch = Scanline().batches(shape, reach, boundary)
    assert _batched(batch, reads, shape, boundary).equal(_literal(rank, reads, shape, boundary))


@given(shapes, offsets, boundaries, st.integers(0, 5))
def test_shuffle_batches_equal_the_literal_order(shape, reads, boundary, seed):
    reach = _reach(reads)
    rank = Shuffle(seed=seed).rank(shape, reach, boundary)
    batch = Shuffle(seed=seed).batches(shape, reach, boundary)
    assert _batched(batch, reads, shape, boundary).equal(_literal(rank, reads, shape, boundary))


@given(shapes, offsets, boundaries, st.data())
def test_batches_of_any_rank_map_equal_the_literal_order(shape, reads, boundary, data):
    count = shape[0] * shape[1]
    ranks = data.draw(st.lists(st.integers(0, 6), min_size=count, max_size=count))
    rank = torch.tensor(ranks).view(shape)
    batch = batches_of(rank, _reach(reads), boundary)
    assert _batched(batch, reads, shape, boundary).equal(_literal(rank, reads, shape, boundary))


@given(shapes, st.integers(0, 3), st.integers(0, 3), boundaries)
def test_scanline_is_a_permutation_that_rounds_schedule_alike(shape, vertical, horizontal, boundary):
    reach = vertical, horizontal
    rank = Scanline().rank(shape, reach, boundary)
    assert sorted(rank.flatten().tolist()) == list(range(shape[0] * shape[1]))
    reads = [(dy, dx) for dy in range(-vertical, vertical + 1) for dx in range(-horizontal, horizontal + 1)]
    rounds = batches_of(rank, reach, boundary)
    closed = Scanline().batches(shape, reach, boundary)
    assert _batched(rounds, reads, shape, boundary).equal(_batched(closed, reads, shape, boundary))


def test_a_wrong_schedule_is_noticed():
    """The comparison above can fail: too small a lag between rows breaks it."""
    shape, reads = (6, 12), [(-1, 1), (0, -1)]
    rank = Scanline().rank(shape, (1, 1), "torus")
    batch = Scanline().batches(shape, (1, 0), "torus")
    assert not _batched(batch, reads, shape, "torus").equal(_literal(rank, reads, shape, "torus"))


@pytest.mark.parametrize(("boundary", "batches"), [("torus", 64 + 9 * 47), ("open", 64 + 5 * 47)])
def test_scanline_needs_the_promised_number_of_batches(boundary, batches):
    assert len(schedule(Scanline(), (48, 64), (4, 4), boundary).sizes) == batches


def test_what_reads_nothing_of_its_level_is_one_batch():
    assert schedule(Scanline(), (5, 7), None, "torus").sizes == [35]
    assert schedule(Simultaneous(), (5, 7), (2, 2), "torus").sizes == [35]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=12), st.integers(1, 7), st.integers(1, 10))
def test_groups_keep_order_and_bounds(sizes, piece, group):
    plan = Schedule(torch.arange(sum(sizes)), sizes, torch.arange(sum(sizes) + 1))
    groups = list(plan.groups(piece, group))
    assert torch.cat([one.sites for one in groups]).tolist() == list(range(sum(sizes)))
    for one in groups:
        assert sum(one.sizes) == len(one.sites)
        assert max(one.sizes) <= piece
        assert len(one.sites) <= group or len(one.sizes) == 1
    rebuilt, open_size = [], 0
    for size, ends in [pair for one in groups for pair in zip(one.sizes, one.ends_batch, strict=True)]:
        open_size += size
        if ends:
            rebuilt.append(open_size)
            open_size = 0
    assert rebuilt == sizes


def test_shuffle_depends_on_its_seed_alone():
    first = Shuffle(seed=1).rank((8, 8), (1, 1), "torus")
    torch.rand(3)
    assert first.equal(Shuffle(seed=1).rank((8, 8), (2, 2), "open"))
    assert not first.equal(Shuffle(seed=2).rank((8, 8), (1, 1), "torus"))
