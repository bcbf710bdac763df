"""The tab that compares two recipes on the same sample, size and seed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from torchsynth.config import load_recipe
from torchsynth.errors import TorchsynthError
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES
from torchsynth.result import Result
from torchsynth.studio import comparison, notes, side, stage
from torchsynth.studio.numbers import Number, asked_seed, asked_size
from torchsynth.studio.pictures import bar, pixels_of, table
from torchsynth.studio.running import CancelledError, Finished, followed
from torchsynth.studio.stage import Stage, Updates, said_of
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Sample, Visitor
from torchsynth.studio.work import Work, recipe_from, synthesis

_OWN = "the one on the left"
_SECOND = "wei_levoy"
_HINT = "Two recipes, with the same sample, size and seed."


def build(asked: side.Side, shown: Stage) -> None:
    """Lay the tab out."""
    with gr.Row(elem_classes="actions"):
        run = gr.Button("Compare", variant="primary", elem_id="compare", scale=0, min_width=130)
    notes.hint(_HINT)
    names = [_OWN, *RECIPES]
    with gr.Row():
        choices = [
            gr.Dropdown(names, value=value, label=f"Recipe {letter}", elem_id=f"recipe-{letter.lower()}")
            for letter, value in (("A", _OWN), ("B", _SECOND))
        ]
    with gr.Row():
        pictures = [_picture(letter) for letter in "AB"]
    measures = gr.HTML(elem_id="measures", padding=False)
    asked.recipe.change(_other, [asked.recipe, choices[1]], choices[1], show_progress="hidden")

    def make(
        visitor: Visitor,
        recipe: dict[str, Any],
        height: Number,
        width: Number,
        seed: Number,
        *names: str,
    ) -> Iterator[Updates]:
        if visitor.sample is None:
            return
        try:
            recipes = [_named(name, recipe) for name in names]
            size = asked_size(height, width)
            works = [synthesis(visitor.sample, one, size, asked_seed(seed)) for one in recipes]
        except TorchsynthError as error:
            gr.Warning(str(error))
            yield {shown.bar: bar(str(error), 0.0, "failed")}
            return
        yield {shown.visitor: visitor, measures: "", **dict.fromkeys(pictures)}
        yield from _compared(visitor, visitor.sample, works, shown, pictures, measures)

    stage.on_click(run, make, [*asked.asked, *choices], [shown.visitor, shown.bar, measures, *pictures])


def _compared(
    visitor: Visitor,
    sample: Sample,
    works: list[Work],
    shown: Stage,
    pictures: list[gr.Image],
    measures: gr.HTML,
) -> Iterator[Updates]:
    """One after the other, so that the times can be compared."""
    ended: list[Finished[Result]] = []
    try:
        for work, picture in zip(works, pictures, strict=True):
            title = f"{'AB'[len(ended)]}: {work.recipe.name}"
            for news in followed(work.make, visitor.begin()):
                if isinstance(news, Finished):
                    ended.append(news)
                    yield {picture: pixels_of(news.value.image[0])}
                else:
                    share = (len(ended) + news.done / max(1, news.total)) / len(works)
                    said = bar(f"{title}, {said_of(news, work.recipe)}", share)
                    yield {shown.visitor: visitor, shown.bar: said, picture: pixels_of(news.image[0])}
    except CancelledError:
        yield {shown.bar: bar("Cancelled", len(ended) / len(works), "cancelled")}
        return
    except TorchsynthError as error:
        gr.Warning(str(error))
        yield {shown.bar: bar(str(error), len(ended) / len(works), "failed")}
        return
    rows = comparison.rows(sample, [one.value for one in ended], [one.seconds for one in ended])
    heads = [f"{letter}: {work.recipe.name}" for letter, work in zip("AB", works, strict=True)]
    yield {shown.bar: bar("Done: both are made and measured", 1.0, "done"), measures: table(rows, heads)}


def _other(own: dict[str, Any], second: str) -> str:
    """Which recipe is B: another one than the one on the left."""
    return next(name for name in (second, side.FIRST_RECIPE, _SECOND) if name != own["name"])


def _picture(letter: str) -> gr.Image:
    """An output; which recipe it is of stands above it and in the table, where it hides nothing."""
    return gr.Image(
        label=letter, show_label=False, elem_id=f"result-{letter.lower()}", elem_classes="pair", format="png",
        interactive=False, height=360, buttons=["fullscreen", "download"], min_width=200,
    )  # fmt: skip


def _named(name: str, own: dict[str, Any]) -> Recipe:
    return recipe_from(own) if name == _OWN else load_recipe(name)
