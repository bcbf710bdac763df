"""The page: its side, its tabs, and the stage below them."""

from __future__ import annotations

from torchsynth.studio import side, stage
from torchsynth.studio.pictures import bar
from torchsynth.studio.tabs import synthesizing
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Visitor

_TITLE = (
    "<div id='title'><h1>torchsynth studio</h1><p>Give it a small sample of a texture, get as much as you want.</p>"
    "</div>"
)


def build() -> gr.Blocks:
    """The whole page."""
    with gr.Blocks(title="torchsynth studio", analytics_enabled=False, delete_cache=(3600, 7200)) as page:
        gr.HTML(_TITLE, padding=False)
        with gr.Row():
            with gr.Column(elem_id="side", scale=0):
                chosen = side.build(page)
            with gr.Column(elem_id="main", scale=1):
                tabs = gr.Tabs()
                shown = _build_stage(chosen)
                with tabs:
                    with gr.Tab("Synthesize", id="synthesize"):
                        synthesizing.build(chosen, shown)
    return page.queue(default_concurrency_limit=8)


def _build_stage(chosen: side.Side) -> stage.Stage:
    with gr.Column():
        with gr.Row():
            cancel = gr.Button("Cancel", size="sm", elem_id="cancel", scale=0, min_width=90)
        shown = stage.build(chosen.visitor)

    def end(visitor: Visitor) -> str | dict[str, object]:
        return bar("Cancelling", 0.0, "cancelled") if visitor.cancel() else gr.skip()

    cancel.click(end, chosen.visitor, shown.bar, queue=False, show_progress="hidden")
    return shown
