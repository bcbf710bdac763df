"""Example-based texture synthesis: every classic pixel-based algorithm in one batched tensor core.

>>> import torch, torchsynth as ts
>>> exemplar = torch.rand(3, 32, 32)
>>> result = ts.synthesize(exemplar, (48, 48), ts.recipes.wei_levoy(levels=2), seed=1)
>>> tuple(result.image.shape)
(1, 3, 48, 48)
"""

from __future__ import annotations

from torchsynth import field as field
from torchsynth import metrics as metrics
from torchsynth import recipes as recipes
from torchsynth import viz as viz
from torchsynth.accept import Best, WithinTolerance
from torchsynth.analogy import analogy
from torchsynth.codebook import Codebook
from torchsynth.completion import extend, fill, tile
from torchsynth.config import dump_recipe, load_recipe
from torchsynth.controls import Controls
from torchsynth.errors import ConfigError, InputError, OutputError, TorchsynthError
from torchsynth.exemplar import Exemplar
from torchsynth.initial import Noise, RandomSource, SeedPatch
from torchsynth.io import read_image, write_image
from torchsynth.neighborhood import Layer
from torchsynth.patches import GraphCut, Quilting
from torchsynth.recipe import Recipe, Structure
from torchsynth.refining import refine
from torchsynth.result import Level, Result
from torchsynth.schedule import OnionPeel, Scanline, Shuffle, Simultaneous
from torchsynth.search import TSVQ, Coherence, Exhaustive, PreferCoherent
from torchsynth.sweep import Sweep
from torchsynth.synthesis import synthesize
from torchsynth.template import Anticausal, Causal, Square
from torchsynth.training import train

__all__ = [
    "TSVQ",
    "Anticausal",
    "Best",
    "Causal",
    "Codebook",
    "Coherence",
    "ConfigError",
    "Controls",
    "Exemplar",
    "Exhaustive",
    "GraphCut",
    "InputError",
    "Layer",
    "Level",
    "Noise",
    "OnionPeel",
    "OutputError",
    "PreferCoherent",
    "Quilting",
    "RandomSource",
    "Recipe",
    "Result",
    "Scanline",
    "SeedPatch",
    "Shuffle",
    "Simultaneous",
    "Square",
    "Structure",
    "Sweep",
    "TorchsynthError",
    "WithinTolerance",
    "analogy",
    "dump_recipe",
    "extend",
    "field",
    "fill",
    "load_recipe",
    "metrics",
    "read_image",
    "recipes",
    "refine",
    "synthesize",
    "tile",
    "train",
    "viz",
    "write_image",
]
