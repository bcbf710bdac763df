"""The tab for plain synthesis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from torchsynth.studio import notes, side, stage
from torchsynth.studio.numbers import Number, asked_seed, asked_size
from torchsynth.studio.stage import Stage, Updates
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Visitor
from torchsynth.studio.work import recipe_from, synthesis


def build(asked: side.Side, shown: Stage) -> None:
    """Lay the tab out."""
    with gr.Row(elem_classes="actions"):
        run = gr.Button("Synthesize", variant="primary", elem_id="synthesize", scale=0, min_width=130)
    notes.hint("Makes new texture from the sample, with the recipe, size and seed on the left.")

    def make(
        visitor: Visitor, recipe: dict[str, Any], height: Number, width: Number, seed: Number
    ) -> Iterator[Updates]:
        yield from stage.asked(
            shown,
            visitor,
            lambda sample: synthesis(
                sample, recipe_from(recipe), asked_size(height, width), asked_seed(seed)
            ),
        )

    stage.on_click(run, make, asked.asked, shown.outputs)
