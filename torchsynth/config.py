"""Recipes as YAML: reading, writing, overriding, and the JSON schema editors complete from."""

from __future__ import annotations

import copy
import difflib
import inspect
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ConfigDict, ValidationError, validate_call

from torchsynth import checks
from torchsynth.errors import ConfigError
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES

_SUFFIXES = (".yaml", ".yml", ".json")
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
    return parse_recipe(made.model_dump(mode="json", exclude_none=True), str(source), rest)


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
        raise _config_error(error, data, subject) from None
    except (TypeError, ValueError, RecursionError) as error:  # dates, aliases that lead in a circle
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
            fact or f"it is {checks.shortened(problem['input'], _as_json)}", "change it",
        ) from None  # fmt: skip


def _as_json(value: object) -> str:
    return json.dumps(value, default=str)  # YAML knows dates as well


def _read(source: str | Path) -> object:
    path = Path(source)
    if path.suffix.lower() not in _SUFFIXES:
        raise ConfigError(
            str(source), f"must be one of the recipes {_listed(RECIPES)}, or a .yaml file",
            "there is no such recipe", _suggestion(str(source), RECIPES),
        )  # fmt: skip
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        fact = f"the system says: {(error.strerror or str(error)).lower()}"
        raise ConfigError(str(path), "must be a readable file", fact, "check the path") from None
    except UnicodeDecodeError:
        raise ConfigError(
            str(path), "must be UTF-8 text", "it is not", "is this the recipe, or a picture?"
        ) from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, subject: str) -> object:
    """Plain data from YAML text in which no key may be there twice: YAML would silently keep the last.

    Args:
        text: The YAML.
        subject: Where it comes from, for messages.

    Raises:
        ConfigError: If it is not valid; the message names the line.

    Example:
        >>> parse_yaml("levels: 3", "my.yaml")
        {'levels': 3}
    """
    try:
        _refuse_duplicates(yaml.compose(text, Loader=yaml.SafeLoader))
        return yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        fact = f"{where}{(error.problem or str(error.context)).removeprefix('but ').replace(', but', ',')}"
    except yaml.reader.ReaderError as error:
        fact = f"line {text.count(chr(10), 0, error.position) + 1}: {error.reason}"
    except RecursionError:
        fact = "it is nested too deeply"
    except ValueError as error:  # a date or a number that looks like one but is none
        fact = str(error)
    raise ConfigError(subject, "must be valid YAML", fact, "correct that line")


def _refuse_duplicates(root: yaml.Node | None) -> None:
    """Look through the whole document once; an alias may lead back to where one has been."""
    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, yaml.CollectionNode):
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            waiting.extend(node.value)
            continue
        keys: set[str] = set()
        for key, value in node.value:
            waiting.extend((key, value))
            if isinstance(key, yaml.ScalarNode) and key.value in keys:
                problem = f"the key {key.value!r} is there twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            keys.add(str(key.value))


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
                subject, "the path must exist in the recipe", f"there is no {_path(steps[:done])!r}",
                "look the path up with 'torchsynth show RECIPE'",
            )  # fmt: skip
        if last:
            place[step] = value
        else:
            place = place[step]
    return changed


def _config_error(error: ValidationError, data: object, subject: str) -> ConfigError:
    """The most telling problem pydantic found, in the words of this library."""
    # A misspelt field is missing under its right name too: the misspelling says more.
    problem = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    path = _data_path(problem["loc"], data)
    kind, context = problem["type"], problem.get("ctx", {})
    if kind.startswith("union_tag"):
        path = [*path, "kind"]
    where = f"{_path(path)!r}" if path else "the recipe"
    message = problem["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    match kind:
        case "extra_forbidden":
            expectation, fact = f"{where} must be a known field", "there is no such field"
            remedy = _suggestion(str(path[-1]), _fields_at(path[:-1], data))
        case "missing" | "union_tag_not_found":
            expectation, fact, remedy = f"{where} is required", "it is missing", "add it"
        case "union_tag_invalid":
            kinds = str(context["expected_tags"]).replace("'", "")
            expectation, fact = f"{where} must be one of {kinds}", f"it is {context['tag']!r}"
            remedy = _suggestion(str(context["tag"]), kinds.split(", "))
        case "value_error":
            expectation, but, fact = message.partition(", but ")
            expectation = f"{where}: {expectation}" if but else f"{where} must fit together"
            fact, remedy = fact or message, "change it"
        case "too_short":
            expectation, fact = f"{where} must have {context['min_length']} or more", "there is none"
            remedy = "add one"
        case _:
            fact = f"it is {checks.shortened(problem['input'], _as_json)}"
            expectation, remedy = f"{where}: {message}", "change it"
    return ConfigError(subject, expectation, fact, remedy)


def _data_path(loc: Sequence[int | str], data: object) -> list[int | str]:
    """The place of a problem in the user's data: pydantic also names the chosen kind or type, which is not."""
    path: list[int | str] = []
    for number, step in enumerate(loc):
        if isinstance(data, str | int | float):
            break
        inside = isinstance(data, dict) and step in data
        if isinstance(data, dict) and not inside and data.get("kind") == step:
            continue
        path.append(step)
        if inside or (isinstance(data, list) and isinstance(step, int) and step < len(data)):
            data = data[step]  # type: ignore[index]
        elif number < len(loc) - 1:
            data = None
    return path


def _fields_at(path: Sequence[int | str], data: Any) -> list[str]:  # noqa: ANN401 (any YAML)
    """The fields of the recipe, or of the part at a path in it."""
    schema = recipe_schema()
    parts, part = schema["$defs"], schema
    for step in path:
        place = part["items"] if isinstance(step, int) else part["properties"][step]
        data = data[step]
        choices = place.get("oneOf") or place.get("anyOf") or [place]
        choices = [one for choice in choices for one in choice.get("oneOf", [choice])]
        named = [parts[choice["$ref"].split("/")[-1]] if "$ref" in choice else choice for choice in choices]
        kind = data.get("kind") if isinstance(data, dict) else None
        matching = [one for one in named if one.get("properties", {}).get("kind", {}).get("const") == kind]
        part = (matching or named)[0]
    return sorted(part["properties"])


def _path(steps: Iterable[int | str]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)
    return text.removeprefix(".")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


def _suggestion(word: str, names: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(names), n=1)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {_listed(names)}"
