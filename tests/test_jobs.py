"""Jobs: from files to files, seen from Python."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch

import torchsynth as ts
from torchsynth import memory
from torchsynth.jobs import Files, run
from torchsynth.recipes import wei_levoy, wei_levoy_single
from torchsynth.records import Job, load_record
from torchsynth.wishes import parse_size

TINY = wei_levoy_single(neighborhood=3)


@pytest.fixture
def exemplar(tmp_path, make_exemplar):
    return str(ts.write_image(make_exemplar(), tmp_path / "a.png"))


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("text", ["3x5", " 3X5 ", "+3x5"])
def test_sizes_are_read(text):
    assert parse_size(text) == (3, 5)


def test_a_record_is_the_job_that_made_it(tmp_path, exemplar):
    recipe = wei_levoy(levels=2, neighborhood=(3, 5), parent=(3,), boundary="open")
    job = Job(exemplar, recipe, (6, 7), (5,), initial=None)
    assert run(job, Files(tmp_path / "out.png", None, None, False)) == [tmp_path / "out.png"]
    loaded = load_record(tmp_path / "out.json")
    assert (loaded.exemplar, loaded.recipe, loaded.size, loaded.seeds) == (exemplar, recipe, (6, 7), (5,))


def test_a_newer_record_may_say_more(tmp_path, exemplar):
    run(Job(exemplar, TINY, (6, 7), (5,)), Files(tmp_path / "out.png", None, None, False))
    record = json.loads((tmp_path / "out.json").read_text())
    (tmp_path / "out.json").write_text(json.dumps(record | {"comment": "mine"}))
    assert load_record(tmp_path / "out.json").seeds == (5,)


def test_a_record_with_a_wrong_recipe_is_told(tmp_path, exemplar):
    run(Job(exemplar, TINY, (6, 7), (5,)), Files(tmp_path / "out.png", None, None, False))
    record = json.loads((tmp_path / "out.json").read_text())
    record["recipe"]["levels"] = 0
    (tmp_path / "out.json").write_text(json.dumps(record))
    with pytest.raises(ts.ConfigError, match=r"out.json: recipe: 'levels': input should be greater than or"):
        load_record(tmp_path / "out.json")


def test_little_memory_changes_nothing_but_the_grouping(tmp_path, exemplar, monkeypatch):
    job, calls = Job(exemplar, TINY, (6, 6), (0, 1, 2)), []

    def watch(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
        calls.append(len(preview()))

    run(job, Files(tmp_path / "a.png", None, None, True), watch)
    assert set(calls) == {3}
    sample = ts.Exemplar(ts.read_image(exemplar))
    monkeypatch.setattr(memory, "_machine_memory", lambda: memory.memory_needed(TINY, sample, (6, 6), 1))
    calls.clear()
    run(job, Files(tmp_path / "b.png", None, None, True), watch)
    assert set(calls) == {1}
    for number in range(3):
        assert (tmp_path / f"a-{number}.png").read_bytes() == (tmp_path / f"b-{number}.png").read_bytes()


def test_an_exception_from_the_progress_leaves_nothing(tmp_path, exemplar):
    before = names(tmp_path)

    def stop(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
        raise RuntimeError("enough")

    files = Files(tmp_path / "out.png", tmp_path / "levels", tmp_path / "map.npz", False)
    with pytest.raises(RuntimeError, match="enough"):
        run(Job(exemplar, TINY, (6, 7), (5,)), files, stop)
    assert names(tmp_path) == before


def test_what_is_finished_stays_when_a_later_output_is_cancelled(tmp_path, exemplar):
    finished = tmp_path / "out-7.png"

    def stop(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
        if finished.exists():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(
            Job(exemplar, TINY, (4, 4), tuple(range(9))), Files(tmp_path / "out.png", None, None, False), stop
        )
    assert names(tmp_path) == ["a.png", *(f"out-{n}.{end}" for n in range(8) for end in ("json", "png"))]


def test_outputs_are_checked_before_the_work(tmp_path, exemplar):
    Path(tmp_path / "out-1.json").touch()

    def stop(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
        pytest.fail("the work has begun")

    with pytest.raises(ts.OutputError, match=r"out-1.json: must not exist yet"):
        run(Job(exemplar, TINY, (4, 4), (0, 1)), Files(tmp_path / "out.png", None, None, False), stop)


def test_the_picture_is_that_of_the_library(tmp_path, exemplar):
    run(Job(exemplar, TINY, (7, 9), (5,)), Files(tmp_path / "out.png", None, None, False))
    result = ts.synthesize(ts.read_image(exemplar), (7, 9), TINY, seed=5)
    assert torch.equal(ts.read_image(tmp_path / "out.png"), result.image[0])


def test_other_versions_are_noted(tmp_path, capsys):
    from torchsynth.cli import main

    first, again = tmp_path / "one.png", tmp_path / "two.png"
    small = ["--set", "levels=2", "--size", "6x6"]
    assert main(["synthesize", "sample:brick", "-o", str(first), *small]) == 0
    assert main(["rerun", str(first.with_suffix(".json")), "-o", str(again)]) == 0
    assert capsys.readouterr().err == ""
    record = json.loads(first.with_suffix(".json").read_text())
    record["versions"]["torch"] = "1.0"
    first.with_suffix(".json").write_text(json.dumps(record))
    assert main(["rerun", str(first.with_suffix(".json")), "-o", str(again), "--overwrite"]) == 0
    assert "note: the record was made with torch 1.0, now" in capsys.readouterr().err
