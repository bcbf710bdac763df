"""YAML files read strictly, and what pydantic finds in them said in the words of this library."""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from torchsynth import checks
from torchsynth.errors import ConfigError

YAML_SUFFIXES = (".yaml", ".yml", ".json")
"""What such files end in; JSON is YAML, too."""


def read_yaml(path: Path, name: str | None = None) -> object:
    """Plain data from a file.

    Args:
        path: The file.
        name: What messages call it; None means by its path.

    Raises:
        ConfigError: If the file cannot be read, or is not valid YAML; the message names the line.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder, "sizes.yaml")
        ...     _ = path.write_text("sizes: [8x8]")
        ...     read_yaml(path)
        {'sizes': ['8x8']}
    """
    name = name or str(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        fact = f"the system says: {(error.strerror or str(error)).lower()}"
        raise ConfigError(name, "must be a readable file", fact, "check the path") from None
    except UnicodeDecodeError:
        raise ConfigError(name, "must be UTF-8 text", "it is not", "is this YAML, or a picture?") from None
    return parse_yaml(text, name)


def parse_yaml(text: str, subject: str) -> object:
    """Plain data from YAML text in which no key may be there twice: YAML would silently keep the last.

    Args:
        text: The text.
        subject: Where it comes from, for messages.

    Raises:
        ConfigError: If it is not valid YAML.

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


def config_error(
    error: ValidationError, data: object, subject: str, whole: str, schema: Callable[[], dict[str, Any]]
) -> ConfigError:
    """The most telling problem pydantic found, in the words of this library.

    Args:
        error: What pydantic found.
        data: In this.
        subject: Where that comes from.
        whole: What it should have been, such as ``the recipe``.
        schema: Makes its JSON schema, for suggestions.
    """
    # A misspelt field is missing under its right name too: the misspelling says more.
    problem = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    path = _data_path(problem["loc"], data)
    kind, context = problem["type"], problem.get("ctx", {})
    if kind.startswith("union_tag"):
        path = [*path, "kind"]
    where = f"{path_text(path)!r}" if path else whole
    message = problem["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    match kind:
        case "extra_forbidden":
            expectation, fact = f"{where} must be a known field", "there is no such field"
            remedy = suggestion(str(path[-1]), _fields_at(path[:-1], data, schema()))
        case "missing" | "union_tag_not_found":
            expectation, fact, remedy = f"{where} is required", "it is missing", "add it"
        case "union_tag_invalid":
            kinds = str(context["expected_tags"]).replace("'", "")
            expectation, fact = f"{where} must be one of {kinds}", f"it is {context['tag']!r}"
            remedy = suggestion(str(context["tag"]), kinds.split(", "))
        case "value_error":
            expectation, but, fact = message.partition(", but ")
            expectation = f"{where}: {expectation}" if but else f"{where} must fit together"
            fact, remedy = fact or message, "change it"
        case "too_short":
            expectation, fact = f"{where} must have {context['min_length']} or more", "there is none"
            remedy = "add one"
        case "tuple_type":
            expectation, remedy = f"{where} must be a list", "write it in brackets: [...]"
            fact = f"it is {checks.shortened(problem['input'], as_json)}"
        case _:
            fact = f"it is {checks.shortened(problem['input'], as_json)}"
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


def _fields_at(path: Sequence[int | str], data: Any, schema: dict[str, Any]) -> list[str]:  # noqa: ANN401 (any YAML)
    """The fields of the whole, or of the part at a path in it."""
    parts, part = schema.get("$defs", {}), schema
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


def path_text(steps: Iterable[int | str]) -> str:
    """A path into nested data, as it is written.

    Example:
        >>> path_text(["sweeps", 0, "search"])
        'sweeps[0].search'
    """
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)
    return text.removeprefix(".")


def listed(names: Iterable[str]) -> str:
    """Names in alphabetical order.

    Example:
        >>> listed({"b": 1, "a": 2})
        'a, b'
    """
    return ", ".join(sorted(names))


def suggestion(word: str, names: Iterable[str]) -> str:
    """The name that may have been meant, or all there are.

    Example:
        >>> suggestion("sedds", ["seeds", "sizes"])
        "did you mean 'seeds'?"
    """
    close = difflib.get_close_matches(word, list(names), n=1)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {listed(names)}"


def as_json(value: object) -> str:
    """Any plain value on one line.

    Example:
        >>> as_json([1, "a"])
        '[1, "a"]'
    """
    return json.dumps(value, default=str)  # YAML knows dates as well
