"""The page: its side, its tabs, and the stage below them."""

from __future__ import annotations

from torchsynth.studio import notes, side, stage
from torchsynth.studio.tabs import comparing, distorting, filling, following, synthesizing, tuning
from torchsynth.studio.toolkit import gr

_TABS = {
    "Synthesize": synthesizing,
    "Target": following,
    "Fill": filling,
    "Distort": distorting,
    "Compare": comparing,
    "Recipe": tuning,
}
_TITLE = (
    "<div id='title'><h1>torchsynth studio</h1><p>Give it a small sample of a texture, get as much as you want.</p>"
    "</div>"
)


def build() -> gr.Blocks:
    """The whole page."""
    page: gr.Blocks
    with gr.Blocks(
        title="torchsynth studio", analytics_enabled=False, delete_cache=(3600, 7200), fill_width=True
    ) as page:
        notes.html(_TITLE)
        with gr.Row():
            with gr.Column(elem_id="side", scale=0):
                chosen = side.build(page)
            with gr.Column(elem_id="main", scale=1):
                with gr.Column(elem_id="work"):
                    tabs = gr.Tabs()
                    shown = stage.build(chosen.visitor)
                with tabs:
                    for title, tab in _TABS.items():
                        with gr.Tab(title, id=title.lower()):
                            tab.build(chosen, shown)
    page.queue(default_concurrency_limit=8)
    return page
