"""Recipes as YAML: reading, writing, overriding, and the JSON schema editors complete from."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from torchsynth.errors import ConfigError
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES

_SUFFIXES = (".yaml", ".yml", ".json")
_STEP = re.compile(r"(?P<key>[^.\[\]]+)|\[(?P<index>\d+)\]")


def load_recipe(source: str | Path, overrides: Sequence[str] = ()) -> Recipe:
    """Read a recipe by its name, or from a YAML file.

    Args:
        source: A name from :data:`torchsynth.recipes.RECIPES`, or the path of a YAML or JSON file.
        overrides: Changes like ``levels=3`` or ``sweeps[0].layers[0].template.size=7``; the part after
            the equals sign is YAML.

    Raises:
        ConfigError: If there is no such recipe or file, or if its content is wrong; the message names
            the line of a syntax error and the path of a wrong value.

    Example:
        >>> load_recipe("wei_levoy", ["levels=2", "boundary=open"]).boundary
        'open'
    """
    return parse_recipe(_read(source), str(source), overrides)


def parse_recipe(data: object, subject: str, overrides: Sequence[str] = ()) -> Recipe:
    """Make a recipe of plain data, as YAML or JSON gives it.

    Args:
        data: Nested dictionaries and lists.
        subject: Where the data comes from, for messages.
        overrides: As in :func:`load_recipe`.

    Raises:
        ConfigError: If the data is not a recipe.

    Example:
        >>> parse_recipe({"levels": "four"}, "my.yaml")
        Traceback (most recent call last):
        torchsynth.errors.ConfigError: my.yaml: 'levels': input should be a valid integer, ...
    """
    if not isinstance(data, dict):
        raise ConfigError(
            subject, "must be a mapping of recipe fields", f"it is a {type(data).__name__}",
            "start from the output of 'torchsynth show wei_levoy'",
        )  # fmt: skip
    for override in overrides:
        data = _overridden(data, override)
    try:
        # Through JSON, where a list is the only sequence: so fields can be strict about types.
        return Recipe.model_validate_json(json.dumps(data))
    except ValidationError as error:
        raise _config_error(error, data, subject) from None
    except TypeError as error:
        raise ConfigError(
            subject, "must hold plain numbers, texts and lists", str(error), "write it as plain YAML"
        ) from None


def dump_recipe(recipe: Recipe) -> str:
    """A recipe as YAML that :func:`load_recipe` reads back to an equal value.

    Example:
        >>> from torchsynth import recipes
        >>> print(dump_recipe(recipes.wei_levoy_single()).splitlines()[0])
        name: wei_levoy_single
    """
    return yaml.dump(
        recipe.model_dump(mode="json", exclude_none=True), Dumper=_Dumper, sort_keys=False, width=100
    )


def recipe_schema() -> dict[str, Any]:
    """The JSON schema of a recipe file, for editors that check YAML while it is typed.

    Example:
        >>> recipe_schema()["title"]
        'Recipe'
    """
    return Recipe.model_json_schema()


class _Loader(yaml.SafeLoader):
    """A safe loader that refuses to see the same key twice: YAML would silently keep the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key!r} is there twice", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Short mappings, such as a template, on one line; everything that holds lists in blocks."""

    def represent_mapping(self, tag: str, mapping: Any, flow_style: bool | None = None) -> yaml.MappingNode:
        values = mapping.values() if isinstance(mapping, dict) else ()
        flat = "kind" in mapping and all(isinstance(value, str | int | float) for value in values)
        return super().represent_mapping(tag, mapping, flow_style=flat)


def _read(source: str | Path) -> object:
    path = Path(source)
    if path.suffix.lower() not in _SUFFIXES:
        if str(source) not in RECIPES:
            raise ConfigError(
                str(source), f"must be one of the recipes {_listed(RECIPES)}, or a .yaml file",
                "there is no such recipe", _suggestion(str(source), RECIPES),
            )  # fmt: skip
        return RECIPES[str(source)]().model_dump(mode="json", exclude_none=True)
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)  # noqa: S506 (a SafeLoader)
    except OSError as error:
        raise ConfigError(
            str(path), "must be a readable file", str(error.strerror).lower(), "check the path"
        ) from None
    except UnicodeDecodeError:
        raise ConfigError(
            str(path), "must be UTF-8 text", "it is not", "is this the recipe, or a picture?"
        ) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = getattr(error, "problem", None) or "it cannot be read"
        raise ConfigError(str(path), "must be valid YAML", f"{where}{problem}", "correct that line") from None


def _overridden(data: dict[str, Any], override: str) -> dict[str, Any]:
    """The data with one ``path=value`` applied; the original stays as it is."""
    path, equals, text = override.partition("=")
    steps = [
        match["key"] if match["index"] is None else int(match["index"]) for match in _STEP.finditer(path)
    ]
    if not equals or not steps:
        raise ConfigError(
            f"--set {override}", "must look like path=value", "it does not",
            "write e.g. --set levels=3",
        )  # fmt: skip
    try:
        value = yaml.load(text, Loader=_Loader)  # noqa: S506 (a SafeLoader)
    except yaml.YAMLError:
        raise ConfigError(
            f"--set {override}", "the value must be YAML", f"{text!r} is not", "quote it"
        ) from None
    changed: dict[str, Any] = json.loads(json.dumps(data))
    place: Any = changed
    for done, step in enumerate(steps):
        last = done == len(steps) - 1
        known = range(len(place)) if isinstance(place, list) else place
        fits = isinstance(place, list) == isinstance(step, int) and isinstance(place, list | dict)
        if not fits or (step not in known and not (last and isinstance(place, dict))):
            raise ConfigError(
                f"--set {override}", "the path must exist in the recipe",
                f"there is no {_path(steps[: done + 1])!r}",
                "look the path up with 'torchsynth show RECIPE'",
            )  # fmt: skip
        if last:
            place[step] = value
        else:
            place = place[step]
    return changed


def _config_error(error: ValidationError, data: object, subject: str) -> ConfigError:
    """The first problem pydantic found, in the words of this library."""
    problem = error.errors()[0]
    path = _data_path(problem["loc"], data)
    where = f"{_path(path)!r}" if path else "the recipe"
    if problem["type"] == "extra_forbidden":
        return ConfigError(
            subject, f"{where} must be a known field", "there is no such field",
            _suggestion(str(path[-1]), _known_fields()),
        )  # fmt: skip
    if problem["type"] == "missing":
        return ConfigError(subject, f"{where} is required", "it is missing", "add it")
    message = problem["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    if problem["type"] == "value_error":
        expectation, _, fact = message.partition(", but ")
        return ConfigError(subject, f"{where}: {expectation}", fact or "this does not", "change it")
    return ConfigError(subject, f"{where}: {message}", f"it is {json.dumps(problem['input'])}", "change it")


def _data_path(loc: Sequence[int | str], data: object) -> list[int | str]:
    """The place of a problem in the user's data: pydantic also names the chosen kind, which is not."""
    path: list[int | str] = []
    for number, step in enumerate(loc):
        inside = isinstance(data, dict) and step in data
        if isinstance(data, dict) and not inside and data.get("kind") == step:
            continue
        path.append(step)
        if inside or (isinstance(data, list) and isinstance(step, int) and step < len(data)):
            data = data[step]  # type: ignore[index]
        elif number < len(loc) - 1:
            data = None
    return path


def _known_fields() -> list[str]:
    """All field names of a recipe and its parts."""
    schema = recipe_schema()
    parts = (schema, *schema["$defs"].values())
    return sorted({field for part in parts for field in part.get("properties", {})})


def _path(steps: Iterable[int | str]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)
    return text.removeprefix(".")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


def _suggestion(word: str, names: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(names), n=1)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {_listed(names)}"
