"""The scripts: each does its work at a tiny size, and says in one line what is wrong with an argument."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import torchsynth as ts

ROOT = Path(__file__).parent.parent
SCRIPTS = ROOT / "scripts"
PICTURES = ROOT / "docs" / "images"
SAMPLES = ROOT / "torchsynth" / "data"


CASE = {"recipe": "wei_levoy", "size": "8x8", "batch": 1, "threads": 1, "repeats": 1}


@pytest.fixture
def script(monkeypatch, tmp_path):
    """Import a script by its name, as if Python had been called with it and some arguments."""
    monkeypatch.syspath_prepend(SCRIPTS)  # which is where Python looks first when it runs one of them
    monkeypatch.chdir(tmp_path)

    def load(name, *arguments):
        path = SCRIPTS / f"{name}.py"
        spec = importlib.util.spec_from_file_location(f"script_{name}", path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, spec.name, module)  # dataclasses look themselves up there
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def picture(make_exemplar):
    """Write a picture of a given size; returns its name."""

    def write(side, name="picture.png"):
        ts.write_image(make_exemplar(1, side, side), name)
        return name

    return write


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_benchmark_measures_in_a_process_of_its_own(script, capsys):
    arguments = ["--sizes", "16x12", "--batches", 2, "--threads", 1, "--repeats", 1, "--out", "found.json"]
    script("benchmark", "--recipes", "wei_levoy", *arguments).main()
    (row,) = json.loads(Path("found.json").read_text())["rows"]
    assert (row["recipe"], row["size"], row["batch"]) == ("wei_levoy", "16x12", 2)
    assert 0 < row["wall_s"] < 60
    assert row["us_per_pixel"] == pytest.approx(row["wall_s"] / (16 * 12 * 2) * 1e6)
    assert row["ratio"] == pytest.approx(row["wall_s"] / row["floor_s"])
    assert row["peak_mb"] > 0
    assert "16x12" in capsys.readouterr().out


def test_benchmark_passes_on_what_its_process_refuses(script, monkeypatch, capsys):
    module = script("benchmark", "--recipes", "wei_levoy")
    refused = subprocess.CompletedProcess([], 2, stdout="", stderr="benchmark.py: error: as I said\n")
    monkeypatch.setattr(module.subprocess, "run", lambda *_, **__: refused)
    with pytest.raises(SystemExit, match=r"^2$"):
        module.main()
    assert capsys.readouterr() == ("", refused.stderr)


@pytest.mark.parametrize("recipe", ["ashikhmin_target", "distorted"])
def test_benchmark_measures_recipes_with_wishes(script, capsys, recipe):
    case = CASE | {"recipe": recipe, "exemplar": "sample:brick"}
    script("benchmark", "--case", json.dumps(case)).main()
    measured = json.loads(capsys.readouterr().out)
    assert measured["us_per_pixel"] == pytest.approx(measured["wall_s"] / 64 * 1e6)
    assert measured["floor_s"] > 0


def test_the_gallery_makes_the_pictures_of_the_readme(script, capsys):
    module = script("gallery", "--out", "made", "--only", "levels")
    module.main()
    assert [path.name for path in Path("made").iterdir()] == ["levels.jpg"]
    made = pixels("made/levels.jpg")
    assert made.shape == (192, 4 * 192 + 3 * script("layout").GAP, 3)
    # The texture is the same to the byte; encoders of JPEG differ a little.
    assert np.abs(made - pixels(PICTURES / "levels.jpg")).mean() < 1
    assert "levels.jpg" in capsys.readouterr().out


def test_the_scripts_make_all_pictures_of_the_readme(script):
    made = {make.__name__ for make in script("gallery").PICTURES} | set(script("tsvq_figures").PICTURES)
    made.add("studio")  # scripts/screenshot.py, which needs a browser
    assert made == {path.stem for path in PICTURES.glob("*.jpg")}


def test_the_figures_of_tsvq(script, capsys):
    module = script("tsvq_figures", "--out", "made")
    module.main()
    for name in module.PICTURES:
        made, there = (pixels(folder / f"{name}.jpg") for folder in (Path("made"), PICTURES))
        # Fonts differ from machine to machine, and with them the margins.
        assert made.shape[:2] == pytest.approx(there.shape[:2], rel=0.1)
        assert made.mean() == pytest.approx(there.mean(), rel=0.1)
    assert capsys.readouterr().out.count(".jpg") == len(module.PICTURES)


def test_the_windows_of_efros_and_leung(script, picture, capsys):
    given = ["--pictures", "rings", picture(12), "--windows", 3, 5, "--part", "10x11", "--size", "12x14"]
    module = script("efros_leung_windows", *given, "--out", "made.png")
    module.main()
    made = pixels("made.png")
    # Two rows of a picture and two outputs, with labels above and gaps between.
    assert made.shape == (2 * (16 + 12) + 8, 11 + 2 * (8 + 14), 3)
    image = module.picture("picture.png", (10, 11))
    assert image.shape == (1, 10, 11)
    grown = ts.synthesize(image, (12, 14), ts.recipes.efros_leung(window=5), seed=0).image[0, 0]
    assert (made[-12:, -14:, 0] == (grown * 255).round().numpy()).all()
    assert capsys.readouterr().out == "made.png\n"


def test_rings_stay_apart(script):
    drawn = script("efros_leung_windows").rings(64, 48)
    assert drawn.shape == (1, 64, 48)
    assert drawn.min() == 0
    assert 0.5 < drawn.mean() < 0.9


def test_lloyds_steps_of_the_figures_go_down(script):
    module = script("tsvq_figures")
    distortions = [step.distortion for step in module.lloyd(module.clusters())]
    assert distortions == sorted(distortions, reverse=True)
    assert distortions[-1] < distortions[0] / 2


@pytest.mark.parametrize("suffix", [".csv", ".md"])
def test_the_measures_are_validated(script, picture, capsys, suffix):
    names = [picture(48, "one.png"), picture(50, "two.png"), "sample:pebbles"]
    module = script("validate_measures", "--textures", *names, "--crop", 22, "--out", f"found{suffix}")
    module.main()
    heading, *lines = capsys.readouterr().out.splitlines()
    assert heading.split()[:3] == ["texture", "picture", "patch"]
    rows, notes = lines[:27], lines[27:]
    assert [row.split("  ")[0] for row in rows[::9]] == names
    assert len(notes) == sum(len(purpose.beaten) for purpose in module.PURPOSES.values()) + 2
    written = Path(f"found{suffix}").read_text().splitlines()
    mark = "," if suffix == ".csv" else " | "
    assert f"one.png{mark}exemplar itself{mark}0.00{mark}1.00" in "\n".join(written)
    assert len(written) == (28 if suffix == ".csv" else 30 + len(notes))
    assert "coverage: the exemplar itself beats the tiled exemplar on 3 of 3" in notes


def test_the_built_in_samples_are_ranked_as_the_validation_says(script):
    module = script("validate_measures")
    images = [module.picture(name) for name in module.TEXTURES]
    for image, other in zip(images, [*images[1:], images[0]], strict=True):
        rows = module.rows_of(image, other, 192)
        for measure, purpose in module.PURPOSES.items():
            assert module.losses(rows, measure, purpose) == []
            worst = {picture: {measure: 0.0} for picture in rows} | {purpose.first: {measure: 3.0}}
            if measure != "coverage":
                assert module.losses(worst, measure, purpose) == list(purpose.beaten)


def test_what_spoils_a_crop_for_the_validation(script, make_exemplar):
    module = script("validate_measures")
    image = make_exemplar(3, 30, 40)
    exemplar, real = module.crops(image, 18)
    assert exemplar.equal(image[:, :15, :18])
    assert real.equal(image[:, 15:, 22:])
    assert module.shuffled(real).flatten(1).sort(1).values.equal(real.flatten(1).sort(1).values)
    gray = torch.rand(1, 16, 16, dtype=torch.float64) / 4 + 3 / 8  # far from 0 and 1, where values are cut
    noise = module.phase_noise(gray)
    assert torch.fft.fft2(noise).abs().allclose(torch.fft.fft2(gray).abs())
    assert not noise.allclose(gray)
    tiles, source = module.tiled(exemplar)
    assert tiles[:, :7, 9:].equal(tiles[:, 7:14, :9])
    assert tiles.equal(exemplar[:, source[0], source[1]])
    assert module.like(real, torch.rand(1, 90, 90)).shape == real.shape
    assert module.like(gray, image).shape == gray.shape


def test_the_samples_are_those_of_the_library(script):
    pytest.importorskip("skimage")
    pytest.importorskip("pooch")
    script("make_samples", "made").main()
    made = {path.name for path in Path("made").iterdir()}
    assert made == {path.name for path in SAMPLES.glob("*.png")}
    for name in made:
        assert np.array_equal(pixels(f"made/{name}"), pixels(SAMPLES / name))


def test_the_pebbles_are_those_of_the_library(script):
    module = script("make_samples")
    made = module.pebbles(module.SIDE, 121, seed=4).astype(int)
    assert np.abs(made - pixels(SAMPLES / "pebbles.png")).max() <= 1


def test_make_samples_says_what_it_needs(script, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)  # as if it were not installed
    module = script("make_samples", "made")
    with pytest.raises(SystemExit, match="pip install scikit-image pooch"):
        module.main()
    assert not Path("made").exists()


@pytest.fixture
def report(script, monkeypatch):
    """The TSVQ report, cut short."""

    def load(*arguments):
        module = script("tsvq_report", *arguments, "--depths", 3, "--beams", 1, 8, "--queries", 40)
        for name, value in {"SHARES": (0.1,), "RUN_DEPTHS": (4,), "LARGE": 72, "LARGE_QUERIES": 20}.items():
            monkeypatch.setattr(module, name, value)
        return module

    return load


def test_the_tsvq_report(report, picture, capsys):
    # The coarsest levels of so small an output have no pixel whose neighbors all come before it.
    exemplar, large = picture(72), picture(75, "large.png")
    report("--exemplar", exemplar, "--size", "20x24", "--large", large, "--out", "found.json").main()
    found = json.loads(Path("found.json").read_text())

    exhaustive, narrow, wide, *_, codebook = found["rows"]
    assert (exhaustive["recall"], exhaustive["excess"]) == (1, 0)
    assert exhaustive["codewords"] == (72 - 8) ** 2  # where a 9x9 neighborhood fits
    assert (narrow["codewords"], wide["codewords"]) == (8, 8)
    # A beam as wide as the tree tries all of its leaves.
    assert 0 <= narrow["recall"] <= wide["recall"] == 1
    assert narrow["excess"] >= wide["excess"] == 0
    assert codebook["excess"] >= codebook["codebook_excess"] > 0
    assert codebook["share"] == pytest.approx(0.1, abs=0.01)

    (run,), (estimated,) = found["runs"], found["estimated_runs"]
    assert (run["exemplar"], run["size"], run["depth"]) == ([72, 72], [20, 24], 4)
    assert (estimated["exemplar"], estimated["depth"]) == ([72, 72], None)
    for one in (run, estimated):
        assert all(0 < one[f"{name}_s"] < 60 for name in ("training", "synthesis", "exhaustive"))
    printed = capsys.readouterr().out
    assert printed.index("Whole runs") < printed.index("exhaustive search estimated")


def test_the_tsvq_report_compares_with_training_and_without(report, capsys):
    module = report()
    run = module.Run((72, 72), (20, 24), None, training_s=30.0, synthesis_s=4.0, exhaustive_s=68.0)
    module.Console(width=140).print(module.runs_table("Runs", [run]))
    row = capsys.readouterr().out.splitlines()[-2]
    cells = [cell.strip() for cell in row.strip("│").split("│")]
    assert cells == ["72x72", "20x24", "to leaves of 64", "30.00", "4.00", "34.00", "68.00", "17.0", "2.0"]


def test_the_tsvq_report_estimates_all_levels(report, make_exemplar, monkeypatch):
    module = report()
    # A clock of our own: 2 seconds to prepare each level, 3 for each query.
    row = module.Row("exhaustive", 2.0, 1, 1.0, 1.0, 0.0, 3e6)
    monkeypatch.setattr(module, "exhaustive_row", lambda _: (row, None))
    run = module.large_run(make_exemplar(1, 72, 72), (16, 24), None)
    assert run.exhaustive_s == pytest.approx(4 * 2 + 3 * (16 * 24 + 8 * 12 + 4 * 6 + 2 * 3))
    assert run.whole_s == run.training_s + run.synthesis_s


def test_the_tsvq_report_asks_for_the_middle_of_a_large_picture(report, make_exemplar):
    module = report()
    image = make_exemplar(3, 74, 80)
    ts.write_image(image, "wide.png")
    assert torch.equal(module.middle_of(Path("wide.png")), image[:, 1:73, 4:76])


@pytest.fixture
def textures(make_exemplar):
    """A folder of a colored picture, a large gray one, and one that is too small."""
    Path("pictures").mkdir()
    for name, shape in {"red": (3, 24, 28), "wide": (1, 48, 60), "tiny": (1, 9, 30)}.items():
        ts.write_image(make_exemplar(*shape), f"pictures/{name}.png")
    Path("pictures/notes.txt").write_text("no picture")
    return ["--textures", "pictures", "--out", "made"]


def test_exemplars_are_gray_shrunk_and_cropped(script, make_exemplar):
    module = script("exemplars")
    image = make_exemplar(4, 48, 60)
    halved = image[:3].mean(0).unfold(0, 2, 2).unfold(1, 2, 2).mean((2, 3))
    torch.testing.assert_close(module.exemplar(image, 20)[0], halved[2:22, 5:25])
    assert module.exemplar(image, 32).shape == (1, 32, 32)  # shrunk by two thirds only
    torch.testing.assert_close(module.exemplar(image[:2], 64), image[:1])


@pytest.mark.parametrize(("side", "levels"), [(128, 4), (127, 3), (64, 3), (40, 2), (31, 1), (15, 1)])
def test_the_coarsest_level_has_sixteen_pixels(script, side, levels):
    assert script("exemplars").Texture("any", torch.zeros(1, side, 200)).levels == levels


def test_the_first_experiment(script, textures, capsys):
    script("experiments", "first", *textures, "--size", 24, "--seeds", 2).main()
    printed = capsys.readouterr().out
    assert "tiny.png is left out: it has fewer than 24 pixels a side" in printed
    assert "2 of 2: wide, 24x24, 1 level" in printed
    lines = [line.split(",") for line in Path("made/measures.csv").read_text().splitlines()]
    methods = ["WL", "Ashikhmin", "W", "W+N", "W+N+M"]
    assert [line[:2] for line in lines[1:]] == [
        [texture, method] for texture in ("red", "wide", "mean") for method in methods
    ]
    gray = ts.read_image("pictures/red.png").mean(0, keepdim=True)[:, :, 2:26]
    result = ts.synthesize(gray, (24, 24), ts.recipes.wei_levoy(levels=1), seed=[0, 1])
    found = ts.metrics.measure(result.image, gray, result.source)
    assert float(lines[1][2]) == pytest.approx(found.patch_distance.mean().item(), abs=1e-3)
    assert float(lines[1][-2]) == pytest.approx(found.seam[:, 0].mean().item(), abs=1e-3)
    # Two seeds below each other, enlarged twice; the exemplar and five methods side by side.
    made = pixels("made/sheets/red.png")
    assert made.shape == (2 * (48 + 16) + 8, 6 * 48 + 5 * 8, 3)
    assert (made[16:64:2, 56:104:2, 0] == (result.image[0, 0] * 255).round().numpy()).all()


def test_the_second_experiment(script, textures):
    pytest.importorskip("scipy")
    given = ["--size", 24, "--seeds", 1, "--block", 9, "--only", "wide", "--jobs", 2]
    script("experiments", "second", *textures, *given).main()
    page = Path("made/index.html").read_text()
    assert 'src="sheets/wide.png"' in page
    assert "http" not in page
    assert "<script" not in page
    assert pixels("made/sheets/wide.png").shape == (96 + 16, 48 + 3 * 96 + 3 * 8, 3)
    assert "wide,graph cut," in Path("made/measures.csv").read_text()


def test_choosing_does_every_recipe(script):
    done = [name for job in script("choosing").JOBS for name in job.recipes]
    assert set(done) == {*ts.recipes.RECIPES, "truth"}


def test_choosing(script, picture, capsys):
    picture(48)
    module = script("choosing", "--exemplars", "picture.png", "--seeds", 1, "--jobs", "hole", "following")
    module.main()
    hole, following = capsys.readouterr().out.strip().split("\n\n")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in hole.splitlines()]
    assert rows[0] == ["hole", "picture", "sharpness", "verbatim", "edge", "seconds"]
    gray = ts.read_image("picture.png").mean(0, keepdim=True)
    crop = gray[:, 6:22, 6:22].contiguous()
    truth = ts.metrics.measure(crop, gray)
    assert rows[2][:4] == ["truth", f"{truth.patch_distance[0]:.2f}", f"{truth.sharpness[0]:.2f}", "1.00"]
    assert [row[0] for row in rows[2:]] == list(module.JOBS[1].recipes)
    assert len(following.splitlines()) == 2 + len(module.JOBS[2].recipes)


def test_timing(script, textures, monkeypatch):
    recipes = ts.recipes
    module = script("experiments", "timing", *textures, "--repeats", 1)
    timings = module.timings
    monkeypatch.setattr(timings, "SIDE", 24)
    plain = timings.Case("plain", 16, 12, recipes.wei_levoy(levels=1), "2190", "a table")
    grown = timings.Case("trees", 16, 12, recipes.wei_levoy_tsvq(levels=1))
    monkeypatch.setattr(timings, "reported_cases", lambda: [plain])
    monkeypatch.setattr(timings, "set_cases", lambda _: [plain, grown])
    module.main()
    line = Path("made/reported.csv").read_text().splitlines()[1].split(",")
    assert [line[0], *line[1:3], *line[4:]] == ["plain", "16x16", "12x12", "2190", "a table"]
    assert 0 < float(line[3]) < 60
    (first, second) = (line.split(",") for line in Path("made/sets.csv").read_text().splitlines()[1:])
    assert (first[0], first[2]) == ("plain", "1.00")
    whole, training, synthesis = (float(one) for one in re.findall(r"[\d.]+", second[1]))
    assert whole == pytest.approx(training + synthesis, abs=0.02)
    assert "2190" in Path("made/index.html").read_text()


def test_a_pass_is_timed_by_what_it_adds(script, make_exemplar, monkeypatch):
    module = script("timings")
    # A clock of our own: a second for each sweep.
    monkeypatch.setattr(module, "best_of", lambda _, work: work())
    monkeypatch.setattr(module, "_synthesize", lambda _exemplar, _side, recipe: float(len(recipe.sweeps)))
    once, often = (ts.recipes.ashikhmin_target(passes=passes) for passes in (1, 3))
    case = module.Case("passes", 12, 14, often, without=once)
    assert module.timed(case, make_exemplar(1, 12, 12), 1).seconds == 2


def test_rows_that_differ_are_usual_seams(script):
    rows = torch.tensor([0.0, 1.0] + [1.0] * 8 + [0.5])  # steps of 1, 0 eight times, and 0.5
    usual = script("comparison_report").usual_seam(rows.view(1, -1, 1).expand(1, 11, 5))
    assert usual == pytest.approx((0.5 + 0.1 * 0.5) / 0.15)


def test_who_wins(script):
    module = script("comparison")
    values = {name: [0.5] * len(module.MEASURES) for name in ("one", "other")}
    names = [one.name for one in module.MEASURES]
    for name, (one, other) in {
        "patch distance": (0.4, 0.6), "sharpness": (0.8, 1.1), "coverage": (0.3, 0.2),
        "seam top-bottom": (0.9, 0.5), "verbatim": (0.001, 0.004),
    }.items():  # fmt: skip
        values["one"][names.index(name)], values["other"][names.index(name)] = one, other
    won = dict(zip(names, module.winners(values), strict=True))
    assert won["patch distance"] == won["coverage"] == {"one"}
    assert won["sharpness"] == {"other"}
    # Seams below 1 are no better than 1, and what is shown as equal is equal.
    assert won["seam top-bottom"] == won["verbatim"] == {"one", "other"}


WRONG_EXPERIMENTS = [
    (["--textures", "none"], "must be a folder, but none is none"),
    (["--textures", "empty"], "must hold pictures"),
    (["--only", "none"], "there is no 'none'"),
    (["--without", "red", "wide", "tiny"], "must leave pictures"),
    (["--only", "tiny"], "must hold pictures of 24x24 pixels or more"),
    (["--out", "pictures"], "there is something in pictures; give another folder, or --overwrite"),
    (["--out", "pictures/notes.txt"], "is a file"),
    (["--seeds", "0"], "must be at least 1, but it is 0"),
    (["--block", "2"], "must be at least 3, but it is 2"),
    (["--block", "25", "--jobs", "2"], "must fit inside red, 24x24, 1 level, but it is 25"),
]


@pytest.mark.parametrize(("given", "said"), WRONG_EXPERIMENTS)
def test_a_wrong_argument_of_an_experiment_is_one_clear_line(script, textures, capsys, given, said):
    Path("empty").mkdir()
    module = script("experiments", "second", *textures, "--size", 24, *given)
    with pytest.raises(SystemExit, match=r"^2$"):
        module.main()
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("experiments.py")
    assert said in line


def test_a_picture_that_cannot_be_read_is_one_clear_line(script, textures, capsys):
    Path("pictures/broken.png").write_text("no picture")
    module = script("experiments", "first", *textures)
    with pytest.raises(SystemExit, match=r"^2$"):
        module.main()
    assert "broken.png" in capsys.readouterr().err
    assert not Path("made").exists()


WRONG = [
    (
        "benchmark",
        ["--case", json.dumps(CASE | {"exemplar": "small.png"})],
        "must fit inside level 1, but that level is only 8x8",
    ),
    ("benchmark", ["--sizes", "12"], "must be HxW"),
    ("benchmark", ["--sizes", "0x8"], "must be at least 1 pixel"),
    ("benchmark", ["--exemplars", "none.png"], "none.png"),
    ("benchmark", ["--recipes", "none"], "none"),
    ("benchmark", ["--repeats", "0"], "must be at least 1, but it is 0"),
    ("benchmark", ["--out", "none/found.json"], "a folder that does not exist, none"),
    ("choosing", ["--exemplars", "none.png"], "none.png"),
    ("choosing", ["--jobs", "none"], "invalid choice: 'none'"),
    ("choosing", ["--size", "41"], "must be at least 42, but it is 41"),
    (
        "choosing",
        ["--exemplars", "small.png"],
        "small.png: must have at least 42 pixels a side, but it is 16x16",
    ),
    ("efros_leung_windows", [], "--out"),
    ("efros_leung_windows", ["--out", "made.txt"], "must end in .png or .jpg"),
    ("efros_leung_windows", ["--out", "none/made.png"], "a folder that does not exist, none"),
    (
        "efros_leung_windows",
        ["--out", "made.png", "--windows", "4"],
        "must be odd, to have a middle, but it is 4",
    ),
    ("efros_leung_windows", ["--out", "made.png", "--windows", "1"], "must be at least 3, but it is 1"),
    ("efros_leung_windows", ["--out", "made.png", "--size", "12"], "must be HxW"),
    ("efros_leung_windows", ["--out", "made.png", "--pictures", "none.png"], "none.png"),
    (
        "efros_leung_windows",
        ["--out", "made.png", "--pictures", "rings", "small.png"],
        "windows: must fit into the middle of small.png, 16x16, but one has 23 pixels",
    ),
    ("gallery", [], "--out"),
    ("gallery", ["--out", "taken"], "taken"),
    ("gallery", ["--out", "made", "--only", "none"], "invalid choice: 'none'"),
    ("make_samples", [], "folder"),
    ("tsvq_figures", ["--out", "taken"], "taken"),
    ("tsvq_report", ["--size", "12x"], "must be HxW"),
    ("tsvq_report", ["--size", "1x1"], "all its neighbors before it, but at 1x1 there is none"),
    ("tsvq_report", ["--exemplar", "none.png"], "none.png"),
    ("tsvq_report", ["--exemplar", "taken"], "taken"),
    ("tsvq_report", ["--large", "none.png"], "none.png"),
    ("tsvq_report", ["--large", "small.png"], "at least 512x512 pixels, but it has 16x16"),
    ("tsvq_report", ["--depths", "31"], "must be from 1 to 30, but it is 31"),
    ("tsvq_report", ["--beams", "two"], "must be a whole number from 1 to 64, but it is 'two'"),
    ("tsvq_report", ["--out", "."], "but . is a folder"),
    ("validate_measures", ["--textures", "small.png"], "textures: must be two or more, all different"),
    ("validate_measures", ["--textures", "none.png", "small.png"], "none.png"),
    ("validate_measures", ["--textures", "small.png", "taken"], "taken"),
    (
        "validate_measures",
        ["--textures", "small.png", "sample:brick"],
        "small.png: must have at least 28 pixels a side to be cut in quarters, but it is 16x16",
    ),
    ("validate_measures", ["--crop", "13"], "must be at least 14, but it is 13"),
    ("validate_measures", ["--out", "found.txt"], "must end in .csv or .md, but it is found.txt"),
    ("validate_measures", ["--out", "none/found.md"], "a folder that does not exist, none"),
]


@pytest.mark.parametrize(("name", "given", "said"), WRONG)
def test_a_wrong_argument_is_one_clear_line(script, picture, capsys, name, given, said):
    Path("taken").write_text("no folder, and no picture")
    picture(16, "small.png")
    module = script(name, *given)
    with pytest.raises(SystemExit, match=r"^2$"):
        module.main()
    out, err = capsys.readouterr()
    # What argparse finds itself comes after a reminder of the usage.
    usage, line = err.splitlines()[:-1], err.splitlines()[-1]
    assert line.startswith(f"{name}.py: error: ")
    assert said in line
    assert out == ""
    assert not usage or usage[0].startswith("usage: ")
