"""Pictures of what a synthesis did: their values, their files, and what cannot be drawn."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib as mpl
import pytest
import torch
from PIL import Image as Pillow
from PIL import ImageSequence

import torchsynth as ts
from torchsynth import viz
from torchsynth.cli import main
from torchsynth.viz.animation import MOST

WORDS = ("cost", "coverage", "tree", "sheet")


@pytest.fixture(scope="module")
def grown():
    """Two outputs with all that was recorded of them, and their codebook."""
    exemplar = ts.read_image("sample:pebbles")[:, :24, :28].contiguous()
    recipe = ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3)
    recorder = viz.Recorder()
    codebook = ts.train(exemplar, recipe)
    result = ts.synthesize(exemplar, (20, 22), recipe, seed=[3, 4], codebook=codebook, progress=recorder)
    return result, recorder, codebook


@pytest.fixture(scope="module")
def filled():
    """A filled hole, and what was known of it."""
    picture = ts.read_image("sample:brick")[:, :24, :24].contiguous()
    hole = torch.zeros(24, 24, dtype=torch.bool)
    hole[8:14, 9:15] = True
    recorder = viz.Recorder()
    recipe = ts.recipes.coherent_fill(levels=1)
    result = ts.fill(picture, hole, recipe=recipe, progress=recorder)
    return result, recorder, ts.Controls(initial=picture, hole=hole)


def bytes_of(frames, name):
    return viz.encode_animation(frames, Path(name))


def opened(data, tmp_path, name):
    """The frames of an animation, as Pillow reads them, and how long each is shown."""
    (tmp_path / name).write_bytes(data)
    with Pillow.open(tmp_path / name) as file:
        frames = [
            (one.convert("RGB").copy(), one.info.get("duration")) for one in ImageSequence.Iterator(file)
        ]
    pictures = [torch.frombuffer(bytearray(one.tobytes()), dtype=torch.uint8) for one, _ in frames]
    height, width = frames[0][0].size[::-1]
    return [one.view(height, width, 3).permute(2, 0, 1) for one in pictures], [held for _, held in frames]


def stored(image):
    """An image as 8 bits hold it."""
    return (viz.paper.shown(image).double() * 255).round().to(torch.uint8)


def test_patches_are_white_where_they_end(grown):
    result, _, _ = grown
    drawn = viz.draw_patches(result)
    assert result.seams().any()
    expanded = result.seams().unsqueeze(1).expand(-1, 3, -1, -1)
    assert drawn[expanded].eq(1).all()
    assert drawn[~expanded].equal(result.image[~expanded])


def test_copies_add_up_to_the_pixels(grown, filled):
    result, _, _ = grown
    counts = viz.copies(result)
    assert counts.shape == (2, 24, 28)
    assert counts.flatten(1).sum(1).tolist() == [20 * 22] * 2
    row, column = result.source[1, :, 5, 6].tolist()
    same = (result.source[1] == torch.tensor([row, column]).view(2, 1, 1)).all(0)
    assert counts[1, row, column] == same.sum()
    filling, _, controls = filled
    assert viz.copies(filling, controls.hole).sum() == controls.hole.sum()
    assert not viz.copies(filling, controls.hole)[0][controls.hole].any()
    assert viz.copies(filling).sum() == 24 * 24


def test_costs_are_the_lighter_the_higher(grown):
    result, _, _ = grown
    drawn = viz.draw_cost(result)[0]
    # Enlarged by 256 // 22; the map is the last thing at the left.
    factor, gap = 11, 8
    side = drawn[:, -gap - 20 * factor : -gap, gap : gap + 22 * factor][:, ::factor, ::factor]
    light = (side * torch.tensor([0.2126, 0.7152, 0.0722]).view(3, 1, 1)).sum(0).flatten()
    order = result.cost[0].flatten().argsort()
    assert light[order].diff().min() >= -1e-3
    assert light[order[-1]] > light[order[0]] + 0.3


def test_a_perfect_match_costs_nothing_and_can_be_drawn():
    result = ts.synthesize(torch.full((1, 12, 12), 0.5), (10, 10), ts.recipes.ashikhmin(noise=False))
    assert result.cost.max() == 0
    assert viz.draw_cost(result).isfinite().all()


def test_a_pyramid_shows_every_level(grown):
    result, _, _ = grown
    drawn = viz.draw_pyramid(result)
    assert drawn.shape == (2, 3, 24 + 20 + 20 + 4 * 8, 2 * 28 + 3 * 8)
    finest = drawn[:, :, -28:-8, 44:66]
    assert finest.equal(result.image)
    coarse = drawn[1, :, -28:-8, 8:30]
    assert coarse[:, ::2, ::2].equal(result.levels[1].image[1])
    assert drawn[0, :, 8:32, 44:72].equal(result.levels[0].exemplar[0])


def test_a_sheet_shows_all_at_one_scale():
    small, large = torch.zeros(1, 8, 8), torch.rand(1, 3, 16, 20)
    drawn = viz.sheet({"small": small, "large, with a very long name that takes several lines": large})
    assert drawn.shape[:2] == (1, 3)
    factor = 256 // 20
    black = (drawn[0] == 0).all(0)
    assert black[:, : 8 + 8 * factor].sum() >= (8 * factor) ** 2
    bottom = drawn[0, :, -8 - 16 * factor : -8, -8 - 20 * factor : -8]
    assert bottom[:, ::factor, ::factor].equal(large[0])
    two_rows = viz.sheet({"1": small, "2": small, "3": small}, columns=2)
    assert two_rows.shape == (1, 3, 8 + 2 * (18 + 256 + 8), 8 + 2 * (256 + 8))
    with pytest.raises(ts.InputError, match="sheet: must show at least one picture"):
        viz.sheet({})
    with pytest.raises(ts.InputError, match="must be one picture, but there are 2"):
        viz.sheet({"two": torch.zeros(2, 1, 4, 4)})


def test_a_sheet_of_a_filled_hole_shows_the_hole(filled):
    result, _, controls = filled
    drawn = viz.draw("sheet", result, controls)[0]
    magenta = (drawn == torch.tensor([1.0, 0.0, 1.0]).view(3, 1, 1)).all(0)
    assert magenta.sum() == controls.hole.sum() * 10**2


def test_a_tree_shows_the_means_of_its_nodes(grown):
    _, _, codebook = grown
    drawn = viz.draw_tree(codebook, steps=1)[0]
    training, tree = next(iter(codebook.trees.items()))
    assert training.level == 0
    seen = tree.centroids[:3].float()
    first = ((seen - seen.min()) / (seen.max() - seen.min()))[0, :3]  # the color of the first neighbor
    assert (drawn == first.view(3, 1, 1)).all(0).sum() >= 10**2
    assert viz.draw_tree(codebook, level=1, steps=2).shape[3] >= drawn.shape[2] / 2
    with pytest.raises(ts.InputError, match="level: must be one of 0, 1, whose trees"):
        viz.draw_tree(codebook, level=2)
    with pytest.raises(ts.InputError, match="steps: must be from 1 to 6"):
        viz.draw_tree(codebook, steps=0)


def test_trees_of_several_exemplars_and_of_guides():
    pictures = torch.rand(2, 1, 20, 20)
    several = ts.train(pictures, ts.recipes.wei_levoy_tsvq(levels=1, neighborhood=5))
    assert viz.draw_tree(several, steps=1).shape[0] == 2
    layers = [ts.Layer(plane=plane, template=ts.Square(size=3)) for plane in ("coarse", "guide")]
    recipe = ts.Recipe(levels=2, sweeps=[ts.Sweep(layers=layers, search=ts.TSVQ())])
    guided = ts.train(ts.Exemplar(torch.rand(3, 20, 20), guide=torch.rand(1, 20, 20)), recipe)
    with pytest.raises(ts.InputError, match="channels: must be given to draw a tree over guides"):
        viz.draw_tree(guided)
    drawn = viz.draw_tree(guided, steps=1, channels=3)[0]
    assert (drawn.amax(0) - drawn.amin(0)).max() > 0.05  # the means of the coarse layer have colors


def test_numbers_of_a_tree_add_up(grown):
    _, _, codebook = grown
    tree = next(iter(codebook.trees.values()))
    sizes = viz.tree.sizes_of(tree)
    assert sizes[0] == int(tree.counts.sum()) == len(tree.members)
    leaves = viz.left_to_right(tree.children)
    assert sorted(leaves) == (tree.children < 0).nonzero().flatten().tolist()


@pytest.mark.parametrize("name", ["a.gif", "a.png", "a.apng", "a.webp"])
def test_an_animation_grows_into_the_output(grown, tmp_path, name):
    result, recorder, _ = grown
    frames = list(recorder.frames(1))
    data = bytes_of(frames, name)
    assert data == bytes_of(recorder.frames(1), name)
    seen, held = opened(data, tmp_path, name)
    assert 5 < len(seen) <= MOST + 4
    assert not seen[0].equal(seen[-1])
    assert held[-1] > 10 * held[0]
    last = stored(result.image[1:])[0]
    if name.endswith(".gif"):
        assert (seen[-1].int() - last.int()).abs().double().mean() < 4  # 256 colors
    else:
        assert seen[-1].equal(last)


def test_an_animation_of_a_hole_shows_the_whole_picture(filled, tmp_path):
    result, recorder, controls = filled
    seen, _ = opened(bytes_of(recorder.frames(), "a.gif"), tmp_path, "a.gif")  # gray: exact
    assert seen[-1].equal(stored(result.image)[0])
    around = ~controls.hole
    assert all(one[:, around].equal(seen[-1][:, around]) for one in seen)
    assert not seen[0].equal(seen[-1])


def test_a_recorder_bounds_what_it_keeps(monkeypatch):
    recorder = viz.Recorder()
    for done in range(1001):
        recorder(0, 0, done, 1000, lambda done=done: torch.full((1, 1, 2, 2), done / 1000))
    assert len(list(recorder.frames())) == MOST + 1
    monkeypatch.setattr("torchsynth.viz.animation._BUDGET", 4 * 20)
    recorder = viz.Recorder()
    for done in range(1001):
        recorder(0, 0, done, 1000, lambda done=done: torch.full((1, 1, 2, 2), done / 1000))
    assert len(list(recorder.frames())) == 21
    with pytest.raises(ts.InputError, match="item: must be from 0 to 0"):
        recorder.frames(1)
    with pytest.raises(ts.InputError, match="animation: must be recorded before it is saved"):
        viz.Recorder().frames()


def test_an_animation_is_saved_once(grown, tmp_path):
    result, recorder, _ = grown
    path = recorder.save(tmp_path / "a.png", item=1, last=result.image[1])
    assert path.read_bytes() == bytes_of(recorder.frames(1), "a.png")
    with pytest.raises(ts.OutputError, match="must not exist yet"):
        recorder.save(path)
    with pytest.raises(ts.InputError, match=r"an animation must end in one of .gif .png .apng .webp"):
        recorder.save(tmp_path / "a.jpg")


def test_drawings_are_the_same_every_time(grown):
    result, _, codebook = grown
    settings = dict(mpl.rcParams)
    for kind in WORDS:
        first, second = (viz.draw(kind, result, ts.Controls(), codebook) for _ in range(2))
        assert first.equal(second)
        assert first.shape[:2] == (2, 3)
        assert 0 <= first.min() <= first.max() <= 1
    assert dict(mpl.rcParams) == settings
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


@pytest.mark.parametrize("kind", viz.KINDS)
def test_without_matplotlib_only_words_are_missing(grown, monkeypatch, kind):
    result, _, codebook = grown
    controls = ts.Controls(angle=10.0) if kind == "field" else ts.Controls()
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    if kind in WORDS:
        message = rf'figure {kind}: needs Matplotlib .+ pip install "torchsynth-textures\[viz\]"'
        with pytest.raises(ts.InputError, match=message):
            viz.draw(kind, result, controls, codebook)
        with pytest.raises(ts.InputError, match="words: needs Matplotlib"):
            viz.lettering.lettering("never drawn before")
    elif kind != "animation":
        assert viz.draw(kind, result, controls).shape[1] == 3


def test_what_needs_more_than_a_result_says_so(grown):
    result, _, _ = grown
    for kind, remedy in (("tree", "codebook=ts.train"), ("animation", "ts.viz.Recorder")):
        with pytest.raises(ts.InputError, match=f"figure {kind}: needs more than the result, .*{remedy}"):
            viz.draw(kind, result, ts.Controls())


@pytest.fixture
def folder(tmp_path, monkeypatch, make_exemplar):
    """Pictures to work with."""
    monkeypatch.chdir(tmp_path)
    ts.write_image(make_exemplar(3, 20, 20), "rgb.png")
    hole = torch.zeros(1, 20, 20)
    hole[:, 6:11, 7:12] = 1
    ts.write_image(hole, "hole.png")
    ts.write_image(torch.cat((make_exemplar(3, 20, 20), 1 - hole)), "cut.png")
    ts.write_image(make_exemplar(1, 12, 14, seed=2), "b.png")
    ts.write_image(make_exemplar(1, 20, 20), "a.png")
    return tmp_path


def run(*arguments):
    return main([str(one) for one in arguments])


def all_of(*kinds):
    return [word for kind, name in kinds for word in ("--figure", f"{kind}={name}")]


MADE = {
    "synthesize": (["synthesize", "rgb.png", "--recipe", "ashikhmin", "--size", "12x14"], "out.png"),
    "fill": (["fill", "rgb.png", "hole.png", "--set", "levels=1"], "out.png"),
    "extend": (["extend", "rgb.png", "--by", "2", "--set", "levels=1"], "out.png"),
    "tile": (["tile", "rgb.png", "--width", "4", "--set", "levels=1"], "out.png"),
    "analogy": (["analogy", "a.png", "rgb.png", "b.png", "--set", "levels=1"], "out.png"),
}


@pytest.mark.parametrize("command", MADE)
@pytest.mark.usefixtures("folder")
def test_every_command_draws(command, tmp_path):
    words, output = MADE[command]
    kinds = all_of(("animation", "f.png"), ("coverage", "c.png"), ("sheet", "s.png"), ("cost", "k.png"))
    assert run(*words, *kinds, "--count", 2, "-o", output) == 0
    for item in (0, 1):
        result = ts.read_image(f"out-{item}.png")
        seen, _ = opened(Path(f"f-{item}.png").read_bytes(), tmp_path, "seen.png")
        assert seen[-1].equal(stored(result[None])[0])
        assert not seen[0].equal(seen[-1])
    # An output's drawing is the same alone; a record makes it again.
    alone = all_of(("coverage", "ca.png"), ("sheet", "sa.png"), ("cost", "ka.png"))
    assert run("rerun", "out-1.json", *alone, "-o", "again.png") == 0
    for first, second in (("c-1.png", "ca.png"), ("s-1.png", "sa.png"), ("k-1.png", "ka.png")):
        assert Path(first).read_bytes() == Path(second).read_bytes()


@pytest.mark.usefixtures("folder")
def test_a_tree_is_drawn_of_what_is_searched():
    words = ("--set", "levels=2", "--set", "neighborhood=5", "--set", "parent=3")
    make = ("synthesize", "rgb.png", "--recipe", "wei_levoy_tsvq", *words, "--size", "12x14")
    assert run(*make, "-o", "plain.png") == 0
    assert run(*make, *all_of(("tree", "t.png"), ("pyramid", "p.tif")), "-o", "drawn.png") == 0
    assert Path("plain.png").read_bytes() == Path("drawn.png").read_bytes()
    assert run("train", "rgb.png", "--recipe", "wei_levoy_tsvq", *words, "-o", "book.safetensors") == 0
    with_book = (*make, "--codebook", "book.safetensors", *all_of(("tree", "r.png")))
    assert run(*with_book, "-o", "third.png") == 0
    assert Path("t.png").read_bytes() == Path("r.png").read_bytes()
    assert Path("plain.json").read_bytes() == Path("drawn.json").read_bytes()
    drawn = ts.read_image("p.tif")
    assert drawn[:, -20:-8, 36:50].equal(ts.read_image("drawn.png"))


def test_blurred_seams_and_alpha_are_in_the_last_frame(folder):
    words = ("synthesize", "rgb.png", "--recipe", "ashikhmin", "--size", "12x14", "--blur-seams", "3")
    assert run(*words, *all_of(("animation", "blurred.webp")), "-o", "out.png") == 0
    seen, _ = opened((folder / "blurred.webp").read_bytes(), folder, "seen.webp")
    assert seen[-1].equal(stored(ts.read_image("out.png")[None])[0])
    assert (
        run("fill", "cut.png", "alpha", "--set", "levels=1", *all_of(("animation", "c.apng")), "-o", "o.png")
        == 0
    )
    seen, _ = opened((folder / "c.apng").read_bytes(), folder, "seen.apng")
    assert seen[-1].equal(stored(ts.read_image("o.png")[None])[0])


ASHIKHMIN = ("--recipe", "ashikhmin", "--size", "12x14")
REFUSED = {
    (*ASHIKHMIN, "--figure", "tree=f.png"): "figure: tree can be drawn of one tree of TSVQ, but the recipe "
    "'ashikhmin' has no tsvq search",
    (
        *ASHIKHMIN,
        "--figure",
        "animation=f.jpg",
    ): "f.jpg: an animation must end in one of .gif .png .apng .webp, but it ends in '.jpg'",
    (
        *ASHIKHMIN,
        "--figure",
        "animation=f",
    ): "f: an animation must end in one of .gif .png .apng .webp, but it has no",
    (
        "--recipe",
        "ashikhmin",
        "--size",
        "1x17000",
        "--figure",
        "animation=f.webp",
    ): "f.webp: the sides of a .webp animation have at most 16383 pixels",
    (
        "--recipe",
        "ashikhmin",
        "--size",
        "1x17000",
        "--figure",
        "cost=f.webp",
    ): "f.webp: the sides of a .webp file have",
    (
        "--recipe",
        "ashikhmin",
        "--set",
        "channels=separate",
        "--figure",
        "coverage=f.png",
    ): "figure coverage: needs a source map",
    (
        "--recipe",
        "wei_levoy_tsvq",
        "--set",
        "levels=1",
        "--set",
        "channels=separate",
        "--figure",
        "tree=f.png",
    ): "has other trees for each channel",
    (*ASHIKHMIN, "--figure", "cost=f.gif"): "f.gif: must end in one of .png",
    (*ASHIKHMIN, "--figure", "animation=rgb.png"): "it is an input as well",
    (*ASHIKHMIN, "--figure", "animation=a.png"): "a.png: must not exist yet",
}


@pytest.mark.parametrize(("options", "message"), REFUSED.items(), ids=[" ".join(one) for one in REFUSED])
def test_what_cannot_be_drawn_is_told_before_the_work(folder, capsys, options, message):
    before = sorted(folder.iterdir())
    assert run("synthesize", "rgb.png", *options, "-o", "out.png") == 2
    said = capsys.readouterr().err
    assert message in said
    assert re.fullmatch(r"error: [^\n]+: [^\n]+, but [^\n]+; [^\n]+\n", said), said
    assert sorted(folder.iterdir()) == before
