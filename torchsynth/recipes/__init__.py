"""The recipes: one short function for each published algorithm, in terms of the library's parts."""

from __future__ import annotations

from collections.abc import Callable

from torchsynth.following import further_pass, with_target
from torchsynth.recipe import Recipe
from torchsynth.recipes.analogy import analogy
from torchsynth.recipes.causal import wei_levoy, wei_levoy_single, wei_levoy_tsvq
from torchsynth.recipes.coherent import ashikhmin, ashikhmin_multires, ashikhmin_target
from torchsynth.recipes.filling import coherent_fill, efros_leung, wei_levoy_fill
from torchsynth.recipes.improved import improved_wl
from torchsynth.recipes.patches import graphcut, quilting, quilting_transfer
from torchsynth.recipes.symmetric import distorted, random_order

RECIPES: dict[str, Callable[[], Recipe]] = {
    "efros_leung": efros_leung,
    "wei_levoy": wei_levoy,
    "wei_levoy_single": wei_levoy_single,
    "wei_levoy_tsvq": wei_levoy_tsvq,
    "wei_levoy_fill": wei_levoy_fill,
    "ashikhmin": ashikhmin,
    "ashikhmin_multires": ashikhmin_multires,
    "ashikhmin_target": ashikhmin_target,
    "coherent_fill": coherent_fill,
    "random_order": random_order,
    "distorted": distorted,
    "improved_wl": improved_wl,
    "analogy": analogy,
    "quilting": quilting,
    "quilting_transfer": quilting_transfer,
    "graphcut": graphcut,
}
"""The recipes by name, with their default parameters."""

__all__ = [
    "RECIPES",
    "analogy",
    "ashikhmin",
    "ashikhmin_multires",
    "ashikhmin_target",
    "coherent_fill",
    "distorted",
    "efros_leung",
    "further_pass",
    "graphcut",
    "improved_wl",
    "quilting",
    "quilting_transfer",
    "random_order",
    "wei_levoy",
    "wei_levoy_fill",
    "wei_levoy_single",
    "wei_levoy_tsvq",
    "with_target",
]
