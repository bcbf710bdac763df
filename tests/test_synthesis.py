"""The entry point: controls, valid regions, seeds, progress, results, and input that cannot be used."""

from __future__ import annotations

import hashlib
import inspect

import numpy as np
import pytest
import torch

import torchsynth as ts
from torchsynth.pyramid import gaussian_pyramid, level_shapes, match_histogram
from torchsynth.result import transfer

SMALL = ts.recipes.wei_levoy(levels=2, neighborhood=5, parent=3)
SINGLE = ts.recipes.wei_levoy_single(neighborhood=5)


def test_the_same_bytes_everywhere():
    """A golden digest: another machine, thread count or torch must not change it.

    If it fails after a deliberate change of an algorithm, say so in the CHANGELOG and put the new one.
    """
    exemplar = ts.read_image("sample:pebbles")[:, :40, :40]
    result = ts.synthesize(
        exemplar, (37, 50), ts.recipes.wei_levoy(levels=3, parent=3, neighborhood=7), seed=2
    )
    digest = hashlib.sha256(result.source.numpy().astype("<i8").tobytes()).hexdigest()
    assert digest == "26ee4dc41481cc597886a2b634b2d58dfafbd00fb1869a7c81d727a8e4541fef"


def test_pixels_outside_the_valid_region_never_matter(make_exemplar):
    exemplar = make_exemplar(1, 32, 32)
    valid = torch.zeros(32, 32, dtype=torch.bool)
    valid[2:26, 5:31] = True
    results = []
    for color in (0.0, 1.0):
        painted = torch.where(valid, exemplar, color)
        # The noise takes the exemplar's histogram, which the paint is part of: so it is given here.
        noise = ts.Controls(make_exemplar(1, 20, 20, seed=5))
        results.append(ts.synthesize(ts.Exemplar(painted, valid), (20, 20), SMALL, controls=noise))
    assert results[0].source.equal(results[1].source)
    rows, columns = results[0].source[0]
    assert valid[rows, columns].all()


def test_initial_pictures_replace_the_noise(make_exemplar):
    exemplar, initial = make_exemplar(1), make_exemplar(1, 12, 12, seed=4)
    one = ts.synthesize(exemplar, (12, 12), SINGLE, controls=ts.Controls(initial), seed=1)
    other = ts.synthesize(exemplar, (12, 12), SINGLE, controls=ts.Controls(initial), seed=2)
    assert one.image.equal(other.image)
    assert one.levels[0].start[0].equal(initial)
    assert not one.image.equal(ts.synthesize(exemplar, (12, 12), SINGLE, seed=1).image)


def test_an_exemplar_as_its_own_start_is_found_again(make_exemplar):
    """All neighborhoods a scanline reads exist in the exemplar once its rows go on as it does."""
    exemplar = make_exemplar(1, 24, 24)
    result = ts.synthesize(exemplar, (24, 24), SMALL, controls=ts.Controls(exemplar))
    assert result.cost.mean() < 0.02


def test_levels_are_the_finest_first(make_exemplar):
    result = ts.synthesize(
        make_exemplar(1, 30, 30), (21, 26), ts.recipes.wei_levoy(levels=3, neighborhood=3, parent=3)
    )
    assert [tuple(level.image.shape[-2:]) for level in result.levels] == [(21, 26), (10, 13), (5, 6)]
    assert result.image.equal(result.levels[0].image)
    assert result.seeds == (0,)


def test_noise_has_the_exemplar_s_histogram_at_every_level(make_exemplar):
    exemplar = make_exemplar(3, 32, 32)
    result = ts.synthesize(exemplar, (32, 32), SMALL)
    for level in result.levels:
        start = level.start[0].flatten(1).sort().values
        sample = level.exemplar[0].flatten(1).sort().values
        assert (start - sample).abs().max() < 0.06


def test_progress_counts_every_pixel_of_every_sweep(make_exemplar):
    calls = []

    def progress(level, sweep, done, total, preview):
        calls.append((level, sweep, done, total, tuple(preview().shape)))

    ts.synthesize(make_exemplar(1), (14, 10), SMALL, seed=[1, 2], progress=progress)
    assert calls[0] == (1, 0, 0, 35 + 140, (2, 1, 7, 5))
    assert calls[-1] == (0, 0, 175, 175, (2, 1, 14, 10))
    assert [call[2] for call in calls] == sorted(call[2] for call in calls)


def test_an_exception_in_progress_cancels_and_nothing_stays_behind(make_exemplar):
    class StoppedError(Exception):
        pass

    def progress(level, sweep, done, total, preview):  # noqa: ARG001 (the callback's signature)
        if done:
            raise StoppedError

    with pytest.raises(StoppedError):
        ts.synthesize(make_exemplar(1), (14, 10), SMALL, progress=progress)
    first = ts.synthesize(make_exemplar(1), (14, 10), SMALL)
    assert first.image.equal(ts.synthesize(make_exemplar(1), (14, 10), SMALL).image)


def test_transfer_carries_other_maps(make_exemplar):
    exemplar = make_exemplar(1, 16, 20)
    result = ts.synthesize(exemplar, (9, 9), SINGLE, seed=[1, 2])
    labels = torch.arange(320, dtype=torch.int32).view(1, 16, 20)
    moved = result.transfer(labels)
    rows, columns = result.source.unbind(1)
    assert moved.dtype == torch.int32
    assert moved[:, 0].equal((rows * 20 + columns).int())
    each = torch.stack([labels, labels + 1000])
    assert result.transfer(each)[1].equal(moved[1] + 1000)
    with pytest.raises(ts.InputError, match=r"map of the exemplar's size \(16, 20\)"):
        result.transfer(labels[:, :5])
    with pytest.raises(ts.InputError, match="one map, or 2"):
        result.transfer(labels.expand(3, 1, 16, 20))


def test_gradients_neither_break_nor_leak(make_exemplar):
    exemplar = make_exemplar(1).requires_grad_()
    result = ts.synthesize(exemplar, (6, 6), SINGLE)
    assert not result.image.requires_grad


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"exemplar": torch.rand(1, 7, 7)}, r"exemplar: the 5x5 result neighborhood must fit inside level 1, but that level is only 3x3; use levels <= 1"),
        ({"exemplar": torch.rand(1, 2, 30)}, r"must fit inside level 0.*use a smaller"),
        ({"size": (0, 4)}, "size: height and width must be at least 1 pixel"),
        ({"size": (4, -4)}, "size: height and width must be at least 1 pixel"),
        ({"size": (10**6, 10**6)}, r"size: must fit the .* GiB of memory .* would take about .* GiB"),
        ({"seed": -1}, r"seed: must be a whole number from 0"),
        ({"seed": 2**32}, r"seed: must be a whole number from 0"),
        ({"seed": []}, "seed: must name at least one output"),
        ({"seed": True}, "seed: must be a whole number"),
        ({"exemplar": torch.rand(2, 1, 20, 20), "seed": [1, 2, 3]}, "2 exemplars needs 2 seeds, but there are 3"),
        ({"controls": ts.Controls(torch.rand(1, 5, 5))}, r"initial: must have the output's channels, height and width \(1, 8, 8\)"),
    ],
)  # fmt: skip
def test_unusable_input_says_what_to_change(arguments, message):
    usable = {"exemplar": torch.rand(1, 20, 20), "size": (8, 8), "recipe": SMALL} | arguments
    with pytest.raises(ts.InputError, match=message):
        ts.synthesize(**usable)


def test_a_valid_region_without_a_whole_neighborhood_is_refused():
    valid = torch.zeros(20, 20, dtype=torch.bool)
    valid[::3] = True
    with pytest.raises(ts.InputError, match="what may be sampled: must hold at least one whole neighborhood"):
        ts.synthesize(ts.Exemplar(torch.rand(1, 20, 20), valid), (8, 8), SMALL)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"levels": 0}, "greater than or equal to 1"),
        ({"levels": 3, "sweeps": [(SMALL.sweeps[0], (0, 1))]}, "no sweep runs on level 2"),
        ({"sweeps": [(SMALL.sweeps[0], (0, 1, 2))]}, "names level 2, but with 2 levels the coarsest is 1"),
        ({"sweeps": []}, "a recipe has sweeps or patches, but this one has neither"),
    ],
)
def test_impossible_recipes_are_refused(changes, message):
    if "sweeps" in changes:
        changes["sweeps"] = tuple(
            sweep.model_copy(update={"levels": levels}) for sweep, levels in changes["sweeps"]
        )
    with pytest.raises(ValueError, match=message):
        ts.Recipe(**({"levels": 2, "sweeps": SMALL.sweeps} | changes))


def test_a_coarsest_level_without_a_result_layer_is_refused():
    coarse_only = SMALL.sweeps[0].model_copy(update={"layers": SMALL.sweeps[0].layers[1:]})
    with pytest.raises(ValueError, match="at level 1 all its layers read above the coarsest"):
        ts.Recipe(levels=2, sweeps=(coarse_only,))


def test_recipe_sizes_have_to_agree():
    with pytest.raises(ts.ConfigError, match="neighborhood: must be one size, or 3"):
        ts.recipes.wei_levoy(levels=3, neighborhood=(5, 5))


@pytest.mark.parametrize("side", [1, 2, 3, 4, 5, 9])
@pytest.mark.parametrize("border", ["circular", "reflect"])
def test_pyramids_of_tiny_pictures(side, border):
    levels = gaussian_pyramid(torch.full((2, 1, side, 7), 0.5), 4, border)
    assert [tuple(level.shape[-2:]) for level in levels] == list(level_shapes((side, 7), 4))
    assert all((level == 0.5).all() for level in levels)


def test_histograms_are_matched_per_sample_and_channel():
    image = torch.rand(2, 3, 6, 6)
    reference = torch.rand(1, 3, 6, 6) * torch.tensor([0.1, 0.5, 1.0]).view(1, 3, 1, 1)
    matched = match_histogram(image, reference)
    for sample in matched:
        for plane, like in zip(sample, reference[0], strict=True):
            assert plane.flatten().sort().values.allclose(like.flatten().sort().values)


def test_a_layer_that_would_never_be_read_is_refused():
    far = ts.Layer(plane="coarse", template=ts.Square(size=3), up=2)
    sweep = SMALL.sweeps[0].model_copy(update={"layers": (*SMALL.sweeps[0].layers, far)})
    with pytest.raises(ValueError, match="up=2 reads above the coarsest level, 1"):
        ts.Recipe(levels=2, sweeps=(sweep,))


def test_weights_beyond_exact_arithmetic_are_refused(monkeypatch):
    monkeypatch.setattr("torchsynth.feasibility._EXACT_FLOAT64", 2**19)
    with pytest.raises(ts.ConfigError, match="weights: distances must be exact in float64"):
        ts.synthesize(torch.rand(1, 20, 20), (8, 8), SMALL)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"recipe": "wei_levoy"}, "recipe: must be a Recipe, but it is 'wei_levoy'"),
        ({"controls": {"initial": 1}}, "controls: must be a Controls"),
    ],
)
def test_arguments_of_another_class_are_refused(arguments, message):
    usable = {"exemplar": torch.rand(1, 20, 20), "size": (8, 8), "recipe": SMALL} | arguments
    with pytest.raises(ts.InputError, match=message):
        inspect.unwrap(ts.synthesize)(**usable)


def test_numpy_numbers_are_numbers():
    size, seed = tuple(np.array([9, 7])), np.int64(3)
    plain = ts.synthesize(torch.ones(1, 20, 20), (9, 7), SMALL, seed=3)
    assert inspect.unwrap(ts.synthesize)(torch.ones(1, 20, 20), size, SMALL, seed=seed).seeds == plain.seeds


@pytest.mark.parametrize("dtype", [torch.uint8, torch.uint16, torch.uint32, torch.bool, torch.float16])
def test_transfer_keeps_every_dtype(make_exemplar, dtype):
    exemplar = make_exemplar(1, 12, 12)
    result = ts.synthesize(exemplar, (7, 7), SINGLE)
    moved = result.transfer((exemplar * 255).to(dtype))
    assert moved.dtype == dtype
    assert (moved.double() == (result.image * 255).to(dtype).double()).all()
    with pytest.raises(ts.InputError, match=r"other: must be a torch\.Tensor"):
        inspect.unwrap(transfer)(result.source, exemplar.numpy(), (12, 12))


def test_the_caller_s_precision_does_not_matter(make_exemplar):
    recipe = ts.recipes.wei_levoy_single(neighborhood=5, boundary="open")
    plain = ts.synthesize(make_exemplar(1), (9, 9), recipe)
    before = torch.get_float32_matmul_precision()
    try:
        torch.set_float32_matmul_precision("medium")
        with torch.autocast("cpu", torch.bfloat16):
            coarse = ts.synthesize(make_exemplar(1), (9, 9), recipe)
        assert torch.get_float32_matmul_precision() == "medium"
    finally:
        torch.set_float32_matmul_precision(before)
    assert coarse.source.equal(plain.source)


def test_one_invalid_pixel_reaches_every_level():
    valid = torch.ones(128, 128, dtype=torch.bool)
    valid[50, 77] = False
    for level, region in enumerate(ts.Exemplar(torch.rand(1, 128, 128), valid).valid_regions(4)):
        assert not region[50 >> level, 77 >> level]
        assert region[:2].all()


def test_results_take_part_in_autograd(make_exemplar):
    previews = []
    recipe = ts.recipes.ashikhmin_multires(levels=2, neighborhood=3)
    result = ts.synthesize(
        make_exemplar(1), (8, 8), recipe, progress=lambda *told: previews.append(told[-1]())
    )
    weight = torch.ones(1, requires_grad=True)
    pictures = [
        *previews,
        *(level.image for level in result.levels),
        *(level.start for level in result.levels),
    ]
    for picture in (*pictures, result.cost):
        (picture * weight).sum().backward()
    assert weight.grad is not None
    result.image.add_(1)  # an ordinary tensor
