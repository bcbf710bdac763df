"""The commands that complete pictures, from files to files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch

import torchsynth as ts
from torchsynth.cli import main
from torchsynth.io import read_picture

FAST = ("--recipe", "coherent_fill", "--set", "levels=1", "--set", "neighborhood=3")


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def runs(capsys):
    """Run a command that must succeed; returns what it printed on both streams."""

    def run(*arguments):
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert code == 0, err
        return out.splitlines(), err

    return run


@pytest.fixture
def fails(capsys):
    """Run a command that must fail; returns its one line, and sees to it that it left nothing."""

    def run(*arguments):
        before = sorted(Path().rglob("*"))
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
        assert len(err.splitlines()) == 1
        assert sorted(Path().rglob("*")) == before
        return err.removeprefix("error: ").strip()

    return run


def _hole(height=20, width=22):
    hole = torch.zeros(height, width, dtype=torch.bool)
    hole[6:12, 7:13] = True
    hole[0, :3] = True
    return hole


FORMS = [
    ("a.png", "8-bit", 1), ("a.png", "8-bit", 3), ("a.png", "8-bit", 4), ("a.png", "16-bit", 1),
    ("a.png", "16-bit", 3), ("a.tif", "float", 1), ("a.tif", "float", 3), ("a.tif", "16-bit", 5),
    ("a.bmp", "8-bit", 3), ("a.png", "1-bit", 1),
]  # fmt: skip


@pytest.mark.parametrize(("name", "depth", "channels"), FORMS)
def test_outside_the_hole_every_value_stays(make_exemplar, runs, name, depth, channels):
    image = make_exemplar(channels, 20, 22, seed=1)
    if depth == "1-bit":
        image = image.round()
    if depth in ("16-bit", "float"):
        image = (image * 0.9997 + 0.0001).clamp(0, 1)
    ts.write_image(image, name, depth=depth)
    ts.write_image(_hole()[None].float(), "hole.png")
    runs("fill", name, "hole.png", "-o", f"out{Path(name).suffix}", *FAST)
    before, after = read_picture(name), read_picture(f"out{Path(name).suffix}")
    assert after.depth == before.depth
    assert after.image[:, ~_hole()].equal(before.image[:, ~_hole()])
    assert not after.image.equal(before.image)
    runs("rerun", "out.json", "-o", f"again{Path(name).suffix}")
    assert Path(f"again{Path(name).suffix}").read_bytes() == Path(f"out{Path(name).suffix}").read_bytes()


def test_the_hole_may_be_marked_in_three_ways(make_exemplar, runs):
    image, hole = make_exemplar(3, 20, 22, seed=1) * 0.5, _hole()
    image = (image * 255).round() / 255
    ts.write_image(image, "photo.png")
    ts.write_image(hole[None].float(), "hole.png")
    ts.write_image(torch.cat((image, 1 - hole[None].float() * 0.8)), "alpha.png")
    magenta = torch.tensor([255.0, 0, 255]).view(3, 1, 1) / 255
    ts.write_image(torch.where(hole, magenta, image), "magenta.png")
    runs("fill", "photo.png", "hole.png", "-o", "one.png", *FAST)
    runs("fill", "alpha.png", "alpha", "-o", "two.png", *FAST)
    runs("fill", "magenta.png", "#FF00ff", "-o", "three.png", *FAST)
    one, two, three = (ts.read_image(f"{name}.png") for name in ("one", "two", "three"))
    assert one.equal(three)
    assert two[:3].equal(one)
    assert two[3].eq(1).all()
    assert json.loads(Path("two.json").read_text())["completion"] == {"task": "fill", "hole": "alpha"}
    for name in ("two", "three"):
        runs("rerun", f"{name}.json", "-o", "again.png", "--overwrite")
        assert Path("again.png").read_bytes() == Path(f"{name}.png").read_bytes()
    filled = ts.fill(image, hole, recipe=ts.load_recipe("coherent_fill", ["levels=1", "neighborhood=3"]))
    assert one.equal(filled.image[0])


def test_gray_in_a_mask_is_told(make_exemplar, runs):
    ts.write_image(make_exemplar(1, 20, 22), "photo.png")
    soft = _hole()[None].float()
    soft[0, 6, 6], soft[0, 12, 12] = 0.6, 0.4
    ts.write_image(soft, "hole.png")
    _, err = runs("fill", "photo.png", "hole.png", "-o", "out.png", *FAST)
    assert err == (
        "note: 2 pixel(s) of the hole are gray: those lighter than half are filled, the others are not\n"
    )
    before, after = ts.read_image("photo.png"), ts.read_image("out.png")
    hole = soft[0] > 0.5
    assert after[:, ~hole].equal(before[:, ~hole])


def test_other_pictures_regions_and_outputs(make_exemplar, runs):
    ts.write_image(make_exemplar(1, 20, 22, seed=1) / 2, "photo.png")
    ts.write_image(make_exemplar(1, 24, 24, seed=2) / 2 + 0.5, "other.png")
    region = torch.zeros(1, 24, 24)
    region[:, :12, :12] = 1
    ts.write_image(region, "region.png")
    ts.write_image(_hole()[None].float(), "hole.png")
    out, _ = runs(
        "fill", "photo.png", "hole.png", "--from", "other.png", "--sample-from", "region.png", "-o", "out.png",
        "--count", 2, "--seed", 3, "--source-map", "map.npz", "--figure", "patches=seams.png", *FAST,
    )  # fmt: skip
    assert out == ["out-0.png", "out-1.png"]
    filled = ts.read_image("out-0.png")
    assert (filled[:, _hole()] > 0.49).all()
    assert not filled.equal(ts.read_image("out-1.png"))
    assert Path("map-1.npz").exists()
    assert ts.read_image("seams-1.png").shape == (3, 20, 22)
    runs("rerun", "out-1.json", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out-1.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "size", "at"),
    [
        (("--size", "23x30"), (23, 30), (1, 4)),
        (("--by", "2"), (24, 26), (2, 2)),
        (("--size", "20x30", "--at", "0,8"), (20, 30), (0, 8)),
    ],
)
def test_extend(make_exemplar, runs, arguments, size, at):
    ts.write_image(make_exemplar(3, 20, 22, seed=1), "photo.png")
    runs("extend", "photo.png", "-o", "out.png", *arguments, *FAST)
    image, result = ts.read_image("photo.png"), ts.read_image("out.png")
    assert result.shape == (3, *size)
    assert result[:, at[0] : at[0] + 20, at[1] : at[1] + 22].equal(image)
    runs("rerun", "out.json", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


def test_tile(make_exemplar, runs):
    ts.write_image(make_exemplar(3, 20, 22, seed=1), "photo.png")
    ts.write_image(_hole()[None].float(), "hole.png")
    runs("tile", "photo.png", "-o", "out.png", "--width", 4, "--hole", "hole.png", *FAST)
    image, result = ts.read_image("photo.png"), ts.read_image("out.png")
    kept = ~_hole()
    kept[:2], kept[-2:], kept[:, :2], kept[:, -2:] = False, False, False, False
    assert result[:, kept].equal(image[:, kept])
    assert json.loads(Path("out.json").read_text())["recipe"]["boundary"] == "torus"
    runs("rerun", "out.json", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


def test_the_usual_recipe_is_recorded(make_exemplar, runs):
    ts.write_image(make_exemplar(1, 20, 22, seed=1), "photo.png")
    ts.write_image(_hole()[None].float(), "hole.png")
    runs("fill", "photo.png", "hole.png", "-o", "out.png")
    recipe = json.loads(Path("out.json").read_text())["recipe"]
    assert (recipe["name"], recipe["levels"]) == ("coherent_fill", 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fill", "a.png", "black.png"), "hole: must mark something, but it marks nothing"),
        (("fill", "a.png", "white.png"), "hole: must leave something of the picture"),
        (("fill", "a.png", "small.png"), "hole: must have the image's shape (20, 22), but its shape is (9, 9)"),
        (("fill", "a.png", "nothing.png"), "hole: must be a picture file, the word alpha, or a color #rrggbb"),
        (("fill", "a.png", "alpha"), "hole: can be the alpha channel of a picture that has one, but it has 1"),
        (("fill", "a.png", "#12345"), "hole: must be a picture file, the word alpha, or a color #rrggbb"),
        (("fill", "a.png", "#123456"), "hole: must mark something, but it marks nothing"),
        (("fill", "a.png", "hole.png", "--from", "rgb.png"), "exemplar: must have the picture's 1 channel(s)"),
        (("fill", "a.png", "hole.png", "--sample-from", "small.png"), "valid: must have the image's shape"),
        (("fill", "a.png", "hole.png", "--within", "0"), "within: must be a whole number of pixels, 1 or more"),
        (("fill", "a.png", "hole.png", "--count", "0"), "--count: must be from 1 to 10000"),
        (("fill", "a.png", "hole.png", "--recipe", "ashikhmin"), "ashikhmin: must work with the boundary 'open'"),
        (("fill", "a.png", "hole.png", "--recipe", "efros_leung", "--set", "window=19"), "what may be sampled"),
        (("extend", "a.png"), "--size and --by: one of them must be given, but neither is given"),
        (("extend", "a.png", "--size", "30x30", "--by", "2"), "--size and --by: one of them must be given"),
        (("extend", "a.png", "--size", "10x30"), "size: must be larger than the picture's, 20x22"),
        (("extend", "a.png", "--by", "0"), "by: must be a whole number of pixels, 1 or more"),
        (("extend", "a.png", "--by", "2", "--at", "5"), "--at: must be ROW,COLUMN in pixels, but it is '5'"),
        (("extend", "a.png", "--by", "2", "--at", "5,0"), "at: must leave the picture inside"),
        (("tile", "a.png", "--width", "20"), "width: must be less than the picture's shorter side, 20"),
        (("tile", "missing.png"), "missing.png: must be a readable"),
    ],
)  # fmt: skip
def test_wrong_input_gets_one_line(make_exemplar, fails, arguments, message):
    ts.write_image(make_exemplar(1, 20, 22), "a.png")
    ts.write_image(make_exemplar(3, 20, 22), "rgb.png")
    ts.write_image(_hole()[None].float(), "hole.png")
    for name, shape, value in (("black", (20, 22), 0.0), ("white", (20, 22), 1.0), ("small", (9, 9), 1.0)):
        ts.write_image(torch.full((1, *shape), value), f"{name}.png")
    assert message in fails(*arguments, "-o", "out.png")


def test_nothing_is_overwritten(make_exemplar, fails):
    ts.write_image(make_exemplar(1, 20, 22), "a.png")
    ts.write_image(_hole()[None].float(), "hole.png")
    assert "it is an input as well" in fails("fill", "a.png", "hole.png", "-o", "hole.png", "--overwrite")


def test_synthesizing_by_growing(make_exemplar, runs, fails):
    ts.write_image(make_exemplar(1, 16, 16), "a.png")
    runs(
        "synthesize",
        "a.png",
        "-o",
        "out.png",
        "--recipe",
        "efros_leung",
        "--set",
        "window=3",
        "--size",
        "9x11",
    )
    assert ts.read_image("out.png").shape == (1, 9, 11)
    assert "grows from what is known" in fails(
        "synthesize", "a.png", "-o", "x.png", "--recipe", "coherent_fill"
    )
