"""The shapes of values: what a place in a JSON schema allows, in the few kinds that a form can edit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, TypeAlias

from torchsynth.config import recipe_schema

Node: TypeAlias = Mapping[str, Any]
"""A JSON schema, or a place in one."""

Control: TypeAlias = Literal[
    "integer", "number", "integers", "choice", "switch", "text", "kind", "part", "list", "span"
]
"""How a value is edited: ``integers`` is a list of them, ``span`` a fixed number of values, ``kind`` a part
that is one of several, and ``part`` one that is always of the same."""


@dataclass(frozen=True)
class Shape:
    """What one place of a recipe may hold.

    Args:
        control: How it is edited.
        optional: Whether it may be null.
        words: The words that it may be: all of a choice; or those that stand for a number, as ``auto``.
        minimum: The smallest number, or None.
        maximum: The largest number, or None.
        step: By how much neighboring numbers differ; 2 for odd ones.
        single: Of ``integers``: whether one of them may stand alone.
        kinds: The definition of each kind of part; of a ``part`` there is one, without a name.
        items: What the places of a ``span`` hold, or each item of a ``list``.
        fewest: The fewest items of a list.
    """

    control: Control
    optional: bool = False
    words: tuple[str, ...] = ()
    minimum: int | float | None = None
    maximum: int | float | None = None
    step: int | None = None
    single: bool = False
    kinds: Mapping[str, Node] = field(default_factory=dict)
    items: tuple[Node, ...] = ()
    fewest: int = 0


@cache
def schema() -> Node:
    """The schema of recipes; to be read only."""
    return recipe_schema()


def shape_of(node: Node, parts: Node) -> Shape:
    """What a place of a schema allows.

    Args:
        node: The place.
        parts: The definitions that the schema refers to, by name.

    Raises:
        TypeError: If a form cannot edit such a value.

    Example:
        >>> shape_of({"anyOf": [{"type": "integer", "minimum": 1}, {"type": "null"}]}, {})
        Shape(control='integer', optional=True, ..., minimum=1, ...)
    """
    allowed = list(_alternatives(node))
    optional = any(one.get("type") == "null" for one in allowed)
    words = tuple(word for one in allowed for word in _words(one))
    rest = [one for one in allowed if one.get("type") != "null" and not _words(one)]
    references = [one for one in rest if "$ref" in one]
    if references:
        return _shape_of_parts([_definition(one, parts) for one in references], optional)
    if not rest:
        return Shape("choice", optional, words)
    types = {str(one["type"]) for one in rest}
    listed = next((one for one in rest if one["type"] == "array"), None)
    if listed is None and len(rest) == 1:
        return _shape_of_value(rest[0], optional, words)
    if listed is None or not types <= {"array", "integer"}:
        raise TypeError(f"a form cannot edit {dict(node)}")
    return _shape_of_array(listed, optional, words, single="integer" in types)


def _alternatives(node: Node) -> Iterator[Node]:
    """What a place may hold, one after another; unions may stand in unions."""
    inside = node.get("anyOf") or node.get("oneOf")
    if inside is None:
        yield node
        return
    for one in inside:
        yield from _alternatives(one)


def _words(node: Node) -> tuple[str, ...]:
    return tuple(node.get("enum", [node["const"]] if "const" in node else []))


def _definition(node: Node, parts: Node) -> Node:
    found: Node = parts[node["$ref"].rpartition("/")[2]]
    return found


def _shape_of_parts(definitions: list[Node], optional: bool) -> Shape:
    if len(definitions) == 1 and "kind" not in definitions[0]["properties"]:
        return Shape("part", optional, kinds={"": definitions[0]})
    kinds = {definition["properties"]["kind"]["const"]: definition for definition in definitions}
    return Shape("kind", optional, tuple(kinds), kinds=kinds)


def _shape_of_value(node: Node, optional: bool, words: tuple[str, ...]) -> Shape:
    match node["type"]:
        case "boolean":
            return Shape("switch", optional, words)
        case "string":
            return Shape("text", optional, words, fewest=node.get("minLength", 0))
        case "integer":
            least, most = _range(node, nearest=1)
            odd = node.get("not") == {"multipleOf": 2}
            return Shape("integer", optional, words, least, most, 2 if odd else 1)
        case _:
            least, most = _range(node, nearest=0)
            return Shape("number", optional, words, least, most)


def _range(node: Node, nearest: int) -> tuple[int | float | None, int | float | None]:
    """The bounds of a number; one that is excluded leaves its neighbor, among whole numbers."""
    # A bound that is put on a validated type keeps its name of the Python side in pydantic's schema.
    least = [node[name] for name in ("minimum", "ge") if name in node]
    least += [node["exclusiveMinimum"] + nearest] if "exclusiveMinimum" in node else []
    most = [node[name] for name in ("maximum", "le") if name in node]
    most += [node["exclusiveMaximum"] - nearest] if "exclusiveMaximum" in node else []
    return max(least, default=None), min(most, default=None)


def _shape_of_array(node: Node, optional: bool, words: tuple[str, ...], single: bool) -> Shape:
    if "prefixItems" in node:
        return Shape("span", optional, words, items=tuple(node["prefixItems"]))
    items, fewest = node["items"], node.get("minItems", 0)
    if "$ref" in items:
        return Shape("list", optional, words, items=(items,), fewest=fewest)
    return Shape("integers", optional, words, single=single, fewest=fewest)
