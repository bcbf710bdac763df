"""Recipes as YAML: reading, writing, overriding, and the JSON schema editors complete from."""

from __future__ import annotations

import copy
import inspect
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ConfigDict, ValidationError, validate_call

from torchsynth import checks
from torchsynth.errors import ConfigError
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES
from torchsynth.yaml_text import (
    YAML_SUFFIXES,
    as_json,
    config_error,
    listed,
    parse_yaml,
    path_text,
    read_yaml,
    suggestion,
)

_STEP = re.compile(r"(?P<key>[^.\[\]]+)|\[(?P<index>\d+)\]")
_PATH = re.compile(r"[^.\[\]]+(\.[^.\[\]]+|\[\d{1,9}\])*")


def load_recipe(source: str | Path, overrides: Sequence[str] = ()) -> Recipe:
    """Read a recipe by its name, or from a YAML file.

    Args:
        source: A name from :data:`torchsynth.recipes.RECIPES`, or the path of a YAML or JSON file.
        overrides: Changes like ``levels=3`` or ``sweeps[0].layers[0].template.size=7``; the part after
            the equals sign is YAML. Of a recipe given by its name, the parameters of its function can be
            set as well: ``neighborhood=7``; they come first.

    Raises:
        ConfigError: If there is no such recipe or file, or if its content is wrong; the message names
            the line of a syntax error and the path of a wrong value.

    Example:
        >>> load_recipe("wei_levoy", ["levels=2", "boundary=open"]).boundary
        'open'
    """
    if str(source) not in RECIPES:
        return parse_recipe(_read(source), str(source), overrides)
    names = set(inspect.signature(RECIPES[str(source)]).parameters)
    parameters = [one for one in overrides if one.partition("=")[0].strip() in names and "=" in one]
    made = _made(str(source), parameters)
    rest = [one for one in overrides if one not in parameters]
    return parse_recipe(made.plain(), str(source), rest)


def parse_recipe(data: object, subject: str, overrides: Sequence[str] = ()) -> Recipe:
    """Make a recipe of plain data, as YAML or JSON gives it.

    Args:
        data: Nested dictionaries and lists.
        subject: Where the data comes from, for messages.
        overrides: As in :func:`torchsynth.load_recipe`.

    Raises:
        ConfigError: If the data is not a recipe.

    Example:
        >>> parse_recipe({"levels": "four"}, "my.yaml")
        Traceback (most recent call last):
        torchsynth.errors.ConfigError: my.yaml: 'levels': input should be a valid integer, ...
    """
    if not isinstance(data, dict):
        raise ConfigError(
            subject, "must be a mapping of recipe fields",
            "it is empty" if data is None else f"it is a {type(data).__name__}",
            "start from the output of 'torchsynth show wei_levoy'",
        )  # fmt: skip
    for override in overrides:
        data = _overridden(data, override)
    try:
        # Through JSON, where a list is the only sequence: so fields can be strict about types.
        return Recipe.model_validate_json(json.dumps(data))
    except ValidationError as error:
        raise config_error(error, data, subject, "the recipe", recipe_schema) from None
    except (TypeError, ValueError, RecursionError) as error:  # dates, aliases that lead in a circle
        raise ConfigError(
            subject, "must hold plain numbers, texts and lists", str(error), "write it as plain YAML"
        ) from None


def dump_recipe(recipe: Recipe) -> str:
    """A recipe as YAML that :func:`torchsynth.load_recipe` reads back to an equal value.

    Example:
        >>> from torchsynth import recipes
        >>> print(dump_recipe(recipes.wei_levoy_single()).splitlines()[0])
        name: wei_levoy_single
    """
    return yaml.dump(recipe.plain(), Dumper=_Dumper, sort_keys=False, width=100)


def recipe_schema() -> dict[str, Any]:
    """The JSON schema of a recipe file, for editors that check YAML while it is typed.

    Example:
        >>> recipe_schema()["title"]
        'Recipe'
    """
    schema = Recipe.model_json_schema()
    # A recipe may hold another, so it is defined among the parts: its own definition goes to the top.
    whole: dict[str, Any] = schema["$defs"]["Recipe"] | {"$defs": schema["$defs"]}
    return whole


class _Dumper(yaml.SafeDumper):
    """Short mappings, such as a template, on one line; everything that holds lists in blocks."""


def _represent_mapping(dumper: yaml.SafeDumper, mapping: dict[str, object]) -> yaml.MappingNode:
    flat = "kind" in mapping and all(isinstance(value, str | int | float) for value in mapping.values())
    return dumper.represent_mapping("tag:yaml.org,2002:map", mapping, flow_style=flat)


def _represent_list(dumper: yaml.SafeDumper, items: list[object]) -> yaml.SequenceNode:
    flat = all(item is None or isinstance(item, int) for item in items)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=flat)


_Dumper.add_representer(dict, _represent_mapping)
_Dumper.add_representer(list, _represent_list)


def _made(name: str, parameters: Sequence[str]) -> Recipe:
    """The recipe that a function makes of the given parameters."""
    make = validate_call(config=ConfigDict(strict=True))(RECIPES[name])
    values = {}
    for parameter in parameters:
        key, _, text = parameter.partition("=")
        values[key.strip()] = parse_yaml(text, f"--set {parameter}")
    try:
        return make(**values)
    except ValidationError as error:
        problem = error.errors()[0]
        said = problem["msg"].removeprefix("Value error, ")
        expectation, _, fact = f"{said[0].lower()}{said[1:]}".partition(", but ")
        raise ConfigError(
            f"{name}: {', '.join(parameters)}", f"must suit the recipe: {expectation}",
            fact or f"it is {checks.shortened(problem['input'], as_json)}", "change it",
        ) from None  # fmt: skip


def _read(source: str | Path) -> object:
    if Path(source).suffix.lower() not in YAML_SUFFIXES:
        raise ConfigError(
            str(source), f"must be one of the recipes {listed(RECIPES)}, or a .yaml file",
            "there is no such recipe", suggestion(str(source), RECIPES),
        )  # fmt: skip
    return read_yaml(Path(source))


def _overridden(data: dict[str, Any], override: str) -> dict[str, Any]:
    """The data with one ``path=value`` applied; the original stays as it is."""
    subject = f"--set {override}"
    path, equals, text = override.partition("=")
    if not equals or _PATH.fullmatch(path.strip()) is None:
        raise ConfigError(subject, "must look like path=value", "it does not", "write e.g. --set levels=3")
    steps = [
        match["key"] if match["index"] is None else int(match["index"])
        for match in _STEP.finditer(path.strip())
    ]
    value = parse_yaml(text, subject)
    changed = copy.deepcopy(data)
    place: Any = changed
    for done, step in enumerate(steps, start=1):
        last = done == len(steps)
        known = range(len(place)) if isinstance(place, list) else place
        fits = isinstance(place, list) == isinstance(step, int) and isinstance(place, list | dict)
        # The last step may be new: a field that has its default is not in the data.
        if not fits or (step not in known and not (last and isinstance(place, dict))):
            raise ConfigError(
                subject, "the path must exist in the recipe", f"there is no {path_text(steps[:done])!r}",
                "look the path up with 'torchsynth show RECIPE'",
            )  # fmt: skip
        if last:
            place[step] = value
        else:
            place = place[step]
    return changed
