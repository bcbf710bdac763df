"""Bad arguments from Python: each is refused before any work, in one sentence that says what to do."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
import torch

import torchsynth as ts
from torchsynth import checks, memory
from torchsynth.recipes import wei_levoy, wei_levoy_single

TINY = wei_levoy_single(neighborhood=3)
NAN, INFINITE, HIGH, LOW = (torch.full((1, 8, 8), value) for value in (float("nan"), float("inf"), 1.5, -0.1))

IMAGES = {
    "an array": (np.zeros((1, 8, 8), np.float32), "must be a torch.Tensor, but it is a ndarray; read files with"),
    "a path": ("brick.png", "must be a torch.Tensor, but it is a str; read files with torchsynth.read_image"),
    "nothing": (None, "must be a torch.Tensor, but it is a NoneType"),
    "bytes": (torch.zeros(1, 8, 8, dtype=torch.uint8),
              "must be float32 or float64 in [0, 1], but its dtype is uint8; convert it first, e.g. image.float()"),
    "half": (torch.zeros(1, 8, 8).half(), "must be float32 or float64 in [0, 1], but its dtype is float16"),
    "complex": (torch.zeros(1, 8, 8, dtype=torch.complex64), "its dtype is complex64"),
    "a plane": (torch.zeros(8, 8), "must have shape (C, H, W) or (B, C, H, W), but its shape is (8, 8)"),
    "five dimensions": (torch.zeros(1, 1, 1, 8, 8), "but its shape is (1, 1, 1, 8, 8)"),
    "no pixel": (torch.zeros(1, 0, 8), "must have at least one pixel, but its shape is (1, 0, 8)"),
    "no channel": (torch.zeros(0, 8, 8), "must have at least one pixel, but its shape is (0, 8, 8)"),
    "NaN": (NAN, "must be finite, but 64 of its values are NaN or infinite; replace them"),
    "infinite": (INFINITE, "must be finite, but 64 of its values are NaN or infinite"),
    "too high": (HIGH, "values must lie in [0, 1], but they reach from 1.5 to 1.5; rescale them"),
    "too low": (LOW, "values must lie in [0, 1], but they reach from -0.1 to -0.1"),
}  # fmt: skip


@pytest.mark.parametrize("case", IMAGES)
def test_bad_images_are_told(case):
    image, message = IMAGES[case]
    with pytest.raises(ts.InputError, match=f"^image: .*{re.escape(message)}") as caught:
        checks.check_image(image, "image")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("case", ["NaN", "too high", "bytes", "a plane"])
def test_bad_images_are_refused_wherever_they_come_in(tmp_path, case):
    image, message = IMAGES[case]
    with pytest.raises(ts.InputError, match=f"^exemplar: {re.escape(message)}"):
        ts.synthesize(image, (8, 8), TINY)
    with pytest.raises(ts.InputError, match=f"^initial: {re.escape(message)}"):
        ts.Controls(initial=image)
    with pytest.raises(ts.InputError, match=f"^image: {re.escape(message)}"):
        ts.write_image(image, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("region", "message"),
    [
        (torch.ones(8, 8), "valid: must be a boolean tensor, but it is float32; compare it"),
        (np.ones((8, 8), bool), "valid: must be a boolean tensor, but it is ndarray"),
        (torch.ones(8, 7, dtype=torch.bool), "valid: must have the image's shape (8, 8), but its shape is (8, 7)"),
        (torch.zeros(8, 8, dtype=torch.bool), "valid: must be True somewhere, but it is False everywhere"),
    ],
)  # fmt: skip
def test_bad_regions_are_told(region, message):
    with pytest.raises(ts.InputError, match=re.escape(message)):
        checks.check_region(region, (8, 8), "valid")


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((0, 5), "size: height and width must be at least 1 pixel, but they are 0x5; ask for at least 1x1"),
        ((5, -1), "but they are 5x-1"),
        ((5,), "size: must be two whole numbers, height and width, but it is (5,); pass e.g."),
        (5, "but it is 5;"),
        ("64x64", "but it is '64x64';"),
        ((5.0, 5), "but it is (5.0, 5);"),
        ((True, 5), "but it is (True, 5);"),
        (None, "but it is None;"),
    ],
)
def test_bad_sizes_are_told(size, message):
    with pytest.raises(ts.InputError, match=re.escape(message)):
        checks.check_size(size)


@pytest.mark.parametrize("size", [(10**6, 10**6), (1, 10**15), (10**400, 10**400)])
def test_an_absurd_size_is_told_what_it_would_take(size, make_exemplar):
    with pytest.raises(
        ts.InputError,
        match=r"^size: must fit the [\d,.]+ GiB of memory of this machine, but 1 output\(s\) of "
        r"\d+x\d+ would take about (more than )?[\w,. ]+ GiB; ask for a smaller size",
    ):
        ts.synthesize(make_exemplar(), size, TINY)


@pytest.mark.parametrize(
    ("seed", "outputs", "message"),
    [
        (-1, None, "seed: must be a whole number from 0 to 2**32 - 1, or a list of such numbers, but it is -1;"),
        (2**32, None, "but it is 4294967296;"),
        (1.5, 2, "but it is 1.5;"),
        (True, None, "but it is True;"),
        ("1", None, "but it is '1';"),
        ([0, -3], None, "but one is -3;"),
        ([1, True], None, "but one is True;"),
        (2**32 - 1, 2, "but one is 4294967296;"),
        ([], None, "seed: must name at least one output, but the list is empty; pass a number"),
        ([1, 2], 3, "seed: a batch of 3 exemplars needs 3 seeds, but there are 2; pass one seed"),
    ],
)  # fmt: skip
def test_bad_seeds_are_told(seed, outputs, message):
    with pytest.raises(ts.InputError, match=re.escape(message)):
        checks.check_seeds(seed, outputs)


def test_seeds_are_spread_over_a_batch():
    assert checks.check_seeds(5, 3) == [5, 6, 7]
    assert checks.check_seeds((3, 1), 2) == [3, 1]
    assert checks.check_seeds(range(2), None) == [0, 1]


@pytest.mark.parametrize(
    ("side", "recipe", "message"),
    [
        (4, wei_levoy_single(neighborhood=9), "the 9x9 result neighborhood must fit inside level 0, but that level "
         "is only 4x4; use a smaller neighborhood or a larger exemplar"),
        (16, wei_levoy(levels=3, neighborhood=5, parent=3), "the 5x5 result neighborhood must fit inside level 2, "
         "but that level is only 4x4; use levels <= 2, a smaller neighborhood or a larger exemplar"),
        (16, wei_levoy(levels=16, neighborhood=3, parent=1), "levels <= "),
    ],
)  # fmt: skip
def test_an_exemplar_that_is_too_small_is_told(make_exemplar, side, recipe, message):
    with pytest.raises(ts.InputError, match=f"^exemplar: .*{re.escape(message)}"):
        ts.synthesize(make_exemplar(height=side, width=side), (8, 8), recipe)


def test_a_region_that_is_too_small_is_told(make_exemplar):
    valid = torch.zeros(16, 16, dtype=torch.bool)
    valid[3:6, 3:6] = True
    with pytest.raises(
        ts.InputError, match=r"^what may be sampled: must hold at least one whole neighborhood at level 0"
    ):
        ts.synthesize(ts.Exemplar(make_exemplar(), valid), (8, 8), wei_levoy_single(neighborhood=5))


def test_outputs_are_made_together_as_far_as_memory_goes(monkeypatch, make_exemplar):
    samples = ts.Exemplar(make_exemplar())
    three = memory.memory_needed(TINY, samples, (500, 500), 3)
    monkeypatch.setattr(memory, "_machine_memory", lambda: three)
    assert memory.outputs_that_fit(TINY, samples, (500, 500), 8) == 3
    assert memory.outputs_that_fit(TINY, samples, (500, 500), 2) == 2
    assert memory.outputs_that_fit(TINY, samples, (5000, 5000), 8) == 1


def test_memory_is_assumed_where_the_system_does_not_say(monkeypatch):
    monkeypatch.delattr("os.sysconf")
    assert memory._machine_memory() == 16 * 2**30


@pytest.mark.parametrize(
    ("picture", "options", "message"),
    [
        (torch.zeros(2, 1, 4, 4), {}, "image: must be one picture (C, H, W), but its shape is (2, 1, 4, 4)"),
        (torch.zeros(1, 4, 4), {"depth": "12-bit"}, "depth: must be one of 1-bit, 8-bit, 16-bit, float, but it is"),
        (torch.zeros(5, 4, 4), {}, "a .png file holds 1, 2, 3 or 4 channels, but the picture has 5; write .tif"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_is_told(tmp_path, picture, options, message):
    with pytest.raises(ts.InputError, match=re.escape(message)):
        # Unwrapped: the type checks of the test run would speak first.
        inspect.unwrap(ts.write_image)(picture, tmp_path / "a.png", **options)
    assert list(Path(tmp_path).iterdir()) == []
