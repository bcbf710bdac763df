"""TSVQ: the tensorised tree against the literal one, and against exhaustive search."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from torch.utils._python_dispatch import TorchDispatchMode

import torchsynth as ts
from tests.reference import tsvq
from torchsynth.accept import Best
from torchsynth.feasibility import matching_dtype
from torchsynth.index import Index
from torchsynth.search import Query


def _index(count, features, seed, exemplars=1, spread=128):
    generator = torch.Generator().manual_seed(seed)
    values = torch.randint(-spread, spread, (exemplars, count, features), generator=generator).float()
    weights = torch.randint(1, 4, (features,), generator=generator)
    return Index.of_vectors(values, weights, values[..., :1])


def _query(features, readable=None):
    return Query(torch.cat((features, torch.ones(*features.shape[:2], 1)), 2), readable)


def _found(search, index, query):
    proposals = search.search(search.fit(index, complete=query.readable is None), query)
    choice = Best().choose(proposals.cost)
    return proposals.source_at(choice.place, index.sites), choice.cost


def _leaves(node):
    return [node[1]] if not node[2] else [leaf for child in node[2] for leaf in _leaves(child)]


@settings(max_examples=60)
@given(
    count=st.integers(1, 60), features=st.integers(1, 4), depth=st.integers(1, 7), seed=st.integers(0, 99),
    spread=st.sampled_from([1, 3, 128]), min_leaf=st.integers(1, 4), beam=st.integers(1, 4),
)  # fmt: skip
def test_equals_the_literal_tree(count, features, depth, seed, spread, min_leaf, beam):
    index = _index(count, features, seed, spread=spread)
    vectors, weights = index.features[0].double().numpy(), index.weights.numpy()
    search = ts.TSVQ(depth=depth, min_leaf=min_leaf, beam=beam)
    tree = search.fit(index, complete=True).tree
    literal = tsvq.grow(vectors, weights, depth, min_leaf=min_leaf)
    ours = [
        tree.members[start : start + size].tolist()
        for start, size, child in zip(tree.starts, tree.counts, tree.children, strict=True)
        if child < 0
    ]
    assert sorted(ours) == sorted(_leaves(literal))
    queries = _index(9, features, seed + 1).features
    rows, cost = _found(search, index, _query(queries))
    for number, query in enumerate(queries[0].double().numpy()):
        best = tsvq.best_member(literal, vectors, weights, query, beam)
        distance = tsvq.distance(query, vectors[best], weights)
        assert cost[0, number] + (query**2 * weights).sum() == distance
        assert rows[0, number] == best or (vectors[rows[0, number]] != vectors[best]).any()


def test_a_full_tree_finds_its_own_vectors():
    index = _index(300, 6, seed=4)
    rows, cost = _found(ts.TSVQ(depth=30), index, _query(index.features))
    assert rows[0].equal(torch.arange(300))
    assert (cost[0] + (index.features[0].square() * index.weights).sum(1) == 0).all()


def test_a_beam_over_all_leaves_is_exhaustive():
    index = _index(200, 5, seed=2)
    queries = _query(_index(50, 5, seed=3).features)
    exhaustive = Best().choose(
        ts.Exhaustive().search(ts.Exhaustive().fit(index, complete=True), queries).cost
    )
    _, cost = _found(ts.TSVQ(depth=4, beam=16), index, queries)
    assert cost.equal(exhaustive.cost)


def test_wider_beams_find_better_matches():
    index = _index(2000, 8, seed=6)
    queries = _query(_index(200, 8, seed=7).features)
    costs = [_found(ts.TSVQ(depth=7, beam=beam), index, queries)[1].mean() for beam in (1, 4, 16)]
    assert costs == sorted(costs, reverse=True)


def test_each_exemplar_has_its_own_tree():
    index = _index(70, 4, seed=1, exemplars=3)
    queries = _index(8, 4, seed=2, exemplars=3).features
    rows, cost = _found(ts.TSVQ(depth=4), index, _query(queries))
    for item in range(3):
        alone = Index.of_vectors(index.features[item : item + 1], index.weights)
        row, price = _found(ts.TSVQ(depth=4), alone, _query(queries[item : item + 1]))
        assert row[0].equal(rows[item])
        assert price[0].equal(cost[item])


def test_codewords_limit_the_leaves():
    index = _index(400, 4, seed=5)
    for codewords in (2, 7, 33):
        tree = ts.TSVQ(depth=20, codewords=codewords).fit(index, complete=True).tree
        assert int((tree.children < 0).sum()) == codewords


def test_central_leaves_propose_the_member_nearest_to_their_centroid():
    index = _index(120, 3, seed=8)
    state = ts.TSVQ(depth=3, leaf="central").fit(index, complete=True)
    full = ts.TSVQ(depth=3).fit(index, complete=True).tree
    for node in (full.children < 0).nonzero().flatten().tolist():
        members = full.members[full.starts[node] : full.starts[node] + full.counts[node]]
        distance = ((index.features[0, members] - full.centroids[node]).square() * index.weights).sum(1)
        assert state.tree.counts[node] == 1
        assert state.tree.members[state.tree.starts[node]] == members[distance.argmin()]


class _Largest(TorchDispatchMode):
    """Notes how many numbers the largest new tensor has."""

    numbers = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        result = func(*args, **(kwargs or {}))
        if isinstance(result, torch.Tensor):
            self.numbers = max(self.numbers, result.numel())
        return result


@pytest.mark.parametrize("leaf", ["nearest", "central"])
@pytest.mark.parametrize("depth", [None, 3])
def test_training_holds_nothing_larger_than_a_few_copies_of_the_vectors(leaf, depth):
    index = _index(20_000, 2, seed=8)
    with _Largest() as largest:
        ts.TSVQ(depth=depth, leaf=leaf).fit(index, complete=True)
    assert largest.numbers <= 2 * index.features.numel()


def test_without_a_depth_leaves_hold_up_to_64():
    # Far more vectors on one side: the tree is deeper there.
    near, far = _index(3000, 4, seed=1, spread=20), _index(200, 4, seed=2)
    index = Index.of_vectors(torch.cat((near.features, far.features), dim=1), near.weights)
    tree = ts.TSVQ().fit(index, complete=True).tree
    counts, leaf = tree.counts, tree.children < 0
    assert counts[leaf].max() <= 64
    assert leaf.sum() < len(index.sites) / 16
    assert tree.depth > ts.TSVQ(depth=6).fit(index, complete=True).tree.depth


@pytest.mark.parametrize("beam", [1, 2, 3])
@pytest.mark.parametrize("readable", [None, torch.tensor([True, True, False, True]).expand(30, 4)])
def test_leaves_of_any_size_propose_their_nearest_member(beam, readable):
    near, far = _index(900, 4, seed=3, spread=2), _index(100, 4, seed=4)
    index = Index.of_vectors(torch.cat((near.features, far.features), dim=1), near.weights)
    search = ts.TSVQ(depth=3, beam=beam)
    state = search.fit(index, complete=readable is None)
    tree = state.tree
    assert tree.counts[tree.children < 0].max() > 10 * tree.counts[tree.children < 0].min()
    queries = torch.cat((_index(15, 4, seed=6, spread=3).features, _index(15, 4, seed=7).features), dim=1)
    queries = queries if readable is None else queries * readable
    rows, cost = _found(search, index, _query(queries, readable))
    weights = index.weights * (1 if readable is None else readable[0])
    for number, query in enumerate(queries[0]):
        kept = torch.zeros(1, dtype=torch.int64)
        for _ in range(tree.depth):
            first = tree.children[kept]
            offered = torch.stack(
                (torch.where(first < 0, kept, first), torch.where(first < 0, -1, first + 1)), 1
            )
            offered = offered.flatten()[offered.flatten() >= 0]
            distance = ((tree.centroids[offered] - query).square() * weights).sum(1)
            kept = offered[distance.sort(stable=True).indices[:beam]]
        members = torch.cat([tree.members[tree.starts[one] :][: tree.counts[one]] for one in kept])
        distance = ((index.features[0, members] - query).square() * weights).sum(1)
        assert rows[0, number] == members[distance.argmin()]
        assert cost[0, number] + (query.square() * weights).sum() == distance.min()


def test_identical_vectors_are_one_leaf():
    index = Index.of_vectors(torch.full((1, 9, 2), 5.0), torch.tensor([1, 1]))
    rows, _ = _found(ts.TSVQ(depth=5), index, _query(torch.zeros(1, 1, 2)))
    assert rows.item() == 0


def test_missing_neighbors_are_left_out():
    index = _index(50, 4, seed=3)
    readable = torch.tensor([[True, False, True, True], [False] * 4])
    queries = _index(2, 4, seed=4).features * readable
    _, cost = _found(ts.TSVQ(depth=3, beam=8), index, _query(queries, readable))
    weights = index.weights * readable[:, None]
    difference = ((queries[0, :, None] - index.features) ** 2 * weights).sum(2)
    base = (queries[0].square() * index.weights).sum(1)
    assert (cost[0] + base).equal(difference.amin(1))


def test_training_in_chunks_changes_nothing(monkeypatch):
    index = _index(300, 5, seed=9)
    whole = ts.TSVQ(depth=6).fit(index, complete=True)
    monkeypatch.setattr("torchsynth.search.tree.CHUNK", 17)
    pieces = ts.TSVQ(depth=6).fit(index, complete=True)
    assert pieces.tree.members.equal(whole.tree.members)
    assert np.array_equal(pieces.tree.centroids, whole.tree.centroids)


@pytest.mark.parametrize(
    "wrong", [{"depth": 0}, {"beam": 0}, {"codewords": 1}, {"min_leaf": 0}, {"threshold": 1.0}]
)
def test_impossible_options_are_refused(wrong):
    with pytest.raises(ValidationError, match=r"should be (greater|less) than"):
        ts.TSVQ(**wrong)


def test_float32_is_left_where_sums_would_no_longer_be_exact():
    exhaustive, tree = ts.recipes.wei_levoy(), ts.recipes.wei_levoy_tsvq()
    assert matching_dtype(tree, channels=3) == torch.float32
    # 260 features: |x|^2 - 2 q.x stays below 2**24, (q - x)^2 may not.
    assert matching_dtype(exhaustive, channels=4) == torch.float32
    assert matching_dtype(tree, channels=4) == torch.float64


def test_centroid_leaves_propose_the_mean_of_their_members():
    index = _index(150, 3, seed=6)
    search = ts.TSVQ(depth=4, leaf="centroid", beam=2)
    queries = _index(20, 3, seed=7).features
    state = search.fit(index, complete=True)
    proposals = search.search(state, _query(queries))
    choice = Best().choose(proposals.cost)
    tree, own = state.tree, proposals.values_at(choice.place)
    leaves = (tree.children < 0).nonzero().flatten().tolist()
    means = {
        node: index.values[0, tree.members[tree.starts[node] : tree.starts[node] + tree.counts[node]]].mean(0)
        for node in leaves
    }
    for number, query in enumerate(queries[0]):
        literal = tsvq.best_leaves(
            tsvq.grow(index.features[0].double().numpy(), index.weights.numpy(), 4),
            index.weights.numpy(), query.double().numpy(), 2,
        )  # fmt: skip
        members = torch.tensor(literal[0][1])
        assert own[0, number].equal(index.values[0, members].double().mean(0).round().float())
        assert own[0, number] in [mean.round() for mean in means.values()]


def test_centroid_leaves_have_no_sources(make_exemplar):
    recipe = ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3, depth=3)
    sweep = recipe.sweeps[0].model_copy(update={"search": ts.TSVQ(depth=3, leaf="centroid")})
    recipe = recipe.model_copy(update={"sweeps": (sweep,)})
    exemplar = make_exemplar(3)
    result = ts.synthesize(exemplar, (12, 11), recipe, seed=[1, 2])
    assert (result.source == -1).all()
    assert ((result.image * 255).round() / 255).sub(result.image).abs().max() < 1e-6
    smooth = ts.synthesize(exemplar, (12, 11), ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3))
    assert result.image.std() < smooth.image.std()
    single = ts.synthesize(exemplar, (12, 11), recipe, seed=2)
    assert single.image[0].equal(result.image[1])
    for wish in (result.seams, lambda: result.transfer(exemplar)):
        with pytest.raises(ts.InputError, match="needs a source map, and so a recipe that copies pixels"):
            wish()
    with pytest.raises(ValidationError, match="seams lie between copied patches"):
        ts.Recipe(levels=1, sweeps=(sweep,), blur_seams=3)
    with pytest.raises(ValidationError, match="levels inherit sources"):
        ts.Recipe(levels=2, sweeps=(sweep,), initial=ts.RandomSource())
