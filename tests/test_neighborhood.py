"""Templates, layers, candidates and both sides of gathering."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from torchsynth.index import Index, candidates
from torchsynth.lattice import to_cells
from torchsynth.neighborhood import (
    Layer,
    Plane,
    Planes,
    feature_positions,
    gather,
    layer_weights,
    layers_at,
    quantize,
    reads_of,
)
from torchsynth.template import Causal, Square

sizes = st.sampled_from([1, 3, 5, 7])


def _plane(channels, height, width, boundary="open", seed=0, valid=None):
    generator = torch.Generator().manual_seed(seed)
    values = torch.randint(-128, 128, (1, height * width, channels), generator=generator).float()
    return Plane(values, (height, width), boundary, valid)


@given(st.sampled_from([3, 5, 7, 9]))
def test_causal_and_its_mirror_make_the_square_without_center(size):
    causal = Causal(size=size).offsets()
    both = torch.cat((causal, -causal)).tolist()
    assert sorted(both) == sorted(Square(size=size, center=False).offsets().tolist())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Causal(size=8), "must be odd, but 8 is even"),
        (lambda: Causal(size=1), "greater than or equal to 3"),
        (lambda: Square(size=0), "greater than or equal to 1"),
        (lambda: Square(size=3.0), "valid integer"),
        (lambda: Layer(plane="result", template=Causal(size=3), weight=0), "greater than or equal to 1"),
        (lambda: Layer(plane="result", template=Causal(size=3), up=2), "'up' is for the coarse plane"),
    ],
)
def test_impossible_parts_are_refused(make, message):
    with pytest.raises(ValidationError, match=message):
        make()


@given(
    st.sampled_from([Causal(size=3), Causal(size=5), Square(size=3), Square(size=1), Square(size=5, center=False)]),
    st.integers(1, 8), st.integers(1, 8), st.integers(1, 3),
)  # fmt: skip
def test_unfolding_equals_reading_pixel_by_pixel(template, height, width, channels):
    layer = Layer(plane="result", template=template)
    plane = _plane(channels, height, width)
    index = Index.of((layer,), (1,), Planes((plane,)), 0)
    offsets = template.offsets().tolist()
    inside = [
        (row, column)
        for row in range(height)
        for column in range(width)
        if all(0 <= row + dy < height and 0 <= column + dx < width for dy, dx in offsets)
    ]
    assert [divmod(site, width) for site in index.sites.tolist()] == inside
    picture = plane.values.view(height, width, channels)
    for number, (row, column) in enumerate(inside):
        literal = torch.cat([picture[row + dy, column + dx] for dy, dx in offsets])
        assert index.features[0, number].equal(literal)


def test_both_sides_agree_where_the_output_is_the_exemplar():
    layers = (
        Layer(plane="result", template=Causal(size=5)),
        Layer(plane="coarse", template=Square(size=3)),
        Layer(plane="coarse", template=Square(size=3), up=2),
    )
    planes = [_plane(2, 24, 28, seed=1), _plane(2, 12, 14, seed=2), _plane(2, 6, 7, seed=3)]
    index = Index.of(layers, (1, 1, 1), Planes(tuple(planes)), 0)
    cells = to_cells(index.sites, 28)
    for boundary in ("open", "torus"):
        output = [Plane(plane.values, plane.shape, boundary) for plane in planes]
        found = []
        for layer in layers:
            plane = output[layer.steps_up]
            reads = reads_of(layer, plane, cells, None)
            found.append(gather(plane, feature_positions(plane, reads.positions)))
        assert torch.cat(found, 2).equal(index.features)


def test_parents_of_odd_levels_may_be_missing():
    layer = Layer(plane="coarse", template=Square(size=1))
    usable = candidates((layer,), Planes((_plane(1, 5, 7), _plane(1, 2, 3))), 0)
    assert usable.sum() == 4 * 6
    assert not usable[4].any()
    assert not usable[:, 6].any()


def test_invalid_pixels_keep_whole_neighborhoods_away():
    valid = torch.ones(9, 9, dtype=torch.bool)
    valid[4, 4] = False
    layer = Layer(plane="result", template=Causal(size=3))
    usable = candidates((layer,), Planes((_plane(1, 9, 9, valid=valid),)), 0)
    blocked = [(4, 4), (4, 5), (5, 3), (5, 4), (5, 5)]
    everywhere = candidates((layer,), Planes((_plane(1, 9, 9),)), 0)
    assert [tuple(cell) for cell in (everywhere & ~usable).nonzero().tolist()] == blocked


def test_a_template_larger_than_the_plane_has_no_candidates():
    layer = Layer(plane="result", template=Causal(size=9))
    assert not candidates((layer,), Planes((_plane(1, 4, 12),)), 0).any()
    assert not candidates((layer,), Planes((_plane(1, 12, 8),)), 0).any()


def test_layers_above_the_coarsest_level_are_left_out():
    layers = (
        Layer(plane="result", template=Causal(size=3)),
        Layer(plane="coarse", template=Square(size=3)),
        Layer(plane="coarse", template=Square(size=3), up=2),
    )
    assert [len(layers_at(layers, level, 3)) for level in range(3)] == [3, 2, 1]


def test_normalized_weights_are_exact_shares():
    layers = (
        Layer(plane="result", template=Causal(size=3), weight=1),
        Layer(plane="coarse", template=Square(size=3), weight=2),
    )
    assert layer_weights(layers, normalize=False) == (1, 2)
    one, other = layer_weights(layers, normalize=True)
    assert one * 4 * 2 == other * 9


def test_quantizing_is_exact_for_8_bit_values():
    image = (torch.arange(256) / 255).view(1, 1, 16, 16)
    assert quantize(image, torch.float32).flatten().tolist() == list(range(-128, 128))
