"""The form of a recipe: a control for every value that it has, in groups that follow its parts.

Three things decide how it is drawn. It is drawn again only where its structure changes, so that somebody
who types a number keeps the focus. While a number is typed, one that does not fit is only told; when the
control is left, it goes back to the value that counts. And the controls have no limits of their own:
gradio would refuse a number beyond them before the recipe is asked, and in other words.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib import resources
from typing import Any

from torchsynth.errors import ConfigError
from torchsynth.recipes import RECIPES
from torchsynth.studio import docstrings, edits
from torchsynth.studio.controls import (
    Content,
    Control,
    Event,
    control_for,
    control_id,
    shown,
    told_when_done,
    told_while_typing,
)
from torchsynth.studio.fields import Field, fields_of
from torchsynth.studio.parameters import parameters_of
from torchsynth.studio.sheet import MAIN, Data, Sheet, presence
from torchsynth.studio.titles import inline, is_flat, is_small, title_of
from torchsynth.studio.toolkit import gr

CSS = resources.files("torchsynth.studio").joinpath("form.css").read_text(encoding="utf-8")
"""How the form looks, for ``launch(css=...)``."""

_HINT = (
    "Parts below were changed by hand. Changing one of these builds the recipe anew, without those changes."
)


def recipe_form(recipe: gr.State, message: gr.Markdown | gr.HTML) -> None:
    """Draw the form of a recipe, inside a :class:`gradio.Blocks`.

    Args:
        recipe: The recipe as complete plain data, see :func:`torchsynth.studio.edits.complete`. The form
            writes each valid change to it, and draws what was written to it from elsewhere.
        message: Where the form says what is wrong with a change; nothing once it is right.
    """
    _Form(recipe, message)


class _Form:
    """The states of a form, and what its events do to them."""

    def __init__(self, recipe: gr.State, message: gr.Markdown | gr.HTML) -> None:
        self.recipe, self.message = recipe, message
        self.sheet = gr.State(Sheet(recipe.value, {}))
        self.main, self.parts = gr.State(0), gr.State(0)
        self.opened = gr.State(frozenset())
        with gr.Column(elem_classes="recipe-form"):
            self.drawing([self.sheet], self.main)(self.draw_main)
            self.hint = gr.HTML(f"<p>{_HINT}</p>", visible=False, elem_classes="recipe-hint")
            with gr.Accordion("All parts of the recipe", open=False, elem_id="recipe-parts"):
                self.drawing([self.sheet, self.opened], self.parts)(self.draw_parts)
        self.outputs = [recipe, self.sheet, self.main, self.parts, message, self.hint]
        recipe.change(self.see, [recipe, self.sheet], self.outputs, **_QUIET)

    def see(self, recipe: Data, sheet: Sheet) -> Any:  # noqa: ANN401 (updates of gradio)
        """Draw a recipe that came from elsewhere."""
        if recipe == sheet.recipe:
            return gr.skip()
        new = Sheet(recipe, {}, sheet.drawn + 1)
        return {self.sheet: new, self.main: new.drawn, self.parts: new.drawn, self.hint: _hint(new)}

    def drawing(self, inputs: Sequence[gr.State], counter: gr.State) -> Event:
        """What draws a part of the form whenever its counter changes, and when the page is opened."""
        triggers = [_load(), counter.change]
        # Gradio notes the listeners of both parts in one place, and fails where two are drawn at the same time.
        render: Event = gr.render(inputs, triggers, show_progress="hidden", **_ALONE)
        return render

    def draw_main(self, sheet: Sheet) -> None:
        """The few parameters of the function that made the recipe."""
        if sheet.name not in RECIPES:
            return
        gr.HTML(_heading("h3", f"Main parameters of {sheet.name}"))
        with gr.Row(elem_classes="recipe-row"):
            for field in parameters_of(sheet.name, sheet.values):
                self.control(replace(field, path=MAIN + field.path))

    def draw_parts(self, sheet: Sheet, opened: frozenset[str]) -> None:
        """All values of all parts; the groups that were open are open again."""
        self.group(fields_of(sheet.recipe), opened)

    def group(self, fields: Sequence[Field], opened: frozenset[str]) -> None:
        """One row of controls, and below it the parts that need a place of their own."""
        small = list(inline(tuple(fields)))
        if small:
            with gr.Row(elem_classes="recipe-row"):
                for field in small:
                    self.control(field)
        for field in fields:
            if not is_small(field):
                self.block(field, opened)

    def block(self, field: Field, opened: frozenset[str]) -> None:
        """A list, or a part that does not fit in a row."""
        match field.shape.control:
            case "list":
                self.items(field, opened)
            case "part" if not field.shape.optional:
                with self.folded(f"{field.label}: {docstrings.brief(field.help)}", field, opened):
                    self.group(field.children, opened)
            case _:
                with gr.Column(elem_classes="recipe-block"):
                    if field.shape.optional:
                        self.control(presence(field))
                    if field.value is not None:
                        self.group([*_own_row(field), *field.children], opened)

    def items(self, field: Field, opened: frozenset[str]) -> None:
        """A list: its items, each with buttons to move and to remove it, and one to add another."""
        one = field.label.removesuffix("s").lower()
        with gr.Row(elem_classes="recipe-bar"):
            gr.HTML(_heading("h4", field.label, field.help))
            self.button(f"Add a {one}", field, partial(edits.added, path=field.path))
        for number, item in enumerate(field.children):
            flat = is_flat(item)
            with gr.Column(elem_classes="recipe-item") if flat else self.folded(title_of(item), item, opened):
                with gr.Row(elem_classes="recipe-bar"):
                    gr.HTML(_heading("h5", title_of(item)) if flat else "")
                    self.buttons(field, number, item)
                self.group(item.children, opened)

    def folded(self, title: str, field: Field, opened: frozenset[str]) -> gr.Accordion:
        """A group that can be opened; gradio would close it at each drawing, so that is remembered."""
        path = field.path
        group = gr.Accordion(title, open=path in opened, elem_id=control_id(path), key=("group", path))
        group.expand(lambda known: known | {path}, self.opened, self.opened, **_QUIET)
        group.collapse(lambda known: known - {path}, self.opened, self.opened, **_QUIET)
        return group

    def buttons(self, field: Field, number: int, item: Field) -> None:
        """The buttons of an item in a list."""
        if number > 0:
            self.button("Up", item, partial(edits.moved, path=field.path, number=number, by=-1))
        if number < len(field.children) - 1:
            self.button("Down", item, partial(edits.moved, path=field.path, number=number, by=1))
        self.button("Remove", item, partial(edits.removed, path=field.path, number=number))

    def button(self, text: str, field: Field, verb: Callable[..., Data]) -> None:
        """A button that changes the recipe."""
        name = control_id(f"{field.path}.{text.split()[0].lower()}")
        button = gr.Button(text, size="sm", min_width=10, scale=0, elem_id=name, key=(text, field.path))

        def press(sheet: Sheet) -> Any:  # noqa: ANN401 (updates of gradio)
            try:
                return self.shown(sheet, sheet.with_recipe(verb(sheet.recipe)))
            except ConfigError as error:
                return {self.message: told(error)}

        button.click(press, [self.sheet], self.outputs, **_QUIET)

    def control(self, field: Field) -> None:
        """The control of one value."""
        control = control_for(field)
        self.listen(told_while_typing(control), control, field, is_done=False)
        self.listen(told_when_done(control), control, field, is_done=True)

    def listen(self, events: Sequence[Event], control: Control, field: Field, is_done: bool) -> None:
        """Do what a control says; once it is left, what cannot be is taken back."""

        def hear(sheet: Sheet, content: Content) -> Any:  # noqa: ANN401 (updates of gradio)
            try:
                new = sheet.with_content(sheet.field(field.path), content)
            except ConfigError as error:
                kept = {control: shown(sheet.field(field.path))} if is_done else {}
                return {self.message: told(error), **kept}
            if is_done and new.recipe == sheet.recipe:
                return gr.skip()
            return self.shown(sheet, new)

        if events:
            outputs = [*self.outputs, control]
            gr.on(events, hear, [self.sheet, control], outputs, trigger_mode="always_last", **_QUIET)

    def shown(self, sheet: Sheet, new: Sheet) -> dict[Any, Any]:
        """What changes in the page from one sheet to the next."""
        updates = {self.recipe: new.recipe, self.sheet: new, self.message: "", self.hint: _hint(new)}
        if new.drawn != sheet.drawn:
            updates[self.parts] = new.drawn
        if new.name != sheet.name:
            updates[self.main] = new.drawn + 1
        return updates


# One at a time: two events that begin with the same sheet would undo each other.
_ALONE: dict[str, Any] = {"concurrency_id": "recipe-form", "concurrency_limit": 1}
_QUIET: dict[str, Any] = {"show_progress": "hidden", "api_visibility": "private", **_ALONE}


def told(error: ConfigError) -> str:
    """An error as the page shows it.

    Example:
        >>> told(ConfigError("recipe", "must be a < b", "a > b", "change it"))
        '<p class="recipe-error">recipe: must be a &lt; b, but a &gt; b; change it</p>'
    """
    return f'<p class="recipe-error">{html.escape(str(error))}</p>'


def _hint(sheet: Sheet) -> dict[str, Any]:
    hint: dict[str, Any] = gr.update(visible=sheet.is_by_hand)
    return hint


def _own_row(field: Field) -> list[Field]:
    """The kind of a part without its fields, which have a group; whether it is there was asked before."""
    if field.shape.control != "kind":
        return []
    label = "Kind" if field.shape.optional else field.label
    return [replace(field, label=label, shape=replace(field.shape, optional=False), children=())]


def _heading(level: str, text: str, said: str = "") -> str:
    muted = f' <span class="recipe-muted">{html.escape(said)}</span>' if said else ""
    return f"<{level}>{html.escape(text)}{muted}</{level}>"


def _load() -> Event:
    """The event that a visitor opens the page."""
    page = gr.context.Context.root_block
    assert page is not None, "a form is drawn inside gr.Blocks"  # noqa: S101 (for the type checker)
    load: Event = page.load
    return load
