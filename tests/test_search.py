"""Searchers against brute force."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import torchsynth as ts
from torchsynth.accept import Best, WithinTolerance, first_minimum
from torchsynth.index import Index
from torchsynth.initial import SeedPatch
from torchsynth.neighborhood import Plane, Planes
from torchsynth.schedule import OnionPeel
from torchsynth.search import Exhaustive, Offers, Query, coherence


def _whole(generator, *shape):
    return torch.randint(-128, 128, shape, generator=generator).float()


def _augmented(queries):
    return torch.cat((queries, torch.ones(*queries.shape[:2], 1)), 2)


@pytest.mark.parametrize("candidates", [1, 5, 127, 128, 129, 2048, 2049, 2300])
@pytest.mark.parametrize("exemplars", [1, 3])
def test_equals_cdist(candidates, exemplars):
    generator = torch.Generator().manual_seed(candidates)
    vectors = _whole(generator, exemplars, candidates, 24)
    index = Index.of_vectors(vectors, torch.ones(24, dtype=torch.int64))
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
    index = Index.of_vectors(_whole(generator, 1, 40, 5), weights)
    queries = _whole(generator, 2, 6, 5)
    readable = torch.rand(6, 5, generator=generator) > 0.4
    readable[0], readable[1] = True, False
    queries = queries * readable
    state = Exhaustive().fit(index, complete=False)
    augmented = _augmented(queries)
    extended = torch.cat((augmented, (~readable).float().expand(2, -1, -1)), 2)
    cost = Exhaustive().search(state, Query(augmented, readable, None, extended)).cost.flatten(2)
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
    index = Index.of_vectors(torch.zeros(1, 300, 4), torch.ones(4, dtype=torch.int64))
    state = Exhaustive().fit(index, complete=True)
    assert Exhaustive().capacity(state) == 3
    assert state.workspace.numel() == 3 * state.width


def _square(plane="result", size=3, center=False):
    return ts.Layer(plane=plane, template=ts.Square(size=size, center=center))


def _causal(**options):
    return ts.Sweep(layers=(ts.Layer(plane="result", template=ts.Causal(size=5)),), **options)


COHERENT = ts.Coherence(template=ts.Causal(size=5))
FARTHER = ts.Coherence(template=ts.Square(size=7))
STREAMED = {
    "exhaustive": (_causal(),),
    "several layers": (
        _causal(),
        ts.Sweep(layers=(_square(), _square("coarse", center=True)), unknown="skip"),
    ),
    "tolerance": (_causal(order=OnionPeel(), accept=WithinTolerance(max_error=None), unknown="skip"),),
    "coherence": (_causal(search=COHERENT),),
    "spared bottom": (_causal(search=ts.Coherence(template=ts.Causal(size=5), spare_bottom=True)),),
    "farther than compared": (_causal(search=COHERENT, unknown="skip"), _causal(search=FARTHER)),
}


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(("channels", "exemplars"), [(1, 2), (3, 1)])
@pytest.mark.parametrize("sweeps", STREAMED.values(), ids=STREAMED)
def test_without_a_table_nothing_else_is_found(monkeypatch, sweeps, channels, exemplars, boundary):
    coherent = sweeps[0].search.wants() is not None
    growing = isinstance(sweeps[0].order, OnionPeel)
    initial = SeedPatch() if growing else ts.RandomSource() if coherent else ts.Noise()
    recipe = ts.Recipe(levels=1 if growing else 2, boundary=boundary, initial=initial, sweeps=sweeps)
    image = torch.rand(exemplars, channels, 22, 25, generator=torch.Generator().manual_seed(channels))
    image = (image * 4).round() / 4  # so that many candidates are as good as others
    kept = ts.synthesize(image, (9, 11), recipe, seed=[5, 6])
    monkeypatch.setattr("torchsynth.search.base.TABLE_BUDGET", 0)
    monkeypatch.setattr("torchsynth.index.CHUNK", 20_000)
    monkeypatch.setattr("torchsynth.search.exhaustive._ONE_BLOCK", 100)
    read = ts.synthesize(image, (9, 11), recipe, seed=[5, 6])
    for one, other in zip(kept.levels, read.levels, strict=True):
        assert one.source.equal(other.source)
        assert one.cost.equal(other.cost)


@pytest.mark.parametrize("search", [Exhaustive(), FARTHER])
@pytest.mark.parametrize("complete", [True, False])
def test_tables_are_kept_only_within_the_budget(monkeypatch, search, complete):
    index = Index.of_vectors(torch.zeros(1, 5000, 8), torch.ones(8, dtype=torch.int64))
    rows = 9 if complete else 17
    for budget, kept in ((5200 * 4 * rows, True), (4900 * 4 * rows, False)):
        monkeypatch.setattr("torchsynth.search.base.TABLE_BUDGET", budget)
        assert (search.fit(index, complete=complete).table is not None) == kept


@pytest.mark.parametrize("exemplars", [1, 2])
@pytest.mark.parametrize("spare_bottom", [False, True])
def test_a_table_of_candidates_is_as_good_as_one_of_positions(monkeypatch, exemplars, spare_bottom):
    """Where few positions are candidates, the table has no rows for the others."""
    heights = []
    table_of = coherence._table

    def noted(index, height, complete):
        heights.append((height, len(index.sites)))
        return table_of(index, height, complete)

    monkeypatch.setattr(coherence, "_table", noted)
    valid = torch.zeros(30, 25, dtype=torch.bool)
    valid[3:18, 4:22] = True
    valid[6, 9] = False
    image = torch.rand(exemplars, 1, 30, 25, generator=torch.Generator().manual_seed(3))
    exemplar = ts.Exemplar((image * 4).round() / 4, valid=valid)
    recipe = ts.recipes.ashikhmin(spare_bottom=spare_bottom)
    seeds = [7, 8]
    few = ts.synthesize(exemplar, (14, 13), recipe, seed=seeds)
    assert all(height == candidates for height, candidates in heights)
    monkeypatch.setattr(coherence, "_NEARLY_ALL", 0.0)
    every = ts.synthesize(exemplar, (14, 13), recipe, seed=seeds)
    assert heights[-1][0] == 30 * 25 > 2 * heights[-1][1]
    assert few.source.equal(every.source)
    assert few.cost.equal(every.cost)


def test_continuations_beyond_what_is_compared_never_reach_around():
    plane = Plane(torch.zeros(1, 9 * 8, 1), (9, 8), "open")
    index = Index.of((_square(),), (1,), Planes((plane,)), 0)
    state = FARTHER.fit(index, complete=True)
    candidates = set(index.sites.tolist())
    offsets = FARTHER.template.offsets().tolist()
    for source in range(-1, 9 * 8):
        nobody = torch.zeros(1, 1, len(offsets), dtype=torch.int64)
        query = Query(torch.ones(1, 1, 9), offers=Offers(nobody + source, None, nobody))
        found = FARTHER.continued(state, query)
        places = found.source.flatten().tolist()
        there = found.cost.flatten().isfinite().tolist()
        for (down, across), place, goes_on in zip(offsets, places, there, strict=True):
            row, column = source // 8 - down, source % 8 - across
            inside = source >= 0 and 0 <= row < 9 and 0 <= column < 8
            assert goes_on == (inside and row * 8 + column in candidates)
            assert not goes_on or place == row * 8 + column


@pytest.mark.parametrize("exemplars", [1, 3])
@pytest.mark.parametrize("tolerance", [0.0, 0.1, 3.0])
@pytest.mark.parametrize("complete", [True, False])
@pytest.mark.parametrize("spread", [256, 3])
def test_sifting_keeps_all_that_matters_exactly(monkeypatch, exemplars, tolerance, complete, spread):
    """Weights for which float32 is not exact: what may be chosen has its exact cost, in its order."""
    monkeypatch.setattr("torchsynth.search.sieve._FEW", 0)  # however many these are
    generator = torch.Generator().manual_seed(7)
    weights = torch.randint(0, 1025, (40,), generator=generator)

    def whole(*shape):
        return torch.randint(-128, 128, shape, generator=generator).double() // (256 // spread)

    index = Index.of_vectors(whole(exemplars, 3000, 40), weights)
    queries, readable = whole(3, 6, 40), torch.rand(6, 40, generator=generator) > 0.4
    if complete:
        readable[:] = True
    queries = queries * readable
    query = Query(_augmented(queries).double(), tolerance=tolerance)
    if not complete:
        missing = (~readable).double().expand(3, -1, -1)
        query = query._replace(readable=readable, extended=torch.cat((query.features, missing), 2))
    state = Exhaustive().fit(index, complete=complete)
    assert state.table.dtype == torch.float32
    found = Exhaustive().search(state, query)
    base = (queries.square() * weights).sum(2)
    vectors = index.features.expand(3, -1, -1)
    distance = ((queries[:, :, None] - vectors[:, None]).square() * weights * readable[:, None]).sum(3)
    for sample in range(3):
        for site in range(6):
            there = found.cost[sample, site].isfinite()
            rows = found.source[sample, site][there]
            assert rows.equal(rows.unique())
            exact = distance[sample, site]
            assert (found.cost[sample, site][there] + base[sample, site]).equal(exact[rows])
            needed = (exact <= (1 + tolerance) * exact.min()).nonzero().squeeze(1)
            assert torch.isin(needed, rows).all()
            if spread == 256:
                assert len(rows) < 2 * len(needed) + 50
    assert first_minimum(found.cost).place.shape == (3, 6)
