"""Laws that hold for every recipe."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import torchsynth as ts
from torchsynth.neighborhood import Layer
from torchsynth.recipes.building import causal_layers
from torchsynth.schedule import Scanline, Shuffle, Simultaneous
from torchsynth.sweep import Sweep
from torchsynth.template import Causal, Square


def _recipe(order, boundary="torus", levels=2, templates=None, normalize=False):
    result = templates or (Causal(size=3) if isinstance(order, Scanline) else Square(size=3, center=False))
    layers = (
        Layer(plane="result", template=result),
        Layer(plane="coarse", template=Square(size=3), weight=2),
    )
    return ts.Recipe(
        levels=levels, boundary=boundary, sweeps=(Sweep(layers=layers, order=order, normalize=normalize),)
    )


def _preferring(kappa):
    search = ts.PreferCoherent(template=Causal(size=5), kappa=kappa)
    return ts.Recipe(levels=2, sweeps=(Sweep(layers=causal_layers(5, 3), search=search),))


RECIPES = {
    "wei_levoy_tsvq": ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3, depth=4),
    "tsvq open": ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3, beam=3, boundary="open"),
    "wei_levoy": ts.recipes.wei_levoy(levels=2, neighborhood=5, parent=3),
    "wei_levoy per level": ts.recipes.wei_levoy(levels=2, neighborhood=(3, 5), parent=(3,)),
    "wei_levoy open": ts.recipes.wei_levoy(levels=2, neighborhood=5, parent=3, boundary="open"),
    "wei_levoy_single": ts.recipes.wei_levoy_single(neighborhood=5),
    "single open": ts.recipes.wei_levoy_single(neighborhood=5, boundary="open"),
    "shuffled": _recipe(Shuffle(seed=4)),
    "shuffled open": _recipe(Shuffle(seed=4), "open"),
    "square scanline": _recipe(Scanline(), templates=Square(size=5, center=False), normalize=True),
    "simultaneous": _recipe(Simultaneous()),
    "simultaneous open": _recipe(Simultaneous(), "open"),
    "ashikhmin": ts.recipes.ashikhmin(),
    "ashikhmin noise": ts.recipes.ashikhmin(noise=True, tileable=False, spare_bottom=True),
    "ashikhmin open": ts.recipes.ashikhmin(boundary="open"),
    "ashikhmin_multires": ts.recipes.ashikhmin_multires(levels=2, neighborhood=3),
    "random_order": ts.recipes.random_order(levels=2, neighborhood=3, parent=3),
    "random tsvq": ts.recipes.random_order(levels=2, neighborhood=3, parent=3, search="tsvq"),
    "random coherence": ts.recipes.random_order(levels=2, neighborhood=3, parent=3, search="coherence"),
    "distorted": ts.recipes.distorted(levels=2, neighborhood=5, parent=3),
    "efros_leung": ts.recipes.efros_leung(window=5),
    "efros_leung waiting": ts.recipes.efros_leung(
        window=5, pick="distance", max_error=0.02, growth=3.0, boundary="torus"
    ),
    "improved_wl": ts.recipes.improved_wl(levels=2, neighborhood=3, parent=3, size=3),
    "improved_wl W N": ts.recipes.improved_wl(morphology=False, levels=2, neighborhood=5, parent=3),
    "prefer coherent": _preferring(2.0),
    "quilting": ts.recipes.quilting(block=6),
    "quilting torus": ts.recipes.quilting(block=7, overlap=3, tolerance=0.3, boundary="torus"),
    "graphcut": ts.recipes.graphcut(refinements=2),
    "graphcut torus": ts.recipes.graphcut(patch=6, k=0.1, refinements=3, boundary="torus"),
    "wei_levoy skipping": ts.Recipe(
        levels=1,
        sweeps=(ts.Sweep(layers=(Layer(plane="result", template=Causal(size=5)),), unknown="skip"),),
    ),
}
every_recipe = pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES.keys())


def _same(one, other):
    return one.source.equal(other.source) and one.image.equal(other.image) and one.cost.equal(other.cost)


@every_recipe
def test_every_pixel_is_a_copy(make_exemplar, recipe):
    exemplar = make_exemplar(3)
    result = ts.synthesize(exemplar, (13, 10), recipe, seed=[1, 2])
    assert result.transfer(exemplar).equal(result.image)
    for level in result.levels:
        rows, columns = level.source.unbind(1)
        picked = level.exemplar[0][:, rows, columns].transpose(0, 1)
        assert picked.equal(level.image)


@every_recipe
def test_a_batch_equals_its_singles(make_exemplar, recipe):
    exemplar = make_exemplar(2)
    batch = ts.synthesize(exemplar, (9, 14), recipe, seed=[5, 9, 5])
    for item, seed in enumerate((5, 9, 5)):
        single = ts.synthesize(exemplar, (9, 14), recipe, seed=seed)
        assert single.source[0].equal(batch.source[item])
        assert single.cost[0].equal(batch.cost[item])
    assert not batch.source[0].equal(batch.source[1])


@every_recipe
def test_a_batch_of_exemplars_equals_its_singles(make_exemplar, recipe):
    exemplars = torch.stack([make_exemplar(2, seed=one) for one in (1, 2, 3)])
    batch = ts.synthesize(exemplars, (9, 11), recipe, seed=7)
    for item in range(3):
        single = ts.synthesize(exemplars[item], (9, 11), recipe, seed=7 + item)
        assert single.image[0].equal(batch.image[item])
        assert single.source[0].equal(batch.source[item])


@every_recipe
def test_threads_do_not_matter(make_exemplar, recipe):
    exemplar = make_exemplar(1, 40, 40)
    before = torch.get_num_threads()
    results = []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            results.append(ts.synthesize(exemplar, (40, 33), recipe, seed=3))
    finally:
        torch.set_num_threads(before)
    assert _same(*results)


def test_threads_do_not_matter_to_any_level():
    """Colored pictures large enough to be blurred by several threads."""
    exemplar = torch.rand(3, 150, 131, dtype=torch.float64)
    recipe = ts.recipes.wei_levoy(levels=4, neighborhood=3, parent=1)
    before = torch.get_num_threads()
    results = []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            start = recipe.initial.start(
                ts.Exemplar(exemplar).images(4), (301, 217), "torus", [torch.Generator().manual_seed(1)]
            )
            results.append((*start, *ts.Exemplar(exemplar).images(4)))
    finally:
        torch.set_num_threads(before)
    assert all(one.equal(other) for one, other in zip(*results, strict=True))


def test_more_outputs_than_fit_the_budget(make_exemplar, monkeypatch):
    exemplar, recipe = make_exemplar(1), RECIPES["wei_levoy_single"]
    free = ts.synthesize(exemplar, (6, 7), recipe, seed=range(9))
    monkeypatch.setattr("torchsynth.search.exhaustive.MEMORY_BUDGET", 2000)
    assert _same(free, ts.synthesize(exemplar, (6, 7), recipe, seed=range(9)))


@every_recipe
def test_memory_budget_does_not_matter(make_exemplar, recipe, monkeypatch):
    exemplar = make_exemplar(1)
    free = ts.synthesize(exemplar, (12, 17), recipe, seed=[3, 4])
    monkeypatch.setattr("torchsynth.search.exhaustive.MEMORY_BUDGET", 4000)
    monkeypatch.setattr("torchsynth.search.coherence.MEMORY_BUDGET", 4000)
    monkeypatch.setattr("torchsynth.search.tsvq.MEMORY_BUDGET", 4000)
    monkeypatch.setattr("torchsynth.visits.GROUP", 5)
    monkeypatch.setattr("torchsynth.search.exhaustive._ONE_BLOCK", 16)
    monkeypatch.setattr("torchsynth.search.exhaustive._BLOCK", 7)
    monkeypatch.setattr("torchsynth.index.CHUNK", 3000)
    monkeypatch.setattr("torchsynth.patches.matching.MEMORY_BUDGET", 1)
    assert _same(free, ts.synthesize(exemplar, (12, 17), recipe, seed=[3, 4]))


@every_recipe
def test_float64_and_layout_do_not_matter(make_exemplar, recipe):
    exemplar = make_exemplar(3)
    plain = ts.synthesize(exemplar, (10, 10), recipe, seed=2)
    double = ts.synthesize(exemplar.double(), (10, 10), recipe, seed=2)
    strided = exemplar.permute(2, 1, 0).contiguous().permute(2, 1, 0)
    assert double.image.dtype == torch.float64
    assert double.source.equal(plain.source)
    assert not strided.is_contiguous()
    assert _same(plain, ts.synthesize(strided, (10, 10), recipe, seed=2))


@every_recipe
def test_the_global_generator_is_left_alone(make_exemplar, recipe):
    state = torch.random.get_rng_state()
    first = ts.synthesize(make_exemplar(1), (8, 8), recipe, seed=2)
    assert torch.random.get_rng_state().equal(state)
    torch.manual_seed(12345)
    assert _same(first, ts.synthesize(make_exemplar(1), (8, 8), recipe, seed=2))


@every_recipe
def test_exact_in_double_precision(make_exemplar, recipe, monkeypatch):
    """float32 is used only where it is exact: matching in float64 changes nothing."""
    exemplar = make_exemplar(3)
    narrow = ts.synthesize(exemplar, (11, 9), recipe, seed=6)
    monkeypatch.setattr("torchsynth.feasibility._EXACT_FLOAT32", 0)
    wide = ts.synthesize(exemplar, (11, 9), recipe, seed=6)
    assert narrow.source.equal(wide.source)
    assert wide.cost.dtype == torch.float64


@settings(max_examples=40)
@given(
    exemplar=st.tuples(st.integers(10, 17), st.integers(10, 17)),
    size=st.tuples(st.integers(1, 19), st.integers(1, 19)),
    channels=st.integers(1, 5),
    name=st.sampled_from(sorted(set(RECIPES) - {"quilting torus"})),  # which wants room for a block
)
def test_any_size_works(exemplar, size, channels, name):
    generator = torch.Generator().manual_seed(channels)
    picture = torch.rand(channels, *exemplar, generator=generator)
    result = ts.synthesize(picture, size, RECIPES[name], seed=1)
    assert result.image.shape == (1, channels, *size)
    assert result.transfer(picture).equal(result.image)
    assert result.cost.min() >= 0
    assert result.cost.max() <= 1


def test_a_constant_exemplar_stays_constant():
    exemplar = torch.full((3, 12, 12), 0.25)
    result = ts.synthesize(exemplar, (9, 9), ts.recipes.wei_levoy(levels=2, neighborhood=5, parent=3))
    assert (result.image == 0.25).all()
    assert (result.cost == 0).all()


def test_a_constant_added_changes_no_source(make_exemplar):
    """In whole steps, and without reaching the ends of the range."""
    recipe = ts.recipes.wei_levoy_single(neighborhood=5)
    dark = (make_exemplar(1) * 255 * 0.7).round() / 255
    bright = (dark * 255 + 40).round() / 255
    one = ts.synthesize(dark, (14, 12), recipe, seed=4)
    other = ts.synthesize(bright, (14, 12), recipe, seed=4)
    assert one.source.equal(other.source)


def test_permuting_channels_changes_no_cost(make_exemplar):
    exemplar = make_exemplar(3)
    recipe = ts.recipes.wei_levoy_single(neighborhood=5)
    initial = make_exemplar(3, 14, 12, seed=8)
    one = ts.synthesize(exemplar, (14, 12), recipe, controls=ts.Controls(initial))
    flipped = ts.synthesize(exemplar.flip(0), (14, 12), recipe, controls=ts.Controls(initial.flip(0)))
    assert one.source.equal(flipped.source)
    assert one.image.equal(flipped.image.flip(1))
