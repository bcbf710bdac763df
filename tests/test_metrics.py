"""The measures: exact on cases small enough to work out by hand, and right about pictures that were spoiled."""

from __future__ import annotations

import inspect
import json
import math

import pytest
import torch

import torchsynth as ts
from torchsynth import metrics
from torchsynth.metrics.copying import WINDOW
from torchsynth.metrics.statistics import LEVELS, pairs, quantiles
from torchsynth.pyramid import blur
from torchsynth.samples import SAMPLES


def sample(name):
    return ts.read_image(f"sample:{name}")


def source_of(text):
    """A source map from rows of ``row,column`` pairs; ``-`` is no source."""
    cells = [
        [(-1, -1) if cell == "-" else tuple(map(int, cell.split(","))) for cell in line.split()]
        for line in text.strip().splitlines()
    ]
    return torch.tensor(cells).permute(2, 0, 1).unsqueeze(0)


def identity(height, width):
    grid = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    return torch.stack(grid).unsqueeze(0)


def quarters(name):
    """An exemplar and a real crop of a sample that share no pixel."""
    image = sample(name)
    return image[None, :, :64, :64], image[None, :, 64:, 64:]


def shuffled(image):
    order = torch.randperm(image[0, 0].numel(), generator=torch.Generator().manual_seed(3))
    return image.flatten(2)[..., order].view_as(image)


def noise_like(image):
    """The same spectrum, with the phases of white noise."""
    generator = torch.Generator().manual_seed(3)
    white = torch.fft.fft2(torch.randn(image.shape[2:], generator=generator, dtype=torch.float64))
    phases = white / white.abs()
    phases[0, 0] = 1
    return torch.fft.ifft2(torch.fft.fft2(image.double()) * phases).real.clamp(0, 1)


TWO_PATCHES = source_of("""
    5,5 5,6 5,7 0,0 0,1
    6,5 6,6 6,7 1,0 1,1
""")


class TestPatchDistance:
    @pytest.mark.parametrize("name", SAMPLES)
    def test_a_real_crop_is_closer_than_what_was_spoiled(self, name):
        exemplar, real = quarters(name)
        names = list(SAMPLES)
        other = sample(names[names.index(name) - 1])[None, :, :64, :64]
        other = other.mean(1, keepdim=True).expand_as(real)
        spoiled = [blur(real, 5, "reflect"), shuffled(real), noise_like(real), other]
        closest, *rest = metrics.patch_distance(torch.cat([real, *spoiled]), exemplar).tolist()
        assert 0.3 < closest < 1.1
        assert all(closest < 0.95 * one for one in rest)

    def test_it_is_the_literal_sliced_wasserstein_distance(self):
        """All patches as rows, dense directions, sorting; with 32x32 patches, so that quantiles are exact."""
        image, exemplar = torch.rand(1, 2, 38, 38), torch.rand(1, 2, 38, 38) ** 2
        directions = torch.zeros(48, 2 * 49, dtype=torch.float64)
        for row, (one, other) in zip(directions, pairs(2), strict=True):
            row[one], row[other] = 0.5**0.5, -(0.5**0.5)
        assert directions.square().sum(1).allclose(torch.ones(48).double())

        def projected(picture):
            patches = torch.nn.functional.unfold(picture.double(), 7)[0].T
            values = picture.double()[0].flatten(1).T
            return (patches @ directions.T).sort(0).values, values.sort(0).values

        def part(found, place):  # quantiles of as many values as there are in all pictures compared
            return quantiles(found[:, place])

        def distance(one, other):
            means = []
            for ours, theirs, whole in zip(
                projected(one), projected(other), projected(exemplar), strict=True
            ):
                apart = [
                    (part(ours, d) - part(theirs, d)).abs().mean() / part(whole, d).std()
                    for d in range(ours.shape[1])
                ]
                means.append(sum(apart) / len(apart))
            return 0.75 * means[0] + 0.25 * means[1]

        unit = (
            distance(exemplar[:, :, :19], exemplar[:, :, 19:])
            + distance(exemplar[..., :19], exemplar[..., 19:])
        ) / 2
        found = metrics.patch_distances(image, exemplar)
        assert found.shape == (1, 1)
        assert found.item() == pytest.approx((distance(image, exemplar) / unit).item(), rel=1e-5)

    def test_of_a_constant_shift_only_the_values_know(self):
        exemplar = torch.rand(1, 1, 40, 40) * 0.5
        one, two = (metrics.patch_distances(exemplar + shift, exemplar)[0, 0] for shift in (0.125, 0.25))
        assert two / one == pytest.approx(2, rel=1e-5)
        turned = metrics.patch_distances(0.5 - exemplar, exemplar)[0, 0]
        assert 0 < turned < one

    def test_it_is_the_distance_of_sorted_values(self):
        """Without differences in either picture, only the values are left: worked out by sorting."""
        stripes = torch.rand(1, 1, 1, 1).expand(1, 1, 20, 20)
        lighter = (stripes * 0.5).contiguous()
        found = metrics.patch_distances(lighter, stripes.contiguous())[0, 0]
        # Neither the exemplar nor its halves vary: the smallest units are used.
        apart = (stripes - lighter).mean().item()
        assert found.item() == pytest.approx(0.25 * apart / 2.0**-10 / 0.01, rel=1e-4)

    def test_a_picture_is_no_distance_from_itself(self):
        image = torch.rand(2, 3, 30, 37)
        assert metrics.patch_distances(image, image).eq(0).all()
        assert metrics.patch_distance(image[:1], image[1:]).item() > 0.1

    def test_a_batch_is_its_pictures(self):
        images, exemplars = torch.rand(3, 2, 32, 40), torch.rand(3, 2, 36, 33)
        for exemplar in (exemplars, exemplars[:1]):
            together = metrics.patch_distances(images, exemplar)
            alone = [
                metrics.patch_distances(images[item, None], exemplar[item % len(exemplar), None])
                for item in range(3)
            ]
            assert together.equal(torch.cat(alone))

    @pytest.mark.parametrize(
        ("size", "levels"), [((14, 14), 1), ((55, 99), 1), ((56, 60), 2), ((500, 230), 4)]
    )
    def test_there_are_as_many_levels_as_fit(self, size, levels):
        exemplar = torch.rand(1, 1, *size)
        assert metrics.patch_distances(torch.rand(1, 1, 512, 300), exemplar).shape == (1, levels)
        assert metrics.patch_distances(exemplar[..., :7, :9], exemplar).shape == (1, 1)
        assert levels <= LEVELS

    def test_outputs_may_have_another_size(self):
        exemplar, _ = quarters("pebbles")
        whole = sample("pebbles")[None]
        assert metrics.patch_distance(whole, exemplar).item() < 1
        assert metrics.patch_distance(shuffled(whole), exemplar).item() > 1

    def test_the_directions_are_always_the_same_and_no_random_number_is_used(self):
        image, exemplar = torch.rand(1, 3, 32, 32), torch.rand(1, 3, 32, 32)
        before = torch.get_rng_state()
        first = metrics.patch_distances(image, exemplar)
        assert torch.get_rng_state().equal(before)
        torch.manual_seed(99)
        assert metrics.patch_distances(image, exemplar).equal(first)

    def test_double_precision_and_views_change_nothing(self):
        image, exemplar = (torch.rand(1, 2, 40, 32) * 255).round() / 255, torch.rand(1, 2, 32, 48)
        found = metrics.patch_distances(image, exemplar)
        views = image.mT.contiguous().mT.double(), exemplar.mT.contiguous().mT.double()
        assert found.equal(metrics.patch_distances(*views))

    def test_quantiles_of_many_values(self):
        values = torch.randperm(4096).double() / 4096
        assert quantiles(values).tolist() == [(4 * part + 2) / 4096 for part in range(1024)]


class TestSharpness:
    @pytest.mark.parametrize("name", SAMPLES)
    def test_a_real_crop_is_as_sharp_as_the_exemplar(self, name):
        exemplar, real = quarters(name)
        spoiled = [blur(real, 5, "reflect"), shuffled(real), noise_like(real)]
        images = torch.cat([real, *spoiled])
        sharp, blurred, rough, _ = metrics.sharpness(images, exemplar).tolist()
        assert blurred < 0.8 < sharp < 1.2 < rough
        near, *far = metrics.gradient_distance(images, exemplar).tolist()
        assert all(near < one / 2 for one in far)

    def test_a_ramp(self):
        ramp = torch.arange(8.0).expand(1, 1, 8, 8) / 8
        slope = torch.stack([ramp, ramp.mT]).sum(0) / 2  # as steep, along the diagonal
        assert metrics.sharpness(ramp, ramp / 4).item() == 4
        assert metrics.sharpness(slope, ramp).item() == pytest.approx(math.sqrt(0.5))
        assert metrics.gradient_distance(ramp / 4, ramp).item() == pytest.approx(0.75)
        assert metrics.sharpness(torch.zeros_like(ramp), ramp).item() == 0

    def test_blur_and_noise_together_may_look_sharp_but_not_in_the_distribution(self):
        """Half the exemplar without any edge, and half with twice as strong ones."""
        exemplar = torch.arange(9).remainder(2).double().expand(1, 1, 9, 9) / 4
        mixed = exemplar * 2
        mixed[..., 4:] = 0
        assert metrics.sharpness(mixed, exemplar).item() == pytest.approx(1)
        assert metrics.gradient_distance(mixed, exemplar).item() == pytest.approx(1, abs=1e-3)

    def test_flat_pictures(self):
        flat = torch.full((1, 2, 16, 16), 0.5)
        assert metrics.sharpness(flat, flat).item() == 1
        assert metrics.gradient_distance(flat, flat).item() == 0
        assert 10 < metrics.sharpness(torch.rand(1, 2, 16, 16), flat).item() < 1e4

    def test_a_batch_is_its_pictures(self):
        images, exemplars = torch.rand(3, 2, 16, 20), torch.rand(3, 2, 18, 19)
        for exemplar in (exemplars, exemplars[:1]):
            for found in (metrics.sharpness, metrics.gradient_distance):
                together = found(images, exemplar)
                for item in range(3):
                    alone = found(images[item, None], exemplar[item % len(exemplar), None])
                    assert alone.item() == pytest.approx(together[item].item(), rel=1e-12)


class TestRunLength:
    def test_two_patches(self):
        # Along rows 3 for six pixels and 2 for four; along columns 2 for all.
        rows, columns = (6 * 3 + 4 * 2) / 10, 2
        assert metrics.run_length(TWO_PATCHES).item() == pytest.approx((rows + columns) / 2)

    def test_on_a_torus_runs_go_on_beyond_the_border(self):
        rolled = TWO_PATCHES.roll((1, 2), (2, 3))
        around = metrics.run_length(rolled, "torus").item()
        assert around == metrics.run_length(TWO_PATCHES, "torus").item()
        assert around == metrics.run_length(TWO_PATCHES).item() > metrics.run_length(rolled).item()

    def test_a_row_that_goes_around_a_torus(self):
        """A source that is continued at the far side as well has a run of the whole width."""
        source = source_of("0,0 0,1 0,2 0,3").roll(1, 3)
        assert metrics.run_length(source, "torus").item() == (4 + 1) / 2
        assert metrics.run_length(source, "open").item() == ((1 + 3 * 3) / 4 + 1) / 2

    def test_pixels_without_source_are_left_out(self):
        source = source_of("- - - 0,0 0,1\n- - - 1,0 1,1")
        assert metrics.run_length(source).item() == 2
        assert metrics.run_length(torch.full((1, 2, 4, 4), -1)).item() == 0

    def test_single_pixels_and_whole_pictures(self):
        assert metrics.run_length(identity(6, 9)).item() == (6 + 9) / 2
        assert metrics.run_length(identity(6, 9).flip(2, 3)).item() == 1

    def test_a_batch_is_its_maps(self):
        both = torch.cat((TWO_PATCHES, identity(2, 5)))
        assert metrics.run_length(both).tolist() == [metrics.run_length(one[None]).item() for one in both]


class TestCoverage:
    def test_a_share_of_what_is_possible(self):
        assert metrics.coverage(TWO_PATCHES, (8, 8)).item() == 1
        assert metrics.coverage(TWO_PATCHES.repeat(1, 1, 1, 2), (8, 8)).item() == 10 / 20
        assert metrics.coverage(TWO_PATCHES.repeat(1, 1, 4, 4), (8, 8)).item() == 10 / 64

    def test_pixels_without_source_are_left_out(self):
        source = source_of("- 0,0 0,0 0,1")
        assert metrics.coverage(source, (4, 4)).item() == pytest.approx(2 / 3)
        assert metrics.coverage(torch.full((1, 2, 4, 4), -1), (4, 4)).item() == 0


class TestCopies:
    def test_windows_of_two_patches(self):
        windows = metrics.source_windows(TWO_PATCHES, 2)
        assert (windows >= 0).tolist() == [[[True, True, False, True]]]
        assert metrics.copied(windows).item() == 0.75
        assert metrics.repetition(windows).item() == 0
        twice = metrics.source_windows(TWO_PATCHES.repeat(1, 1, 1, 2), 2)
        assert metrics.copied(twice).item() == metrics.repetition(twice).item() == 6 / 9

    def test_pixels_without_source_are_no_copies(self):
        source = identity(4, 4)
        source[..., 3, 3] = -1
        windows = metrics.source_windows(source, 2) >= 0
        assert int(windows.sum()) == 8
        assert not windows[0, 2, 2]
        assert metrics.copied(metrics.source_windows(torch.full((1, 2, 4, 4), -1), 2)).item() == 0

    def test_windows_are_the_literal_ones(self):
        """Against a loop over all windows of both pictures."""
        exemplar = torch.randint(0, 2, (2, 9, 8)).float()
        image = torch.randint(0, 2, (2, 10, 11)).float()
        image[:, 2:8, 3:9] = exemplar[:, 1:7, 2:8]
        found = metrics.matched_windows(image[None], exemplar[None], 3)[0]
        theirs = {
            tuple(exemplar[:, r : r + 3, c : c + 3].flatten().tolist()) for r in range(7) for c in range(6)
        }
        names = {}
        for row in range(8):
            for column in range(9):
                ours = image[:, row : row + 3, column : column + 3]
                flat = all(len(set(plane.flatten().tolist())) == 1 for plane in ours)
                window = tuple(ours.flatten().tolist())
                assert (found[row, column] >= 0).item() == (window in theirs and not flat)
                if window in theirs and not flat:
                    assert names.setdefault(window, found[row, column].item()) == found[row, column]
        assert len(set(names.values())) == len(names) >= 16

    @pytest.mark.parametrize("window", [1, 2, 3, 7, 8])
    def test_pictures_show_the_copies_that_the_source_map_tells(self, window):
        """In an exemplar without two equal pixels nothing is alike by chance."""
        exemplar = torch.stack([torch.arange(24).repeat(24, 1), torch.arange(24).repeat(24, 1).T]) / 24.0
        source = identity(20, 22)
        source[..., 11:] = source[..., :11] + torch.tensor([2, 1]).view(1, 2, 1, 1)
        image = exemplar[:, source[0, 0], source[0, 1]]
        told, seen = (
            metrics.source_windows(source, window),
            metrics.matched_windows(image[None], exemplar[None], window),
        )
        if window == 1:
            assert (seen == -1).all()  # one pixel is flat
            return
        assert (told >= 0).equal(seen >= 0)
        assert metrics.repetition(told).equal(metrics.repetition(seen))
        assert 0 < metrics.repetition(told).item() < metrics.copied(told).item()

    def test_a_flat_picture_is_no_copy(self):
        flat = torch.full((1, 3, 16, 16), 0.25)
        assert (metrics.matched_windows(flat, flat) == -1).all()

    @pytest.mark.parametrize("name", SAMPLES)
    def test_a_real_crop_is_no_copy_but_a_tiled_exemplar_is(self, name):
        exemplar, real = quarters(name)
        tiled = exemplar[..., :32, :32].repeat(1, 1, 2, 2)
        for measure in (metrics.copied, metrics.repetition):
            clean, copy = measure(metrics.matched_windows(torch.cat((real, tiled)), exemplar)).tolist()
            assert clean == 0
            assert copy > 0.6
        source = identity(32, 32).repeat(1, 1, 2, 2)
        assert metrics.coverage(source, (64, 64)).item() == 0.25

    def test_a_batch_is_its_pictures(self):
        images, exemplars = torch.rand(3, 1, 16, 20).round(), torch.rand(3, 1, 18, 19).round()
        for exemplar in (exemplars, exemplars[:1]):
            together = metrics.matched_windows(images, exemplar, 3) >= 0
            for item in range(3):
                alone = metrics.matched_windows(images[item, None], exemplar[item % len(exemplar), None], 3)
                assert (alone[0] >= 0).equal(together[item])


WRONG = [
    ({"image": torch.rand(1, 13, 20)}, "image: must have at least 14 pixels a side .* but it is 13x20"),
    ({"exemplar": torch.rand(1, 20, 13)}, "exemplar: must have at least 14 pixels .* but it is 20x13"),
    ({"image": torch.rand(3, 16, 16)}, "image: must have as many channels as the exemplar, 1, but it has 3"),
    ({"image": torch.rand(1, 16, 16) + 1}, r"image: values must lie in \[0, 1\]"),
    ({"image": torch.rand(3, 1, 16, 16), "exemplar": torch.rand(2, 1, 16, 16)}, "must be one picture, or 3"),
    ({"source": identity(16, 17)}, "source: must have the size of the output, 16x16, but it has 16x17"),
    ({"source": identity(16, 16).repeat(2, 1, 1, 1)}, "but it has 2 outputs of 16x16"),
    ({"source": identity(16, 16) + 1}, r"must lead into the exemplar, 16x16, or be -1, but .* to 16, 16"),
    ({"source": identity(16, 16) - 2}, "must lead into the exemplar, .* but it reaches from -2, -2"),
    ({"source": identity(16, 16) - torch.tensor([1, 0]).view(2, 1, 1)}, "must lead into the exemplar"),
    ({"source": identity(16, 16).int()}, "source: must be int64, but its dtype is torch.int32"),
    ({"source": identity(16, 16)[:, :1]}, r"must have shape \(2, OH, OW\)"),
]  # fmt: skip


class TestMeasure:
    def test_all_of_a_result(self):
        exemplar = sample("gravel")[:, :48, :48]
        result = ts.synthesize(exemplar, (40, 44), ts.recipes.ashikhmin(), seed=[1, 2])
        found = metrics.measure(result.image, exemplar, result.source, boundary="torus")
        assert found.patch_distance.equal(metrics.patch_distance(result.image, exemplar[None]))
        assert found.patch_distances.mean(1).equal(found.patch_distance)
        assert found.sharpness.equal(metrics.sharpness(result.image, exemplar[None]))
        assert found.gradient_distance.equal(metrics.gradient_distance(result.image, exemplar[None]))
        assert found.copied.equal(metrics.copied(metrics.source_windows(result.source)))
        assert found.repetition.equal(metrics.repetition(metrics.source_windows(result.source)))
        assert found.run_length.equal(metrics.run_length(result.source, "torus"))
        assert found.coverage.equal(metrics.coverage(result.source, (48, 48)))
        assert found.seam.equal(metrics.seam_ratio(result.image))
        assert found.run_length.min() > 3

    def test_without_a_source_map(self):
        exemplar = sample("gravel")[:, :48, :48]
        found = metrics.measure(exemplar, exemplar)
        assert found.run_length is None
        assert found.coverage is None
        assert found.copied.tolist() == [1]
        assert found.repetition.tolist() == [0]

    def test_rows_are_plain_numbers(self):
        exemplar = torch.rand(3, 20, 20)
        rows = metrics.measure(torch.rand(2, 3, 16, 16), exemplar).rows()
        assert json.loads(json.dumps(rows, allow_nan=False)) == rows
        assert rows[0]["seam"] != rows[1]["seam"]
        assert rows[0]["coverage"] is None

    @pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
    def test_flat_pictures_have_numbers_too(self, value):
        flat, rough = torch.full((1, 16, 16), value), torch.rand(1, 16, 16)
        for pair in ((flat, flat), (flat, rough), (rough, flat), (1 - flat, flat)):
            json.dumps(metrics.measure(*pair).rows(), allow_nan=False)

    def test_a_source_map_may_be_inexact_but_not_another_one(self):
        exemplar = sample("grass")[:, :48, :48]
        result = ts.synthesize(exemplar, (32, 32), ts.recipes.ashikhmin(blur_seams=3), seed=1)
        rounded = ((result.image * 25).round() / 25).clamp(0, 1)
        assert metrics.measure(rounded, exemplar, result.source).coverage.item() > 0.4
        shifted = result.source.roll(5, 2)
        with pytest.raises(ts.InputError, match="source: must lead to the colors of the output"):
            metrics.measure(result.image, exemplar, shifted)

    def test_a_map_without_any_source(self):
        image = torch.rand(1, 16, 16)
        found = metrics.measure(image, image, torch.full((2, 16, 16), -1))
        assert (found.copied.item(), found.coverage.item(), found.run_length.item()) == (0, 0, 0)

    @pytest.mark.parametrize(("changes", "said"), WRONG)
    def test_what_cannot_be_measured(self, changes, said):
        image = torch.rand(1, 16, 16)
        with pytest.raises(ts.InputError, match=said):
            metrics.measure(**({"image": image, "exemplar": image} | changes))

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"boundary": "ring"}, "boundary: must be one of torus, open, but it is 'ring'"),
            ({"source": [[0]]}, r"source: must be a Tensor, but it is \[\[0\]\]"),
        ],
    )
    def test_what_is_of_another_type(self, changes, said):
        image = torch.rand(1, 16, 16)
        unchecked = inspect.unwrap(metrics.measure)  # where types are not checked, as outside of tests
        with pytest.raises(ts.InputError, match=said):
            unchecked(image, image, **changes)


def test_windows_of_copies_fit_into_all_that_can_be_measured():
    assert WINDOW <= metrics.SMALLEST_SIDE


def test_seams_of_a_ramp():
    ramp = torch.arange(4.0).expand(1, 1, 3, 4) / 3
    assert metrics.seam_ratio(ramp).tolist() == [[1, pytest.approx(3)]]


def test_one_picture_is_a_batch_of_one():
    image, exemplar = torch.rand(1, 1, 20, 20), torch.rand(1, 1, 24, 24)
    for measure in (
        metrics.patch_distance,
        metrics.sharpness,
        metrics.gradient_distance,
        metrics.matched_windows,
    ):
        assert measure(image[0], exemplar[0]).equal(measure(image, exemplar))
        with pytest.raises(ts.InputError, match=r"exemplar: must have shape \(C, H, W\) or"):
            measure(image, exemplar[0, 0])
    assert metrics.seam_ratio(image[0]).equal(metrics.seam_ratio(image))
    with pytest.raises(ts.InputError, match="image: must have shape"):
        metrics.seam_ratio(image[0, 0])
