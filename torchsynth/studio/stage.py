"""The stage: the bar, the output and its pyramids, while it is made and after; and what can be downloaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from torchsynth.errors import TorchsynthError
from torchsynth.exemplar import Exemplar
from torchsynth.recipe import Recipe
from torchsynth.result import Result
from torchsynth.studio import notes
from torchsynth.studio.downloads import write_files
from torchsynth.studio.pictures import Pyramids, bar, pixels_of
from torchsynth.studio.running import CancelledError, Finished, Snapshot, followed
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Made, Sample, Visitor
from torchsynth.studio.work import Work
from torchsynth.viz import draw_field

Updates: TypeAlias = dict[Any, Any]
"""What the page shall show, by component."""

IDLE = "Nothing was made yet: choose a sample and a recipe, then what to make of them."
KINDS = {"image": "Image", "source_map": "Source map", "recipe": "Recipe", "record": "Record"}
_REASONS = {
    "source_map": "No source map: the output does not consist of copies",
    "record": "No record: what was painted is in no file",
}


@dataclass(frozen=True)
class Stage:
    """The components of the stage."""

    visitor: gr.State
    bar: gr.HTML
    result: gr.Image
    pyramids: gr.HTML
    downloads: dict[str, gr.DownloadButton]
    drawing: gr.Image
    missing: gr.HTML

    @property
    def outputs(self) -> list[Any]:
        """All that a computation may change."""
        return [
            self.visitor, self.bar, self.result, self.pyramids, self.drawing, self.missing,
            *self.downloads.values(),
        ]  # fmt: skip


def build(visitor: gr.State) -> Stage:
    """Lay the stage out."""
    with gr.Column(elem_id="output"):
        with gr.Row(equal_height=True):
            result, drawing = (
                gr.Image(
                    label=label, elem_id=f"shown-{label.lower()}", format="png", interactive=False, height=440,
                    buttons=["fullscreen"], min_width=200, visible=visible,
                )
                for label, visible in (("Result", True), ("Field", False))
            )  # fmt: skip
        with gr.Row(elem_id="downloads"):
            downloads = {
                kind: gr.DownloadButton(
                    label, size="sm", interactive=False, elem_id=f"download-{kind}", min_width=80
                )
                for kind, label in KINDS.items()
            }
        missing = notes.html("", name="missing")
    with gr.Column(elem_id="levels"):
        notes.section("Level by level")
        pyramids = notes.html("", name="pyramids")
    with gr.Row(elem_id="status"):
        shown = notes.html(bar(IDLE, 0.0, "idle"), name="progress")
        cancel = gr.Button("Cancel", size="sm", elem_id="cancel", scale=0, min_width=90)

    def end(who: Visitor) -> None:
        who.cancel()  # the run itself says so: an answer from here might come after its last word

    cancel.click(end, visitor, None, queue=False, show_progress="hidden")
    return Stage(visitor, shown, result, pyramids, downloads, drawing, missing)


def perform(stage: Stage, visitor: Visitor, work: Work) -> Iterator[Updates]:
    """Make something, and show it while it is made.

    Yields:
        What the page shall show.
    """
    ticket = visitor.begin()
    pyramids = Pyramids(Exemplar(work.sample.picture.image).images(work.recipe.levels))
    yield {
        stage.visitor: visitor,
        stage.bar: bar("Preparing", 0.0),
        stage.pyramids: pyramids.html(),
        stage.drawing: _drawn(work),
    }
    share = 0.0
    try:
        for news in followed(work.make, ticket):
            if isinstance(news, Snapshot):
                share = news.done / max(1, news.total)
                yield _on_the_way(stage, news, pyramids, work)
            else:
                yield from _finished(stage, visitor, work, news)
    except CancelledError:
        yield {stage.bar: bar("Cancelled", share, "cancelled")}
    except TorchsynthError as error:
        gr.Warning(str(error))
        yield {stage.bar: bar(str(error), share, "failed")}


def _drawn(work: Work) -> gr.Image:
    """The field that distorts the output, if one does."""
    if not work.controls.distorts:
        return gr.Image(visible=False)
    field = draw_field(work.controls.angle, work.controls.scale, work.size)
    return gr.Image(pixels_of(field[0]), visible=True)


def said_of(news: Snapshot, recipe: Recipe) -> str:
    """How far a computation is, in words."""
    several = f"level {news.level}, " if recipe.levels > 1 else ""
    return f"{several}sweep {news.sweep + 1}: {news.done:,} of {news.total:,} pixels"


def _on_the_way(stage: Stage, news: Snapshot, pyramids: Pyramids, work: Work) -> Updates:
    if news.begins and news.sweep == 0:
        pyramids.put("start", news.level, news.image)
    else:
        pyramids.put("result", news.level, news.image)
    return {
        stage.bar: bar(said_of(news, work.recipe), news.done / max(1, news.total)),
        stage.result: pixels_of(news.image[0]),
        stage.pyramids: pyramids.html(),
    }


def _finished(stage: Stage, visitor: Visitor, work: Work, news: Finished[Result]) -> Iterator[Updates]:
    result = news.value
    visitor.made = Made(result, work.sample, work.controls, dict(work.words), work.painted, news.seconds)
    height, width = result.image.shape[-2:]
    said = f"Done: {height} x {width} pixels in {news.seconds:.2f} s, {result.recipe.name}, seed {result.seeds[0]}"
    yield {stage.bar: bar(said, 1.0, "done"), stage.result: pixels_of(result.image[0])}
    files = write_files(visitor.made, visitor.files("result"))
    pyramids = Pyramids([level.exemplar for level in result.levels])
    for number, level in enumerate(result.levels):
        pyramids.put("start", number, level.start)
        pyramids.put("result", number, level.image)
    yield {
        stage.visitor: visitor,
        stage.pyramids: pyramids.html(),
        stage.missing: _missing(files),
        **{
            button: gr.DownloadButton(value=files.get(kind), interactive=kind in files)
            for kind, button in stage.downloads.items()
        },
    }


def _missing(files: Mapping[str, str]) -> str:
    """Why some of the buttons are gray."""
    reasons = "; ".join(reason for kind, reason in _REASONS.items() if kind not in files)
    return f"<div class='hint'>{reasons}</div>" if reasons else ""


def asked(stage: Stage, visitor: Visitor, plan: Callable[[Sample], Work]) -> Iterator[Updates]:
    """Make what is asked for of the visitor's sample; what is wrong with it is told, and nothing is made.

    Args:
        stage: Where it is shown.
        visitor: Who asks.
        plan: Says what is to be made of the sample.

    Yields:
        What the page shall show.
    """
    if visitor.sample is None:
        gr.Warning("The page is still loading: try again in a moment.")
        return
    try:
        work = plan(visitor.sample)
    except TorchsynthError as error:
        gr.Warning(str(error))
        yield {stage.bar: bar(str(error), 0.0, "failed")}
        return
    yield from perform(stage, visitor, work)


def on_click(
    button: gr.Button, make: Callable[..., Iterator[Updates]], inputs: list[Any], outputs: list[Any]
) -> None:
    """Have a button make something.

    A computation of one visitor does not wait for another's, and a second click does nothing while the first
    one's is running.
    """
    button.click(
        lambda *given: (yield from make(*given)),  # gradio streams only what looks like a generator function
        inputs, outputs, show_progress="hidden", concurrency_limit=None, trigger_mode="once",
    )  # fmt: skip
