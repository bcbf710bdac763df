"""The tab for the recipe: every value of every part."""

from __future__ import annotations

from torchsynth.studio import notes, side
from torchsynth.studio.form import recipe_form
from torchsynth.studio.stage import Stage

_HINT = "Changes count for all tabs. The file at the side, <i>As YAML</i>, says the same."


def build(asked: side.Side, _shown: Stage) -> None:
    """Lay the tab out."""
    notes.hint(_HINT)
    recipe_form(asked.recipe, notes.html("", "recipe-message"))
