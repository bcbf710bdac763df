"""Every part works with every other, and equals visiting one pixel after the other."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
import torch
from pydantic import ValidationError

import torchsynth as ts
from torchsynth.schedule import Schedule, goes_around, visited_rows

SEARCHES = {
    "exhaustive": ts.Exhaustive(),
    "tsvq": ts.TSVQ(depth=3, beam=2),
    "coherence": ts.Coherence(template=ts.Square(size=3)),
}
PREFERENCES = {
    "exhaustive preferring": ts.PreferCoherent(template=ts.Square(size=3), kappa=1.0),
    "tsvq preferring": ts.PreferCoherent(
        best=ts.TSVQ(depth=3, beam=2), template=ts.Square(size=3), kappa=1.0
    ),
}
ORDERS = {"scanline": ts.Scanline(), "shuffle": ts.Shuffle(seed=2)}
COMBINATIONS = list(
    itertools.product(
        SEARCHES, ORDERS, (1, 2), (False, True), (False, True), ("torus", "open"), ("read", "skip")
    )
)


def literal_schedule(order, shape, reach, boundary, rows, waiting):
    """The library's schedule, with a batch for each rank: nothing is visited together that need not be."""
    rank = order.rank(shape, reach or (0, 0), boundary)
    chosen = visited_rows(rows, shape[0])
    if goes_around(rows):
        rank = rank.roll(chosen[0], 0)
    visited = torch.zeros(shape, dtype=torch.bool)
    visited[chosen] = True
    rank = rank.masked_fill(~(visited & waiting), shape[0] * shape[1]).flatten()
    ranks, batch = rank.unique(return_inverse=True)
    sizes = [int((rank == one).sum()) for one in ranks if one < shape[0] * shape[1]]
    after = torch.tensor([shape[0] * shape[1]])
    return Schedule(batch.argsort(stable=True)[: sum(sizes)], sizes, torch.cat((batch, after)))


def recipe_of(search, order, levels, follows, boundary, unknown):
    template = ts.Causal(size=3) if order == "scanline" else ts.Square(size=3, center=False)
    layers = (
        ts.Layer(plane="result", template=template),
        ts.Layer(plane="coarse", template=ts.Square(size=3)),
    )
    found = (SEARCHES | PREFERENCES)[search]
    sweep = ts.Sweep(layers=layers, search=found, order=ORDERS[order], unknown=unknown)
    recipe = ts.Recipe(levels=levels, boundary=boundary, initial=ts.RandomSource(), sweeps=(sweep,))
    return ts.recipes.with_target(recipe, passes=2) if follows else recipe


def controls_of(make_exemplar, size, follows, distorts):
    painted = torch.zeros(size, dtype=torch.bool)
    painted[1:6, 2:9] = True
    return ts.Controls(
        target=make_exemplar(2, *size, seed=4) if follows else None,
        target_region=painted if follows else None,
        angle=ts.field.swirl(size, 120.0) if distorts else None,
        scale=ts.field.zoom(size, 0.6, 1.7) if distorts else None,
    )


@pytest.mark.parametrize(
    ("search", "order", "levels", "follows", "distorts", "boundary", "unknown"),
    COMBINATIONS,
    ids=["-".join(map(str, one)) for one in COMBINATIONS],
)
def test_equals_the_literal_loop(
    make_exemplar, monkeypatch, search, order, levels, follows, distorts, boundary, unknown
):
    size = (8, 11)
    recipe = recipe_of(search, order, levels, follows, boundary, unknown)
    controls = controls_of(make_exemplar, size, follows, distorts)
    exemplar = make_exemplar(2, 14, 13, seed=1)
    batched = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    monkeypatch.setattr("torchsynth.course.schedule", literal_schedule)
    literal = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    assert batched.source.equal(literal.source)
    assert batched.cost.equal(literal.cost)
    assert batched.transfer(exemplar).equal(batched.image)


GUIDED = list(
    itertools.product(
        SEARCHES | PREFERENCES, ORDERS, (1, 2), (False, True), ("torus", "open"), ("read", "skip")
    )
)


@pytest.mark.parametrize(
    ("search", "order", "levels", "distorts", "boundary", "unknown"),
    GUIDED,
    ids=["-".join(map(str, one)) for one in GUIDED],
)
def test_guided_synthesis_equals_the_literal_loop(
    make_exemplar, monkeypatch, search, order, levels, distorts, boundary, unknown
):
    size = (8, 11)
    plain = recipe_of(search, order, levels, False, boundary, unknown)
    guides = (
        ts.Layer(plane="guide", template=ts.Square(size=3), weight=2),
        ts.Layer(plane="coarse_guide", template=ts.Square(size=1)),
    )
    sweep = plain.sweeps[0].model_copy(update={"layers": (*plain.sweeps[0].layers, *guides)})
    recipe = plain.changed(sweeps=(sweep,))
    controls = replace(
        controls_of(make_exemplar, size, False, distorts), guide=make_exemplar(3, *size, seed=8)
    )
    exemplar = ts.Exemplar(make_exemplar(2, 14, 13, seed=1), guide=make_exemplar(3, 14, 13, seed=6))
    batched = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    monkeypatch.setattr("torchsynth.course.schedule", literal_schedule)
    literal = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    assert batched.source.equal(literal.source)
    assert batched.cost.equal(literal.cost)
    assert batched.transfer(exemplar.image).equal(batched.image)


def test_tileable_sweeps_equal_the_literal_loop(make_exemplar, monkeypatch):
    exemplar, recipe = make_exemplar(1, 20, 19), ts.recipes.ashikhmin()
    batched = ts.synthesize(exemplar, (17, 23), recipe, seed=1)
    monkeypatch.setattr("torchsynth.course.schedule", literal_schedule)
    assert ts.synthesize(exemplar, (17, 23), recipe, seed=1).source.equal(batched.source)


def test_a_literal_loop_with_another_reach_differs(make_exemplar, monkeypatch):
    """The comparison can fail: a schedule that forgets what is read gives another texture."""
    exemplar, recipe = make_exemplar(1, 20, 19), ts.recipes.ashikhmin()
    right = ts.synthesize(exemplar, (17, 23), recipe, seed=1)

    def forgetful(_order, shape, reach, *rest):
        return literal_schedule(ts.Simultaneous(), shape, reach, *rest)

    monkeypatch.setattr("torchsynth.course.schedule", forgetful)
    assert not ts.synthesize(exemplar, (17, 23), recipe, seed=1).source.equal(right.source)


def test_a_distorted_batch_equals_its_singles(make_exemplar):
    exemplar, size = make_exemplar(3, 18, 18), (12, 10)
    recipe = ts.recipes.distorted(levels=2, neighborhood=3, parent=3, search="coherence")
    controls = ts.Controls(angle=ts.field.radial(size))
    batch = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[1, 2])
    for item, seed in enumerate((1, 2)):
        single = ts.synthesize(exemplar, size, recipe, controls=controls, seed=seed)
        assert single.source[0].equal(batch.source[item])


def test_a_whole_turn_and_scale_one_change_nothing(make_exemplar):
    exemplar, recipe = make_exemplar(1, 18, 18), ts.recipes.random_order(levels=2, neighborhood=3, parent=3)
    plain = ts.synthesize(exemplar, (12, 12), recipe)
    turned = ts.synthesize(exemplar, (12, 12), recipe, controls=ts.Controls(angle=360.0, scale=1.0))
    assert plain.source.equal(turned.source)


def test_half_a_turn_is_a_rotated_exemplar():
    """Vertical stripes of two widths lie the other way around after half a turn."""
    exemplar = torch.tensor([0.1, 0.1, 0.5, 0.9]).repeat(6).expand(1, 24, 24).contiguous()
    recipe = ts.recipes.distorted(levels=1, neighborhood=5)
    result = ts.synthesize(exemplar, (24, 24), recipe, controls=ts.Controls(angle=180.0), seed=1)
    straight = ts.synthesize(exemplar, (24, 24), recipe, seed=1)

    def rising(image):
        """How often a middle gray is followed by a bright pixel."""
        pairs = image[0, 0].unfold(1, 2, 1).flatten(0, 1)
        return int(((pairs[:, 0] == 0.5) & (pairs[:, 1] == exemplar.max())).sum())

    assert rising(straight.image) > 10 * max(1, rising(result.image))


def test_each_target_may_be_its_own(make_exemplar):
    exemplar, size = make_exemplar(1, 18, 18), (10, 12)
    targets = torch.stack([make_exemplar(1, *size, seed=one) for one in (1, 2)])
    recipe = ts.recipes.ashikhmin_target(passes=2, neighborhood=3)
    batch = ts.synthesize(exemplar, size, recipe, controls=ts.Controls(target=targets), seed=[5, 5])
    for item in (0, 1):
        controls = ts.Controls(target=targets[item])
        single = ts.synthesize(exemplar, size, recipe, controls=controls, seed=5)
        assert single.source[0].equal(batch.source[item])


def test_more_passes_come_closer_to_the_target():
    exemplar = torch.rand(1, 40, 40, generator=torch.Generator().manual_seed(1))
    target = torch.zeros(1, 32, 32)
    target[:, 8:24, 8:24] = 1
    distances = []
    for passes in (1, 3, 8):
        recipe = ts.recipes.ashikhmin_target(passes=passes)
        result = ts.synthesize(exemplar, (32, 32), recipe, controls=ts.Controls(target=target))
        distances.append((result.image[0] - target).square().mean().item())
    assert distances == sorted(distances, reverse=True)


def test_what_was_not_painted_does_not_matter(make_exemplar):
    exemplar, size = make_exemplar(3, 24, 24), (20, 20)
    painted = torch.zeros(size, dtype=torch.bool)
    painted[4:12, 5:15] = True
    recipe = ts.recipes.with_target(ts.recipes.ashikhmin_multires(levels=2, neighborhood=3), passes=2)
    results = []
    for background in (0.0, 0.7):
        target = torch.where(painted, make_exemplar(3, *size, seed=7), background)
        controls = ts.Controls(target=target, target_region=painted)
        results.append(ts.synthesize(exemplar, size, recipe, controls=controls))
    assert results[0].source.equal(results[1].source)


def test_passes_can_be_looked_at_one_by_one(make_exemplar):
    exemplar, target = make_exemplar(1, 16, 16), make_exemplar(1, 9, 9, seed=3)
    seen = {}

    def progress(_level, sweep, done, _total, preview):
        seen[sweep, done] = preview()

    recipe = ts.recipes.ashikhmin_target(passes=3, neighborhood=3)
    ts.synthesize(exemplar, (9, 9), recipe, controls=ts.Controls(target=target), progress=progress)
    for passes in (1, 2):
        after = seen[passes, 81 * passes]
        shorter = ts.recipes.ashikhmin_target(passes=passes, neighborhood=3)
        assert after.equal(
            ts.synthesize(exemplar, (9, 9), shorter, controls=ts.Controls(target=target)).image
        )


IMPOSSIBLE = {
    "skips all it could see": (
        {"levels": 1, "sweeps": [{"layers": [{"plane": "result", "template": {"kind": "square", "size": 3}}],
                                  "order": {"kind": "simultaneous"}, "unknown": "skip"}]},
        "a level's first sweep sees something",
    ),
    "goes around an open boundary": (
        {"levels": 1, "boundary": "open",
         "sweeps": [{"layers": [{"plane": "result", "template": {"kind": "causal", "size": 3}}], "rows": [-2, 2]}]},
        r"rows \[-2, 2\] go around a torus, but the boundary is open",
    ),
    "an even kernel": (
        {"levels": 1, "blur_seams": 4,
         "sweeps": [{"layers": [{"plane": "result", "template": {"kind": "causal", "size": 3}}]}]},
        "must be odd, but 4 is even",
    ),
    "up without coarse": (
        {"levels": 1, "sweeps": [{"layers": [{"plane": "target", "template": {"kind": "square", "size": 3}, "up": 1}]}]},
        "'up' is for the coarse planes; a target layer reads its own level",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("data", "message"), IMPOSSIBLE.values(), ids=IMPOSSIBLE.keys())
def test_what_cannot_work_says_so(data, message):
    with pytest.raises(ValidationError, match=message):
        ts.Recipe.model_validate(data)


def test_rows_that_nobody_visits_are_noticed(make_exemplar):
    sweep = ts.recipes.ashikhmin().sweeps[0]
    recipe = ts.Recipe(levels=1, initial=ts.RandomSource(), sweeps=(sweep,))
    with pytest.raises(ts.InputError, match="must visit every row of level 0, but no sweep visits row 8"):
        ts.synthesize(make_exemplar(1), (10, 10), recipe)


def literal_layer(rank, _reach, _boundary):
    """A layer's pixels one after the other."""
    ranks, batch = rank.unique(return_inverse=True)
    assert len(ranks) - bool((rank == 0).any()) == int((rank > 0).sum())
    return Schedule.of(batch, rank > 0)


# Acceptances make no difference to what a search reads: not all of them with all else.
ONION = [
    *itertools.product(SEARCHES, ("best",), (1, 2), (False, True), ("torus", "open")),
    *itertools.product(SEARCHES, ("tolerant",), (2,), (False,), ("torus", "open")),
    *itertools.product(SEARCHES, ("strict",), (1,), (False,), ("torus", "open")),
]
ACCEPT = {
    "best": ts.Best(),
    "tolerant": ts.WithinTolerance(epsilon=0.5, max_error=None),
    "strict": ts.WithinTolerance(epsilon=0.5, max_error=0.02, growth=2.0),
}


@pytest.mark.parametrize(
    ("search", "accept", "levels", "follows", "boundary"),
    ONION,
    ids=["-".join(map(str, one)) for one in ONION],
)
def test_an_onion_equals_the_literal_loop(
    make_exemplar, monkeypatch, search, accept, levels, follows, boundary
):
    size = (10, 9)
    recipe = recipe_of(search, "shuffle", levels, False, boundary, "skip")
    peeled = recipe.sweeps[0].model_copy(update={"order": ts.OnionPeel(seed=1), "accept": ACCEPT[accept]})
    recipe = recipe.changed(sweeps=(peeled, peeled.model_copy(update={"unknown": "read"})))
    if follows:
        recipe = ts.recipes.with_target(recipe)
    hole = torch.zeros(size, dtype=torch.bool)
    hole[2:5, 3:7] = True
    hole[8, 1] = True
    picture, exemplar = make_exemplar(2, *size, seed=5), make_exemplar(2, 14, 13, seed=1)
    controls = replace(controls_of(make_exemplar, size, follows, distorts=False), initial=picture, hole=hole)
    batched = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    assert batched.image[:, :, ~hole].equal(picture[:, ~hole].expand(2, -1, -1))
    monkeypatch.setattr("torchsynth.course.schedule_layer", literal_layer)
    literal = ts.synthesize(exemplar, size, recipe, controls=controls, seed=[3, 4])
    assert batched.source.equal(literal.source)
    assert batched.cost.equal(literal.cost)
    for item, seed in enumerate((3, 4)):
        alone = ts.synthesize(exemplar, size, recipe, controls=controls, seed=seed)
        assert alone.source[0].equal(batched.source[item])
