"""The public surface, and what importing it costs."""

from __future__ import annotations

import pickle

import pytest
import torch
from pydantic import ValidationError

import torchsynth as ts

SURFACE = [
    "Anticausal", "analogy", "Best", "Causal", "Codebook", "Coherence", "ConfigError", "Controls", "Exemplar", "Exhaustive", "GraphCut", "InputError", "Layer", "Level",
    "Noise", "OnionPeel", "OutputError", "PreferCoherent", "Quilting", "RandomSource", "Recipe", "Result", "Scanline", "SeedPatch", "Shuffle", "Simultaneous", "Square", "Structure", "Sweep",
    "TSVQ", "TorchsynthError", "WithinTolerance", "dump_recipe", "extend", "field", "fill", "load_recipe", "metrics", "read_image", "recipes", "refine", "synthesize",
    "tile", "train", "viz", "write_image",
]  # fmt: skip


def test_public_names():
    assert sorted(ts.__all__) == sorted(SURFACE)
    assert all(hasattr(ts, name) for name in SURFACE)


def test_every_recipe_has_a_name_a_description_and_a_docstring():
    for name, make in ts.recipes.RECIPES.items():
        assert make().name == name == make.__name__
        assert make().description
        assert "Source:" in make.__doc__


def test_parts_are_frozen():
    with pytest.raises(ValidationError, match="frozen"):
        ts.recipes.wei_levoy().levels = 2


@pytest.mark.parametrize("kind", [ts.InputError, ts.ConfigError, ts.OutputError])
def test_errors_survive_pickling(kind):
    error = kind("size", "must be small", "it is large", "shrink it")
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 (made here)
    assert type(again) is kind
    assert str(again) == "size: must be small, but it is large; shrink it"


def test_results_survive_pickling():
    result = ts.synthesize(torch.rand(1, 10, 10), (5, 5), ts.recipes.wei_levoy_single(neighborhood=3))
    again = pickle.loads(pickle.dumps(result))  # noqa: S301 (made here)
    assert again.image.equal(result.image)
    assert again.recipe == result.recipe
