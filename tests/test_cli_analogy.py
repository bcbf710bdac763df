"""The command ``torchsynth analogy``, and recipes with a structure on the command line."""

from __future__ import annotations

import json

import pytest
import torch

import torchsynth as ts
from torchsynth.cli import main


@pytest.fixture
def files(tmp_path, make_exemplar, monkeypatch):
    monkeypatch.chdir(tmp_path)
    a = (make_exemplar(1, 24, 26, seed=1) * 255).round() / 255
    ts.write_image(a, "a.png")
    ts.write_image(1 - a, "a-prime.png")
    ts.write_image(make_exemplar(1, 12, 17, seed=2), "b.png")
    ts.write_image((a > 0.5).float(), "labels.png")
    return tmp_path


def test_an_analogy_is_made_and_made_again(files, capsys):
    assert main(["analogy", "a.png", "a-prime.png", "b.png", "-o", "out.png", "--source-map", "map.npz"]) == 0
    made = ts.analogy(*(ts.read_image(name) for name in ("a.png", "a-prime.png", "b.png")))
    assert ts.read_image("out.png").equal(made.image[0])
    assert main(["rerun", "out.json", "-o", "again.png"]) == 0
    assert (files / "again.png").read_bytes() == (files / "out.png").read_bytes()
    record = json.loads((files / "out.json").read_text())
    assert {name: one["path"] for name, one in record["inputs"].items()} == {
        "exemplar": "a-prime.png", "guide": "a.png", "output_guide": "b.png",
    }  # fmt: skip
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("files")
def test_recipe_parameters_and_counts_reach_it():
    arguments = ["analogy", "a.png", "a-prime.png", "b.png", "-o", "out.png", "--count", "2"]
    assert main([*arguments, "--set", "levels=1", "--set", "search=tsvq"]) == 0
    pictures = [ts.read_image(name) for name in ("a.png", "a-prime.png", "b.png")]
    made = ts.analogy(*pictures, ts.recipes.analogy(levels=1, search="tsvq"), seed=[0, 1])
    assert ts.read_image("out-1.png").equal(made.image[1])


@pytest.mark.usefixtures("files")
def test_labels_are_told_apart():
    ts.write_image((torch.rand(1, 9, 8, generator=torch.Generator().manual_seed(3)) > 0.5).float(), "to.png")
    assert main(["analogy", "labels.png", "a.png", "to.png", "-o", "out.png", "--labels"]) == 0
    pictures = [ts.read_image(name) for name in ("labels.png", "a.png", "to.png")]
    assert ts.read_image("out.png").equal(ts.analogy(*pictures, labels=True).image[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.png", "b.png", "b.png"], "A: must have the height and width of A', (12, 17), but its shape is (1, 24, 26)"),
        (["a.png", "a-prime.png", "none.png"], "none.png: must be a readable image file"),
        (["a.png", "a-prime.png", "b.png", "--labels"], "A: a map must have at most 64 labels"),
        (["labels.png", "a.png", "b.png", "--labels"], "B: must show labels of A only"),
        (["a.png", "a-prime.png", "b.png", "--recipe", "wei_levoy"], "guide: must be given to a recipe that compares it"),
        (["a.png", "a-prime.png", "b.png", "--set", "guide=4"], "analogy: guide=4: must suit the recipe: a side must be odd, but 4 is even"),
        (["b.png", "b.png", "a.png", "--set", "neighborhood=19"], "exemplar: the 19x19 result + 3x3 coarse + 5x5 guide"),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_one_line(files, capsys, arguments, message):
    before = sorted(path.name for path in files.iterdir())
    assert main(["analogy", *arguments, "-o", "out.png"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: {message}")
    assert told.count("\n") == 1
    assert sorted(path.name for path in files.iterdir()) == before


def test_what_was_chosen_is_said_and_recorded(files, capsys):
    arguments = ["synthesize", "a.png", "--recipe", "improved_wl", "--size", "9x9", "--levels-dir", "levels"]
    small = ["--set", "levels=2", "--set", "neighborhood=3", "--set", "parent=3"]
    assert main([*arguments, *small, "-o", "out.png"]) == 0
    result = ts.synthesize(
        ts.read_image("a.png"), (9, 9), ts.recipes.improved_wl(levels=2, neighborhood=3, parent=3)
    )
    structure = result.recipe.structure
    what = {"erode": "dark", "dilate": "bright"}[structure.operation]
    side = f"{structure.size}x{structure.size}"
    assert (
        f"note: the {what} edges of the exemplar were widened with a {side} square" in capsys.readouterr().err
    )
    recorded = json.loads((files / "out.json").read_text())["recipe"]["structure"]
    assert (recorded["operation"], recorded["size"]) == (structure.operation, structure.size)
    written = ts.read_image("levels/structure-level-1-image.png")
    assert (written * 255).round().equal((result.structure.levels[1].image[0] * 255).round())
