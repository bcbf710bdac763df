"""The side of the page: the sample, the recipe and the size, chosen once for all tabs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from torchsynth.config import dump_recipe, load_recipe, parse_recipe
from torchsynth.errors import TorchsynthError
from torchsynth.recipe import Recipe
from torchsynth.recipes import RECIPES
from torchsynth.samples import PREFIX, SAMPLES, sample_path
from torchsynth.studio import notes
from torchsynth.studio.edits import complete
from torchsynth.studio.palette import color_at, palette, with_color
from torchsynth.studio.pictures import enlarged, pixels_of
from torchsynth.studio.toolkit import gr
from torchsynth.studio.visitor import Sample, Visitor
from torchsynth.studio.work import read_sample, recipe_from, upload_name
from torchsynth.yaml_text import parse_yaml, read_yaml

FIRST_SAMPLE = "pebbles"
FIRST_RECIPE = "ashikhmin"
FIRST_SHAPE = (128, 128)

_SENT = 512
_PENDING = "<div class='hint'>This text is not applied yet.</div>"


@dataclass(frozen=True)
class Side:
    """What is chosen at the side.

    Args:
        visitor: The visitor.
        recipe: The recipe as plain data; whatever changes it, all that shows it follows.
        colors: The brush's colors.
        turn: Counts samples, so that what depends on the sample can follow it.
    """

    visitor: gr.State
    recipe: gr.State
    colors: gr.State
    turn: gr.State
    height: gr.Number
    width: gr.Number
    seed: gr.Number

    @property
    def asked(self) -> list[Any]:
        """What every synthesis is asked with: visitor, recipe, height, width, seed."""
        return [self.visitor, self.recipe, self.height, self.width, self.seed]


def build(page: gr.Blocks) -> Side:
    """Lay the side out.

    Args:
        page: The page.
    """
    visitor = gr.State(Visitor(), delete_callback=Visitor.close)
    recipe = gr.State(complete(load_recipe(FIRST_RECIPE)))
    colors, turn = gr.State([]), gr.State(0)
    notes.section("Sample")
    _build_sample(page, visitor, colors, turn)
    notes.section("Recipe")
    _build_recipe(page, visitor, recipe)
    notes.section("Output")
    with gr.Row():
        height, width, seed = (
            # No limits: see .numbers, which checks what is typed here.
            gr.Number(value, label=label, min_width=70, elem_id=label.lower())
            for label, value in (("Height", FIRST_SHAPE[0]), ("Width", FIRST_SHAPE[1]), ("Seed", 0))
        )
    return Side(visitor, recipe, colors, turn, height, width, seed)


def _build_sample(page: gr.Blocks, visitor: gr.State, colors: gr.State, turn: gr.State) -> None:
    names = list(SAMPLES)
    shown = gr.Image(
        label="Sample", elem_id="sample", format="png", interactive=False, height=216, show_label=False,
        buttons=["fullscreen"],
    )  # fmt: skip
    about = notes.hint("", "about-sample")
    thumbnails = gr.Gallery(
        [(str(sample_path(f"{PREFIX}{name}")), name) for name in names],
        columns=4, rows=1, height=92, allow_preview=False, show_label=False, interactive=False,
        object_fit="cover", elem_id="thumbnails", format="png", buttons=[],
    )  # fmt: skip
    upload = gr.UploadButton(
        "Upload a sample", size="sm", file_count="single", elem_id="upload-sample", type="filepath"
    )

    def show(who: Visitor, count: int, path: str, name: str) -> dict[Any, Any]:
        try:
            who.sample = read_sample(path, name)
        except TorchsynthError as error:
            gr.Warning(str(error))
            return {turn: count}
        image = who.sample.picture.image
        return {
            visitor: who, turn: count + 1, shown: enlarged(pixels_of(image), _enlargement(who.sample)), colors: palette(image),
            about: _about(who.sample),
        }  # fmt: skip

    outputs = [visitor, turn, shown, colors, about]

    def pick(who: Visitor, count: int, event: gr.SelectData) -> dict[Any, Any]:
        path = f"{PREFIX}{names[event.index]}"
        return show(who, count, path, path)

    def take(who: Visitor, count: int, path: str) -> dict[Any, Any]:
        return show(who, count, path, upload_name(path))

    def begin(who: Visitor, count: int) -> dict[Any, Any]:
        path = f"{PREFIX}{FIRST_SAMPLE}"
        return show(who, count, path, path)

    def add_color(who: Visitor, known: list[str], event: gr.SelectData) -> list[str]:
        if who.sample is None:
            return known
        image, factor = who.sample.picture.image, _enlargement(who.sample)
        column, row = (
            min(int(at) // factor, side - 1)
            for at, side in zip(event.index, reversed(who.sample.shape), strict=True)
        )
        return with_color(known, color_at(image, row, column))

    thumbnails.select(pick, [visitor, turn], outputs, show_progress="hidden")
    upload.upload(take, [visitor, turn, upload], outputs, show_progress="hidden")
    page.load(begin, [visitor, turn], outputs, show_progress="hidden")
    shown.select(add_color, [visitor, colors], colors, show_progress="hidden")


def _enlargement(sample: Sample) -> int:
    """Gradio reckons with pictures that are shown smaller than they are, so the sample is sent larger."""
    return math.ceil(_SENT / max(sample.shape))


def _about(sample: Sample) -> str:
    height, width = sample.shape
    channels = {1: "gray", 2: "gray + alpha", 3: "RGB", 4: "RGBA"}
    number = len(sample.picture.image)
    kind = channels.get(number, f"{number} channels")
    facts = f"{height} &times; {width} &middot; {kind}, {sample.picture.depth}"
    return f"<div class='hint'><b>{escape(sample.name)}</b> &middot; {facts}</div>"


def _build_recipe(page: gr.Blocks, visitor: gr.State, recipe: gr.State) -> None:
    first = load_recipe(FIRST_RECIPE)
    chosen = gr.Dropdown(
        list(RECIPES), value=FIRST_RECIPE, show_label=False, label="Recipe", elem_id="recipe", container=False
    )
    about = notes.html(_described(first), "about-recipe")
    with gr.Accordion("As YAML", open=False, elem_id="yaml-panel"):
        with gr.Row():
            apply = gr.Button("Apply", size="sm", elem_id="apply-yaml", min_width=80)
            load = gr.UploadButton("Load a file", size="sm", elem_id="load-yaml", min_width=80)
            save = gr.DownloadButton("Download", size="sm", elem_id="save-yaml", min_width=80)
        pending = notes.html("", "pending-yaml")
        text = gr.Code(
            dump_recipe(first),
            language="yaml",
            show_label=False,
            elem_id="yaml",
            max_lines=24,
            interactive=True,
        )
    drawn = gr.State(dump_recipe(first))

    def pick(name: str) -> dict[str, Any]:
        return complete(load_recipe(name))

    def read(written: str) -> dict[Any, Any]:
        try:
            return {recipe: complete(parse_recipe(parse_yaml(written, "YAML"), "YAML")), pending: ""}
        except TorchsynthError as error:
            return {pending: f"<p class='recipe-error'>Not applied. {escape(str(error))}</p>"}

    def leave(written: str, known: str) -> dict[Any, Any]:
        return {pending: ""} if written == known else read(written)

    def load_file(path: str, present: dict[str, Any]) -> dict[str, Any]:
        return _or_warn(lambda: _loaded(path), present)

    def show(who: Visitor, data: dict[str, Any]) -> tuple[str, str, str, str, str]:
        made = recipe_from(data)
        file = who.files("recipe") / f"{made.name.replace(' ', '-').replace('/', '-')}.yaml"
        file.write_text(dump_recipe(made), encoding="utf-8")
        return dump_recipe(made), dump_recipe(made), _described(made), str(file), ""

    chosen.input(pick, chosen, recipe, show_progress="hidden")
    apply.click(read, text, [recipe, pending], show_progress="hidden")
    # Queued, as nobody is told of states that change outside of the queue.
    text.blur(leave, [text, drawn], [recipe, pending], show_progress="hidden")
    text.input(
        lambda written, known: "" if written == known else _PENDING,
        [text, drawn], pending, show_progress="hidden", queue=False, trigger_mode="always_last",
    )  # fmt: skip
    load.upload(load_file, [load, recipe], recipe, show_progress="hidden")
    for event in (recipe.change, page.load):
        event(show, [visitor, recipe], [text, drawn, about, save, pending], show_progress="hidden")


def _or_warn(read: Callable[[], Recipe], present: dict[str, Any]) -> dict[str, Any]:
    """What was read; if it is no recipe, a message, and what there was."""
    try:
        return complete(read())
    except TorchsynthError as error:
        gr.Warning(str(error))
        return present


def _loaded(path: str) -> Recipe:
    name = upload_name(path)
    return parse_recipe(read_yaml(Path(path), name), name)


def _described(recipe: Recipe) -> str:
    about = escape(recipe.description or "a recipe of your own")
    return f"<div class='hint'><b>{escape(recipe.name)}</b> &middot; {about}</div>"
