"""The main parameters: the few that the function of a recipe takes, of which all its parts follow."""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import TypeAdapter

from torchsynth.config import load_recipe
from torchsynth.recipes import RECIPES
from torchsynth.studio import docstrings
from torchsynth.studio.edits import complete, override
from torchsynth.studio.fields import Field, labeled
from torchsynth.studio.shapes import shape_of


def parameters_of(name: str, values: Mapping[str, Any]) -> tuple[Field, ...]:
    """The parameters of a recipe's function.

    Args:
        name: Of the recipe.
        values: Those that are not as usual.

    Example:
        >>> [(field.path, field.value) for field in parameters_of("wei_levoy", {"levels": 3})]
        [('levels', 3), ('neighborhood', 9), ('parent', 5), ('boundary', 'torus')]
    """
    make = RECIPES[name]
    said = docstrings.arguments(inspect.getdoc(make) or "")
    hints = typing.get_type_hints(make)
    found = []
    for key, parameter in inspect.signature(make).parameters.items():
        node = TypeAdapter(hints[key]).json_schema()
        help_ = said.get(key, "")
        shape = shape_of(node, node.get("$defs", {}))
        if re.search(r"\bodd\b", help_) and shape.control == "integer":
            # The functions leave ranges to the parts: the arrows of a control need to know this one.
            shape = replace(shape, minimum=1, step=2)
        usual = parameter.default
        found.append(Field(key, labeled(key), help_, shape, values.get(key, usual), usual))
    return tuple(found)


def made(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """The recipe that a function makes of its parameters, as plain data.

    Args:
        name: Of the recipe.
        values: Those that are not as usual.

    Raises:
        ConfigError: If they do not fit.

    Example:
        >>> made("wei_levoy", {"neighborhood": 7})["sweeps"][0]["layers"][0]["template"]["size"]
        7
    """
    return complete(load_recipe(name, [override(*one) for one in values.items()]))
