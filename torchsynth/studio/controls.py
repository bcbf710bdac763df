"""The control of each kind of value, and the way between a value and what its control shows."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeAlias

from torchsynth.studio import docstrings
from torchsynth.studio.fields import Field, read, written
from torchsynth.studio.toolkit import gr

Control: TypeAlias = gr.Number | gr.Dropdown | gr.Checkbox | gr.Textbox
"""What a value is edited with."""
Content: TypeAlias = str | int | float | bool | None
"""What a control shows, and what somebody puts into it."""
Event: TypeAlias = Callable[..., Any]
"""What listeners are attached to."""

_ODD_SIDES = range(1, 32, 2)
"""The sides that are offered; any other can be typed."""
_FINE = 0.05
"""By how much the arrows of a control change a number that is not whole."""


def control_id(path: str) -> str:
    """The id of a field's control in the page.

    Example:
        >>> control_id("sweeps[0].layers[1].template.size")
        'recipe-sweeps-0-layers-1-template-size'
    """
    return "-".join(["recipe", *re.findall(r"\w+", path)])


def control_for(field: Field) -> Control:
    """The control of a field, showing its value.

    Args:
        field: Of a part, its kind is edited; of an optional span, whether it is there.
    """
    usual: dict[str, Any] = {
        "label": field.label,
        "info": info_of(field) or None,
        "value": shown(field),
        "elem_id": control_id(field.path),
        "interactive": True,
        # What is shown comes from the recipe at each drawing, not from what a visitor had typed before.
        "preserved_by_key": [],
    }
    match field.shape.control:
        case "switch" | "span":
            return gr.Checkbox(**usual, key=("switch", field.path))
        case "text":
            return gr.Textbox(**usual, max_lines=1, elem_classes="recipe-wide", key=("text", field.path))
    if _is_number(field):
        unset = docstrings.unset(field.help) if field.shape.optional else None
        step = 1 if field.shape.control == "integer" else _FINE
        return gr.Number(**usual, step=step, placeholder=unset, key=("number", field.path))
    return gr.Dropdown(
        **usual, choices=_choices(field), allow_custom_value=_is_typed(field), filterable=_is_typed(field),
        key=("choice", field.path),
    )  # fmt: skip


def info_of(field: Field) -> str:
    """What a control says below its label: of a part, what its kind does."""
    if field.shape.control != "kind" or not field.kind:
        return docstrings.brief(field.help)
    return docstrings.summary(field.shape.kinds[field.kind].get("description", ""))


def shown(field: Field) -> Content:
    """What the control of a field shows."""
    if field.shape.control == "span":
        return field.value is not None
    if field.shape.control == "kind":
        return field.kind
    if _is_typed(field):
        return written(field)
    value: Content = field.value
    return value


def value_of(field: Field, content: Content) -> object:
    """The value that somebody means by what they put into the control of a field."""
    if field.shape.control == "span":
        return [None] * len(field.shape.items) if content else None
    if _is_typed(field) and content is not None:
        return read(field, str(content))
    if field.shape.control == "integer" and isinstance(content, float) and content.is_integer():
        return int(content)
    return content


def told_while_typing(control: Control) -> list[Event]:
    """The events of a control at which somebody may not have finished yet."""
    return [control.input] if isinstance(control, gr.Number | gr.Textbox) else []


def told_when_done(control: Control) -> list[Event]:
    """The events of a control at which its value is meant."""
    return [control.submit, control.blur] if isinstance(control, gr.Number | gr.Textbox) else [control.input]


def _is_number(field: Field) -> bool:
    shape = field.shape
    return shape.control in ("integer", "number") and not shape.words and not _is_odd(field)


def _is_odd(field: Field) -> bool:
    return field.shape.step == 2


def _is_typed(field: Field) -> bool:
    """Whether its control shows words and numbers, both as text."""
    if field.shape.control in ("integer", "integers"):
        return not _is_number(field)
    return False


def _choices(field: Field) -> list[tuple[str, str]]:
    shape = field.shape
    words = [(word.replace("_", " "), word) for word in shape.words]
    if not _is_typed(field):
        return words
    unset = docstrings.unset(field.help)
    words = [(unset, unset)] * shape.optional + words
    if _is_odd(field):
        least, most = shape.minimum or 1, shape.maximum or _ODD_SIDES.stop
        words += [(str(side), str(side)) for side in _ODD_SIDES if least <= side <= most]
    if written(field) not in [word for _, word in words]:
        words.append((written(field), written(field)))
    return words
