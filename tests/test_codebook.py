"""Codebooks: trained once, the same bytes ever after, and refused wherever they do not belong."""

from __future__ import annotations

import inspect
import io
import json
import os
import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest
import safetensors.torch
import torch

import torchsynth as ts
from torchsynth import memory
from torchsynth.cli import main
from torchsynth.codebook import PackedTree, trainings
from torchsynth.progress import training_bar
from torchsynth.search.base import Volume

RECIPE = ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5, parent=3, depth=4)
SMALL = ("--set", "levels=2", "--set", "sweeps[0].layers[0].template.size=5")


def with_search(recipe, **options):
    """The recipe with other options of its first sweep's search."""
    search = recipe.sweeps[0].search.model_copy(update=options)
    first = recipe.sweeps[0].model_copy(update={"search": search})
    return recipe.model_copy(update={"sweeps": (first, *recipe.sweeps[1:])})


def with_layers(recipe, *layers):
    first = recipe.sweeps[0].model_copy(update={"layers": layers})
    return recipe.model_copy(update={"sweeps": (first, *recipe.sweeps[1:])})


@pytest.fixture(scope="module")
def exemplar():
    values = torch.rand(3, 16, 16, generator=torch.Generator().manual_seed(0))
    return (values * 255).round() / 255


@pytest.fixture(scope="module")
def codebook(exemplar):
    return ts.train(exemplar, RECIPE)


@pytest.fixture
def untrainable(monkeypatch):
    """Growing a tree is an error from now on."""

    def grow(*_):
        pytest.fail("a tree is trained")

    monkeypatch.setattr(ts.TSVQ, "grow", grow)


def same(one, other):
    return all(
        getattr(mine, name).equal(getattr(theirs, name))
        for mine, theirs in zip(one.levels, other.levels, strict=True)
        for name in ("image", "source", "cost")
    )


RECIPES = {
    "as it is": RECIPE,
    "beam": with_search(RECIPE, beam=3),
    "central": with_search(RECIPE, leaf="central"),
    "codewords": with_search(RECIPE, codewords=9, min_leaf=2, threshold=0.1),
    "weighted": with_layers(RECIPE, *(one.model_copy(update={"weight": 3}) for one in RECIPE.sweeps[0].layers)),
    "open": RECIPE.model_copy(update={"boundary": "open"}),
    "random order": ts.recipes.random_order(levels=2, neighborhood=5, parent=3, search="tsvq"),
}  # fmt: skip


@pytest.mark.parametrize("name", RECIPES)
def test_the_bytes_are_those_of_training_anew(tmp_path, exemplar, monkeypatch, name):
    anew = ts.synthesize(exemplar, (7, 9), RECIPES[name], seed=[3, 4])
    codebook = ts.Codebook.load(ts.train(exemplar, RECIPES[name]).save(tmp_path / "book.safetensors"))
    monkeypatch.setattr(ts.TSVQ, "grow", None)
    assert same(ts.synthesize(exemplar, (7, 9), RECIPES[name], seed=[3, 4], codebook=codebook), anew)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_batch_and_a_valid_region_have_their_codebook(make_exemplar, dtype):
    batch = torch.stack([make_exemplar(seed=seed, dtype=dtype) for seed in range(3)])
    valid = torch.ones(16, 16, dtype=torch.bool)
    valid[0, 0] = False
    sample = ts.Exemplar(batch, valid)
    codebook = ts.train(sample, RECIPE)
    assert {tree.roots for tree in codebook.trees.values()} == {3}
    with_it = ts.synthesize(sample, (7, 7), RECIPE, codebook=codebook)
    assert same(with_it, ts.synthesize(sample, (7, 7), RECIPE))
    with pytest.raises(ts.InputError, match="it was trained on another image, dtype or valid region"):
        ts.synthesize(batch, (7, 7), RECIPE, codebook=codebook)


@pytest.mark.usefixtures("untrainable")
def test_without_a_codebook_trees_are_trained(exemplar):
    with pytest.raises(pytest.fail.Exception, match="a tree is trained"):
        ts.synthesize(exemplar, (4, 4), RECIPE)


def test_packing_keeps_the_tree(exemplar):
    for training, packed in ts.train(exemplar, RECIPES["codewords"]).trees.items():
        found = {}

        def grow(self, index, grow=ts.TSVQ.grow, found=found):
            found[len(found)] = grow(self, index)
            return found[0]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ts.TSVQ, "grow", grow)
            ts.train(exemplar, RECIPES["codewords"])
        tree, unpacked = found[training.level], packed.unpack()
        assert unpacked.depth == tree.depth
        for name in ("centroids", "children", "members", "starts", "counts"):
            assert getattr(unpacked, name).equal(getattr(tree, name)), name


def test_what_is_saved_is_loaded(tmp_path, codebook):
    path = codebook.save(tmp_path / "book.safetensors")
    loaded = ts.Codebook.load(str(path))
    assert (loaded.exemplar, loaded.versions) == (codebook.exemplar, codebook.versions)
    assert list(loaded.trees) == list(codebook.trees)
    assert loaded.versions["torch"] == torch.__version__
    assert loaded.encode() == path.read_bytes() == codebook.encode()


def test_a_codebook_serves_other_recipes_with_its_trees(exemplar, codebook):
    """The beam, the boundary and a second sweep do not change what was trained."""
    twice = RECIPES["beam"].model_copy(update={"sweeps": RECIPE.sweeps * 2, "boundary": "open"})
    assert trainings(twice) == trainings(RECIPE)
    assert same(
        ts.synthesize(exemplar, (6, 6), twice, codebook=codebook), ts.synthesize(exemplar, (6, 6), twice)
    )


OTHER_RECIPES = {
    "depth": (with_search(RECIPE, depth=5), "its 'depth' is 4, not 5, at level 0"),
    "codewords": (with_search(RECIPE, codewords=7), "its 'codewords' is None, not 7, at level 0"),
    "min_leaf": (with_search(RECIPE, min_leaf=2), "its 'min_leaf' is 1, not 2, at level 0"),
    "threshold": (with_search(RECIPE, threshold=0.5), "its 'threshold' is 1e-10, not 0.5, at level 0"),
    "leaf": (with_search(RECIPE, leaf="central"), "its 'leaf' is nearest, not central, at level 0"),
    "template": (with_layers(RECIPE, *RECIPE.sweeps[0].layers[:1]), "it compares another neighborhood at level 0"),
    "weights": (
        with_layers(RECIPE, RECIPE.sweeps[0].layers[0].model_copy(update={"weight": 2}), RECIPE.sweeps[0].layers[1]),
        "its weights are (1, 1), not (2, 1), at level 0",
    ),
    "levels": (ts.recipes.wei_levoy_tsvq(levels=3, neighborhood=3, parent=3), "it compares another neighborhood at level 0"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHER_RECIPES)
def test_a_codebook_of_another_recipe_is_refused(exemplar, codebook, name):
    recipe, fact = OTHER_RECIPES[name]

    def stop(*_):
        pytest.fail("the work has begun")

    message = (
        f"codebook: must have been trained for the recipe 'wei_levoy_tsvq' as it is, but {fact}; "
        "train one for it, with torchsynth.train or 'torchsynth train'"
    )
    with pytest.raises(ts.InputError, match=f"^{re.escape(message)}$"):
        ts.synthesize(exemplar, (6, 6), recipe, codebook=codebook, progress=stop)


def test_a_level_that_was_not_trained_is_told(exemplar, codebook):
    coarse = replace(codebook, trees=dict(list(codebook.trees.items())[1:]))
    with pytest.raises(ts.InputError, match="but it has no tree at level 0; train one for it"):
        ts.synthesize(exemplar, (6, 6), RECIPE, codebook=coarse)


@pytest.mark.parametrize("change", ["value", "dtype", "shape"])
def test_a_codebook_of_another_exemplar_is_refused(exemplar, codebook, change):
    other = {"value": exemplar.clone(), "dtype": exemplar.double(), "shape": exemplar[:, :, :15]}[change]
    if change == "value":
        other[2, 15, 15] = 1 - other[2, 15, 15]
    message = (
        r"^codebook: must have been trained on this exemplar \(SHA-256 \w{12}\.\.\.\), but it was trained on "
        r"another image, dtype or valid region \(\w{12}\.\.\.\); train one for it"
    )
    with pytest.raises(ts.InputError, match=message):
        ts.synthesize(other, (6, 6), RECIPE, codebook=codebook)


def test_recipes_without_trees_are_refused(exemplar, codebook):
    plain = ts.recipes.wei_levoy(levels=2, neighborhood=5)
    message = (
        "codebook: must be given to a recipe that searches with trees, but the recipe 'wei_levoy' has no"
    )
    with pytest.raises(ts.InputError, match=f"^{message} tsvq search; drop it, or use e.g. wei_levoy_tsvq$"):
        ts.synthesize(exemplar, (6, 6), plain, codebook=codebook)
    message = "recipe: must search with trees to be trained, but 'wei_levoy' has no tsvq search; use e.g."
    with pytest.raises(ts.InputError, match=f"^{message}"):
        ts.train(exemplar, plain)


@pytest.mark.usefixtures("untrainable")
def test_training_is_checked_before_it_starts(exemplar, monkeypatch):
    with pytest.raises(ts.InputError, match="exemplar: values must lie in"):
        ts.train(exemplar * 3, RECIPE)
    with pytest.raises(ts.InputError, match="recipe: must be a Recipe, but it is 'wei_levoy_tsvq'"):
        inspect.unwrap(ts.train)(exemplar, "wei_levoy_tsvq")
    with pytest.raises(
        ts.InputError, match="neighborhood must fit inside level 1, but that level is only 3x3"
    ):
        ts.train(exemplar[:, :6, :6], RECIPE)
    with pytest.raises(ts.InputError, match=r"codebook: must be a Codebook, but it is 'book.safetensors'"):
        inspect.unwrap(ts.synthesize)(exemplar, (4, 4), RECIPE, codebook="book.safetensors")
    monkeypatch.setattr(memory, "_machine_memory", lambda: 2**20)
    with pytest.raises(ts.InputError, match=r"exemplar: training on it must fit the 0.0 GiB of memory"):
        ts.train(exemplar, RECIPE)


def test_the_progress_of_training(exemplar):
    calls = []
    ts.train(exemplar, RECIPE, progress=lambda *call: calls.append(call))
    assert calls == [(0, 0, 320), (1, 256, 320), (1, 320, 320)]

    def stop(*_):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        ts.train(exemplar, RECIPE, progress=stop)


def test_names_and_files_that_are_there_are_refused(tmp_path, codebook):
    with pytest.raises(
        ts.InputError, match=r"book\.pt: a codebook must end in \.safetensors, but it ends in"
    ):
        codebook.save(tmp_path / "book.pt")
    path = tmp_path / "book.safetensors"
    path.write_bytes(b"mine")
    with pytest.raises(ts.OutputError, match=r"book\.safetensors: must not exist yet, but it does; choose"):
        codebook.save(path)
    assert path.read_bytes() == b"mine"
    assert codebook.save(path, overwrite=True) == path
    assert ts.Codebook.load(path).exemplar == codebook.exemplar
    assert list(tmp_path.iterdir()) == [path]


def damaged(message, data):
    expected = (
        f"book: must be a whole codebook, as torchsynth.train makes them, but {message}; check the path"
    )
    with pytest.raises(ts.InputError, match=f"^{re.escape(expected)}"):
        ts.Codebook.decode(data, "book")


def test_missing_files_are_told(tmp_path):
    for place, told in (("nothing", "no such file or directory"), ("", "is a directory")):
        with pytest.raises(
            ts.InputError, match=f"must be a readable codebook file, but the system says: {told}"
        ):
            ts.Codebook.load(tmp_path / place)


def test_a_file_cut_anywhere_is_told(codebook):
    data = codebook.encode()
    for length in range(0, len(data), 97):
        damaged("it is not a safetensors file, or cut short", data[:length])


def test_a_file_with_any_byte_changed_is_told(codebook):
    data = codebook.encode()
    for place in range(0, len(data), 31):
        changed = bytearray(data)
        changed[place] ^= 1 << (place % 7)
        try:
            loaded = ts.Codebook.decode(bytes(changed), "book")
        except ts.InputError as error:
            assert str(error).startswith("book: must be a whole codebook")  # noqa: PT017 (either is right)
        else:  # what is written about the trees is compared with the exemplar and recipe
            assert [packed.children.tolist() for packed in loaded.trees.values()] == [
                packed.children.tolist() for packed in codebook.trees.values()
            ]


@pytest.mark.parametrize("data", [b"", b"hello", b"\x89PNG\r\n\x1a\n" * 9, b"\x02\0\0\0\0\0\0\0[]"])
def test_foreign_files_are_told(data):
    damaged("it is not a safetensors file, or cut short", data)


def test_other_safetensors_files_are_told():
    damaged("it holds no codebook", safetensors.torch.save({"weight": torch.ones(3)}))
    damaged("it holds no codebook", safetensors.torch.save({}, {"format": "pt"}))
    damaged("it holds no codebook", b"\x02\0\0\0\0\0\0\0{}")
    damaged("its header '' is missing or unknown", safetensors.torch.save({}, {"torchsynth_codebook": "?"}))


def rewritten(codebook, tensors=None, **header):
    """The file with other tensors or header values; None removes one. The checksum is left as it is."""
    data = codebook.encode()
    old = safetensors.torch.load(data) | (tensors or {})
    text = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])["__metadata__"]["torchsynth_codebook"]
    new = {name: one for name, one in (json.loads(text) | header).items() if one is not None}
    kept = {name: one for name, one in old.items() if one is not None}
    return safetensors.torch.save(kept, {"torchsynth_codebook": json.dumps(new)})


def test_header_values_are_told(codebook):
    assert ts.Codebook.decode(rewritten(codebook), "book").exemplar == codebook.exemplar
    for name in ("format", "exemplar", "trained", "checksum", "versions"):
        damaged(f"its header '{name}' is missing or unknown", rewritten(codebook, **{name: None}))
    damaged("its header 'format' is missing or unknown", rewritten(codebook, format=2))
    damaged("its header 'trained' is missing or unknown", rewritten(codebook, trained=[{"level": "x"}]))


@pytest.mark.parametrize("name", ["centroids", "children", "members", "counts"])
def test_missing_tensors_and_other_kinds_are_told(codebook, name):
    damaged(f"the tensor '1.{name}' is missing", rewritten(codebook, {f"1.{name}": None}))
    kind = "the tensors of tree 0 are of other kinds"
    damaged(kind, rewritten(codebook, {f"0.{name}": torch.zeros(3, dtype=torch.float64)}))
    damaged(kind, rewritten(codebook, {f"0.{name}": torch.zeros(1, 1, 1, dtype=torch.int32)}))
    if name != "members":
        dtype, shape = (torch.int8, (2, 2)) if name == "centroids" else (torch.int32, (2,))
        changed = rewritten(codebook, {f"0.{name}": torch.zeros(shape, dtype=dtype)})
        damaged("the tensors of tree 0 do not belong together", changed)


def edited(codebook, name, place, value):
    """A codebook that is written as if it had been trained like that: its checksum is right."""
    training, packed = next(iter(codebook.trees.items()))
    values = getattr(packed, name).clone()
    values[place] = value
    return replace(codebook, trees={**codebook.trees, training: replace(packed, **{name: values})})


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [("children", 0, 10**6), ("children", 0, 0), ("children", 1, 1), ("children", -1, -5), ("children", -1, 3),
     ("counts", -1, 10**6), ("counts", -1, 0), ("counts", 0, 1), ("members", 0, -1)],
)  # fmt: skip
def test_indices_out_of_range_are_told(codebook, name, place, value):
    part = "children" if name == "children" else "members"
    damaged(f"the {part} in tree 0 are out of range", edited(codebook, name, place, value).encode())


def test_an_edited_tree_is_told_by_its_checksum(codebook):
    centroids = next(iter(codebook.trees.values())).centroids.clone()
    centroids[0, 0] += 1
    damaged("its content has changed since it was written", rewritten(codebook, {"0.centroids": centroids}))


def test_a_tree_of_other_candidates_is_refused(exemplar, codebook):
    message = r"its tree does not fit the 144 candidates of 63 values at level 0; train one for it"
    training, packed = next(iter(codebook.trees.items()))
    coarse = next(reversed(codebook.trees.values()))
    coarse = PackedTree(*(getattr(coarse, one.name).clone() for one in fields(coarse)))
    narrow = replace(packed, centroids=packed.centroids[:, :5])
    for wrong in (
        edited(codebook, "members", 0, 10**6),
        replace(codebook, trees={**codebook.trees, training: narrow}),
        replace(codebook, trees={**codebook.trees, training: coarse}),
    ):
        loaded = ts.Codebook.decode(wrong.encode(), "book")
        with pytest.raises(ts.InputError, match=message):
            ts.synthesize(exemplar, (6, 6), RECIPE, codebook=loaded)


def test_a_packed_tree_is_small(codebook):
    packed = next(iter(codebook.trees.values()))
    assert isinstance(packed, PackedTree)
    assert {getattr(packed, name).dtype for name in ("children", "members", "counts")} == {torch.int32}
    assert packed.centroids.dtype == torch.int8


@pytest.fixture
def folder(tmp_path, monkeypatch, exemplar):
    monkeypatch.chdir(tmp_path)
    ts.write_image(exemplar, "a.png")
    return tmp_path


@pytest.fixture
def runs(folder, capsys):  # noqa: ARG001 (the commands run there)
    """Run a command and see its exit code; returns what it printed."""

    def run(*arguments, code=0):
        assert main([str(one) for one in arguments]) == code
        out, err = capsys.readouterr()
        return out if code == 0 else err

    return run


def names():
    return sorted(path.name for path in Path().iterdir())


def test_train_synthesize_and_rerun(runs, monkeypatch):
    assert runs("train", "a.png", "-o", "book.safetensors", *SMALL) == "book.safetensors\n"
    assert names() == ["a.png", "book.safetensors"]
    runs("synthesize", "a.png", "-o", "anew.png", "--recipe", "wei_levoy_tsvq", *SMALL, "--size", "9x8")
    monkeypatch.setattr(ts.TSVQ, "grow", None)
    use = ("--codebook", "book.safetensors", *SMALL, "--size", "9x8")
    runs("synthesize", "a.png", "-o", "out.png", *use)
    assert Path("out.png").read_bytes() == Path("anew.png").read_bytes()
    record = json.loads(Path("out.json").read_text())
    assert record["recipe"]["name"] == "wei_levoy_tsvq"
    stored = ts.Codebook.load("book.safetensors")
    assert record["inputs"]["codebook"] == {"path": "book.safetensors", "sha256": stored.sha256}
    runs("rerun", "out.json", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    assert Path("again.json").read_bytes() == Path("out.json").read_bytes()


def test_a_changed_codebook_is_told_by_rerun(runs):
    runs("train", "a.png", "-o", "book.safetensors", *SMALL)
    runs("synthesize", "a.png", "-o", "out.png", "--codebook", "book.safetensors", *SMALL, "--size", "5x5")
    runs("train", "a.png", "-o", "other.safetensors", *SMALL, "--set", "sweeps[0].search.depth=2")
    os.replace("other.safetensors", "book.safetensors")
    told = runs("rerun", "out.json", "-o", "again.png", code=2)
    assert told.startswith("error: book.safetensors: must be the file the record was made with (SHA-256 ")


def test_the_command_line_takes_a_recipe_file_and_a_region(runs):
    Path("my.yaml").write_text(ts.dump_recipe(RECIPE))
    ts.write_image(torch.ones(1, 16, 16), "valid.png")
    runs("train", "a.png", "-o", "book.safetensors", "--config", "my.yaml", "--valid", "valid.png")
    use = ("--config", "my.yaml", "--codebook", "book.safetensors", "--size", "5x5")
    runs("synthesize", "a.png", "-o", "out.png", "--valid", "valid.png", *use)
    told = runs("synthesize", "a.png", "-o", "other.png", *use, code=2)
    assert "but it was trained on another image, dtype or valid region" in told


def test_what_the_command_line_refuses(runs):
    Path("old.safetensors").touch()
    before = names()
    refused = {
        ("train", "a.png", "-o", "old.safetensors"): "old.safetensors: must not exist yet, but it does;",
        ("train", "a.png", "-o", "book.png"): "book.png: a codebook must end in .safetensors, but it ends in '.png';",
        ("train", "a.png", "-o", "a.png"): "a.png: must be a file of its own, but it is an input as well;",
        ("train", "a.png", "-o", "b.safetensors", "--recipe", "wei_levoy"): "recipe: must search with trees",
        ("train", "no.png", "-o", "b.safetensors"): "no.png: must be a readable image file",
        ("train", "a.png", "-o", "b.safetensors", "--recipe", "x", "--config", "y"): "only one of them can be given",
        ("synthesize", "a.png", "-o", "b.png", "--codebook", "a.png"): "a.png: must be a whole codebook, as",
        ("synthesize", "a.png", "-o", "b.png", "--codebook", "no"): "no: must be a readable codebook file",
    }  # fmt: skip
    for arguments, message in refused.items():
        told = runs(*arguments, code=2)
        assert told.startswith("error: ")
        assert message in told
        assert told.count("\n") == 1
    assert names() == before


def test_an_interruption_leaves_no_codebook(runs, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    before = names()
    monkeypatch.setattr(ts.TSVQ, "grow", interrupted)
    told = runs("train", "a.png", "-o", "book.safetensors", *SMALL, code=2)
    assert told == "error: cancelled: no unfinished file was left behind\n"
    assert names() == before


def test_a_terminal_sees_the_training(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    terminal = io.StringIO()
    monkeypatch.setattr(sys, "stderr", terminal)
    with training_bar() as progress:
        assert progress is None
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    with training_bar() as progress:
        progress(1, 256, 320)
    assert "training level 1" in terminal.getvalue()
    assert "256/320" in terminal.getvalue()


def test_deep_trees_are_known_to_take_more_memory():
    shallow, deep = ts.TSVQ(depth=8), ts.TSVQ(depth=20)
    layer = ts.Layer(plane="result", template=ts.Causal(size=5))
    volume = Volume(exemplars=1, pixels=100, channels=1, item=4, layers=(layer,), complete=True)
    assert deep.memory(volume) > shallow.memory(volume)
    assert ts.TSVQ(depth=20, codewords=256).memory(volume) == shallow.memory(volume)
