"""The references of the improved Wei & Levoy and of image analogies, held to what must be true of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from kornia.morphology import dilation, erosion

from tests.reference import analogy, ashikhmin, improved_wei_levoy, wei_levoy
from tests.reference.improved_wei_levoy import pixels


def _random(seed, channels, height, width):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(channels, height, width, generator=generator, dtype=torch.float64).numpy()


def _shown(image, source):
    return image[:, source[..., 0], source[..., 1]]


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize(("levels", "size"), [(1, (6, 5)), (2, (8, 7))])
def test_without_its_switches_it_is_wei_levoy(levels, size, torus):
    sample, noise = _random(1, 2, 10, 9), _random(2, 2, *size)
    settings = (sample, noise, levels, 3, 3)
    plain = wei_levoy.synthesize(*settings, torus=torus, lonely=(3, 3))
    improved = improved_wei_levoy.synthesize(*settings, False, False, torus=torus, lonely=(3, 3))
    assert improved.tolist() == plain.tolist()


def test_levels_are_stretched_channel_by_channel():
    finest = np.stack([_random(1, 1, 4, 4)[0], np.full((4, 4), 0.25)])
    level = np.stack([np.array([[0.4, 0.5], [0.6, 0.5]]), np.full((2, 2), 0.75)])
    first, flat = improved_wei_levoy.stretched(level, finest)
    middle = (finest[0].min() + finest[0].max()) / 2
    assert first == pytest.approx(np.array([[finest[0].min(), middle], [finest[0].max(), middle]]))
    assert flat.tolist() == level[1].tolist()


def _windows(image, size):
    """What each place of a torus sees through a square, (H, W, offsets, channels)."""
    half = range(-(size // 2), size // 2 + 1)
    return np.stack([np.roll(image, (-dy, -dx), (0, 1)) for dy in half for dx in half], axis=2)


def _costs(place, layers):
    """Summed squared differences of one place to all candidates, at once; impossible ones are infinite.

    Layers are: sample, output, size, which offsets count, weight, and whether it is one level up.
    """
    total = 0
    for sample, output, size, counted, weight, up in layers:
        here = (place[0] // 2, place[1] // 2) if up else place
        wanted, offered = _windows(output, size)[here], _windows(sample, size)
        cost = weight * ((offered - wanted) ** 2).sum(-1)[..., counted].sum(-1).astype(float)
        half = size // 2
        inside = np.full(cost.shape, np.inf)
        inside[half : cost.shape[0] - half, half : cost.shape[1] - half] = 0
        cost += inside
        total = total + (cost.repeat(2, 0).repeat(2, 1) if up else cost)
    return total


def _first_best(costs):
    return np.unravel_index(int(costs.argmin()), costs.shape)


def _settled(height, width, half):
    """The places of a causal pass on a torus all of whose neighbors are older: they never change again."""
    rows = range(half, height)
    return [(row, (step + row * half) % width) for row in rows for step in range(half, width)]


@pytest.mark.parametrize("weighting", [False, True])
@pytest.mark.parametrize("size", [(8, 6), (4, 10)])
def test_the_last_pixel_has_the_best_of_all_whole_neighborhoods(weighting, size):
    sample, noise = _random(3, 2, 14, 12), _random(4, 2, *size)
    levels = improved_wei_levoy.canvases(sample, noise, 2, 5, 3, weighting, True)
    fine, coarse = levels
    last = size[0] - 1, (size[1] - 1 + (size[0] - 1) * 2) % size[1]
    layers = [
        (fine.sample, fine.value, 5, [one for one in range(25) if one != 12], 1, False),
        (coarse.sample, coarse.value, 3, list(range(9)), 1 + weighting, True),
    ]
    assert tuple(fine.source[last]) == _first_best(_costs(last, layers))


@pytest.mark.parametrize("weighting", [False, True])
def test_weighting_lets_the_parents_count_twice_and_stretches_them(weighting):
    sample, noise = _random(5, 1, 12, 12), _random(6, 1, 8, 8)
    fine, coarse = improved_wei_levoy.canvases(sample, noise, 2, 3, 3, weighting, False)
    plain = wei_levoy.pyramid(sample, 2, "reflect")[1]
    assert (coarse.sample.min() == pixels(sample).min()) == weighting
    assert (coarse.sample.tolist() == pixels(plain).tolist()) != weighting
    layers = [
        (fine.sample, fine.value, 3, list(range(4)), 1, False),
        (coarse.sample, coarse.value, 3, list(range(9)), 1 + weighting, True),
    ]
    # Below the parents of the sample's last row there is none: hence the same candidates as for a square.
    for place in _settled(8, 8, 1):
        assert tuple(fine.source[place]) == _first_best(_costs(place, layers))


def test_the_bottom_part_knows_the_top_and_nothing_that_is_not_synthesized(monkeypatch):
    """What the first pixel of the bottom part compares: not its right, and not the noise below."""
    sample, noise = _random(7, 1, 9, 9), _random(8, 1, 6, 7)
    seen = {}
    compare = improved_wei_levoy.above

    def spy(canvas, seeing, candidate, template):
        looks = len(template), int(canvas.known.sum())
        seen[looks] = [offset for offset in template if seeing(offset) is not None]
        return compare(canvas, seeing, candidate, template)

    monkeypatch.setattr(improved_wei_levoy, "above", spy)
    improved_wei_levoy.synthesize(sample, noise, 1, 5, None, False, True)
    above = [(dy, dx) for dy in (-2, -1) for dx in range(-2, 3)]
    # Two rows below row 4 is row 0; row 5 is not synthesized.
    assert seen[24, 4 * 7] == [*above, *((2, dx) for dx in range(-2, 3))]
    assert seen[24, 4 * 7 + 1] == [*above, (0, -1), *((2, dx) for dx in range(-2, 3))]
    # The last pixel of row 5 sees all, and so do all that come after it.
    assert len(seen[24, 6 * 7 - 1]) == len(seen[24, 6 * 7]) == 24
    assert len(seen[12, 0]) == 12
    assert sorted(known for looks, known in seen if looks == 12) == list(range(4 * 7))


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("height", [1, 2, 8])
def test_all_switches_end_and_a_constant_gives_itself(height, torus):
    sample, noise = np.full((2, 9, 9), 0.3), _random(9, 2, height, 8)
    source = improved_wei_levoy.synthesize(sample, noise, 1, 5, 3, True, True, torus=torus, lonely=(4, 4))
    assert source.shape == (height, 8, 2)
    assert source.min() >= 2
    assert (_shown(sample, source) == 0.3).all()


@pytest.mark.parametrize("kappa", [None, 0.0, 5.0, 1e9])
def test_an_analogy_with_a_piece_of_a_gives_that_piece_of_a_prime(kappa):
    a, a_prime = _random(12, 1, 9, 10), _random(13, 3, 9, 10)
    b = a[:, 1:-1, 1:-1]
    source = analogy.synthesize(a, a_prime, b, _random(14, 3, 7, 8), 1, 3, None, 3, kappa=kappa)
    assert _shown(a_prime, source).tolist() == a_prime[:, 1:-1, 1:-1].tolist()


def test_every_settled_pixel_of_an_analogy_has_the_best_of_all_neighborhoods():
    a, a_prime, b = _random(15, 2, 12, 14), _random(16, 1, 12, 14), _random(17, 2, 8, 6)
    settings = (a, a_prime, b, _random(18, 1, 8, 6), 2, 5, 3, 3)
    result, coarse = analogy.canvases(*settings, 3, torus=True)
    guides = improved_wei_levoy.prepared(wei_levoy.pyramid(a, 2, "reflect"), b, True, matched=False)
    layers = [
        (result.sample, result.value, 5, list(range(12)), 1, False),
        (coarse.sample, coarse.value, 3, list(range(9)), 1, True),
        (guides[0].sample, guides[0].value, 3, list(range(9)), 1, False),
        (guides[1].sample, guides[1].value, 3, list(range(9)), 1, True),
    ]
    # The parents' square keeps candidates as far from the lower border as the causal one from the upper.
    for place in _settled(8, 6, 2):
        assert tuple(result.source[place]) == _first_best(_costs(place, layers))
    assert result.source.tolist() != analogy.synthesize(*settings, None, torus=True).tolist()


def _continued(source):
    """How many pixels continue the patch of the neighbor to their left."""
    return int((source[:, 1:] - source[:, :-1] == (0, 1)).all(-1).sum())


@pytest.mark.parametrize("torus", [True, False])
def test_coherence_copies_longer_patches_the_larger_kappa_is(torus):
    a, a_prime, b = _random(19, 1, 10, 12), _random(20, 1, 10, 12), _random(21, 1, 8, 8)
    counts = [
        _continued(
            analogy.synthesize(a, a_prime, b, _random(22, 1, 8, 8), 1, 3, None, 3, torus=torus, kappa=kappa)
        )
        for kappa in (None, 0.5, 1e9)
    ]
    assert counts[0] < counts[1] < counts[2]
    assert counts[2] > 8 * 7 / 2


def test_coherence_is_preferred_if_it_is_at_most_kappa_times_worse():
    costs = {(1, 1): 100, (2, 2): 150, (3, 3): 150}
    assert analogy.preferred((1, 1), [(2, 2), (3, 3)], costs, 0.5) == (2, 2)
    assert analogy.preferred((1, 1), [(2, 2), (3, 3)], costs, 0.49) == (1, 1)
    assert analogy.preferred((1, 1), [], costs, 9.0) == (1, 1)
    assert analogy.preferred((2, 2), [(3, 3)], costs, 0.0) == (3, 3)


@pytest.mark.parametrize("torus", [True, False])
def test_coherence_counts_half_as_much_one_level_up(monkeypatch, torus):
    places, extras = [], []

    def continued(result, place, offsets, choices, coherent=analogy.coherent):
        places.append(place)
        return coherent(result, place, offsets, choices)

    def preferred(best, offers, costs, extra, preferred=analogy.preferred):
        extras.append(extra)
        return preferred(best, offers, costs, extra)

    monkeypatch.setattr(analogy, "coherent", continued)
    monkeypatch.setattr(analogy, "preferred", preferred)
    a, a_prime, b = _random(27, 1, 10, 9), _random(28, 1, 10, 9), _random(29, 1, 6, 6)
    analogy.synthesize(a, a_prime, b, _random(30, 1, 6, 6), 2, 3, 1, 3, torus=torus, kappa=3.0)
    assert extras == [1.5] * 9 + [3.0] * 36
    # On a torus each row starts one column further right, half the neighborhood.
    assert [column for _, column in places[::3][:3]] == ([0, 1, 2] if torus else [0, 0, 0])
    assert places[9::6] == [(row, row if torus else 0) for row in range(6)]


@pytest.mark.parametrize("torus", [True, False])
def test_coherent_candidates_continue_synthesized_neighbors_and_are_candidates(torus):
    canvas = ashikhmin.Canvas(np.zeros((9, 9, 1), dtype=int), (4, 5), torus)
    for place, source in {(1, 0): (4, 7), (1, 4): (4, 2), (0, 1): (6, 6)}.items():
        canvas.set(place, source)
        canvas.known[place] = place != (0, 1)
    choices = [(row, column) for row in range(1, 8) for column in range(1, 8)]
    offsets = ashikhmin.causal(3)
    # Right of (4, 7) is no candidate; the neighbor above (1, 1) is not synthesized.
    assert analogy.coherent(canvas, (1, 1), offsets, choices) == []
    assert analogy.coherent(canvas, (2, 0), offsets, choices) == ([(5, 3), (5, 7)] if torus else [(5, 7)])


@pytest.mark.parametrize(("operation", "same"), [("erosion", erosion), ("dilation", dilation)])
@pytest.mark.parametrize("size", [3, 5])
def test_morphology_is_kornias(operation, same, size):
    image = _random(23, 2, 7, 6)
    expected = same(torch.as_tensor(image)[None], torch.ones(size, size))[0]
    assert analogy.morphology(image, size, operation) == pytest.approx(expected.numpy())


@pytest.mark.parametrize("operation", ["erosion", "dilation"])
def test_an_eroded_texture_is_undone_by_the_best_analogy(operation):
    sample, noise, second = _random(24, 1, 12, 11), _random(25, 1, 8, 7), _random(26, 1, 8, 7)
    settings = {"operation": operation, "size": 3, "neighborhood": 3, "guide": 5}
    source, guide = analogy.improved(sample, noise, 2, 3, 3, True, True, **settings, second_noise=second)
    thick = analogy.morphology(sample, 3, operation)
    layers = [
        (pixels(sample), pixels(_shown(sample, source)), 3, [one for one in range(9) if one != 4], 1, False),
        (pixels(thick), pixels(_shown(thick, guide)), 5, list(range(25)), 1, False),
    ]
    # The last rows and then the first ones are visited last, with all that is around them.
    last = 0, (6 + 1) % 7
    assert tuple(source[last]) == _first_best(_costs(last, layers))
    once, same = analogy.improved(sample, noise, 2, 3, 3, True, True, **settings)
    assert same.tolist() == guide.tolist()
    assert once.tolist() != source.tolist()
