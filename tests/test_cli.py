"""The command line, from a file to a file."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

import torchsynth as ts
from torchsynth.cli import main
from torchsynth.config import parse_recipe
from torchsynth.io import read_picture
from torchsynth.progress import progress_bar
from torchsynth.recipes import RECIPES
from torchsynth.samples import SAMPLES

FAST = ("--recipe", "wei_levoy_single", "--set", "sweeps[0].layers[0].template.size=3")


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def runs(capsys):
    """Run a command that must succeed and say nothing on stderr; returns the lines it printed."""

    def run(*arguments):
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert (code, err) == (0, "")
        return out.splitlines()

    return run


def files():
    return sorted(str(path) for path in Path().rglob("*") if path.is_file())


def chosen_from(image, exemplar, source):
    return torch.equal(image, exemplar[:, source[0], source[1]])


FORMS = [
    ("a.png", "1-bit", 1), ("a.png", "8-bit", 1), ("a.png", "8-bit", 2), ("a.png", "8-bit", 3),
    ("a.png", "8-bit", 4), ("a.png", "16-bit", 1), ("a.png", "16-bit", 2), ("a.png", "16-bit", 3),
    ("a.png", "16-bit", 4), ("a.tif", "float", 1), ("a.tif", "float", 3), ("a.tif", "16-bit", 5),
    ("a.bmp", "8-bit", 3), ("a.webp", "8-bit", 4),
]  # fmt: skip


@pytest.mark.parametrize(("name", "depth", "channels"), FORMS)
def test_every_pixel_of_the_output_file_is_one_of_the_exemplar_file(runs, name, depth, channels):
    exemplar = torch.rand(channels, 9, 11)
    steps = {"1-bit": 1, "8-bit": 255, "16-bit": 65535, "float": 2**20}[depth]
    ts.write_image((exemplar * steps).round() / steps, name, depth=depth)
    output = f"out{Path(name).suffix}"
    arguments = (name, "-o", output, *FAST, "--size", "6x7", "--source-map", "map.npz")
    assert runs("synthesize", *arguments) == [output]
    original, made = read_picture(name), read_picture(output)
    assert made.depth == original.depth == depth
    assert made.image.shape == (channels, 6, 7)
    with np.load("map.npz") as stored:
        source, size = torch.from_numpy(stored["source"]).long(), stored["exemplar_size"]
    assert tuple(size) == (9, 11)
    assert chosen_from(made.image, original.image, source)


def test_the_default_is_the_multiresolution_recipe_at_twice_the_size(runs, make_exemplar):
    ts.write_image(make_exemplar(height=10, width=11), "a.png")
    changes = ("levels=2", "sweeps[0].layers[0].template.size=3")
    runs("synthesize", "a.png", "-o", "out.png", "--set", changes[0], "--set", changes[1])
    record = json.loads(Path("out.json").read_text())
    assert record["recipe"]["name"] == "wei_levoy"
    assert record["size"] == [20, 22]
    expected = ts.synthesize(ts.read_image("a.png"), (20, 22), ts.load_recipe("wei_levoy", changes))
    assert torch.equal(ts.read_image("out.png"), (expected.image[0] * 255).round() / 255)


def test_the_record_makes_the_same_bytes_again(runs, make_exemplar):
    Path("in").mkdir()
    ts.write_image(make_exemplar(3, 12, 12), "in/a.png", depth="16-bit")
    ts.write_image((make_exemplar(1, 12, 12, seed=1) > 0.01).float(), "in/valid.png")
    ts.write_image(make_exemplar(3, 10, 8, seed=2), "in/start.png")
    runs("synthesize", "in/a.png", "-o", "out.png", *FAST, "--size", "10x8", "--seed", "77",
         "--valid", "in/valid.png", "--initial", "in/start.png")  # fmt: skip
    record = json.loads(Path("out.json").read_text())
    assert set(record) == {"recipe", "size", "seed", "inputs", "versions"}
    assert (record["seed"], record["size"]) == (77, [10, 8])
    assert record["inputs"]["exemplar"] == {"path": "in/a.png", "sha256": read_picture("in/a.png").sha256}
    assert record["versions"]["torch"] == torch.__version__
    assert runs("rerun", "out.json", "-o", "again.png") == ["again.png"]
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    assert Path("again.json").read_bytes() == Path("out.json").read_bytes()


def test_a_record_finds_its_exemplar_beside_it(runs, make_exemplar, monkeypatch):
    ts.write_image(make_exemplar(), "a.png")
    runs("synthesize", "a.png", "-o", "out.png", *FAST, "--size", "4x4")
    Path("elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    runs("rerun", "../out.json", "-o", "out.png")
    assert Path("out.png").read_bytes() == Path("../out.png").read_bytes()


def test_several_outputs_are_those_of_consecutive_seeds(runs, make_exemplar):
    """More than are made together: where the cut between them lies must not show."""
    ts.write_image(make_exemplar(), "a.png")
    size = ("--size", "5x7")
    printed = runs("synthesize", "a.png", "-o", "out.png", *FAST, *size, "--seed", "3", "--count", "9",
                   "--source-map", "map.npz", "--levels-dir", "levels")  # fmt: skip
    assert printed == [f"out-{number}.png" for number in range(9)]
    for number in (0, 7, 8):
        runs("synthesize", "a.png", "-o", f"one-{number}.png", *FAST, *size, "--seed", 3 + number)
        assert Path(f"one-{number}.png").read_bytes() == Path(f"out-{number}.png").read_bytes()
        assert json.loads(Path(f"out-{number}.json").read_text())["seed"] == 3 + number
        assert Path(f"map-{number}.npz").exists()
    assert len(list(Path("levels").iterdir())) == 9 * 3


def test_the_levels_are_written(runs, make_exemplar):
    ts.write_image(make_exemplar(3, 16, 12), "a.png")
    runs("synthesize", "a.png", "-o", "out.tif", "--levels-dir", "levels", "--size", "9x10",
         "--set", "levels=2", "--set", "sweeps[0].layers[0].template.size=3")  # fmt: skip
    shapes = {path.stem: tuple(ts.read_image(path).shape) for path in Path("levels").iterdir()}
    assert shapes == {
        "level-0-exemplar": (3, 16, 12), "level-0-start": (3, 9, 10), "level-0-image": (3, 9, 10),
        "level-1-exemplar": (3, 8, 6), "level-1-start": (3, 4, 5), "level-1-image": (3, 4, 5),
    }  # fmt: skip
    assert torch.equal(ts.read_image("levels/level-0-image.tif"), ts.read_image("out.tif"))
    assert torch.equal(ts.read_image("levels/level-0-exemplar.tif"), ts.read_image("a.png"))


def test_the_levels_of_a_black_and_white_picture_are_gray(runs, make_exemplar):
    ts.write_image((make_exemplar() > 0.5).float(), "a.png", depth="1-bit")
    runs("synthesize", "a.png", "-o", "out.png", "--levels-dir", "levels", "--size", "9x10",
         "--set", "levels=2", "--set", "sweeps[0].layers[0].template.size=3")  # fmt: skip
    assert read_picture("out.png").depth == "1-bit"
    assert len(ts.read_image("levels/level-1-exemplar.png").unique()) > 2


def test_only_the_valid_part_is_sampled(runs, make_exemplar):
    ts.write_image(make_exemplar(), "a.png")
    region = torch.zeros(1, 16, 16)
    region[:, 4:12, 6:14] = 1
    ts.write_image(
        torch.cat((region, torch.ones(1, 16, 16))), "valid.png"
    )  # an opaque alpha counts for nothing
    runs(
        "synthesize",
        "a.png",
        "-o",
        "out.png",
        *FAST,
        "--valid",
        "valid.png",
        "--size",
        "8x8",
        "--source-map",
        "map.npz",
    )
    with np.load("map.npz") as stored:
        rows, columns = stored["source"]
    assert region[0, rows, columns].all()


def test_an_initial_picture_replaces_the_noise(runs, make_exemplar):
    ts.write_image(make_exemplar(), "a.png")
    runs("synthesize", "a.png", "-o", "out.png", *FAST, "--initial", "a.png", "--size", "16x16",
         "--levels-dir", "levels")  # fmt: skip
    assert torch.equal(ts.read_image("levels/level-0-start.png"), ts.read_image("a.png"))


def test_a_recipe_file_can_be_given(runs, make_exemplar):
    ts.write_image(make_exemplar(), "a.png")
    Path("my.yaml").write_text("\n".join(runs("show", "wei_levoy_single")).replace("size: 11", "size: 3"))
    runs("synthesize", "a.png", "-o", "out.png", "--config", "my.yaml", "--size", "6x6")
    runs("synthesize", "a.png", "-o", "same.png", *FAST, "--size", "6x6")
    assert Path("out.png").read_bytes() == Path("same.png").read_bytes()


def test_overwrite_replaces_what_is_there(runs, make_exemplar):
    ts.write_image(make_exemplar(), "a.png")
    arguments = ("synthesize", "a.png", "-o", "out.png", *FAST, "--size", "4x4", "--overwrite",
                 "--levels-dir", "levels", "--source-map", "map.npz")  # fmt: skip
    runs(*arguments)
    first = {name: Path(name).read_bytes() for name in files()}
    runs(*arguments)
    assert {name: Path(name).read_bytes() for name in files()} == first


def test_a_sample_can_be_given(runs):
    runs("synthesize", "sample:brick", "-o", "out.png", *FAST, "--size", "4x4")
    runs("rerun", "out.json", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


@pytest.mark.parametrize(("command", "names"), [("recipes", RECIPES), ("samples", SAMPLES)])
def test_lists_have_one_plain_line_each(runs, command, names):
    lines = runs(command)
    prefix = "sample:" if command == "samples" else ""
    assert [line.split()[0] for line in lines] == [f"{prefix}{name}" for name in names]
    assert all(line == line.rstrip() and "  " in line for line in lines)


@pytest.mark.parametrize("name", RECIPES)
def test_show_prints_the_recipe(runs, name):
    assert parse_recipe(yaml.safe_load("\n".join(runs("show", name))), name) == RECIPES[name]()


def test_schema_prints_json(runs):
    assert json.loads("\n".join(runs("schema")))["title"] == "Recipe"


def test_version(runs):
    (line,) = runs("--version")
    assert line.startswith("torchsynth 0.")


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


def test_a_terminal_sees_the_progress(monkeypatch, make_exemplar):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress_bar() as progress:
        progress(2, 0, 150, 600, lambda: make_exemplar()[None])
    shown = sys.stderr.getvalue()
    assert "level 2 sweep 1" in shown
    assert "150/600" in shown


def test_a_pipe_sees_no_progress(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress_bar() as progress:
        assert progress is None


def test_the_installed_command(make_exemplar):
    """One real process: nothing but the path on stdout, nothing on stderr, then one error line."""
    ts.write_image(make_exemplar(), "a.png")
    command = [
        Path(sys.executable).with_name("torchsynth"),
        "synthesize",
        "a.png",
        "-o",
        "out.png",
        *FAST,
        "--size",
        "4x4",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "out.png\n", "")
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "error: out.png: must not exist yet, but it does; choose another name, or allow it with --overwrite (overwrite=True)\n"
    )
