"""``torchsynth measure``, from files to numbers."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import torch

import torchsynth as ts
from torchsynth.cli import main
from torchsynth.metrics import Measures
from torchsynth.source_map import read_source_map

SIZE = (32, 36)


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def runs(capsys):
    """Run a command that must succeed and say nothing on stderr; returns what it printed."""

    def run(*arguments):
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert (code, err) == (0, "")
        return out

    return run


@pytest.fixture
def fails(capsys):
    """Run a command that must fail; returns its one line."""

    def run(*arguments):
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
        assert len(err.splitlines()) == 1
        return err.removeprefix("error: ").strip()

    return run


@pytest.fixture
def synthesized():
    """Two outputs with their source maps, made from a part of a sample."""
    ts.write_image(ts.read_image("sample:gravel")[:, :48, :50], "gravel.png")
    arguments = ["synthesize", "gravel.png", "--recipe", "ashikhmin", "--size", "32x36", "--count", "2"]
    assert main([*arguments, "-o", "out.png", "--source-map", "map.npz"]) == 0
    return ["out-0.png", "out-1.png"], ["map-0.npz", "map-1.npz"]


def saved(name="map.npz", **arrays):
    np.savez(name, **arrays)
    return name


def test_json_holds_what_measure_finds(synthesized, runs):
    outputs, maps = synthesized
    given = [word for path in maps for word in ("--source-map", path)]
    runs("measure", *outputs, "--exemplar", "gravel.png", *given)
    found = json.loads(runs("measure", *outputs, "--exemplar", "gravel.png", *given, "--json"))
    recipe = ts.recipes.ashikhmin()
    exemplar = ts.read_image("gravel.png")
    result = ts.synthesize(exemplar, SIZE, recipe, seed=[0, 1])
    expected = ts.metrics.measure(torch.stack([*map(ts.read_image, outputs)]), exemplar, result.source).rows()
    named = [
        {"output": output, "source_map": path, **row}
        for output, path, row in zip(outputs, maps, expected, strict=True)
    ]
    assert found == {"exemplar": "gravel.png", "outputs": named}
    assert all(row["run_length"] > 1 and row["coverage"] > 0.1 for row in named)


def test_without_source_maps_copies_are_looked_for(synthesized, runs):
    outputs, maps = synthesized
    found = json.loads(runs("measure", outputs[0], "--exemplar", "gravel.png", "--json"))["outputs"][0]
    told = runs("measure", outputs[0], "--exemplar", "gravel.png", "--source-map", maps[0], "--json")
    for name in ("copied", "repetition"):
        assert found[name] == pytest.approx(json.loads(told)["outputs"][0][name], abs=0.01)
    assert found["copied"] > 0
    assert found["run_length"] is found["coverage"] is found["source_map"] is None


def test_the_table_has_a_line_for_each_measure(runs):
    lines = runs("measure", "sample:brick", "sample:grass", "--exemplar", "sample:brick").splitlines()
    names = [name.replace("_", " ") for name in Measures.__dataclass_fields__]
    assert lines[0] == "sample:brick"
    assert [line.strip().split("  ")[0] for line in lines[1:10]] == names
    assert lines[10] == "sample:grass"
    assert lines[-1].startswith("Without --source-map")
    by_name = dict(zip(names, lines[1:10], strict=True))
    assert "  0   1: as close to the exemplar as two real crops are" in by_name["patch distance"]
    assert "  1   share of 11x11 windows that are verbatim copies" in by_name["copied"]
    assert "  -   pixels" in by_name["run length"]
    assert "-" not in lines[7].split("   ")[0]


def test_alpha_is_a_channel(runs):
    image = torch.rand(4, 20, 20)
    ts.write_image(image, "a.png")
    found = json.loads(runs("measure", "a.png", "--exemplar", "a.png", "--json"))["outputs"][0]
    assert (found["patch_distance"], found["sharpness"], found["copied"]) == (0, 1, 1)


WRONG = [
    (["none.png", "--exemplar", "gravel.png"], "none.png: must be a readable image file"),
    (["out-0.png", "--exemplar", "none.png"], "none.png: must be a readable image file"),
    (["map-0.npz", "--exemplar", "gravel.png"], "map-0.npz: must be a PNG"),
    (["sample:pebbles", "--exemplar", "gravel.png"], "must have as many channels as the exemplar, 1, but it has 3"),
    (["small.png", "--exemplar", "gravel.png"], "small.png: must have at least 14 pixels a side"),
    (["out-0.png", "--exemplar", "small.png"], "small.png: must have at least 14 pixels a side"),
    (["out-0.png", "out-1.png", "--exemplar", "gravel.png", "--source-map", "map-0.npz"], "once for each output, 2"),
    (["small.png", "--exemplar", "gravel.png", "--source-map", "map-0.npz"], "small.png"),
    (["gravel.png", "--exemplar", "gravel.png", "--source-map", "map-0.npz"], "size of the output, 48x50, but it has 32x36"),
    (["out-0.png", "--exemplar", "sample:gravel", "--source-map", "map-0.npz"], "into the exemplar, 128x128, but it was made for one of 48x50"),
    (["out-0.png", "--exemplar", "gravel.png", "--source-map", "map-1.npz"], "map-1.npz: must lead to the colors of the output"),
    (["out-0.png", "--exemplar", "gravel.png", "--source-map", "none.npz"], "none.npz: must be a readable .npz file"),
    (["out-0.png", "--exemplar", "gravel.png", "--source-map", "."], ".: must be a readable .npz file"),
    (["out-0.png", "--exemplar", "gravel.png", "--source-map", "out-0.png"], "damaged, or another kind of file"),
    (["out-0.png", "--exemplar", "gravel.png", "--source-map", "outside.npz"], "outside.npz: must lead into the exemplar, 48x50, or be -1"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "said"), WRONG)
def test_what_cannot_be_measured_is_one_line(synthesized, capsys, fails, given, said):
    ts.write_image(torch.rand(1, 13, 30), "small.png")
    with np.load("map-0.npz") as stored:
        saved("outside.npz", source=stored["source"] + 20, exemplar_size=stored["exemplar_size"])
    capsys.readouterr()
    assert synthesized
    assert said in fails("measure", *given)


GOOD = {"source": np.zeros((2, 3, 4), np.int32), "exemplar_size": np.array([5, 6], np.int32)}
FORMS = [
    ({}, "holds no 'source'"),
    ({"source": GOOD["source"]}, "holds no 'exemplar_size'"),
    (GOOD | {"source": np.zeros((2, 3))}, "its 'source' has shape (2, 3) and dtype float64"),
    (GOOD | {"source": np.zeros((2, 3, 4))}, "dtype float64"),
    (GOOD | {"source": np.zeros((3, 3, 4), int)}, "its arrays have shapes (3, 3, 4) and (2,)"),
    (GOOD | {"source": np.zeros((2, 0, 4), int)}, "its 'source' has shape (2, 0, 4)"),
    (GOOD | {"exemplar_size": np.array([5, 6, 7])}, "its arrays have shapes (2, 3, 4) and (3,)"),
    (GOOD | {"source": np.array([None])}, "damaged, or another kind of file"),
]


class TestReadSourceMap:
    def test_what_is_written_is_read(self):
        found = read_source_map(Path(saved(**GOOD)))
        assert found.source.equal(torch.zeros(1, 2, 3, 4, dtype=torch.int64))
        assert found.exemplar == (5, 6)

    @pytest.mark.parametrize(("arrays", "said"), FORMS)
    def test_other_arrays(self, arrays, said):
        with pytest.raises(ts.InputError, match="must be a source map") as caught:
            read_source_map(Path(saved(**arrays)))
        assert said in str(caught.value)

    def test_a_single_array(self):
        np.save("one.npy", GOOD["source"])
        with pytest.raises(ts.InputError, match="it holds no 'source'"):
            read_source_map(Path("one.npy"))

    def test_a_damaged_file_is_never_more_than_an_error(self):
        """Cut anywhere, and with every byte changed in turn, it is refused or read as something."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **GOOD)
        data = buffer.getvalue()
        path = Path("map.npz")
        refused = 0
        for place in range(len(data)):
            for damaged in (data[:place], data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :]):
                path.write_bytes(damaged)
                try:
                    read_source_map(path)
                except ts.InputError:
                    refused += 1
        assert refused > len(data)
