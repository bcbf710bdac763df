"""Bad input on the command line: one line on stderr, exit code 2, and nothing left behind."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image as Pillow

import torchsynth as ts
from torchsynth import jobs
from torchsynth.cli import main
from torchsynth.io import read_image

FAST = ("--recipe", "wei_levoy_single", "--set", "sweeps[0].layers[0].template.size=3", "--size", "8x8")


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def fails(tmp_path, monkeypatch, capsys):
    """Run a command that must fail with exactly one line, and leave the folder as it was."""
    monkeypatch.chdir(tmp_path)

    def run(arguments, message):
        before = contents(tmp_path), sorted(tmp_path.rglob("*"))
        code = main([str(one) for one in arguments])
        out, err = capsys.readouterr()
        assert code == 2, err
        assert out == ""
        assert message in err
        assert re.fullmatch(r"error: [^\n]+: [^\n]+, but [^\n]+; [^\n]+\n", err), err
        assert (contents(tmp_path), sorted(tmp_path.rglob("*"))) == before

    return run


@pytest.fixture
def pictures(tmp_path):
    """A good picture in several forms, and many bad ones."""
    generator = np.random.default_rng(0)
    colors = generator.integers(0, 256, (12, 12, 4), dtype=np.uint8)
    deep = generator.random((12, 12, 4)).astype(np.float32)
    Pillow.fromarray(colors[..., :3]).save(tmp_path / "rgb.png")
    Pillow.fromarray(colors).save(tmp_path / "rgba.png")
    Pillow.fromarray(colors[:2, :2, 0]).save(tmp_path / "tiny.png")
    Pillow.fromarray(colors[..., 0]).save(
        tmp_path / "animated.png", save_all=True, append_images=[Pillow.fromarray(colors[..., 1])]
    )
    Pillow.fromarray(colors[..., 0]).save(tmp_path / "drawing.gif")
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("hello")
    tifffile.imwrite(tmp_path / "deep.tif", deep[..., :3], photometric="rgb", compression="zlib")
    tifffile.imwrite(tmp_path / "large.tif", deep[..., :3] * 3, photometric="rgb")
    tifffile.imwrite(tmp_path / "cmyk16.tif", (deep * 65535).astype(np.uint16), photometric="separated")
    tifffile.imwrite(tmp_path / "pages.tif", colors[..., :2].transpose(2, 0, 1), photometric="minisblack")
    tifffile.imwrite(tmp_path / "double.tif", deep[..., 0].astype(np.float64))
    for name, value in (("nan.tif", np.nan), ("infinite.tif", -np.inf)):
        bad = deep[..., :3].copy()
        bad[3, 4, 1] = value
        tifffile.imwrite(tmp_path / name, bad, photometric="rgb")
    ts.write_image(read_image(tmp_path / "rgb.png"), tmp_path / "rgb16.png", depth="16-bit")
    for name in ("rgb.png", "rgb16.png", "deep.tif"):
        data = (tmp_path / name).read_bytes()
        (tmp_path / f"cut-{name}").write_bytes(data[: len(data) // 2])
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    return tmp_path


EXEMPLARS = {
    "nothing.png": "nothing.png: must be a readable image file, but the system says: no such file or directory;",
    "folder": "folder: must be a readable image file, but the system says: is a directory;",
    "file/inside.png": "file/inside.png: must be a readable image file, but the system says: not a directory;",
    "two\nlines.png": "two lines.png: must be a readable image file",
    "empty.png": "empty.png: must be an image, but the file is empty; check the path",
    "text.png": "text.png: must be a PNG, JPEG, TIFF, BMP or WebP image, but it is none of these",
    "drawing.gif": "drawing.gif: must be a PNG, JPEG, TIFF, BMP or WebP image, but it is none of these",
    "animated.png": "animated.png: must be one whole image that can be read without loss, but it holds 2 pictures;",
    "cut-rgb.png": "cut-rgb.png: must be one whole image that can be read without loss, but image file is truncated",
    "cut-rgb16.png": "cut-rgb16.png: must be one whole image that can be read without loss, but",
    "cut-deep.tif": "cut-deep.tif: must be one whole image that can be read without loss, but",
    "cmyk16.tif": "but 16-bit TIFF of the kind SEPARATED is not supported",
    "pages.tif": "pages.tif: must be one whole image that can be read without loss, but it holds 2 pictures;",
    "double.tif": "but values of type float64 are not supported",
    "nan.tif": "exemplar: must be finite, but 1 of its values are NaN or infinite",
    "infinite.tif": "exemplar: must be finite, but 1 of its values are NaN or infinite",
    "large.tif": "exemplar: values must lie in [0, 1], but they reach from",
    "tiny.png": "exemplar: the 3x3 result neighborhood must fit inside level 0, but that level is only 2x2",
    "sample:bric": "must be one of the samples brick, grass, gravel, pebbles, but there is no such sample; "
    "did you mean sample:brick?",
    "sample:zzz": "but there is no such sample; list them with 'torchsynth samples'",
}


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("exemplar", EXEMPLARS)
def test_bad_exemplars(fails, exemplar):
    fails(["synthesize", exemplar, "-o", "out.png", *FAST], EXEMPLARS[exemplar])


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("name", ["rgb.png", "rgb16.png", "deep.tif"])
def test_a_file_cut_anywhere_is_told_or_whole(tmp_path, name):
    data = (tmp_path / name).read_bytes()
    whole = read_image(tmp_path / name)
    for length in range(1, len(data), max(1, len(data) // 40)):
        (tmp_path / "cut").write_bytes(data[:length])
        try:
            image = read_image(tmp_path / "cut")
        except ts.InputError as error:
            assert str(error).startswith(f"{tmp_path / 'cut'}: must be ")  # noqa: PT017 (either is right)
        else:
            assert (image == whole).all()


OUTPUTS = {
    "out.gif": "out.gif: must end in one of .png .tif .tiff .bmp .webp .jpg .jpeg, but it ends in '.gif'; rename",
    "out": "out: must end in one of .png .tif .tiff .bmp .webp .jpg .jpeg, but it has no extension; rename",
    "out.jpg": "out.jpg: a .jpg file holds 1 or 3 channels, but the picture has 4 (alpha is one of them); write .png",
    "out.bmp": "out.bmp: a .bmp file holds 1 or 3 channels, but the picture has 4",
    "rgb.png": "rgb.png: must not exist yet, but it does; choose another name, or allow it with --overwrite (overwrite=True)",
    "no/out.png": "no/out.png: its folder must exist and be writable, but no: the system says: no such file",
    "file/out.png": "file/out.png: its folder must exist and be writable, but file: the system says: not a directory",
    "folder.png": "folder.png: must be a file name, but it is a folder; add a file name",
    "x" * 300 + ".png": "its folder must exist and be writable, but .: the system says: file name too long",
    "rgba.png": "rgba.png: must be a file of its own, but it is an input as well; choose another name",
}


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("output", OUTPUTS, ids=lambda output: output[-12:])
def test_bad_outputs(fails, output):
    Path("folder.png").mkdir()
    fails(["synthesize", "rgba.png", "-o", output, *FAST], OUTPUTS[output])


@pytest.mark.usefixtures("pictures")
def test_a_record_that_exists_is_not_replaced(fails):
    Path("out.json").write_text("mine")
    fails(["synthesize", "rgb.png", "-o", "out.png", *FAST], "out.json: must not exist yet, but it does")


@pytest.mark.usefixtures("pictures")
def test_the_input_is_not_replaced_even_with_overwrite(fails):
    fails(
        ["synthesize", "rgb.png", "-o", "folder/../rgb.png", "--overwrite", *FAST],
        "rgb.png: must be a file of its own, but it is an input as well",
    )


@pytest.mark.usefixtures("pictures")
def test_a_webp_that_is_too_long(fails):
    fails(
        ["synthesize", "rgb.png", "-o", "out.webp", *FAST, "--size", "1x16384"],
        "out.webp: the sides of a .webp file have at most 16383 pixels, but the picture is 1x16384; write .png",
    )


OPTIONS = {
    ("--source-map", "map.png"): "map.png: a source map must end in .npz, but it ends in '.png'; rename it",
    ("--source-map", "map"): "map: a source map must end in .npz, but it has no extension; rename it",
    ("--source-map", "no/map.npz"): "no/map.npz: its folder must exist and be writable",
    ("--levels-dir", "file"): "file: must be a folder, but it is a file; choose another name",
    ("--levels-dir", "no/levels"): "no/levels: its folder must exist and be writable",
    (
        "--size",
        "0x8",
    ): "size: height and width must be at least 1 pixel, but they are 0x8; ask for at least 1x1",
    ("--size", "8x-3"): "size: height and width must be at least 1 pixel, but they are 8x-3",
    ("--size", "8"): "size: must be HxW, height and width in pixels, but it is '8'; write e.g. 256x256",
    ("--size", "8x8x3"): "size: must be HxW, height and width in pixels, but it is '8x8x3'",
    ("--size", "axb"): "size: must be HxW, height and width in pixels, but it is 'axb'",
    ("--size", "1e3x8"): "size: must be HxW, height and width in pixels, but it is '1e3x8'",
    ("--size", ""): "size: must be HxW, height and width in pixels, but it is ''",
    ("--size", "1000000x1000000"): "1 output(s) of 1000000x1000000 would take about ",
    ("--size", "9" * 99 + "x8"): "would take about more than a quintillion GiB",
    ("--size", "9" * 5000 + "x8"): "size: must be HxW, height and width in pixels, but it is '9999",
    (
        "--seed",
        "-1",
    ): "seed: must be a whole number from 0 to 2**32 - 1, or a list of such numbers, but it is -1",
    ("--seed", str(2**32)): "but it is 4294967296",
    ("--seed", str(2**32 - 1), "--count", "2"): "but one is 4294967296",
    ("--count", "0"): "--count: must be from 1 to 10000, but it is 0; choose a number between them",
    ("--count", "-3"): "--count: must be from 1 to 10000, but it is -3",
    ("--count", "1000000000"): "--count: must be from 1 to 10000, but it is 1000000000",
    ("--recipe", "wei_levi"): "but there is no such recipe; did you mean 'wei_levoy'?",
    ("--config", "my.yaml"): "--recipe and --config: only one of them can be given, but both are; drop one",
    (
        "--set",
        "levels",
    ): "--set levels: must look like path=value, but it does not; write e.g. --set levels=3",
    ("--set", "sweeps[0].layers[0].template.size=4"): "a side must be odd, but 4 is even",
    ("--set", "levels=true"): "'levels': input should be a valid integer, but it is true",
    (
        "--set",
        "levels=4",
    ): "exemplar: the 3x3 result neighborhood must fit inside level 3, but that level is only 1x1; "
    "use levels <= 3, a smaller neighborhood",
    ("--valid", "tiny.png"): "valid: must have the image's shape (12, 12), but its shape is (2, 2)",
    ("--valid", "nothing.png"): "nothing.png: must be a readable image file",
    ("--initial", "rgba.png"): "initial: must have the output's channels, height and width (3, 8, 8), but",
}


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: " ".join(options)[:40])
def test_bad_options(fails, options):
    fails(["synthesize", "rgb.png", "-o", "out.png", *FAST, *options], OPTIONS[options])


@pytest.mark.usefixtures("pictures")
def test_two_outputs_in_one_file(fails):
    Path("levels").mkdir()
    fails(
        ["synthesize", "rgb.png", "-o", "levels/level-0-image.png", "--levels-dir", "levels", *FAST],
        "levels/level-0-image.png: must be a file of its own, but it is another output as well",
    )


@pytest.mark.usefixtures("pictures")
def test_a_misspelt_recipe_file(fails):
    text = ts.dump_recipe(ts.recipes.wei_levoy())
    Path("my.yaml").write_text(text.replace("search: {kind", "search: {depht: 3, kind"))
    fails(
        ["synthesize", "rgb.png", "-o", "out.png", "--config", "my.yaml"],
        "my.yaml: 'sweeps[0].search.depht' must be a known field, but there is no such field; choose from: kind",
    )


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", '{"inputs": [1]}', '{"recipe": 1, "size": [1, 2], "seed": 0, "inputs": {}}', "\x00",
     '{"recipe": {}, "size": [1, 2], "seed": 0, "inputs": {"valid": {"path": "a", "sha256": "b"}}}'],
)  # fmt: skip
def test_what_is_not_a_record(fails, text):
    Path("out.json").write_text(text)
    fails(
        ["rerun", "out.json", "-o", "again.png"],
        "out.json: must be a record that 'torchsynth synthesize' wrote, but it is not; pass the .json beside",
    )


def test_a_record_that_is_missing(fails):
    fails(
        ["rerun", "no.json", "-o", "again.png"],
        "no.json: must be a readable file, but the system says: no such",
    )


@pytest.mark.usefixtures("pictures")
def test_a_changed_exemplar_is_told(fails, capsys):
    assert main(["synthesize", "rgb.png", "-o", "out.png", *FAST]) == 0
    capsys.readouterr()
    os.replace("rgba.png", "rgb.png")
    fails(
        ["rerun", "out.json", "-o", "again.png"],
        "rgb.png: must be the file the record was made with (SHA-256",
    )


@pytest.mark.parametrize(
    "arguments", [["synthesize", "a.png", "-o", "b.png", "--bogus"], ["bogus"], ["synthesize"]]
)
def test_usage_errors_exit_with_two(capsys, arguments):
    assert main(arguments) == 2
    assert "Usage: torchsynth" in capsys.readouterr().err


FULL = ["synthesize", "deep.tif", "-o", "out.tif", "--levels-dir", "levels", "--source-map", "map.npz", *FAST]


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("fits", range(6))
def test_a_full_disk_leaves_nothing(fails, monkeypatch, fits):
    """Each of the six files is cut short in turn."""
    written = []
    write_bytes = Path.write_bytes

    def write_until_full(self, data):
        written.append(self)
        if len(written) <= fits:
            return write_bytes(self, data)
        write_bytes(self, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", write_until_full)
    fails(FULL, "must be written completely, but the system says: no space left on device; free some space")
    assert len(written) == fits + 1


@pytest.fixture
def cancelled(tmp_path, monkeypatch, capsys):
    """Run a command that is interrupted, and see that it leaves the folder as it was."""
    monkeypatch.chdir(tmp_path)

    def run(arguments):
        before = sorted(tmp_path.rglob("*"))
        assert main(arguments) == 2
        assert capsys.readouterr().err == "error: cancelled: no unfinished file was left behind\n"
        assert sorted(tmp_path.rglob("*")) == before

    return run


@pytest.mark.usefixtures("pictures")
def test_an_interruption_of_the_work_leaves_nothing(cancelled, monkeypatch):
    synthesize = jobs.synthesize

    def interrupted(*arguments, **options):
        def progress(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
            if done:
                raise KeyboardInterrupt

        return synthesize(*arguments, **options | {"progress": progress})

    monkeypatch.setattr(jobs, "synthesize", interrupted)
    cancelled(FULL)


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize("fits", range(6))
def test_an_interruption_of_the_writing_leaves_nothing(cancelled, monkeypatch, fits):
    written = []
    write_bytes = Path.write_bytes

    def write_until_interrupted(self, data):
        written.append(self)
        write_bytes(self, data[: len(data) // 2])
        if len(written) > fits:
            raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", write_until_interrupted)
    cancelled(FULL)
