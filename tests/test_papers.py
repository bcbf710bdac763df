"""The library against the papers' literal algorithms, pixel for pixel."""

from __future__ import annotations

import pytest
import torch

import torchsynth as ts
from tests.reference import wei_levoy


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
