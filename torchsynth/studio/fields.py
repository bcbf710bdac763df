"""The fields of a form: every value of a recipe with what it may be, made of the recipe's schema."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from torchsynth.studio import docstrings
from torchsynth.studio.shapes import Node, Shape, schema, shape_of

_INTEGER = re.compile(r"[+-]?\d+")


@dataclass(frozen=True)
class Field:
    """One value of a recipe, and all that a form needs to show and to change it.

    Args:
        path: Where it is, as in ``--set``: ``sweeps[0].layers[1].template.size``.
        label: What it is called.
        help: What it does, from the documentation of the part that it belongs to.
        shape: What it may hold.
        value: What it holds, as plain data.
        default: What it holds if it is not given; None as well where it has to be given.
        required: Whether it has to be given.
        children: The fields of a part, the items of a list, the places of a span.
    """

    path: str
    label: str
    help: str
    shape: Shape
    value: Any
    default: Any = None
    required: bool = False
    children: tuple[Field, ...] = ()

    @property
    def name(self) -> str:
        """The last step of its path, without the number of an item.

        Example:
            >>> field_at({"levels": 1, "sweeps": [{"layers": []}]}, "sweeps[0]").name
            'sweeps'
        """
        return self.path.rpartition(".")[2].partition("[")[0]

    @property
    def kind(self) -> str:
        """Which kind of part it is; nothing where there is but one, or no part."""
        return self.value.get("kind", "") if isinstance(self.value, Mapping) else ""

    def walk(self) -> Iterator[Field]:
        """The field itself and all that are inside it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def child(self, name: str) -> Field:
        """The field of that name in a part."""
        return next(child for child in self.children if child.name == name)


def fields_of(recipe: Mapping[str, Any], whole: Node | None = None) -> tuple[Field, ...]:
    """All fields of a recipe, those of its parts inside them.

    Args:
        recipe: As plain data.
        whole: The schema; the one of recipes if it is not given.

    Example:
        >>> from torchsynth import recipes
        >>> data = recipes.wei_levoy().model_dump(mode="json")
        >>> [field.path for field in fields_of(data)][:3]
        ['name', 'description', 'levels']
        >>> field = field_at(data, "sweeps[0].layers[1].template.size")
        >>> field.value, field.shape.control, field.shape.step
        (5, 'integer', 2)
    """
    whole = whole or schema()
    return _of_part(whole, recipe, "", whole["$defs"])


def field_at(recipe: Mapping[str, Any], path: str) -> Field:
    """The field at a path.

    Raises:
        KeyError: If the recipe has no such field.
    """
    for top in fields_of(recipe):
        for field in top.walk():
            if field.path == path:
                return field
    raise KeyError(path)


def read(field: Field, text: str) -> object:
    """The value that stands for a text somebody typed; what cannot be read stays as it is.

    Args:
        field: What it was typed for: a whole number, several of them, or a word.
        text: What was typed; nothing, or what stands for it, means null.

    Example:
        >>> field = field_at({"levels": 3, "sweeps": [{"layers": []}]}, "sweeps[0].levels")
        >>> read(field, "0, 2"), read(field, "finer"), read(field, written(field))
        ([0, 2], 'finer', None)
    """
    text = text.strip()
    if field.shape.optional and text in ("", docstrings.unset(field.help)):
        return None
    pieces = [piece.strip() for piece in text.strip("[]()").split(",") if piece.strip()]
    if text in field.shape.words or not pieces or not all(map(_INTEGER.fullmatch, pieces)):
        return text
    numbers = [int(piece) for piece in pieces]
    alone = field.shape.control == "integer" or field.shape.single
    return numbers[0] if alone and len(numbers) == 1 else numbers


def written(field: Field) -> str:
    """The text that :func:`read` reads back as the field's value."""
    if field.value is None:
        return docstrings.unset(field.help)
    return ", ".join(map(str, field.value)) if isinstance(field.value, list) else str(field.value)


def labeled(name: str) -> str:
    """A field's name as a label.

    Example:
        >>> labeled("blur_seams")
        'Blur seams'
    """
    return name.replace("_", " ").capitalize()


def _of_part(definition: Node, data: Mapping[str, Any], path: str, parts: Node) -> tuple[Field, ...]:
    said = docstrings.arguments(definition.get("description", ""))
    required = definition.get("required", [])
    found = []
    for name, node in definition["properties"].items():
        if name == "kind":
            continue  # it is the value of the part as a whole
        default = node.get("default")
        place = f"{path}.{name}" if path else name
        field = _field(place, labeled(name), said.get(name, ""), node, data.get(name, default), parts)
        found.append(replace(field, default=default, required=name in required))
    return tuple(found)


def _field(path: str, label: str, said: str, node: Node, value: Any, parts: Node) -> Field:  # noqa: ANN401 (any value)
    shape = shape_of(node, parts)
    return Field(path, label, said, shape, value, children=_children(path, label, shape, value, parts))


def _children(path: str, label: str, shape: Shape, value: Any, parts: Node) -> tuple[Field, ...]:  # noqa: ANN401 (any value)
    if value is None or isinstance(value, str):
        return ()
    match shape.control:
        case "kind":
            return _of_part(shape.kinds[value["kind"]], value, path, parts)
        case "part":
            return _of_part(shape.kinds[""], value, path, parts)
        case "list":
            one = label.removesuffix("s")
            return tuple(
                _field(f"{path}[{number}]", f"{one} {number + 1}", "", shape.items[0], item, parts)
                for number, item in enumerate(value)
            )
        case "span":
            return tuple(
                _field(f"{path}[{number}]", name, "", node, item, parts)
                for number, (name, node, item) in enumerate(zip(_ENDS, shape.items, value, strict=True))
            )
        case _:
            return ()


_ENDS = ("From", "To")
"""What the two places of a span are called."""
