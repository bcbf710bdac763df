"""One more pass over a finished output."""

from __future__ import annotations

import pytest
import torch

import torchsynth as ts
from tests.reference import ashikhmin
from tests.test_papers import Draws
from torchsynth.cli import main

SIZE = (10, 13)


@pytest.fixture
def sample(make_exemplar):
    return make_exemplar(3, 11, 12, seed=6)


@pytest.fixture
def target(make_exemplar):
    return make_exemplar(3, *SIZE, seed=9)


def _whole(image):
    return (image * 255).round().long().permute(1, 2, 0).numpy()


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_equals_the_paper_literally(sample, target, boundary):
    controls, n = ts.Controls(target=target), 3
    recipe = ts.recipes.ashikhmin_target(neighborhood=n, boundary=boundary)
    once = ts.synthesize(sample, SIZE, recipe, controls=controls, seed=4)
    twice = ts.refine(sample, once, controls=controls, seed=5)
    canvas = ashikhmin.Canvas(_whole(sample), SIZE, boundary == "torus")
    for place in torch.cartesian_prod(*map(torch.arange, SIZE)).tolist():
        canvas.set(tuple(place), tuple(once.source[0, :, place[0], place[1]].tolist()))
        canvas.known[tuple(place)] = True
    draws = Draws(5, SIZE[0] * SIZE[1], SIZE[1])
    draws.begun = True  # nothing is drawn for a start
    ashikhmin.sweep(
        canvas, range(SIZE[0]), n // 2, draws(), ashikhmin.causal(n), ashikhmin.square(n), noise=True,
        target=_whole(target), painted=torch.ones(SIZE, dtype=torch.bool).numpy(), below=ashikhmin.anticausal(n),
    )  # fmt: skip
    assert twice.source[0].permute(1, 2, 0).tolist() == canvas.source.tolist()
    assert not twice.source.equal(once.source)


def test_is_the_next_pass(sample, target):
    one, two = (ts.recipes.with_target(ts.recipes.wei_levoy_single(neighborhood=5), passes=n) for n in (1, 2))
    controls = ts.Controls(target=target)
    once = ts.synthesize(sample, SIZE, one, controls=controls, seed=3)
    twice = ts.refine(sample, once, controls=controls)
    assert twice.source.equal(ts.synthesize(sample, SIZE, two, controls=controls, seed=3).source)
    assert not twice.source.equal(once.source)


def test_another_target_may_be_followed(sample, target):
    recipe, other = ts.recipes.ashikhmin_target(), target.flip(1)
    once = ts.synthesize(sample, SIZE, recipe, controls=ts.Controls(target=target))
    twice = ts.refine(sample, once, controls=ts.Controls(target=other))
    errors = [float((result.image - other).square().mean()) for result in (once, twice)]
    assert errors[1] < errors[0]


@pytest.mark.parametrize(
    "recipe",
    [
        ts.recipes.ashikhmin_multires(levels=2, neighborhood=3),
        ts.recipes.wei_levoy(levels=2, neighborhood=3, parent=3),
        ts.recipes.random_order(levels=2, neighborhood=3),
        ts.recipes.ashikhmin(neighborhood=3),
    ],
    ids=lambda recipe: recipe.name,
)
def test_laws_hold(sample, recipe):
    first = ts.synthesize(sample, SIZE, recipe, seed=[1, 2])
    result = ts.refine(sample, first, seed=7)
    assert result.image.equal(result.transfer(sample))
    assert result.levels[0].start.equal(first.image)
    alone = ts.refine(sample, first.source[1:], recipe, seed=8)
    assert result.source[1:].equal(alone.source)


def test_patches_can_be_refined_by_pixels(sample):
    quilt = ts.synthesize(sample, SIZE, ts.recipes.quilting(block=4))
    result = ts.refine(sample, quilt, ts.recipes.ashikhmin(neighborhood=3))
    assert result.image.equal(result.transfer(sample))


def test_coarse_levels_begin_with_every_second_source(make_exemplar):
    exemplar = make_exemplar(1, 12, 12)
    source = ts.synthesize(exemplar, (8, 8), ts.recipes.ashikhmin()).source
    recipe = ts.recipes.ashikhmin_multires(levels=2, neighborhood=3)
    result = ts.refine(exemplar, source, recipe)
    coarse = ts.Exemplar(exemplar).images(2)[1]
    rows, columns = (source[:, :, ::2, ::2] // 2)[0]
    assert result.levels[1].start[0].equal(coarse[0][:, rows, columns])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"output": torch.zeros(1, 2, 4, 4)}, "initial_source: must hold whole numbers"),
        ({"output": torch.zeros(2, 4, dtype=torch.int64)}, r"initial_source: must be \(2, OH, OW\)"),
        ({"output": torch.full((1, 2, 4, 4), -1)}, "must name a pixel of the exemplar, 11x12, everywhere, but it goes from -1"),
        ({"output": torch.full((1, 2, 4, 4), 11)}, None),
        ({"output": torch.full((1, 2, 4, 4), 12)}, "must name a pixel of the exemplar"),
        ({"recipe": None}, "recipe: must be given to refine a source map"),
        ({"recipe": ts.recipes.quilting()}, "quilting: must go over single pixels.*it copies whole patches"),
        ({"recipe": ts.recipes.improved_wl()}, "it makes a guide of its own"),
        ({"recipe": ts.recipes.efros_leung(channels="separate")}, "its pixels are no copies"),
        ({"controls": ts.Controls(initial=torch.zeros(3, 4, 4))}, "initial_source: must be the only start"),
        ({"output": torch.full((2, 2, 4, 4), 3), "seed": (1, 2, 3)}, "initial_source: must be of the output's"),
    ],
)  # fmt: skip
def test_errors(sample, change, message):
    given = {"output": torch.full((1, 2, 4, 4), 3), "recipe": ts.recipes.ashikhmin(neighborhood=3)} | change
    output, recipe = given.pop("output"), given.pop("recipe")
    if message is None:  # the last row is there, the last but one column too
        assert ts.refine(sample, output - torch.tensor([1, 0]).view(2, 1, 1), recipe).image.shape == (
            1,
            3,
            4,
            4,
        )
        return
    with pytest.raises(ts.TorchsynthError, match=message):
        ts.refine(sample, output, recipe, **given)


def test_sources_must_be_valid(sample):
    valid = torch.ones(11, 12, dtype=torch.bool)
    valid[:, :6] = False
    with pytest.raises(ts.InputError, match="must name valid pixels of the exemplar only"):
        ts.refine(
            ts.Exemplar(sample, valid), torch.full((1, 2, 4, 4), 3), ts.recipes.ashikhmin(neighborhood=3)
        )


@pytest.fixture
def folder(tmp_path, monkeypatch, sample, target):
    monkeypatch.chdir(tmp_path)
    ts.write_image(sample, "exemplar.png")
    ts.write_image(target, "target.png")
    command = ["synthesize", "exemplar.png", "--target", "target.png"]
    assert main([*command, "-o", "one.png", "--source-map", "one.npz"]) == 0
    return tmp_path


def test_on_the_command_line(folder, sample, target):
    command = ["synthesize", "exemplar.png", "--target", "target.png", "--refine", "one.npz"]
    assert main([*command, "-o", "two.png"]) == 0
    controls = ts.Controls(target=target)
    once = ts.synthesize(sample, SIZE, ts.recipes.ashikhmin_target(), controls=controls)
    twice = ts.read_image("two.png")
    assert twice.equal(ts.refine(sample, once, controls=controls).image[0])
    assert not twice.equal(once.image[0])
    assert main(["rerun", "two.json", "-o", "again.png"]) == 0
    assert (folder / "again.png").read_bytes() == (folder / "two.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["exemplar.png", "--passes", "2", "--target", "target.png"],
            "--passes: cannot be given to --refine",
        ),
        (
            ["target.png"],
            "source map: must be that of an output of this exemplar, 10x13, but it belongs to one of 11x12",
        ),
        (["exemplar.png", "--size", "9x9"], "initial_source: must be of the output's height and width"),
        (["exemplar.png", "--recipe", "quilting"], "quilting: must go over single pixels"),
    ],
)
def test_errors_on_the_command_line(folder, capsys, arguments, message):
    capsys.readouterr()
    assert main(["synthesize", *arguments, "--refine", "one.npz", "-o", "two.png"]) == 2
    assert message in capsys.readouterr().err
    assert not (folder / "two.png").exists()
