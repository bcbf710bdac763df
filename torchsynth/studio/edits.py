"""Editing a recipe that is plain data: each verb gives a new recipe, complete and checked, or an error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import yaml

from torchsynth.config import parse_recipe
from torchsynth.errors import ConfigError
from torchsynth.recipe import Recipe
from torchsynth.recipes import improved_wl
from torchsynth.studio.fields import field_at
from torchsynth.studio.shapes import Node, schema, shape_of

_SUBJECT = "recipe"
_FIRST: Mapping[str, Any] = {"levels": 1, "size": 5, "kappa": 0.5}
"""What a new part begins with where it needs a value, has no usual one, and finds none around it."""


def complete(recipe: Mapping[str, Any] | Recipe) -> dict[str, Any]:
    """A recipe as plain data in which every field of every part has its value.

    Raises:
        ConfigError: If it is no recipe.

    Example:
        >>> from torchsynth import recipes
        >>> complete(recipes.ashikhmin())["sweeps"][0]["levels"] is None
        True
    """
    checked = recipe if isinstance(recipe, Recipe) else parse_recipe(dict(recipe), _SUBJECT)
    return checked.model_dump(mode="json")


def changed(recipe: Mapping[str, Any], path: str, value: object) -> dict[str, Any]:
    """The recipe with another value at a path, and what has to follow from it.

    Args:
        recipe: As plain data.
        path: As in ``--set``: ``sweeps[0].layers[1].template.size``.
        value: Plain data: for a part all its fields that have no default, for an optional one None.

    Raises:
        ConfigError: If the value does not fit; the recipe itself stays as it is.

    Example:
        >>> from torchsynth import recipes
        >>> changed(complete(recipes.wei_levoy()), "levels", 2)["levels"]
        2
        >>> changed(complete(recipes.wei_levoy()), "sweeps[0].layers[0].template.size", 4)
        Traceback (most recent call last):
        torchsynth.errors.ConfigError: recipe: 'sweeps[0].layers[0].template.size': a side must be odd, ...
    """
    changes = [(path, value), *_following(recipe, path, value)]
    return complete(parse_recipe(dict(recipe), _SUBJECT, [override(*one) for one in changes]))


def with_kind(recipe: Mapping[str, Any], path: str, kind: str) -> dict[str, Any]:
    """The recipe with a part of another kind at a path.

    What both kinds have stays; the rest has its usual values. What has none is taken from around the part,
    as far as there is such a field: a searcher for continuations, for one, takes the template of its sweep.

    Args:
        recipe: As plain data.
        path: Of the part.
        kind: One of those that the part may be of.

    Raises:
        ConfigError: If the part does not go together with the rest of the recipe.

    Example:
        >>> from torchsynth import recipes
        >>> with_kind(complete(recipes.wei_levoy()), "sweeps[0].search", "coherence")["sweeps"][0]["search"]
        {'kind': 'coherence', 'template': {'kind': 'causal', 'size': 9}, 'spare_bottom': False}
    """
    field = field_at(recipe, path)
    if kind not in field.shape.kinds:
        known = ", ".join(field.shape.kinds)
        raise ConfigError(f"{_SUBJECT}: {path}", f"must be one of {known}", f"it is {kind!r}", "choose one")
    definition = field.shape.kinds[kind]
    usual = _new_part(definition, recipe, path)
    kept = {name: value for name, value in (field.value or {}).items() if name in definition["properties"]}
    # Some parts do more by default than suits every recipe: then the same without what is optional.
    bare = {name: None for name, node in definition["properties"].items() if _may_be_left_out(node)}
    wanted = [usual | kept, usual, usual | bare]
    return _first_that_fits(recipe, path, [part | {"kind": kind} for part in wanted])


def switched(recipe: Mapping[str, Any], path: str, on: bool) -> dict[str, Any]:
    """The recipe with an optional part, or without it.

    Args:
        recipe: As plain data.
        path: Of the part, such as ``patches`` or ``structure``.
        on: Whether it is there; then it has its usual values.

    Raises:
        ConfigError: If the recipe cannot have it, or cannot do without it.

    Example:
        >>> from torchsynth import recipes
        >>> quilted = switched(complete(recipes.wei_levoy()), "patches", True)
        >>> quilted["patches"]["kind"], switched(quilted, "patches", False)["sweeps"][0]["search"]
        ('quilting', {'kind': 'exhaustive'})
    """
    shape = field_at(recipe, path).shape
    part = _new_part(next(iter(shape.kinds.values())), recipe, path) if on else None
    return changed(recipe, path, part)


def added(recipe: Mapping[str, Any], path: str) -> dict[str, Any]:
    """The recipe with one more item in a list: a copy of its last one, or else one with usual values.

    Raises:
        ConfigError: If the recipe cannot have it.

    Example:
        >>> from torchsynth import recipes
        >>> len(added(complete(recipes.wei_levoy()), "sweeps")["sweeps"])
        2
    """
    items = _items(recipe, path)
    return changed(recipe, path, [*items, items[-1] if items else _new_item(recipe, path)])


def removed(recipe: Mapping[str, Any], path: str, number: int) -> dict[str, Any]:
    """The recipe with one item less in a list.

    Raises:
        ConfigError: If the recipe cannot do without it.

    Example:
        >>> from torchsynth import recipes
        >>> removed(complete(recipes.wei_levoy()), "sweeps", 0)
        Traceback (most recent call last):
        torchsynth.errors.ConfigError: recipe: ...: a recipe has sweeps or patches, but this one has neither; ...
    """
    items = _items(recipe, path)
    return changed(recipe, path, items[:number] + items[number + 1 :])


def moved(recipe: Mapping[str, Any], path: str, number: int, by: int) -> dict[str, Any]:
    """The recipe with one item of a list elsewhere in it; nothing moves beyond the ends.

    Args:
        recipe: As plain data.
        path: Of the list.
        number: Which item.
        by: How far: -1 is one up, 1 one down.

    Raises:
        ConfigError: If the order matters to the recipe, and this one does not fit.

    Example:
        >>> from torchsynth import recipes
        >>> layers = moved(complete(recipes.wei_levoy()), "sweeps[0].layers", 0, 1)["sweeps"][0]["layers"]
        >>> [layer["plane"] for layer in layers]
        ['coarse', 'result']
    """
    items = _items(recipe, path)
    item = items.pop(number)
    items.insert(max(0, number + by), item)
    return changed(recipe, path, items)


def override(path: str, value: object) -> str:
    """A change as ``--set`` takes it.

    Example:
        >>> override("sweeps[0].search.threshold", 1e-10)
        'sweeps[0].search.threshold=1.0e-10'
    """
    # YAML's own writer: what JSON writes as 1e-10, YAML would read as a word.
    text = yaml.safe_dump(value, default_flow_style=True, width=10**9, sort_keys=False)
    return f"{path}={text.removesuffix('...' + chr(10)).strip()}"


def _following(recipe: Mapping[str, Any], path: str, value: object) -> Iterator[tuple[str, object]]:
    """What has to change together: else no single change would be allowed, and a form could make none."""
    before, _, name = path.rpartition(".")
    start = f"{before}." if before else ""
    if name == "boundary" and recipe.get("structure"):
        yield "boundary", value
        yield "structure.recipe.boundary", value
    if name == "patches" and value is not None:
        yield f"{start}sweeps", []
        yield f"{start}initial", {"kind": "noise"}
        yield f"{start}levels", 1
    if name == "patches" and value is None:
        yield f"{start}sweeps", [_new_item(recipe, f"{start}sweeps")]
    if name == "sweeps" and value:
        yield f"{start}patches", None


def _first_that_fits(recipe: Mapping[str, Any], path: str, parts: Sequence[object]) -> dict[str, Any]:
    """The recipe with the first of some parts that goes together with it; else what is wrong with that."""
    errors = []
    for part in parts:
        try:
            return changed(recipe, path, part)
        except ConfigError as error:
            errors.append(error)
    raise errors[0]


def _items(recipe: Mapping[str, Any], path: str) -> list[Any]:
    return list(field_at(recipe, path).value)


def _new_item(recipe: Mapping[str, Any], path: str) -> dict[str, Any]:
    shape = shape_of(field_at(recipe, path).shape.items[0], schema()["$defs"])
    return _new_part(shape.kinds[""], recipe, path)


def _new_part(definition: Node, recipe: Mapping[str, Any], path: str) -> dict[str, Any]:
    """A part with a value for all it requires; the rest is left to its defaults."""
    places = {name: definition["properties"][name] for name in definition.get("required", ())}
    part = {name: _new_value(name, node, recipe, path) for name, node in places.items()}
    if "kind" in definition["properties"]:
        return {"kind": definition["properties"]["kind"]["const"]} | part
    return part


def _new_value(name: str, node: Node, recipe: Mapping[str, Any], path: str) -> object:
    if path == "structure" and name == "recipe":
        usual = complete(improved_wl(boundary=recipe["boundary"]))["structure"]
        return usual["recipe"]
    around = next(_named(name, _around(recipe, path)), None)
    if around is not None:
        return around
    if name in _FIRST:
        return _FIRST[name]
    shape = shape_of(node, schema()["$defs"])
    match shape.control:
        case "list":
            return [_new_part(shape_of(shape.items[0], schema()["$defs"]).kinds[""], recipe, path)]
        case "kind" | "part":
            return _new_part(next(iter(shape.kinds.values())), recipe, path)
        case _:
            return shape.words[0]


def _around(recipe: Mapping[str, Any], path: str) -> object:
    """The part that the part at a path belongs to."""
    outside = path.rpartition(".")[0]
    return field_at(recipe, outside).value if outside else {}


def _named(name: str, data: object) -> Iterator[object]:
    """The values of that name in nested data, in the order in which they stand there."""
    if isinstance(data, Mapping):
        yield from [data[name]] if data.get(name) is not None else []
        for value in data.values():
            yield from _named(name, value)
    elif isinstance(data, list):
        for value in data:
            yield from _named(name, value)


def _may_be_left_out(node: Node) -> bool:
    return shape_of(node, schema()["$defs"]).optional
