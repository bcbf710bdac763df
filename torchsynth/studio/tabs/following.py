"""The tab for painted targets: paint what goes where, and let the texture follow it, pass by pass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.lattice import Shape
from torchsynth.studio import editors, notes, side, stage
from torchsynth.studio.numbers import Number, asked_seed, asked_size, paper_size
from torchsynth.studio.painting import layer_of, region_of, target_of
from torchsynth.studio.stage import Stage, Updates
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Made, Sample, Visitor
from torchsynth.studio.work import Work, following, one_more_pass, recipe_from

_HINT = (
    "Paint with colors of the sample, or click on it to pick one. What stays blank is free. Each further pass "
    "follows the target more."
)
_PAPERS = ("Blank", "Last result")


def build(asked: side.Side, shown: Stage) -> None:
    """Lay the tab out."""
    with gr.Row(elem_classes="actions"):
        first = gr.Button("First pass", variant="primary", elem_id="first-pass", scale=0, min_width=120)
        again = gr.Button("One more pass", elem_id="one-more-pass", scale=0, min_width=140)
    notes.hint(_HINT)
    editor = editors.canvas("target", editors.blank(side.FIRST_SHAPE, [], others=True))
    paper = gr.Radio(_PAPERS, value="Blank", label="Paint on", elem_id="paper")

    def begin(
        visitor: Visitor,
        recipe: dict[str, Any],
        height: Number,
        width: Number,
        seed: Number,
        painted: str | None,
    ) -> Iterator[Updates]:
        def plan(sample: Sample) -> Work:
            size = asked_size(height, width)
            return following(
                sample, recipe_from(recipe), size, asked_seed(seed), _wish(sample, painted, size), 1
            )

        yield from stage.asked(shown, visitor, plan)

    def go_on(visitor: Visitor, painted: str | None) -> Iterator[Updates]:
        def plan(_: Sample) -> Work:
            made = _made(visitor)
            height, width = made.result.image.shape[-2:]
            wish = _wish(made.sample, painted, (height, width))
            return one_more_pass(made.result, made.sample, made.result.seeds[0], wish)

        yield from stage.asked(shown, visitor, plan)

    def prepare(visitor: Visitor, height: Number, width: Number, chosen: str, colors: list[str]) -> gr.HTML:
        if chosen == "Last result" and visitor.made is not None:
            return editors.on(editors.showing(visitor.made.result.image[0], colors, others=True))
        size = paper_size(height, width)
        return gr.HTML() if size is None else editors.on(editors.blank(size, colors, others=True))

    stage.on_click(first, begin, [*asked.asked, editor], shown.outputs)
    stage.on_click(again, go_on, [asked.visitor, editor], shown.outputs)
    gr.on(
        [asked.height.change, asked.width.change, paper.input, asked.colors.change],
        prepare, [asked.visitor, asked.height, asked.width, paper, asked.colors], editor, show_progress="hidden",
        queue=False,  # gradio may lose a click that comes just when a queued event has ended
    )  # fmt: skip


def _wish(sample: Sample, painted: str | None, size: Shape) -> Controls:
    layer = layer_of(painted, size, "target")
    return Controls(target=target_of(layer, len(sample.picture.image)), target_region=region_of(layer))


def _made(visitor: Visitor) -> Made:
    if visitor.made is None:
        raise InputError("pass", "needs an output to go over", "there is none yet", "make a first pass")
    if visitor.made.controls.hole is not None:
        raise InputError(
            "pass",
            "goes over a whole output",
            "the last one is a picture that was filled",
            "make a first pass",
        )
    return visitor.made
