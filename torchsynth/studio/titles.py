"""How the fields of a recipe are laid out and named: what stands in one row, and what a group is called."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from torchsynth.studio.fields import Field, fields_of

_GROUPS = ("kind", "part", "list", "span")
_FEW = 2
"""How many values a part may have to stand in the row of the part that it belongs to."""


def is_small(field: Field) -> bool:
    """Whether a field needs no group of its own: a single value, or a part with few of them.

    Example:
        >>> from torchsynth import recipes
        >>> from torchsynth.studio.fields import field_at
        >>> data = recipes.wei_levoy_tsvq().model_dump(mode="json")
        >>> [is_small(field_at(data, f"sweeps[0].{name}")) for name in ("order", "search")]
        [True, False]
    """
    if field.shape.control in ("list", "part") or (field.shape.control == "kind" and field.shape.optional):
        return False
    return len(field.children) <= _FEW and not any(child.shape.control in _GROUPS for child in field.children)


def is_flat(field: Field) -> bool:
    """Whether all values of a part stand in one row."""
    return all(is_small(child) for child in field.children)


def inline(fields: tuple[Field, ...]) -> Iterator[Field]:
    """The fields of one row, those of small parts right after them and named after them.

    Example:
        >>> from torchsynth import recipes
        >>> from torchsynth.studio.fields import field_at
        >>> data = recipes.wei_levoy().model_dump(mode="json")
        >>> [field.label for field in inline(field_at(data, "sweeps[0].layers[0]").children)]
        ['Plane', 'Template', 'Template size', 'Weight', 'Up', 'Sigma']
    """
    for field in fields:
        if is_small(field):
            yield field
            for child in field.children:
                yield replace(child, label=f"{field.label} {child.label.lower()}")


def looks(recipe: Mapping[str, Any], but: str) -> dict[str, object]:
    """What a form of the recipe shows, by path: titles, kinds and values, but for the value at one path.

    Example:
        >>> from torchsynth import recipes
        >>> four, two = (recipes.wei_levoy(levels=n).model_dump(mode="json") for n in (4, 2))
        >>> looks(four, but="levels") == looks(two, but="levels")
        True
    """
    return {
        field.path: (
            title_of(field),
            field.kind,
            None if field.children or field.path == but else field.value,
        )
        for top in fields_of(recipe)
        for field in top.walk()
    }


def title_of(field: Field) -> str:
    """What the item of a list is called.

    Example:
        >>> from torchsynth import recipes
        >>> from torchsynth.studio.fields import field_at
        >>> title_of(field_at(recipes.wei_levoy().model_dump(mode="json"), "sweeps[0]"))
        'Sweep 1: scanline, exhaustive, all levels'
    """
    if field.name != "sweeps" or not field.path.endswith("]"):
        return field.label
    words = [field.child(name).kind.replace("_", " ") for name in ("order", "search")]
    rows = [] if field.child("rows").value is None else ["some rows"]
    return f"{field.label}: {', '.join([*words, _levels(field.child('levels').value), *rows])}"


def _levels(levels: list[int] | str | None) -> str:
    if levels is None:
        return "all levels"
    if isinstance(levels, str):
        return f"{levels} level{'s' if levels == 'finer' else ''}"
    return f"level{'s' if len(levels) > 1 else ''} {', '.join(map(str, levels))}"
