"""The tab for fields: turn and scale the texture from place to place."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch

from torchsynth.controls import Controls
from torchsynth.errors import InputError, TorchsynthError
from torchsynth.field import MAKERS
from torchsynth.lattice import Shape
from torchsynth.recipe import Recipe
from torchsynth.studio import editors, notes, side, stage
from torchsynth.studio.numbers import Number, asked_seed, asked_size, paper_size
from torchsynth.studio.painting import field_of, layer_of
from torchsynth.studio.purposes import distorted_as_fits
from torchsynth.studio.stage import Stage, Updates
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Sample, Visitor
from torchsynth.studio.work import Work, distortion, read_upload, recipe_from, upload_name
from torchsynth.wishes import FIELDS, field_picture, parse_field

NONE, PAINTED, UPLOADED = "none", "painted below", "a picture"
_USUAL, _OWN = "distorted, as fits", "the one on the left"
_RECIPES = (_USUAL, _OWN)
_SUITS = {
    "angle": ("constant", "swirl", "radial", "wave"),
    "scale": ("constant", "zoom", "wave"),
}
_FIRST = {
    ("angle", "constant"): "45", ("angle", "swirl"): "180", ("angle", "radial"): "0", ("angle", "wave"): "30, 2",
    ("scale", "constant"): "1.5", ("scale", "zoom"): "0.5, 2", ("scale", "wave"): "0.4, 2, 1",
}  # fmt: skip
_HINT = (
    "Turns and stretches the texture from place to place. Recipes that see their neighbors on all sides follow a "
    "field best: <b>distorted</b> does."
)
_PAINT = "Paint in grays: black is 0\N{DEGREE SIGN} or a quarter, white 360\N{DEGREE SIGN} or four times"


@dataclass(frozen=True)
class _Choice:
    """How one field is chosen: a maker with its numbers, or a picture."""

    subject: str
    maker: gr.Dropdown
    numbers: gr.Textbox
    file: gr.UploadButton


def build(asked: side.Side, shown: Stage) -> None:
    """Lay the tab out."""
    with gr.Row(elem_classes="actions"):
        run = gr.Button("Distort", variant="primary", elem_id="distort", scale=0, min_width=130)
    notes.hint(_HINT)
    with gr.Row():
        chosen = gr.Dropdown(list(_RECIPES), value=_USUAL, label="Recipe", elem_id="distort-with")
    with gr.Row():
        choices = [_build_choice(subject, asked) for subject in FIELDS]
    with gr.Column(visible=False) as painting:
        notes.hint(_PAINT)
        editor = editors.canvas("field", editors.blank(side.FIRST_SHAPE, editors.GRAYS))

    def make(
        visitor: Visitor, recipe: dict[str, Any], height: Number, width: Number, seed: Number, painted: str | None,
        name: str, *given: str,
    ) -> Iterator[Updates]:  # fmt: skip
        def plan(sample: Sample) -> Work:
            size = asked_size(height, width)
            fields = _Fields(visitor, size, painted)
            for number, subject in enumerate(FIELDS):
                fields.add(subject, given[2 * number], given[2 * number + 1])
            return distortion(
                sample, _recipe(name, recipe, sample), size, asked_seed(seed), fields.controls(), fields.words,
                painted=fields.painted,
            )  # fmt: skip

        yield from stage.asked(shown, visitor, plan)

    def prepare(height: Number, width: Number) -> gr.HTML:
        size = paper_size(height, width)
        return gr.HTML() if size is None else editors.on(editors.blank(size, editors.GRAYS))

    makers = [one.maker for one in choices]
    texts = [one for choice in choices for one in (choice.maker, choice.numbers)]
    stage.on_click(run, make, [*asked.asked, editor, chosen, *texts], shown.outputs)
    gr.on(
        [one.input for one in makers],
        lambda *chosen: gr.Column(visible=PAINTED in chosen),
        makers, painting, show_progress="hidden", queue=False,
    )  # fmt: skip
    gr.on(
        [asked.height.change, asked.width.change],
        prepare,
        [asked.height, asked.width], editor, show_progress="hidden", queue=False,
    )  # fmt: skip


def _build_choice(subject: str, asked: side.Side) -> _Choice:
    names = [NONE, *_SUITS[subject], PAINTED, UPLOADED]
    first = "swirl" if subject == "angle" else NONE
    with gr.Column(min_width=240):
        maker = gr.Dropdown(names, value=first, label=subject.capitalize(), elem_id=f"maker-{subject}")
        numbers = gr.Textbox(
            _FIRST.get((subject, first), ""), label=_label(first), visible=first in MAKERS,
            elem_id=f"numbers-{subject}", lines=1, max_lines=1,
        )  # fmt: skip
        file = gr.UploadButton("Choose a gray picture", size="sm", visible=False, elem_id=f"file-{subject}")

    def show(name: str) -> tuple[gr.Textbox, gr.UploadButton]:
        value = _FIRST.get((subject, name), "")
        return (
            gr.Textbox(value=value, label=_label(name), visible=name in MAKERS),
            gr.UploadButton(visible=name == UPLOADED),
        )

    def take(visitor: Visitor, path: str) -> tuple[Visitor, gr.UploadButton]:
        try:
            visitor.fields[subject] = field_picture(subject, read_upload(path))
        except TorchsynthError as error:
            gr.Warning(str(error))
            return visitor, gr.UploadButton()
        return visitor, gr.UploadButton(label=upload_name(path))

    maker.input(show, maker, [numbers, file], show_progress="hidden", queue=False)
    file.upload(take, [asked.visitor, file], [asked.visitor, file], show_progress="hidden")
    return _Choice(subject, maker, numbers, file)


def _recipe(name: str, own: dict[str, Any], sample: Sample) -> Recipe:
    return recipe_from(own) if name == _OWN else distorted_as_fits(sample)


def _label(maker: str) -> str:
    """The maker's parameters."""
    if maker not in MAKERS:
        return "Numbers"
    return ", ".join(list(inspect.signature(MAKERS[maker]).parameters)[1:])


class _Fields:
    """The fields that a visitor asks for, put together one by one."""

    def __init__(self, visitor: Visitor, size: Shape, painting: str | None) -> None:
        self._visitor, self._size, self._painting = visitor, size, painting
        self._found: dict[str, torch.Tensor | float] = {}
        self.words: dict[str, str] = {}
        self.painted = False

    def add(self, subject: str, maker: str, numbers: str) -> None:
        """One more field, if there is one."""
        if maker in MAKERS:
            self.words[subject] = f"{maker}:{''.join(numbers.split())}" if numbers.strip() else maker
            self._found[subject] = parse_field(subject, self.words[subject], self._size)
        elif maker == PAINTED:
            self.painted = True
            self._found[subject] = field_of(layer_of(self._painting, self._size, subject), subject)
        elif maker == UPLOADED:
            self.painted = True
            self._found[subject] = self._uploaded(subject)

    def controls(self) -> Controls:
        """All of them."""
        if not self._found:
            raise InputError("field", "must turn or scale something", "both are none", "choose one of them")
        return Controls(angle=self._found.get("angle"), scale=self._found.get("scale"))

    def _uploaded(self, subject: str) -> torch.Tensor:
        if subject not in self._visitor.fields:
            raise InputError(subject, "must be a gray picture", "none is chosen yet", "choose one")
        return self._visitor.fields[subject]
