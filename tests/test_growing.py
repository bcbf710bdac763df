"""Efros & Leung, and filling in the same order, against the literal algorithms, pixel for pixel."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import torchsynth as ts
from tests.reference import coherent_fill, efros_leung, wei_levoy_fill
from torchsynth.pyramid import gaussian_pyramid, whole_regions
from torchsynth.schedule import OnionPeel, Shuffle
from torchsynth.search import chance, draw_at, scatter_draws, spare


def _ints(image):
    return np.round(image.numpy() * 255).astype(int).transpose(1, 2, 0)


def _ties(shape, seed=0):
    return Shuffle(seed=seed).rank(shape, (0, 0), "open").numpy()


def _hole(shape, seed, share):
    generator = torch.Generator().manual_seed(seed)
    hole = torch.rand(shape, generator=generator) < share
    hole[1:4, 2:5] = True
    hole[-1, -1] = False
    return hole


class Picks:
    """The random numbers of an acceptance, as the reference asks for them."""

    def __init__(self, seed, shape, before):
        generator = torch.Generator().manual_seed(seed)
        before(generator)
        self.draws = torch.randint(2**62, (shape[0] * shape[1],), generator=generator)[None]
        self.width = shape[1]

    def __call__(self, row, column, layer):
        return int(chance(draw_at(self.draws[:, [row * self.width + column]], -layer)))


def _one_draw(generator):
    torch.rand(1, generator=generator, dtype=torch.float64)


GROWN = [
    # channels, exemplar, output, window, options
    (1, (10, 9), (8, 9), 3, {}),
    (3, (9, 9), (7, 8), 5, {}),
    (1, (11, 10), (9, 7), 5, {"epsilon": 1.0}),
    (1, (10, 10), (8, 8), 3, {"pick": "distance", "epsilon": 3.0}),
    (2, (9, 10), (7, 7), 3, {"max_error": 0.01, "growth": 1.7}),
    (1, (9, 9), (8, 7), 5, {"max_error": 0.0005, "growth": 2.0, "sigma": 0.8}),
    (1, (9, 9), (8, 7), 3, {"max_error": None, "epsilon": 0.0}),
]


def _literal(sample, valid, picture, known, window, options, torus, seed, before):
    reference = {"epsilon": 0.1, "max_error": 0.3, "growth": 1.1, "sigma": window / 6.4} | options
    reference["max_error"] = reference["max_error"] or float("inf")
    weighted = reference.pop("pick", "uniform") == "distance"
    return efros_leung.grow(
        _ints(sample), valid.numpy(), _ints(picture), known.numpy(), window=window, torus=torus,
        order=_ties(tuple(known.shape)), draw=Picks(seed, known.shape, before), weighted=weighted, **reference,
    )  # fmt: skip


@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize(("channels", "exemplar", "size", "window", "options"), GROWN)
def test_growing_equals_efros_leung(make_exemplar, channels, exemplar, size, window, options, boundary):
    sample = make_exemplar(channels, *exemplar, seed=3, dtype=torch.float64)
    recipe = ts.recipes.efros_leung(window=window, boundary=boundary, **options)
    result = ts.synthesize(sample, size, recipe, seed=5)
    middle = [slice(side // 2 - 1, side // 2 + 2) for side in size]
    known = torch.zeros(size, dtype=torch.bool)
    known[middle[0], middle[1]] = True
    valid = torch.ones(exemplar, dtype=torch.bool)
    image, source, _ = _literal(
        sample, valid, result.image[0], known, window, options, boundary == "torus", 5, _one_draw
    )
    found = result.source[0].permute(1, 2, 0)
    assert found[~known].tolist() == source[~known.numpy()].tolist()
    assert (_ints(result.image[0]) == image).all()
    # The seed is a patch of the exemplar.
    steps = found[middle[0], middle[1]] - found[middle[0].start + 1, middle[1].start + 1]
    assert steps.reshape(-1, 2).tolist() == torch.cartesian_prod(*[torch.arange(-1, 2)] * 2).tolist()


@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize(("channels", "exemplar", "size", "window", "options"), GROWN)
def test_filling_equals_efros_leung(make_exemplar, channels, exemplar, size, window, options, boundary):
    sample = make_exemplar(channels, *exemplar, seed=3, dtype=torch.float64)
    valid = torch.ones(exemplar, dtype=torch.bool)
    valid[0, 0] = False
    picture = make_exemplar(channels, *size, seed=8, dtype=torch.float64)
    hole = _hole(size, seed=2, share=0.4)
    recipe = ts.recipes.efros_leung(window=window, boundary=boundary, **options)
    controls = ts.Controls(initial=picture, hole=hole)
    result = ts.synthesize(ts.Exemplar(sample, valid), size, recipe, controls=controls, seed=7)
    image, source, _ = _literal(
        sample, valid, picture, ~hole, window, options, boundary == "torus", 7, _one_draw
    )
    assert result.source[0].permute(1, 2, 0).tolist() == source.tolist()
    assert (_ints(result.image[0]) == image).all()
    assert result.image[0][:, ~hole].equal(picture[:, ~hole])


def test_outputs_that_refuse_different_pixels_part_company(make_exemplar):
    sample = make_exemplar(1, 10, 10, seed=3)
    recipe = ts.recipes.efros_leung(window=3, max_error=0.004, growth=1.5)
    seeds = [1, 2, 3]
    told = []
    together = ts.synthesize(sample, (9, 9), recipe, seed=seeds, progress=lambda *told_: told.append(told_))
    for number, seed in enumerate(seeds):
        alone = ts.synthesize(sample, (9, 9), recipe, seed=seed)
        assert together.source[number].equal(alone.source[0])
        assert together.image[number].equal(alone.image[0])
    done = [one[2] for one in told]
    assert done == sorted(done)
    assert done[-1] == told[-1][3] == 81


@pytest.mark.parametrize("search", ["exhaustive"])
@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize(
    ("channels", "size", "levels", "n", "parent"),
    [(1, (9, 8), 1, 3, 3), (3, (8, 9), 1, 5, 3), (1, (15, 16), 2, 3, 3), (2, (16, 13), 2, 3, 1)],
)
def test_filling_equals_constrained_wei_levoy(
    make_exemplar, channels, size, levels, n, parent, boundary, search
):
    picture = make_exemplar(channels, *size, seed=4, dtype=torch.float64)
    sample = make_exemplar(channels, 17, 16, seed=5, dtype=torch.float64)
    valid = torch.ones(17, 16, dtype=torch.bool)
    valid[0, 1] = False
    hole = torch.zeros(size, dtype=torch.bool)
    hole[2:5, 2:6] = True
    recipe = ts.recipes.wei_levoy_fill(
        levels=levels, neighborhood=n, parent=parent, boundary=boundary, search=search
    )
    controls = ts.Controls(initial=picture, hole=hole)
    result = ts.synthesize(ts.Exemplar(sample, valid), size, recipe, controls=controls, seed=7)
    border = "circular" if boundary == "torus" else "reflect"
    pictures = gaussian_pyramid(picture.masked_fill(hole, 0)[None], levels, border)
    knowns = whole_regions(~hole, levels, border)
    samples = ts.Exemplar(sample, valid).images(levels)
    valids = whole_regions(valid, levels, "reflect")
    literal = wei_levoy_fill.fill(
        [_ints(one[0]) for one in samples], [one.numpy() for one in valids],
        [_ints(one[0]) for one in pictures], [one.numpy() for one in knowns],
        n=n, parent=parent, orders=[_ties(tuple(one.shape)) for one in knowns], torus=boundary == "torus",
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == literal.tolist()


@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize(
    ("channels", "size", "n", "passes"), [(1, (9, 10), 3, 1), (1, (10, 9), 5, 2), (3, (9, 9), 3, 3)]
)
def test_coherent_filling_equals_the_literal_one(make_exemplar, channels, size, n, passes, boundary):
    picture = make_exemplar(channels, *size, seed=4, dtype=torch.float64)
    hole = _hole(size, seed=1, share=0.2)
    hole[0] = False
    recipe = ts.recipes.coherent_fill(levels=1, neighborhood=n, passes=passes, boundary=boundary)
    exemplar = make_exemplar(channels, 12, 12, seed=6, dtype=torch.float64)
    top, left = 1, 1
    shown = exemplar.clone()
    shown[:, top : top + size[0] - 1, left : left + size[1] - 1] = picture[:, :-1, :-1]
    controls = ts.Controls(initial=picture, hole=hole, exemplar_at=(-top, -left))
    result = ts.synthesize(shown, size, recipe, controls=controls, seed=7)
    generator = torch.Generator().manual_seed(7)
    torch.rand(channels, *size, generator=generator, dtype=torch.float64)
    draws = [torch.randint(2**62, (1, size[0] * size[1]), generator=generator) for _ in range(passes)]

    def spare_(number, row, column, k, count):
        mixed = scatter_draws(draws[number][:, [row * size[1] + column]], n * n)
        return int(spare(mixed[0, 0, k], count))

    source = np.full((*size, 2), -1)
    for row, column in (~hole).nonzero().tolist():
        if picture[:, row, column].equal(shown[:, row + top, column + left]):
            source[row, column] = row + top, column + left
    assert (source[~hole.numpy()] >= 0).all(1).sum() > 20
    literal = coherent_fill.fill(
        _ints(shown), np.ones((12, 12), dtype=bool), _ints(picture), (~hole).numpy(), source, n=n,
        passes=passes, order=_ties(size), spare=spare_, torus=boundary == "torus",
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == literal.tolist()


def test_layers_do_not_depend_on_what_is_visited():
    known = torch.zeros(5, 6, dtype=torch.bool)
    known[2, 2] = True
    rank = OnionPeel(seed=1).layer(known, ~known, "open")
    assert (rank > 0).nonzero().tolist() == [[1, 1], [1, 2], [1, 3], [2, 1], [2, 3], [3, 1], [3, 2], [3, 3]]
    assert not (OnionPeel(seed=2).layer(known, ~known, "open").equal(rank))
