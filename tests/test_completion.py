"""Filling, extending and tiling: what stays, what is refused, and that they are what they say."""

from __future__ import annotations

import pytest
import torch

import torchsynth as ts
from torchsynth import metrics, samples
from torchsynth.checks import check_place
from torchsynth.completion import plan_filling, plan_tiling

FILLING = {
    "default": None,
    "coherent_fill": ts.recipes.coherent_fill(levels=2, neighborhood=3),
    "efros_leung": ts.recipes.efros_leung(window=5),
    "separate": ts.recipes.efros_leung(window=3, channels="separate"),
    "wei_levoy_fill": ts.recipes.wei_levoy_fill(levels=2, neighborhood=3, parent=3),
    "wei_levoy_fill tsvq": ts.recipes.wei_levoy_fill(levels=2, neighborhood=3, parent=3, search="tsvq"),
    "wei_levoy": ts.recipes.wei_levoy(levels=2, neighborhood=3, parent=3),
    "random_order": ts.recipes.random_order(levels=2, neighborhood=3, parent=3),
    "ashikhmin": ts.recipes.ashikhmin(neighborhood=3, tileable=False),
}


def _hole(height, width):
    """A hole in three pieces: one inside, one of a single pixel, one at a corner."""
    hole = torch.zeros(height, width, dtype=torch.bool)
    hole[7:12, 8:13] = True
    hole[4, 20] = True
    hole[-3:, -2:] = True
    return hole


@pytest.mark.parametrize("recipe", FILLING.values(), ids=FILLING)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_what_is_known_stays_and_the_hole_does_not_matter(make_exemplar, recipe, dtype):
    image = make_exemplar(2, 24, 25, seed=2, dtype=dtype) * 0.999
    hole = _hole(24, 25)
    before = torch.get_rng_state()
    results = [
        ts.fill(image.masked_fill(hole, color), hole, recipe=recipe, seed=4) for color in (0.0, 0.3, 1.0)
    ]
    assert torch.get_rng_state().equal(before)
    for result in results:
        assert result.image.dtype == dtype
        assert result.image[0][:, ~hole].equal(image[:, ~hole])
        assert result.image.equal(results[0].image)
        assert result.source.equal(results[0].source)
    if recipe is None or recipe.channels == "joint":
        # All is copied from what is known; what was known, from where it is.
        assert results[0].transfer(image).equal(results[0].image)
        assert not results[0].transfer(hole[None]).any()
        rows, columns = torch.meshgrid(torch.arange(24), torch.arange(25), indexing="ij")
        assert results[0].source[0][:, ~hole].equal(torch.stack((rows, columns))[:, ~hole])


@pytest.mark.parametrize("recipe", FILLING.values(), ids=FILLING)
def test_a_batch_with_different_holes_equals_its_singles(make_exemplar, recipe):
    images = torch.stack([make_exemplar(2, 24, 25, seed=seed) for seed in (1, 2)])
    holes = torch.stack([_hole(24, 25), _hole(24, 25).flip(0)])
    together = ts.fill(images, holes, recipe=recipe, seed=[5, 9])
    for number, seed in enumerate((5, 9)):
        alone = ts.fill(images[number], holes[number], recipe=recipe, seed=seed)
        assert together.image[number].equal(alone.image[0])
    assert together.seeds == (5, 9)


def test_exemplars_of_their_own_may_refuse_different_pixels(make_exemplar):
    exemplars = torch.stack([make_exemplar(1, 9, 9, seed=seed) for seed in (1, 2)])
    recipe = ts.recipes.efros_leung(window=3, max_error=0.003, growth=1.5)
    together = ts.synthesize(exemplars, (8, 8), recipe, seed=3)
    for number in range(2):
        alone = ts.synthesize(exemplars[number], (8, 8), recipe, seed=3 + number)
        assert together.source[number].equal(alone.source[0])


def test_a_hole_from_one_pixel_to_half_the_picture(make_exemplar):
    image = make_exemplar(1, 32, 32, seed=3)
    hole = torch.zeros(32, 32, dtype=torch.bool)
    hole[10, 11] = True
    assert ts.fill(image, hole).image[0][:, ~hole].equal(image[:, ~hole])
    hole[:, 16:] = True
    assert ts.fill(image, hole).image[0][:, ~hole].equal(image[:, ~hole])


def test_another_exemplar_and_a_region_of_it(make_exemplar):
    image, other = make_exemplar(1, 20, 20, seed=1) / 2, make_exemplar(1, 24, 24, seed=2) / 2 + 0.5
    hole = torch.zeros(20, 20, dtype=torch.bool)
    hole[5:12, 6:13] = True
    valid = torch.zeros(24, 24, dtype=torch.bool)
    valid[:14, :14] = True
    for recipe in (ts.recipes.efros_leung(window=3), None):
        result = ts.fill(image, hole, recipe=recipe, exemplar=other, valid=valid)
        source = result.source[0][:, hole]
        assert source.min() >= 0
        assert source.max() < 14
        assert result.image[0][:, hole].equal(other[:, source[0], source[1]])
        assert (result.source[0][:, ~hole] == -1).all()
        with pytest.raises(ts.InputError, match="transfer: needs a source for every pixel"):
            result.transfer(other)
        assert not result.seams()[0][
            ~torch.nn.functional.max_pool2d(hole[None].float(), 3, 1, 1)[0].bool()
        ].any()


def test_within_samples_only_around_the_hole(make_exemplar):
    image = make_exemplar(1, 32, 32, seed=3)
    hole = torch.zeros(32, 32, dtype=torch.bool)
    hole[14:17, 15:18] = True
    valid = plan_filling(image, hole, within=6).exemplar.valid
    assert valid[8:23, 9:24].sum() == valid.sum() == 15 * 15 - 9
    source = ts.fill(image, hole, recipe=ts.recipes.efros_leung(window=5), within=6).source[0][:, hole]
    assert 8 + 2 <= source[0].min() <= source[0].max() < 23 - 2


def test_texture_of_the_picture_itself_is_restored():
    """A periodic picture has only one sensible way to fill a hole."""
    rows, columns = torch.meshgrid(torch.arange(40), torch.arange(40), indexing="ij")
    image = (((rows // 2) % 3) * 40 + ((columns + rows) % 5) * 20)[None].float() / 255
    hole = torch.zeros(40, 40, dtype=torch.bool)
    hole[15:25, 14:26] = True
    for recipe in (ts.recipes.efros_leung(window=9), ts.recipes.wei_levoy_fill(levels=1, neighborhood=9)):
        assert ts.fill(image, hole, recipe=recipe).image[0].equal(image)


@pytest.mark.parametrize("at", [None, (0, 0), (3, 7)])
def test_extending_keeps_the_picture(make_exemplar, at):
    image = make_exemplar(3, 20, 21, seed=1)
    result = ts.extend(image, (23, 28), at=at, recipe=ts.recipes.coherent_fill(levels=1))
    top, left = (1, 3) if at is None else at
    assert result.image[0, :, top : top + 20, left : left + 21].equal(image)
    assert result.transfer(image).equal(result.image)
    batch = ts.extend(torch.stack((image, image)), (23, 28), at=at, recipe=ts.recipes.coherent_fill(levels=1))
    assert batch.image[0].equal(result.image[0])
    assert batch.seeds == (0, 1)


def test_tiling_changes_only_the_strip_and_mends_the_seam():
    image = ts.read_image(f"{samples.PREFIX}gravel")[:, :96, :96]
    before = metrics.seam_ratio(image[None])
    result = ts.tile(image, width=16)
    assert result.image[0, :, 8:-8, 8:-8].equal(image[:, 8:-8, 8:-8])
    assert not result.image[0].equal(image)
    after = metrics.seam_ratio(result.image)
    assert (before > 1.15).any()
    assert (after < 1.15).all()


def test_tiling_and_filling_together(make_exemplar):
    image = make_exemplar(1, 33, 30, seed=5)
    hole = torch.zeros(33, 30, dtype=torch.bool)
    hole[12:17, 13:16] = True
    plan = plan_tiling(image, 5, hole)
    assert plan.controls.hole[2].all()
    assert not plan.controls.hole[3, 3:-3].any()
    results = [ts.tile(image.masked_fill(hole, color), width=5, hole=hole) for color in (0.0, 1.0)]
    assert results[0].image.equal(results[1].image)
    kept = ~plan.controls.hole
    assert results[0].image[0][:, kept].equal(image[:, kept])


def test_the_edge_of_a_filled_hole_is_no_sharper_than_the_picture():
    image = ts.read_image(f"{samples.PREFIX}gravel")
    hole = torch.zeros(image.shape[1:], dtype=torch.bool)
    hole[40:72, 44:76] = True
    cut = image.masked_fill(hole, 0)
    assert metrics.edge_ratio(cut, hole) > 2
    # The texture's own edges between stones come out at up to 1.3, where they follow the hole's.
    for recipe in (None, ts.recipes.efros_leung(window=7), ts.recipes.coherent_fill(levels=1)):
        ratios = metrics.edge_ratio(ts.fill(image, hole, recipe=recipe, seed=[0, 1, 2]).image, hole)
        assert ratios.mean() < 1.5


def test_progress_and_cancelling(make_exemplar):
    image = make_exemplar(3, 20, 20, seed=1)
    told = []

    def stop(_level, _sweep, done, total, _preview):
        told.append((done, total))
        if done > total / 2:
            raise KeyboardInterrupt

    hole = _hole(20, 24)[:, :20]
    for recipe in (ts.recipes.efros_leung(window=3), ts.recipes.efros_leung(window=3, channels="separate")):
        with pytest.raises(KeyboardInterrupt):
            ts.fill(image, hole, recipe=recipe, progress=stop)
        told.clear()
        ts.fill(image, hole, recipe=recipe, progress=lambda *one: told.append(one[2:4]))
        assert told[-1][0] == told[-1][1]
        assert [one[0] for one in told] == sorted(one[0] for one in told)
        told.clear()


def test_the_usual_recipe_has_as_many_levels_as_fit(make_exemplar):
    def levels(side, hole_side):
        hole = torch.zeros(side, side, dtype=torch.bool)
        hole[1 : 1 + hole_side, 1 : 1 + hole_side] = True
        return plan_filling(make_exemplar(1, side, side), hole).fitting(None).levels

    assert levels(96, 20) == 3
    assert levels(32, 9) == 2
    assert levels(12, 4) == 1


IMAGE = torch.rand(1, 16, 16)
SOME = torch.zeros(16, 16, dtype=torch.bool)
SOME[6:9, 6:9] = True


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ts.fill(IMAGE, SOME & False), "hole: must mark something, but it marks nothing"),
        (lambda: ts.fill(IMAGE, SOME | True), "hole: must leave something of the picture, but it covers all"),
        (lambda: ts.fill(IMAGE, SOME[:8]), r"hole: must have the image's shape \(16, 16\), but its shape is"),
        (lambda: ts.fill(IMAGE, SOME.float()), "hole: must be a boolean tensor, but it is float32"),
        (
            lambda: ts.fill(IMAGE, SOME, recipe=ts.recipes.efros_leung(window=17)),
            "exemplar: .* 17x17",
        ),
        (
            lambda: ts.fill(IMAGE, SOME, recipe=ts.recipes.efros_leung(window=9)),
            "what may be sampled: must hold at least one whole neighborhood at level 0",
        ),
        (lambda: ts.fill(IMAGE, SOME, valid=SOME), "hole: must leave something to sample from"),
        (lambda: ts.fill(IMAGE, SOME, within=0), "within: must be a whole number of pixels, 1 or more"),
        (
            lambda: ts.fill(IMAGE, SOME, exemplar=torch.rand(3, 16, 16)),
            r"exemplar: must have the picture's 1 ch",
        ),
        (
            lambda: ts.fill(IMAGE, SOME, exemplar=IMAGE, within=2),
            "within: counts pixels around the hole, in the picture itself",
        ),
        (
            lambda: ts.fill(torch.rand(2, 1, 16, 16), torch.stack((SOME, SOME, SOME))),
            "hole: must be one for all, or one for each of the 2 pictures, but there are 3",
        ),
        (
            lambda: ts.fill(IMAGE, SOME, recipe=ts.recipes.wei_levoy_fill(levels=5)),
            "hole: must leave something known at each of the 5 levels, but of level 2 nothing is; use 2 levels or fewer",
        ),
        (
            lambda: ts.fill(IMAGE, SOME, recipe=ts.recipes.ashikhmin()),
            "ashikhmin: must work with the boundary 'open' to complete this picture",
        ),
        (
            lambda: ts.extend(IMAGE, (16, 16)),
            "size: must be larger than the picture's, 16x16, but it is 16x16",
        ),
        (
            lambda: ts.extend(IMAGE, (12, 20)),
            "size: must be larger than the picture's, 16x16, but it is 12x20",
        ),
        (lambda: ts.extend(IMAGE, (20, 20), at=(5, 0)), r"at: must leave the picture inside: from \(0, 0\)"),
        (lambda: ts.tile(IMAGE, width=16), "width: must be less than the picture's shorter side, 16"),
        (lambda: ts.tile(IMAGE, width=0), "width: must be a whole number of pixels, 1 or more"),
        (lambda: ts.Controls(hole=SOME), "hole: must come with the picture it is in"),
        (lambda: ts.Controls(initial=IMAGE, exemplar_at=(0, 0)), "exemplar_at: says where the exemplar lies"),
        (
            lambda: ts.synthesize(IMAGE, (16, 16), ts.recipes.coherent_fill()),
            "hole: must be given to the recipe 'coherent_fill', which grows from what is known",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ts.TorchsynthError, match=message):
        call()


def test_refusing_needs_an_order_that_comes_back():
    layers = (ts.Layer(plane="result", template=ts.Causal(size=3)),)
    with pytest.raises(ValueError, match="only the order 'onion_peel' comes back"):
        ts.Sweep(layers=layers, accept=ts.WithinTolerance())
    assert ts.Sweep(layers=layers, accept=ts.WithinTolerance(max_error=None)).order.kind == "scanline"


def test_separate_channels_are_pictures_of_their_own(make_exemplar):
    exemplar = make_exemplar(3, 12, 12, seed=1)
    apart = ts.recipes.efros_leung(window=3, channels="separate")
    result = ts.synthesize(exemplar, (9, 8), apart, seed=[4, 5])
    for channel in range(3):
        alone = ts.synthesize(exemplar[channel : channel + 1], (9, 8), apart, seed=[4, 5])
        assert result.image[:, channel].equal(alone.image[:, 0])
    assert (result.source == -1).all()
    assert result.recipe == apart
    with pytest.raises(ts.InputError, match="copies each channel from somewhere else"):
        result.transfer(exemplar)
    with pytest.raises(ValueError, match="seams are those of all channels together"):
        apart.changed(blur_seams=3)


@pytest.mark.parametrize("trial", range(6))
def test_outputs_part_company_in_the_middle_of_a_layer(trial):
    """Few colors and a strict error: outputs refuse the same pixel first, and others in the same layer."""
    generator = torch.Generator().manual_seed(trial)
    image = torch.randint(0, 3, (1, 11, 12), generator=generator) / 2
    hole = torch.zeros(11, 12, dtype=torch.bool)
    hole[2:8, 3:9] = True
    recipe = ts.recipes.efros_leung(window=3, max_error=0.02, growth=1.6, epsilon=0.4)
    told = []
    together = ts.fill(
        image, hole, recipe=recipe, seed=[0, 1, 2], progress=lambda *one: told.append(one[2:4])
    )
    for seed in range(3):
        alone = ts.fill(image, hole, recipe=recipe, seed=seed)
        assert together.image[seed].equal(alone.image[0])
        assert together.source[seed].equal(alone.source[0])
        assert together.cost[seed].equal(alone.cost[0])
    assert told[-1] == (36, 36)


def test_pictures_of_a_batch_may_have_different_usual_levels(make_exemplar):
    images = torch.stack([make_exemplar(1, 40, 40, seed=seed) for seed in (1, 2)])
    holes = torch.zeros(2, 40, 40, dtype=torch.bool)
    holes[0, 10:13, 10:13] = True
    holes[1, 14:] = True
    result = ts.fill(images, holes, seed=[3, 4])
    assert len(result.levels) == 1
    for number, seed in enumerate((3, 4)):
        assert ts.fill(images[number], holes[number], seed=seed).image[0].equal(result.image[number])


def test_tiling_takes_a_hole_for_each_picture(make_exemplar):
    images = torch.stack([make_exemplar(1, 24, 24, seed=seed) for seed in (1, 2)])
    holes = torch.zeros(2, 24, 24, dtype=torch.bool)
    holes[0, 8:10, 8:10] = True
    holes[1, 12:15, 12:15] = True
    result = ts.tile(images, width=4, hole=holes, seed=[3, 4])
    for number, seed in enumerate((3, 4)):
        alone = ts.tile(images[number], width=4, hole=holes[number], seed=seed)
        assert alone.image[0].equal(result.image[number])


def test_progress_is_told_often(make_exemplar, monkeypatch):
    monkeypatch.setattr("torchsynth.visits._TOLD", 20)
    told = []
    recipe = ts.recipes.wei_levoy(levels=1, neighborhood=3)
    ts.synthesize(make_exemplar(1, 12, 12), (20, 20), recipe, progress=lambda *one: told.append(one[2]))
    assert len(told) > 15


def test_extremes(make_exemplar):
    image = make_exemplar(1, 64, 64, seed=1)
    hole = torch.zeros(64, 64, dtype=torch.bool)
    hole[30:33, 30:33] = True
    anything = ts.recipes.efros_leung(epsilon=1e33, window=5)
    assert ts.fill(image, hole, recipe=anything).source.min() >= 0
    everywhere = ts.fill(image, hole, within=10**12, seed=2)
    assert everywhere.image.equal(ts.fill(image, hole, seed=2).image)
    assert ts.extend(image, (75, 64)).image[0, :, 4:68].equal(image)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ts.extend(IMAGE, (10**6, 10**6)), "size: must fit the .* of memory of this machine"),
        (lambda: check_place((1.5, 2), "at"), "at: must be a row and a column, two whole numbers"),
        (lambda: check_place("ab", "at"), "at: must be a row and a column, two whole numbers"),
        (lambda: ts.fill(IMAGE, SOME, exemplar=IMAGE[None]), "exemplar: must be one picture"),
    ],
)
def test_what_is_refused_at_once(call, message):
    with pytest.raises(ts.InputError, match=message):
        call()
