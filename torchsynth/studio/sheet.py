"""The sheet: what one visitor's form shows, and what it shows after somebody used a control."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from torchsynth.recipes import RECIPES
from torchsynth.studio import edits
from torchsynth.studio.controls import Content, value_of
from torchsynth.studio.fields import Field, field_at
from torchsynth.studio.parameters import made, parameters_of
from torchsynth.studio.shapes import Shape
from torchsynth.studio.titles import looks

Data: TypeAlias = dict[str, Any]
"""A recipe as plain data."""

MAIN = "main."
"""What goes before the names of main parameters, so that they are told from the recipe's fields."""
_THERE = "?"
"""What goes after the path of an optional part for the question whether it is there."""


@dataclass(frozen=True)
class Sheet:
    """What a visitor's form shows.

    Args:
        recipe: The recipe.
        values: The main parameters that are not as usual.
        drawn: How often its structure changed.
    """

    recipe: Data
    values: Data
    drawn: int = 0

    @property
    def name(self) -> str:
        """The recipe's name; its main parameters are those of the function that has it."""
        return str(self.recipe["name"])

    @property
    def is_by_hand(self) -> bool:
        """Whether its main parameters alone do not make the recipe."""
        return self.name in RECIPES and made(self.name, self.values) != self.recipe

    def field(self, path: str) -> Field:
        """The field of a control, as it is now."""
        if path.endswith(_THERE):
            return presence(field_at(self.recipe, path.removesuffix(_THERE)))
        if not path.startswith(MAIN):
            return field_at(self.recipe, path)
        fields = parameters_of(self.name, self.values)
        field = next(field for field in fields if MAIN + field.path == path)
        return replace(field, path=path)

    def with_content(self, field: Field, content: Content) -> Sheet:
        """The sheet after somebody put something into the control of a field.

        Raises:
            ConfigError: If the recipe cannot have it.
        """
        if field.path.startswith(MAIN):
            values = self.values | {field.name: value_of(field, content)}
            return Sheet(made(self.name, values), values, self.drawn + 1)
        if field.path.endswith(_THERE):
            return self.with_recipe(
                edits.switched(self.recipe, field.path.removesuffix(_THERE), bool(content))
            )
        if field.shape.control == "kind":
            return self.with_recipe(edits.with_kind(self.recipe, field.path, str(content)))
        new = edits.changed(self.recipe, field.path, value_of(field, content))
        return self.with_recipe(new, but=field.path)

    def with_recipe(self, recipe: Data, but: str = "") -> Sheet:
        """The sheet of a changed recipe; to be drawn again if it differs elsewhere than in one control."""
        same = looks(recipe, but) == looks(self.recipe, but)
        return replace(self, recipe=recipe, drawn=self.drawn + (not same))


def presence(field: Field) -> Field:
    """The question whether an optional part is there."""
    there = field.value is not None
    return replace(field, path=field.path + _THERE, shape=Shape("switch"), value=there, children=())
