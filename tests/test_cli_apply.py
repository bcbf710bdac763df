"""The command ``torchsynth apply``."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import torchsynth as ts
from torchsynth.cli import main
from torchsynth.io import read_picture


@pytest.fixture
def files(tmp_path, make_exemplar, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ts.write_image(make_exemplar(3, 20, 22), "exemplar.png")
    ts.write_image(torch.rand(3, 20, 22, generator=torch.Generator().manual_seed(1)), "normal.png")
    ts.write_image(
        torch.rand(1, 20, 22, generator=torch.Generator().manual_seed(2)), "height.png", depth="16-bit"
    )
    ts.write_image(
        torch.rand(1, 20, 22, generator=torch.Generator().manual_seed(3)), "rough.tif", depth="float"
    )
    arguments = ["synthesize", "exemplar.png", "--recipe", "ashikhmin", "--size", "9x11", "-o", "out.png"]
    assert main([*arguments, "--source-map", "map.npz"]) == 0
    return tmp_path


def test_maps_are_carried_over_in_their_depth(files, capsys):
    capsys.readouterr()
    names = ["normal.png", "height.png", "rough.tif"]
    assert main(["apply", "map.npz", *names, "--out", "made"]) == 0
    assert capsys.readouterr().out.split() == [f"made/{name}" for name in names]
    rows, columns = np.load("map.npz")["source"]
    for name in names:
        one, made = (read_picture(folder / name) for folder in (files, files / "made"))
        assert made.depth == one.depth
        assert made.image.equal(one.image[:, rows, columns])


def test_the_exemplar_itself_gives_the_output(files):
    assert main(["apply", "map.npz", "exemplar.png", "--out", "made"]) == 0
    assert ts.read_image(files / "made" / "exemplar.png").equal(ts.read_image("out.png"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["map.npz", "small.png", "--out", "made"], "small.png: must have the exemplar's size, 20x22, but it is 9x11"),
        (["map.npz", "none.png", "--out", "made"], "none.png: must be a readable image file"),
        (["none.npz", "normal.png", "--out", "made"], "none.npz: must be a readable .npz file"),
        (["out.png", "normal.png", "--out", "made"], "out.png: must be a source map"),
        (["map.npz", "normal.png", "--out", "map.npz"], "map.npz: must be a folder, but it is a file"),
        (["map.npz", "normal.png", "--out", "."], "normal.png: must be a file of its own, but it is a map as well"),
        (["map.npz", "normal.png", "full/normal.png", "--out", "made"], "made/normal.png: must be a file of its own"),
        (["map.npz", "normal.png", "--out", "full"], "full/normal.png: must not exist yet"),
        (["map.npz", "normal.png", "--out", "no/made"], "no/made: its folder must exist"),
        (["outside.npz", "normal.png", "--out", "made"], "outside.npz: must lead into an exemplar of 20x22"),
        (["given.npz", "normal.png", "--out", "made"], "transfer: needs a source for every pixel"),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_one_line(files, capsys, arguments, message):
    ts.write_image(ts.read_image("out.png"), "small.png")
    (files / "full").mkdir()
    ts.write_image(ts.read_image("normal.png"), files / "full" / "normal.png")
    held = dict(np.load("map.npz"))
    for name, value in (("outside", 20), ("given", -1)):
        source = held["source"].copy()
        source[:, 2, 3] = value
        np.savez(f"{name}.npz", source=source, exemplar_size=held["exemplar_size"])
    before = sorted(files.rglob("*"))
    capsys.readouterr()
    assert main(["apply", *arguments]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: {message}")
    assert told.count("\n") == 1
    assert sorted(files.rglob("*")) == before
