"""The library against the papers' literal algorithms, pixel for pixel."""

from __future__ import annotations

import pytest
import torch

import torchsynth as ts
from tests.reference import ashikhmin, random_order, wei_levoy
from torchsynth.search import chance, scatter_draws, spare


def _noise(seed, channels, size):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(channels, *size, generator=generator, dtype=torch.float64)


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(
    ("channels", "exemplar", "size", "levels", "causal", "parent"),
    [
        (1, (9, 8), (7, 10), 1, 3, None),
        (1, (9, 11), (3, 2), 1, 5, None),
        (3, (8, 8), (5, 9), 1, 3, None),
        (1, (9, 9), (1, 1), 1, 5, None),
        (1, (12, 12), (9, 12), 2, 3, 3),
        (2, (13, 11), (11, 6), 2, 3, 3),
        (1, (17, 18), (13, 10), 3, 3, 3),
        (1, (14, 14), (6, 9), 2, 5, 3),
        (1, (12, 14), (3, 4), 2, 3, 3),
    ],
)
def test_equals_wei_levoy(make_exemplar, channels, exemplar, size, levels, causal, parent, boundary):
    sample = make_exemplar(channels, *exemplar, seed=3, dtype=torch.float64)
    if parent is None:
        recipe = ts.recipes.wei_levoy_single(neighborhood=causal, boundary=boundary)
    else:
        recipe = ts.recipes.wei_levoy(levels=levels, neighborhood=causal, parent=parent, boundary=boundary)
    result = ts.synthesize(sample, size, recipe, seed=11)
    lonely = tuple(result.levels[-1].source[0, :, 0, 0].tolist())
    assert levels > 1 or boundary == "torus" or min(lonely) >= causal // 2
    literal = wei_levoy.synthesize(
        sample, _noise(11, channels, size), levels, causal, parent, boundary == "torus", lonely
    )
    assert result.source[0].permute(1, 2, 0).tolist() == literal.tolist()


class Draws:
    """The library's random numbers for one sample, as the references ask for them."""

    def __init__(self, seed, pixels, width):
        self.generator = torch.Generator().manual_seed(seed)
        self.pixels, self.width, self.begun = pixels, width, False

    def __call__(self):
        if not self.begun:
            self.begun = True
            return _Start(torch.rand(self.pixels, generator=self.generator, dtype=torch.float64), self.width)
        return _Pass(torch.randint(2**62, (self.pixels,), generator=self.generator), self.width)


class _Start:
    def __init__(self, draws, width):
        self.draws, self.width = draws, width

    def start(self, row, column, count):
        return int(self.draws[row * self.width + column] * count)


class _Pass:
    def __init__(self, draws, width):
        self.draws, self.width = scatter_draws(draws[None], 49)[0], width

    def spare(self, row, column, number, count):
        return int(spare(self.draws[row * self.width + column, number], count))

    def chance(self, row, column, number):
        return int(chance(self.draws[row * self.width + column, number])) / 2**31


def _whole(image):
    return (image * 255).round().long().permute(1, 2, 0).numpy()


def _sources(canvas):
    return canvas.source.tolist()


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("noise", [True, False])
@pytest.mark.parametrize(
    ("channels", "exemplar", "size", "n", "tileable", "spare_bottom"),
    [
        (1, (9, 10), (12, 11), 3, False, False),
        (3, (8, 11), (7, 13), 3, True, False),
        (1, (11, 11), (9, 14), 5, True, True),
        (1, (10, 12), (2, 9), 5, True, False),
        (2, (9, 9), (1, 3), 3, False, True),
    ],
)
def test_equals_ashikhmin(
    make_exemplar, channels, exemplar, size, n, tileable, spare_bottom, noise, boundary
):
    sample = make_exemplar(channels, *exemplar, seed=5)
    recipe = ts.recipes.ashikhmin(
        neighborhood=n, noise=noise, tileable=tileable, spare_bottom=spare_bottom, boundary=boundary
    )
    result = ts.synthesize(sample, size, recipe, seed=21)
    torus = boundary == "torus"
    literal = ashikhmin.synthesize(
        _whole(sample), size, n, Draws(21, size[0] * size[1], size[1]),
        torus=torus, noise=noise, tileable=tileable and torus, spare_bottom=spare_bottom,
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == _sources(literal)


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(("passes", "noise"), [(1, False), (1, True), (3, False)])
def test_equals_ashikhmin_with_a_target(make_exemplar, passes, noise, boundary):
    size, n = (10, 13), 3
    sample, target = make_exemplar(3, 11, 12, seed=6), make_exemplar(3, *size, seed=9)
    painted = torch.zeros(size, dtype=torch.bool)
    painted[2:8, 3:] = True
    recipe = ts.recipes.ashikhmin_target(passes=passes, neighborhood=n, noise=noise, boundary=boundary)
    controls = ts.Controls(target=target, target_region=painted)
    result = ts.synthesize(sample, size, recipe, controls=controls, seed=4)
    literal = ashikhmin.follow(
        _whole(sample), size, n, Draws(4, 130, 13), _whole(target), painted.numpy(), passes,
        torus=boundary == "torus", noise=noise,
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == _sources(literal)


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("noise", [True, False])
@pytest.mark.parametrize("size", [(12, 10), (13, 11)])
def test_equals_ashikhmin_on_several_levels(make_exemplar, size, noise, boundary):
    sample = make_exemplar(2, 18, 17, seed=7, dtype=torch.float64)
    recipe = ts.recipes.ashikhmin_multires(levels=2, neighborhood=3, parent=3, noise=noise, boundary=boundary)
    result = ts.synthesize(sample, size, recipe, seed=8)
    samples = [_whole(torch.as_tensor(level)) for level in wei_levoy.pyramid(sample, 2, "reflect")]
    generator = torch.Generator().manual_seed(8)
    sizes = _halved(size)
    draws = iter(
        [
            _Start(
                torch.rand(sizes[1][0] * sizes[1][1], generator=generator, dtype=torch.float64), sizes[1][1]
            ),
            _Pass(torch.randint(2**62, (sizes[1][0] * sizes[1][1],), generator=generator), sizes[1][1]),
            _Pass(torch.randint(2**62, (size[0] * size[1],), generator=generator), size[1]),
        ]
    )
    literal = ashikhmin.multires(
        samples, sizes, 3, 3, lambda: next(draws), torus=boundary == "torus", noise=noise
    )
    assert result.source[0].permute(1, 2, 0).tolist() == _sources(literal)


def _halved(size):
    """The sizes of two levels."""
    return [size, (size[0] // 2, size[1] // 2)]


def _orders(seed, sizes):
    """The pixels of each level in the library's random order."""
    orders = []
    for height, width in sizes:
        rank = torch.randperm(height * width, generator=torch.Generator().manual_seed(seed))
        orders.append([divmod(site, width) for site in rank.argsort().tolist()])
    return orders


def _turning(size):
    """Angles and scales of an output, and what the references ask of them."""
    angle = torch.linspace(0, 170, size[0] * size[1], dtype=torch.float64).view(size)
    scale = torch.linspace(0.5, 1.9, size[0] * size[1], dtype=torch.float64).view(size)

    def field(level):
        def at(row, column):
            sides = [max(1, side >> level) for side in size]
            middle = [
                ((2 * place + 1) * large) // (2 * small)
                for place, large, small in zip((row, column), size, sides, strict=True)
            ]
            return float(angle[tuple(middle)]), float(scale[tuple(middle)])

        return at

    return ts.Controls(angle=angle, scale=scale), field


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("distorts", [False, True])
@pytest.mark.parametrize("size", [(8, 10), (9, 7)])
def test_equals_random_order(make_exemplar, size, distorts, boundary):
    sample = make_exemplar(1, 14, 13, seed=2, dtype=torch.float64)
    recipe = ts.recipes.random_order(levels=2, neighborhood=3, parent=3, order_seed=5, boundary=boundary)
    controls, field = _turning(size) if distorts else (None, None)
    result = ts.synthesize(sample, size, recipe, controls=controls, seed=3)
    torus = boundary == "torus"
    levels = wei_levoy.pyramid(sample, 2, "reflect")
    noise = wei_levoy.pyramid(_noise(3, 1, size), 2, "circular" if torus else "reflect")
    noise = [wei_levoy.match(image, level) for image, level in zip(noise, levels, strict=True)]
    literal = random_order.synthesize(
        [_whole(torch.as_tensor(level)) for level in levels],
        [_whole(torch.as_tensor(image)) for image in noise],
        _orders(5, _halved(size)), 3, 3, torus, field,
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == literal.tolist()


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("distorts", [False, True])
@pytest.mark.parametrize("size", [(8, 10), (9, 7)])
def test_equals_coherent_random_order(make_exemplar, size, distorts, boundary):
    sample = make_exemplar(2, 14, 13, seed=2, dtype=torch.float64)
    recipe = ts.recipes.random_order(
        levels=2, neighborhood=3, parent=3, order_seed=5, boundary=boundary, search="coherence"
    )
    controls, field = _turning(size) if distorts else (None, None)
    result = ts.synthesize(sample, size, recipe, controls=controls, seed=3)
    sizes, generator = _halved(size), torch.Generator().manual_seed(3)
    pixels = [height * width for height, width in sizes]
    draws = [_Start(torch.rand(pixels[1], generator=generator, dtype=torch.float64), sizes[1][1])]
    for level in (1, 1, 0, 0):
        words = torch.randint(2**62, (pixels[level],), generator=generator)
        draws.append(_Pass(words, sizes[level][1]))
    taken = iter(draws)
    literal = random_order.coherent(
        [_whole(torch.as_tensor(level)) for level in wei_levoy.pyramid(sample, 2, "reflect")],
        sizes, _orders(5, sizes), 3, 3, lambda: next(taken), boundary == "torus", field,
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).tolist() == literal.tolist()
