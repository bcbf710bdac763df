"""Many outputs at once: grids, manifests, interruptions, and Ray."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import torchsynth as ts
from torchsynth.batch import Grid, Manifest, Report, in_process, load_grid, on_ray, run_batch
from torchsynth.batch.work import Made, Output
from torchsynth.cli import main
from torchsynth.io import read_picture

JOBS = "exemplars: [one.png, two.png]\nrecipes: [ashikhmin, small.yaml]\nsizes: [9x8, 6x6]\nseeds: 3..5\n"
MANY = 2 * 2 * 2 * 3


@pytest.fixture
def folder(tmp_path, make_exemplar, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ts.write_image(make_exemplar(3, 14, 15, seed=1), "one.png")
    ts.write_image(make_exemplar(1, 12, 12, seed=2), "two.png")
    small = ts.recipes.wei_levoy(levels=2, neighborhood=3, parent=3)
    Path("small.yaml").write_text(ts.dump_recipe(small), encoding="utf-8")
    Path("jobs.yaml").write_text(JOBS, encoding="utf-8")
    return tmp_path


def _pictures(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.png"))}


def _times(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.name != "manifest.json"}


def test_every_output_is_that_of_a_single_call(folder, capsys):
    assert main(["batch", "jobs.yaml", "--out", "made"]) == 0
    said = capsys.readouterr()
    assert len(said.out.split()) == MANY
    assert said.err == f"{MANY} made, 0 there already, 0 failed\n"
    manifest = json.loads(Path("made/manifest.json").read_text(encoding="utf-8"))
    assert len(manifest["outputs"]) == MANY
    assert sorted(entry["file"] for entry in manifest["outputs"].values()) == sorted(
        _pictures(folder / "made")
    )
    for entry in manifest["outputs"].values():
        picture = read_picture(folder / "made" / entry["file"])
        recipe = ts.load_recipe(entry["recipe"])
        exemplar = ts.read_image(entry["exemplar"])
        alone = ts.synthesize(exemplar, tuple(entry["size"]), recipe, seed=entry["seed"])
        assert picture.image.equal(alone.image[0])
        assert picture.sha256 == entry["sha256"]


def test_its_records_make_the_same_again(folder):
    main(["batch", "jobs.yaml", "--out", "made"])
    record = sorted((folder / "made").glob("two-small*.json"))[0]
    assert main(["rerun", str(record), "-o", "again.png"]) == 0
    assert Path("again.png").read_bytes() == record.with_suffix(".png").read_bytes()


def test_nothing_is_made_twice(folder, capsys):
    main(["batch", "jobs.yaml", "--out", "made"])
    before = _times(folder / "made")
    capsys.readouterr()
    assert main(["batch", "jobs.yaml", "--out", "made"]) == 0
    assert capsys.readouterr().err == f"0 made, {MANY} there already, 0 failed\n"
    assert _times(folder / "made") == before


def test_only_what_is_new_is_made(folder):
    run_batch(load_grid(Path("jobs.yaml")), folder / "made")
    before = _times(folder / "made")
    report = run_batch(
        Grid(exemplars=["one.png"], recipes=["ashikhmin"], sizes=["9x8"], seeds="4..7"), folder / "made"
    )
    assert (len(report.made), report.kept) == (2, 2)
    assert before.items() <= _times(folder / "made").items()
    ts.write_image(ts.read_image("one.png").flip(1), "one.png", overwrite=True)  # another one of that name
    assert (
        run_batch(
            Grid(exemplars=["one.png"], recipes=["ashikhmin"], sizes=["9x8"], seeds=[4]), folder / "made"
        ).kept
        == 0
    )


@pytest.mark.parametrize("lost", ["manifest.json", "a record", "a picture"])
def test_what_an_interruption_left_is_completed(folder, lost):
    """As after a kill between any two of its steps: pictures, then records, then the manifest."""
    grid = load_grid(Path("jobs.yaml"))
    made = folder / "made"
    run_batch(grid, made)
    whole, first = _pictures(made), sorted(made.glob("*.png"))[0]
    (made / "manifest.json").unlink()
    missing = {"manifest.json": None, "a record": first.with_suffix(".json"), "a picture": first}[lost]
    if missing is not None:
        missing.unlink()
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left, running = made / f".x.png.{gone.pid}.part", made / f".x.png.{os.getpid()}.part"
    left.touch()
    running.touch()
    report = run_batch(grid, made)
    assert [path.name for path in report.made] == ([] if missing is None else [first.name])
    assert report.kept == MANY - len(report.made)
    assert _pictures(made) == whole
    assert not left.exists()
    assert running.exists()  # another process may be at work


def test_killed_it_goes_on(folder):
    jobs = "exemplars: [one.png]\nrecipes: [small.yaml]\nsizes: [24x24]\nseeds: 0..95\n"
    Path("many.yaml").write_text(jobs, encoding="utf-8")
    command = [sys.executable, "-m", "torchsynth", "batch", "many.yaml", "--out", "made"]
    made = folder / "made"
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not (made / "manifest.json").exists() or not _pictures(made):
        assert process.poll() is None, "it ended before it could be killed"
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = _times(made)
    finished = {name for name in before if name.endswith(".png") and name.replace(".png", ".json") in before}
    assert 0 < len(finished) < 96
    report = run_batch(load_grid(Path("many.yaml")), made)
    assert report.kept == len(finished)
    assert len(report.made) == 96 - len(finished)
    assert {name: when for name, when in _times(made).items() if name in finished} == {
        name: before[name] for name in finished
    }
    whole = run_batch(load_grid(Path("many.yaml")), folder / "whole")
    assert len(whole.made) == 96
    assert _pictures(made) == _pictures(folder / "whole")
    assert not list(made.glob(".*"))


def test_the_manifest_is_written_ever_more_seldom(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(
        "torchsynth.batch.manifest.json.dumps", lambda found, **_: written.append(len(found["outputs"])) or ""
    )
    manifest = Manifest(tmp_path)
    for number in range(1000):
        output = Output(str(number), number, f"made-{number}", {})
        manifest.save([Made(output, {f"made-{number}.png": b"1"}, "0")])
    assert written[:3] == [1, 2, 3]
    assert len(written) < 100  # a sixteenth more each time
    assert all(later < 1.1 * earlier + 1 for earlier, later in pairwise(written))
    manifest.write()
    assert written[-1] == len(list(tmp_path.glob("*.png"))) == 1000


def test_stopped_it_has_noted_all_that_is_finished(folder, monkeypatch):
    """Also what came after the manifest was last written."""
    monkeypatch.setattr("torchsynth.batch.manifest._SHARE", 2)

    def stop(done, _total, _about):
        if done >= 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_batch(load_grid(Path("jobs.yaml")), folder / "made", progress=stop)
    noted = json.loads(Path("made/manifest.json").read_text(encoding="utf-8"))["outputs"].values()
    assert len(noted) == 6
    assert sorted(entry["file"] for entry in noted) == sorted(_pictures(folder / "made"))


def test_one_bad_job_does_not_stop_the_rest(folder, capsys, make_exemplar):
    ts.write_image(make_exemplar(1, 4, 4), "tiny.png")
    jobs = "exemplars: [tiny.png, none.png, one.png]\nrecipes: [small.yaml, ashikhmn]\nsizes: [6x6]\nseeds: [0, 1]\n"
    Path("bad.yaml").write_text(jobs, encoding="utf-8")
    assert main(["batch", "bad.yaml", "--out", "made"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "2 made, 0 there already, 10 failed"
    assert len(said) == 4
    assert any("ashikhmn (6 outputs)" in line and "did you mean 'ashikhmin'?" in line for line in said)
    assert any("none.png (2 outputs): none.png: must be a readable image file" in line for line in said)
    assert any(
        "failed: tiny.png, small.yaml, 6x6, seeds 0 to 1 (2 outputs): exemplar" in line for line in said
    )
    assert len(_pictures(folder / "made")) == 2


def test_a_picture_that_was_changed_is_left_alone(folder, capsys):
    main(["batch", "jobs.yaml", "--out", "made"])
    changed = sorted((folder / "made").glob("*.png"))[0]
    changed.write_bytes(b"mine")
    capsys.readouterr()
    assert main(["batch", "jobs.yaml", "--out", "made"]) == 1
    said = capsys.readouterr().err
    assert f"0 made, {MANY - 1} there already, 1 failed" in said
    assert "must be as it was made, but it was changed since; move it away to have it made again" in said
    assert changed.read_bytes() == b"mine"


@pytest.mark.parametrize("ending", [".npz", "-patches.png", ".json", ".png"])
def test_an_output_is_there_with_all_its_files(folder, ending):
    grid = Grid(exemplars="one.png", recipes="ashikhmin", sizes="7x9", source_maps=True, figures="patches")
    (path,) = run_batch(grid, folder / "made").made
    path.with_name(f"{path.stem}{ending}").unlink()
    assert len(run_batch(grid, folder / "made").made) == 1
    assert path.with_name(f"{path.stem}{ending}").is_file()


def test_one_recipe_under_two_names_is_made_under_both(folder):
    Path("mine.yaml").write_text(ts.dump_recipe(ts.recipes.ashikhmin()), encoding="utf-8")
    first = Grid(exemplars="one.png", recipes="mine.yaml", sizes="7x9")
    both = first.model_copy(update={"recipes": ("mine.yaml", "ashikhmin")})
    run_batch(first, folder / "made")
    report = run_batch(both, folder / "made")
    assert (len(report.made), report.kept) == (1, 1)
    same = both.model_copy(update={"exemplars": ("one.png", "./one.png")})
    report = run_batch(same, folder / "made")
    assert (len(report.made), report.kept) == (0, 2)


def test_an_address_where_nothing_listens(folder, capsys):
    with contextlib.closing(socket.socket()) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    assert main(["batch", "jobs.yaml", "--out", "made", "--engine", "ray", "--ray-address", address]) == 2
    assert (
        f"--ray-address: must be that of a running Ray cluster, but nothing answers at {address}"
        in capsys.readouterr().err
    )
    assert not (folder / "made").exists()


def test_source_maps_and_other_formats(folder):
    grid = Grid(
        exemplars=["one.png"],
        recipes=["ashikhmin"],
        sizes=[[7, 9]],
        seeds=[1],
        format="tif",
        source_maps=True,
    )
    (path,) = run_batch(grid, folder / "made").made
    assert path.suffix == ".tif"
    rows, columns = np.load(path.with_suffix(".npz"))["source"]
    assert ts.read_image(path).equal(ts.read_image("one.png")[:, rows, columns])
    assert not run_batch(grid.model_copy(update={"source_maps": False}), folder / "made").kept


def test_drawings(folder):
    kinds = ("patches", "animation")
    grid = Grid(exemplars=["one.png"], recipes=["ashikhmin"], sizes=["7x9"], seeds=[1], figures=kinds)
    (path,) = run_batch(grid, folder / "made").made
    result = ts.synthesize(ts.read_image("one.png"), (7, 9), ts.recipes.ashikhmin(), seed=1)
    drawn = ts.read_image(path.with_name(f"{path.stem}-patches.png"))
    assert drawn.sub(ts.viz.draw_patches(result)[0]).abs().max() < 1 / 500
    assert path.with_name(f"{path.stem}-animation.gif").read_bytes()[:3] == b"GIF"
    (failure,) = run_batch(grid.model_copy(update={"figures": ("field",)}), folder / "made").failures
    assert "field can be drawn where there is one" in str(failure)


def test_single_values_need_no_list():
    grid = Grid(exemplars="a.png", recipes="ashikhmin", sizes="4x5", seeds=7, figures="patches")
    assert (grid.exemplars, grid.recipes, grid.sizes) == (("a.png",), ("ashikhmin",), ((4, 5),))
    assert (grid.seeds, grid.figures) == ((7,), ("patches",))


def test_sizes_are_twice_the_exemplars_if_none_is_given(folder):
    (path,) = run_batch(Grid(exemplars=["two.png"], recipes=["ashikhmin"]), folder / "made").made
    assert ts.read_image(path).shape == (1, 24, 24)


def test_files_are_found_beside_the_grid(folder, monkeypatch):
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    assert len(run_batch(load_grid(Path("../jobs.yaml")), Path("made")).made) == MANY


def test_progress_counts_outputs(folder):
    told = []
    grid = Grid(exemplars=["one.png", "two.png"], recipes=["ashikhmin"], sizes=["5x5"], seeds="0..19")
    run_batch(grid, folder / "made", progress=lambda done, total, _: told.append((done, total)))
    assert told == [(16, 40), (20, 40), (36, 40), (40, 40)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a mapping with lists of exemplars, recipes, sizes and seeds, but it is empty"),
        ("[1]", "but it is a list"),
        ("recipes: [ashikhmin]", "'exemplars' is required, but it is missing"),
        ("exemplars: []", "'exemplars' must have 1 or more"),
        ("{exemplars: [a], sedds: [1]}", "'sedds' must be a known field, but there is no such field; did you mean 'seeds'?"),
        ("{exemplars: [a], seeds: 5..3}", "seeds go from start up to stop"),
        ("{exemplars: [a], seeds: 0..100000}", "at most 100000 of them"),
        ("{exemplars: [a], seeds: three}", "'seeds': seeds are a list, or a range such as 3..5, but it is 'three'"),
        ("{exemplars: [a], seeds: [-1]}", "'seeds[0]': input should be greater than or equal to 0"),
        ("{exemplars: [a], seeds: [1.5]}", "'seeds[0]': input should be a valid integer"),
        ("{exemplars: [a], sizes: [64]}", "'sizes[0]': a size is written HxW, but it is 64"),
        ("{exemplars: {a: 1}}", "'exemplars' must be a list, but it is"),
        ("{exemplars: [a], sizes: []}", "'sizes' must have 1 or more"),
        ("{exemplars: [a], sizes: [64xx64]}", "must be HxW, height and width in pixels, but it is '64xx64'"),
        ("{exemplars: [a], sizes: ['0x4']}", "'sizes[0]': input should be greater than or equal to 1"),
        ("{exemplars: [a], format: gif}", "'format': input should be 'png'"),
        ("{exemplars: [a, b], seeds: 0..99999}", "must ask for at most 100000 outputs, but they are 200000"),
        ("{exemplars: [a], figures: [patchs]}", "but it is 'patchs': did you mean 'patches'?"),
        ("exemplars: [a", "must be valid YAML, but line 1"),
    ],
)  # fmt: skip
def test_wrong_grids_are_one_line(folder, capsys, text, message):
    Path("wrong.yaml").write_text(text, encoding="utf-8")
    assert main(["batch", "wrong.yaml", "--out", "made"]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (folder / "made").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.yaml", "--out", "made"], "none.yaml: must be a readable file"),
        (["one.png", "--out", "made"], "one.png: must end in one of .yaml .yml .json"),
        (["jobs.yaml", "--out", "one.png"], "one.png: must be a folder, but it is a file"),
        (["jobs.yaml", "--out", "no/made"], "no/made: its folder must exist and be writable"),
        (["jobs.yaml", "--out", "full"], "full/manifest.json: must be what 'torchsynth batch' wrote"),
        (["jobs.yaml", "--out", "made", "--ray-address", "auto"], "--ray-address: is for --engine ray"),
    ],
)
def test_wrong_arguments_are_one_line(folder, capsys, arguments, message):
    Path("full").mkdir()
    Path("full/manifest.json").write_text('{"name": "my extension"}', encoding="utf-8")
    assert main(["batch", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not (folder / "made").exists()


@pytest.mark.usefixtures("folder")
def test_without_ray(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["batch", "jobs.yaml", "--out", "made", "--engine", "ray"]) == 2
    assert 'install it: pip install "torchsynth-textures[ray]"' in capsys.readouterr().err


@pytest.fixture(scope="module")
def cluster():
    """A cluster of this machine's, shut down in the end."""
    engine = on_ray()
    yield engine
    import ray

    ray.shutdown()


def test_ray_makes_the_same_bytes(folder, cluster):
    grid = load_grid(Path("jobs.yaml")).model_copy(update={"source_maps": True})
    _, there = (
        run_batch(grid, folder / name, engine=one) for name, one in (("here", in_process), ("there", cluster))
    )
    assert len(there.made) == MANY
    assert not there.failures
    same = [path.name for path in (folder / "here").iterdir() if path.name != "manifest.json"]
    assert len(same) == 3 * MANY
    assert all(
        (folder / "here" / name).read_bytes() == (folder / "there" / name).read_bytes() for name in same
    )
    assert run_batch(grid, folder / "there", engine=cluster).kept == MANY


def test_ray_tells_of_bad_jobs(folder, cluster, make_exemplar):
    ts.write_image(make_exemplar(1, 4, 4), "tiny.png")
    grid = Grid(exemplars=["tiny.png", "two.png"], recipes=["small.yaml"], sizes=["6x6"])
    report = run_batch(grid, folder / "made", engine=cluster)
    assert len(report.made) == 1
    assert [failure.outputs for failure in report.failures] == [1]
    assert "tiny.png" in str(report.failures[0])


def test_a_dead_worker_is_replaced(folder, cluster):
    """Workers are killed while they work; the outputs are the same all the same."""
    grid = Grid(exemplars=["one.png"], recipes=["small.yaml"], sizes=["48x48"], seeds="0..63")
    reports: list[Report] = []
    thread = threading.Thread(
        target=lambda: reports.append(run_batch(grid, folder / "there", engine=cluster))
    )
    thread.start()
    killed = 0
    while killed < 2 and thread.is_alive():
        listed = subprocess.run(["ps", "-eo", "pid,args"], capture_output=True, text=True, check=True).stdout
        at_work = [line.split()[0] for line in listed.splitlines() if " ray::attempt" in line]
        for pid in at_work[: 2 - killed]:
            os.kill(int(pid), signal.SIGKILL)
            killed += 1
        time.sleep(0.02)
    thread.join()
    assert killed == 2
    assert len(reports[0].made) == 64
    run_batch(grid, folder / "here")
    assert _pictures(folder / "there") == _pictures(folder / "here")
