"""The tab for holes: paint over what should go, and have it filled with the texture around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from torchsynth.config import load_recipe
from torchsynth.errors import InputError
from torchsynth.recipe import Recipe
from torchsynth.studio import editors, notes, side, stage
from torchsynth.studio.numbers import Number, asked_seed
from torchsynth.studio.painting import layer_of, region_of
from torchsynth.studio.stage import Stage, Updates
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Sample, Visitor
from torchsynth.studio.work import Work, filling, recipe_from

_HINT = "Paint over what is to be replaced. It is filled with what is around it; nothing else changes."
_PICTURES = ("The sample", "Last result")
_USUAL, _OWN = "coherent_fill, as fits", "the one on the left"
_RECIPES = (_USUAL, "coherent_fill", "efros_leung", "wei_levoy_fill", _OWN)


def build(asked: side.Side, shown: Stage) -> None:
    """Lay the tab out."""
    with gr.Row(elem_classes="actions"):
        run = gr.Button("Fill", variant="primary", elem_id="fill", scale=0, min_width=130)
    notes.hint(_HINT)
    editor = editors.canvas("hole", editors.blank(side.FIRST_SHAPE, editors.HOLE_COLORS))
    with gr.Row():
        picture = gr.Radio(_PICTURES, value=_PICTURES[0], label="Picture", elem_id="picture", min_width=200)
        chosen = gr.Dropdown(
            list(_RECIPES), value=_USUAL, label="Filled with", elem_id="fill-with", min_width=180
        )

    def make(
        visitor: Visitor, recipe: dict[str, Any], seed: Number, which: str, name: str, painted: str | None
    ) -> Iterator[Updates]:
        def plan(sample: Sample) -> Work:
            picture = _picture(visitor, sample, which)
            hole = region_of(layer_of(painted, picture.shape, "hole"))
            return filling(picture, hole, _recipe(name, recipe), asked_seed(seed))

        yield from stage.asked(shown, visitor, plan)

    def prepare(visitor: Visitor, which: str) -> gr.HTML:
        if visitor.sample is None:
            return gr.HTML()
        try:
            picture = _picture(visitor, visitor.sample, which)
        except InputError as error:
            gr.Warning(str(error))
            picture = visitor.sample
        return editors.on(editors.showing(picture.picture.image, editors.HOLE_COLORS))

    stage.on_click(
        run, make, [asked.visitor, asked.recipe, asked.seed, picture, chosen, editor], shown.outputs
    )
    gr.on(
        [asked.turn.change, picture.input],
        prepare,
        [asked.visitor, picture],
        editor,
        show_progress="hidden",
        queue=False,
    )


def _picture(visitor: Visitor, sample: Sample, which: str) -> Sample:
    """What is filled, which is its own sample: its pixels come from nowhere else."""
    if which == _PICTURES[0]:
        return sample
    if visitor.made is None:
        raise InputError("picture", "must be there", "nothing was made yet", "fill the sample instead")
    made = visitor.made
    return Sample("last result", replace(made.sample.picture, image=made.result.image[0]))


def _recipe(name: str, own: dict[str, Any]) -> Recipe | None:
    if name == _USUAL:
        return None
    return recipe_from(own) if name == _OWN else load_recipe(name)
