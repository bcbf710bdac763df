"""Targets, fields, drawings and blurred seams: from Python and from the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import torch

import torchsynth as ts
from torchsynth import checks, field, metrics, viz
from torchsynth.cli import main
from torchsynth.io import Picture
from torchsynth.result import seams
from torchsynth.wishes import controls_from


@pytest.fixture
def folder(tmp_path, monkeypatch, make_exemplar):
    """Pictures to work with."""
    monkeypatch.chdir(tmp_path)
    ts.write_image(make_exemplar(3, 20, 18), "rgb.png")
    ts.write_image(make_exemplar(3, 12, 14, seed=2), "target.png")
    ts.write_image(make_exemplar(1, 12, 14, seed=2), "gray.png")
    region = torch.zeros(1, 12, 14)
    region[:, 3:9, 2:8] = 1
    ts.write_image(torch.cat((make_exemplar(3, 12, 14, seed=2), region)), "painted.png")
    ts.write_image(region, "region.png")
    ts.write_image(torch.zeros(1, 12, 14), "nothing.png")
    ts.write_image(torch.full((1, 12, 14), 0.5), "middle.png", depth="16-bit")
    return tmp_path


@pytest.fixture
def run(capsys, folder):  # noqa: ARG001 (the pictures are there)
    """Run a command; returns its exit code and what it said on stderr."""

    def run(*arguments):
        code = main([str(one) for one in arguments])
        return code, capsys.readouterr().err

    return run


def test_a_target_from_files_equals_one_from_python(run):
    assert run("synthesize", "rgb.png", "--target", "painted.png", "--passes", "2", "-o", "a.png") == (0, "")
    assert run(
        "synthesize", "rgb.png", "--target", "target.png", "--target-region", "region.png", "--passes", "2",
        "-o", "b.png",
    ) == (0, "")  # fmt: skip
    painted = ts.read_image("region.png")[0] > 0.5
    result = ts.synthesize(
        ts.read_image("rgb.png"),
        (12, 14),
        ts.recipes.ashikhmin_target(passes=2),
        controls=ts.Controls(target=ts.read_image("target.png"), target_region=painted),
    )
    assert ts.read_image("a.png").equal(result.image[0])
    assert ts.read_image("b.png").equal(result.image[0])
    free = ts.synthesize(
        ts.read_image("rgb.png"), (12, 14), ts.recipes.ashikhmin_target(passes=2),
        controls=ts.Controls(target=ts.read_image("target.png")),
    )  # fmt: skip
    assert not free.source.equal(result.source)


def test_other_recipes_follow_a_target_too(run):
    for recipe in ("wei_levoy", "random_order", "ashikhmin_multires"):
        code, said = run(
            "synthesize", "rgb.png", "--recipe", recipe, "--set", "levels=1", "--target", "target.png",
            "-o", f"{recipe}.png",
        )  # fmt: skip
        assert (code, said) == (0, "")
        layers = json.loads(Path(f"{recipe}.json").read_text())["recipe"]["sweeps"][-1]["layers"]
        assert "target" in [layer["plane"] for layer in layers]


@pytest.mark.parametrize("options", [
    ("--target", "painted.png", "--passes", "2"),
    ("--target", "target.png", "--target-region", "region.png"),
    ("--size", "12x14", "--angle", "swirl:90", "--scale", "middle.png"),
    ("--size", "12x14", "--angle", "30", "--scale", "wave:0.2,1,1.1"),
    ("--size", "12x14", "--blur-seams", "3"),
])  # fmt: skip
def test_records_make_the_same_bytes(run, options):
    assert run("synthesize", "rgb.png", "--recipe", "ashikhmin", *options, "-o", "a.png") == (0, "")
    assert run("rerun", "a.json", "-o", "b.png") == (0, "")
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()
    assert ts.read_image("a.png").shape == (3, 12, 14)


def test_fields_on_the_command_line_equal_those_in_python(run):
    code, said = run(
        "synthesize", "rgb.png", "--recipe", "ashikhmin", "--size", "12x14", "--angle", "swirl:90", "--scale",
        "zoom:0.5,1.5", "-o", "a.png", "--figure", "field=f.png", "--figure", "sources=s.png",
    )  # fmt: skip
    assert (code, said) == (0, "")
    controls = ts.Controls(angle=field.swirl((12, 14), 90.0), scale=field.zoom((12, 14), 0.5, 1.5))
    result = ts.synthesize(ts.read_image("rgb.png"), (12, 14), ts.recipes.ashikhmin(), controls=controls)
    assert ts.read_image("a.png").equal(result.image[0])
    for kind, name in (("field", "f.png"), ("sources", "s.png")):
        drawn = viz.draw(kind, result, controls)
        assert drawn.shape == (1, 3, 12, 14)
        assert torch.allclose(ts.read_image(name), drawn[0].clamp(0, 1).float(), atol=1 / 255)


def test_gray_pictures_give_fields():
    picture = Picture(torch.tensor([[[0.0, 0.5, 1.0]]]), "8-bit", "")
    controls = controls_from({"angle": picture, "scale": picture}, {}, 3, (1, 3))
    assert controls.angle.tolist() == [[0.0, 180.0, 360.0]]
    assert controls.scale.tolist() == [[0.25, 1.0, 4.0]]
    exact = Picture(torch.tensor([[[-30.0, 0.5, 400.0]]]), "float", "")
    assert controls_from({"angle": exact}, {}, 3, (1, 3)).angle.tolist() == [[-30.0, 0.5, 400.0]]


def test_a_target_of_an_exemplar_with_alpha_keeps_its_own():
    picture = Picture(torch.rand(4, 5, 5), "8-bit", "")
    controls = controls_from({"target": picture}, {}, 4, (5, 5))
    assert controls.target.shape == (4, 5, 5)
    assert controls.target_region is None


WRONG = {
    ("--target", "target.png", "--size", "13x14"): "target: must have the output's channels, height and width "
    "(3, 13, 14), but its shape is (3, 12, 14)",
    ("--target", "gray.png"): "(3, 12, 14), but its shape is (1, 12, 14)",
    ("--target", "target.png", "--target-region", "nothing.png"): "target region: must be True somewhere",
    ("--target", "painted.png", "--target-region", "region.png"): "target region: must be marked once",
    ("--target-region", "region.png"): "target region: must come with a target",
    ("--target", "target.png", "--passes", "0"): "passes: must be from 1 to 20, but it is 0",
    ("--target", "target.png", "--passes", "21"): "passes: must be from 1 to 20, but it is 21",
    ("--passes", "2"): "--passes: must come with a target",
    ("--recipe", "ashikhmin_target"): "target: must be given to the recipe 'ashikhmin_target'",
    ("--target", "missing.png"): "missing.png: must be a readable image file",
    ("--angle", "nan"): "angle: must be finite",
    ("--angle", "swril:3"): "did you mean 'swirl'?",
    ("--angle", "swirl:x"): "'swirl' takes the numbers degrees, but it is given 'x'",
    ("--angle", "swirl"): "'swirl' takes the numbers degrees, but it is given ''",
    ("--angle", "rgb.png"): "angle: a field's picture must be gray, but it has 3 channels",
    ("--angle", "middle.png"): "angle: must have the output's height and width (40, 36), but its shape is (12, 14)",
    ("--scale", "0"): "scale: must lie from 0.0625 to 16, but it is 0",
    ("--scale", "-2"): "scale: must lie from 0.0625 to 16, but it is -2",
    ("--scale", "inf"): "scale: must be finite",
    ("--scale", "zoom:1,99"): "scale: must lie from 0.0625 to 16, but it reaches from 1 to 99",
    ("--scale", "zoom:-1,2"): "zoom: must go from a factor above 0 to another, but it goes from -1 to 2",
    ("--angle", "30", "--recipe", "ashikhmin", "--figure", "patches=f.png"): "figure patches: needs an output that "
    "is neither turned nor scaled",
    ("--angle", "30", "--recipe", "ashikhmin", "--blur-seams", "3"): "blur_seams: needs an output that is neither",
    ("--target", "target.png", "--codebook", "c.safetensors"): "--codebook: serves the recipe it was trained for",
    ("--recipe", "ashikhmin", "--size", "1x17000", "--figure", "patches=f.webp"): "f.webp: ",
    ("--recipe", "random_order", "--set", "neighborhood=1"): "a square without its center needs a side of 3",
    ("--figure", "field=f.png"): "figure: field can be drawn where there is one",
    ("--figure", "seams=f.png"): "figure: must be one of patches, sources, field, cost, coverage, pyramid, tree, sheet, animation, but it is 'seams'",
    ("--figure", "patches"): "--figure: must be KIND=FILE",
    ("--figure", "patches=a.png", "--figure", "patches=b.png"): "patches is there twice",
    ("--figure", "patches=out.png"): "must be a file of its own",
    ("--figure", "patches=p.txt"): "must end in one of",
    ("--figure", "patches=rgb.png"): "it is an input as well",
    ("--blur-seams", "4"): "'blur_seams': a side must be odd, but 4 is even",
}  # fmt: skip


@pytest.mark.parametrize(("options", "message"), WRONG.items(), ids=[" ".join(one) for one in WRONG])
def test_wrong_wishes_are_told(folder, run, options, message):
    before = sorted(folder.iterdir())
    code, said = run("synthesize", "rgb.png", *options, "-o", "out.png")
    assert code == 2
    assert message in said
    assert re.fullmatch(r"error: [^\n]+: [^\n]+, but [^\n]+; [^\n]+\n", said), said
    assert sorted(folder.iterdir()) == before


def test_what_needs_sources_is_refused_without_them(run, folder):
    before = sorted(folder.iterdir())
    centroids = ("--recipe", "wei_levoy_tsvq", "--set", "levels=1", "--set", "sweeps[0].search.leaf=centroid")
    for option in (("--source-map", "s.npz"), ("--figure", "patches=p.png"), ("--figure", "sources=p.png")):
        code, said = run("synthesize", "rgb.png", *centroids, *option, "-o", "out.png")
        assert code == 2
        assert "needs a source map, and so a recipe that copies pixels, but leaves of the recipe" in said
    assert sorted(folder.iterdir()) == before
    assert run("synthesize", "rgb.png", *centroids, "--size", "9x9", "-o", "out.png") == (0, "")


@pytest.mark.parametrize(("make", "message"), [
    (lambda: ts.Controls(target=torch.rand(3, 4)), r"target: must have shape \(C, H, W\)"),
    (lambda: ts.Controls(target_region=torch.ones(3, 4, dtype=torch.bool)), "must come with the target"),
    (lambda: ts.Controls(target=torch.rand(1, 3, 4), target_region=torch.ones(3, 5, dtype=torch.bool)),
     r"target_region: must have the image's shape \(3, 4\)"),
    (lambda: ts.Controls(target=torch.rand(1, 3, 4), target_region=torch.zeros(3, 4, dtype=torch.bool)),
     "target_region: must be True somewhere"),
    (lambda: checks.check_field("north", "angle", None), "angle: must be a number, or a tensor"),
    (lambda: ts.Controls(angle=torch.rand(3)), r"angle: must have shape \(H, W\)"),
    (lambda: ts.Controls(angle=torch.tensor(3.0)), r"angle: must have shape \(H, W\)"),
    (lambda: ts.Controls(scale=torch.zeros(3, 3)), "scale: must lie from 0.0625 to 16, but it is 0"),
    (lambda: ts.Controls(scale=torch.full((3, 3), torch.nan)), "scale: must be finite"),
    (lambda: ts.recipes.with_target(ts.recipes.wei_levoy(), passes=0), "passes: must be from 1 to 20"),
    (lambda: ts.recipes.with_target(ts.recipes.wei_levoy(), passes=True), "passes: must be from 1 to 20, but it is True"),
    (lambda: ts.Controls(scale=torch.zeros(0, 5)), r"scale: must have shape \(H, W\)"),
    (lambda: checks.check_field(10**400, "angle", None), "angle: must be finite"),
    (lambda: checks.check_field(1e300, "scale", (0.5, 2.0)), "scale: must lie from 0.5 to 2, but it is 1e"),
    (lambda: ts.field.zoom((3, 3), 0.0, 1.0), "zoom: must go from a factor above 0"),
    (lambda: ts.field.swirl((0, 8), 3.0), "swirl: must be made for an output of at least 1x1, but the shape is 0x8"),
    (lambda: ts.field.constant((3, 3), float("inf")), "constant: value must be finite, but it is inf"),
    (lambda: ts.field.wave((3, 3), 1.0, float("nan")), "wave: periods must be finite, but it is nan"),
])  # fmt: skip
def test_wrong_controls_are_told(make, message):
    with pytest.raises((ts.InputError, ts.ConfigError), match=message):
        make()


@pytest.mark.parametrize(
    ("recipe", "controls", "message"),
    [
        (ts.recipes.wei_levoy(levels=1), {"target": torch.rand(1, 8, 8)}, "has no layer on the target plane"),
        (ts.recipes.ashikhmin_target(), {}, "which follows one, but there is none"),
        (
            ts.recipes.ashikhmin_target(),
            {"target": torch.rand(1, 9, 8)},
            "target: must have the output's channels",
        ),
        (
            ts.recipes.ashikhmin(),
            {"angle": torch.rand(9, 8)},
            "angle: must have the output's height and width",
        ),
    ],
)
def test_controls_that_do_not_fit_are_told(recipe, controls, message):
    with pytest.raises(ts.InputError, match=message):
        ts.synthesize(torch.rand(1, 20, 20), (8, 8), recipe, controls=ts.Controls(**controls))


def test_seams_are_where_copies_end():
    """Two patches side by side, the right one from elsewhere."""
    rows, columns = torch.meshgrid(torch.arange(4), torch.arange(6), indexing="ij")
    source = torch.stack((rows, torch.where(columns < 3, columns, columns + 5)))[None]
    expected = torch.zeros(1, 4, 6, dtype=torch.bool)
    expected[:, :, 2] = True
    assert seams(source, "open").equal(expected)
    expected[:, :, 5] = True
    expected[:, 3] = True
    assert seams(source, "torus").equal(expected)


def test_patches_are_larger_than_those_of_wei_levoy():
    exemplar = ts.read_image("sample:pebbles")
    share = [
        ts.synthesize(exemplar, (48, 48), recipe).seams().float().mean()
        for recipe in (ts.recipes.ashikhmin(), ts.recipes.wei_levoy_single(neighborhood=5))
    ]
    assert share[0] < share[1] / 2


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_blurring_touches_only_the_seams(make_exemplar, boundary):
    exemplar = make_exemplar(3, 24, 24)
    plain = ts.recipes.ashikhmin(boundary=boundary)
    sharp = ts.synthesize(exemplar, (15, 13), plain)
    blurred = ts.synthesize(exemplar, (15, 13), plain.model_copy(update={"blur_seams": 5}))
    assert blurred.source.equal(sharp.source)
    ends = sharp.seams()
    beside = ends | ends.roll(1, 1) | ends.roll(1, 2)
    changed = (blurred.image != sharp.image).any(1)
    assert (changed <= beside).all()
    rows, columns = sharp.source.unbind(1)
    whole = torch.ones_like(ends)  # pixels whose four neighbors continue their patch
    for axis, step in ((1, 1), (1, -1), (2, 1), (2, -1)):
        moved = [place.roll(-step, axis) for place in (rows, columns)]
        moved[axis - 1] = moved[axis - 1] - step
        follows = (moved[0] == rows) & (moved[1] == columns)
        if boundary == "open":
            follows.select(axis, -1 if step == 1 else 0).fill_(True)
        whole &= follows
    assert not (changed & whole).any()
    assert changed.any()
    assert blurred.image.dtype == exemplar.dtype


def test_a_field_is_drawn_along_its_angle():
    across = viz.draw_field(0.0, None, (48, 48))[0, 0] == 0
    upright = viz.draw_field(90.0, None, (48, 48))[0, 0] == 0
    assert across.any()
    assert upright.equal(across.T)
    assert viz.draw_field(None, 2.0, (48, 48))[0, 0].eq(0).sum() > across.sum()


def test_tileable_output_has_no_sharp_seam():
    """Steps from the last to the first row are hardly larger than those inside."""
    exemplar = ts.read_image("sample:pebbles").mean(0, keepdim=True)

    def ratio(recipe):
        return metrics.seam_ratio(ts.synthesize(exemplar, (64, 64), recipe, seed=[1, 2]).image)[:, 0].mean()

    assert ratio(ts.recipes.ashikhmin(tileable=True)) < 1.3
    assert ratio(ts.recipes.ashikhmin(tileable=False)) > 1.3


def test_passes_of_a_recipe_with_passes_are_counted_anew():
    five = ts.recipes.ashikhmin_target(passes=5)
    assert ts.recipes.with_target(five, passes=3) == ts.recipes.ashikhmin_target(passes=3)
    again = ts.recipes.with_target(ts.recipes.with_target(ts.recipes.wei_levoy(), passes=4), passes=2)
    assert again == ts.recipes.with_target(ts.recipes.wei_levoy(), passes=2)


def test_sweeps_that_share_the_rows_all_follow_a_target():
    layers = (ts.Layer(plane="result", template=ts.Causal(size=3)),)
    halves = ts.Recipe(levels=1, sweeps=[ts.Sweep(layers=layers, rows=rows) for rows in ((0, 3), (3, None))])
    following = ts.recipes.with_target(halves)
    assert [sweep.rows for sweep in following.sweeps] == [(0, 3), (3, None)]
    assert all(sweep.layers[-1].plane == "target" for sweep in following.sweeps)


def test_a_picture_to_start_from_leaves_inheritance_alone(make_exemplar):
    exemplar, initial = make_exemplar(1, 20, 20), make_exemplar(1, 12, 12, seed=3)
    recipe = ts.recipes.ashikhmin_multires(levels=2, neighborhood=3)
    result = ts.synthesize(exemplar, (12, 12), recipe, controls=ts.Controls(initial))
    coarse = result.levels[1].source[0]
    rows, columns = torch.meshgrid(torch.arange(12), torch.arange(12), indexing="ij")
    inherited = 2 * coarse[:, rows // 2, columns // 2] + torch.stack((rows % 2, columns % 2))
    assert result.levels[0].start[0].equal(exemplar[:, inherited[0], inherited[1]])


def test_gray_means_of_a_black_and_white_picture_are_kept(run):
    black_and_white = (torch.rand(1, 24, 24, generator=torch.Generator().manual_seed(1)) > 0.5).float()
    ts.write_image(black_and_white, "bw.png", depth="1-bit")
    assert run("synthesize", "bw.png", "--recipe", "ashikhmin", "--blur-seams", "3", "-o", "out.png") == (
        0,
        "",
    )
    assert len(ts.read_image("out.png").unique()) > 2


def test_alpha_is_no_color_of_a_drawing():
    exemplar = torch.cat((torch.full((3, 16, 16), 0.25), torch.ones(1, 16, 16)))
    result = ts.synthesize(exemplar, (6, 6), ts.recipes.ashikhmin(neighborhood=3))
    drawn = viz.draw_patches(result)
    assert sorted(drawn.unique().tolist()) in ([0.25, 1.0], [0.25], [1.0])


def test_a_distorted_result_has_no_straight_seams(make_exemplar):
    result = ts.synthesize(make_exemplar(1), (8, 8), ts.recipes.ashikhmin(), controls=ts.Controls(angle=20.0))
    with pytest.raises(ts.InputError, match="seams: needs an output that is neither turned nor scaled"):
        result.seams()


def test_patches_are_drawn_on_the_command_line(run):
    assert run("synthesize", "rgb.png", "--recipe", "ashikhmin", "--size", "12x14", "-o", "a.png", "--count", "2",
               "--figure", "patches=p.png") == (0, "")  # fmt: skip
    exemplar = ts.read_image("rgb.png")
    result = ts.synthesize(exemplar, (12, 14), ts.recipes.ashikhmin(), seed=[0, 1])
    for item in (0, 1):
        assert torch.allclose(ts.read_image(f"p-{item}.png"), viz.draw_patches(result)[item], atol=1 / 255)
