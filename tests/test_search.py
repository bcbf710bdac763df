"""Searchers against brute force."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from torchsynth.accept import Best, first_minimum
from torchsynth.neighborhood import Index
from torchsynth.search import Exhaustive, Query


def _whole(generator, *shape):
    return torch.randint(-128, 128, shape, generator=generator).float()


def _augmented(queries):
    return torch.cat((queries, torch.ones(*queries.shape[:2], 1)), 2)


@pytest.mark.parametrize("candidates", [1, 5, 127, 128, 129, 2048, 2049, 2300])
@pytest.mark.parametrize("exemplars", [1, 3])
def test_equals_cdist(candidates, exemplars):
    generator = torch.Generator().manual_seed(candidates)
    index = Index(
        _whole(generator, exemplars, candidates, 24),
        torch.arange(candidates),
        torch.ones(24, dtype=torch.int64),
        (1, candidates),
        torch.zeros(exemplars, candidates, 1),
    )
    queries = _whole(generator, 3, 7, 24)
    distance = torch.cdist(
        queries.double(), index.features.double(), compute_mode="donot_use_mm_for_euclid_dist"
    )
    state = Exhaustive().fit(index, complete=True)
    cost = Exhaustive().search(state, Query(_augmented(queries))).cost.flatten(2)
    base = queries.square().sum(2, keepdim=True)
    assert (cost[..., :candidates] + base).equal(distance.square().round().float())
    assert cost[..., candidates:].isinf().all()
    choice = Best().choose(Exhaustive().search(state, Query(_augmented(queries))).cost)
    assert choice.place.equal(distance.argmin(2))


def test_weights_and_missing_neighbors_count_as_they_should():
    generator = torch.Generator().manual_seed(1)
    weights = torch.tensor([1, 3, 2, 5, 1])
    index = Index(_whole(generator, 1, 40, 5), torch.arange(40), weights, (1, 40), torch.zeros(1, 40, 1))
    queries = _whole(generator, 2, 6, 5)
    readable = torch.rand(6, 5, generator=generator) > 0.4
    readable[0], readable[1] = True, False
    queries = queries * readable
    state = Exhaustive().fit(index, complete=False)
    cost = Exhaustive().search(state, Query(_augmented(queries), readable)).cost.flatten(2)
    base = (queries.square() * weights).sum(2, keepdim=True)
    difference = (queries[:, :, None] - index.features[:, None]).square() * weights * readable[:, None]
    assert (cost + base).equal(difference.sum(3))


@given(st.integers(1, 4), st.integers(1, 5), st.integers(1, 9), st.integers(0, 3))
def test_first_minimum_takes_the_first_of_equals(sites, blocks, columns, values):
    generator = torch.Generator().manual_seed(sites * 100 + blocks * 10 + columns)
    cost = torch.randint(0, values + 1, (2, sites, blocks, columns), generator=generator).float()
    choice = first_minimum(cost)
    flat = cost.flatten(2)
    first = (flat == flat.amin(2, keepdim=True)).int().argmax(2)
    assert choice.place.equal(first)
    assert choice.cost.equal(flat.amin(2))


def test_capacity_bounds_the_workspace(monkeypatch):
    monkeypatch.setattr("torchsynth.search.exhaustive.MEMORY_BUDGET", 4 * 1000)
    index = Index(
        torch.zeros(1, 300, 4),
        torch.arange(300),
        torch.ones(4, dtype=torch.int64),
        (1, 300),
        torch.zeros(1, 300, 1),
    )
    state = Exhaustive().fit(index, complete=True)
    assert Exhaustive().capacity(state) == 3
    assert state.workspace.numel() == 3 * state.width
