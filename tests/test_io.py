"""Every format, depth and channel count, from a tensor to a file and back."""

from __future__ import annotations

import io
import pickle
import struct
import zlib

import numpy as np
import pytest
import tifffile
import torch
from PIL import Image as Pillow

import torchsynth as ts
from torchsynth.io import check_writable, read_picture, staging, write_image

LOSSLESS = [
    *((".png", depth, channels) for depth in ("8-bit", "16-bit") for channels in (1, 2, 3, 4)),
    *((".tif", depth, channels) for depth in ("8-bit", "16-bit", "float") for channels in (1, 2, 3, 4, 5)),
    *((".bmp", "8-bit", channels) for channels in (1, 3)),
    *((".webp", "8-bit", channels) for channels in (3, 4)),
    *((suffix, "1-bit", 1) for suffix in (".png", ".tif", ".bmp")),
    (".tiff", "16-bit", 3),
    (".jpg", "8-bit", 1),
    (".jpeg", "8-bit", 3),
]
LARGEST = {"1-bit": 1, "8-bit": 255, "16-bit": 65535}


def values(depth, channels, height=7, width=10, seed=0):
    """A picture that uses the whole range of a depth."""
    generator = torch.Generator().manual_seed(seed)
    noise = torch.rand(channels, height, width, generator=generator)
    noise[:, 0, 0], noise[:, -1, -1] = 0, 1
    return noise if depth == "float" else (noise * LARGEST[depth]).round() / LARGEST[depth]


@pytest.mark.parametrize(("suffix", "depth", "channels"), [one for one in LOSSLESS if "jp" not in one[0]])
def test_round_trip_is_exact(tmp_path, suffix, depth, channels):
    image = values(depth, channels)
    path = write_image(image, tmp_path / f"picture{suffix}", depth=depth)
    picture = read_picture(path)
    assert torch.equal(picture.image, image)
    assert picture.depth == depth
    again = write_image(picture.image, tmp_path / f"again{suffix}", depth=picture.depth)
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.parametrize(("suffix", "depth", "channels"), [one for one in LOSSLESS if "jp" in one[0]])
def test_jpeg_keeps_smooth_pictures_closely(tmp_path, suffix, depth, channels):
    ramp = torch.linspace(0, 1, 32).expand(channels, 24, 32)
    picture = read_picture(write_image(ramp, tmp_path / f"picture{suffix}", depth=depth))
    assert picture.image.shape == ramp.shape
    assert (picture.image - ramp).abs().max() < 4 / 255


def test_gray_webp_keeps_its_values_in_three_channels(tmp_path):
    image = values("8-bit", 1)
    assert torch.equal(
        ts.read_image(write_image(image, tmp_path / "a.webp")), image.expand(3, -1, -1).contiguous()
    )


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1)])
@pytest.mark.parametrize(("suffix", "depth"), [(".png", "16-bit"), (".tif", "float"), (".tif", "16-bit")])
@pytest.mark.parametrize("channels", [1, 2, 3])
def test_one_pixel_sides_are_kept(tmp_path, size, suffix, depth, channels):
    image = values("8-bit", channels, *size) if size != (1, 1) else torch.full((channels, 1, 1), 1.0)
    assert torch.equal(
        ts.read_image(write_image(image, tmp_path / f"a{suffix}", depth=depth)) * 255, image * 255
    )


@pytest.mark.parametrize(
    ("suffix", "depth", "channels", "stored"),
    [
        (".png", "float", 3, "16-bit"),
        (".jpg", "16-bit", 3, "8-bit"),
        (".bmp", "float", 1, "8-bit"),
        (".png", "1-bit", 3, "8-bit"),
    ],
)
def test_a_format_without_the_depth_takes_its_best(tmp_path, suffix, depth, channels, stored):
    image = values("1-bit", channels)
    assert read_picture(write_image(image, tmp_path / f"a{suffix}", depth=depth)).depth == stored


def test_write_image_takes_batches_of_one_views_and_gradients(tmp_path):
    image = values("8-bit", 3, 6, 6).double().transpose(1, 2)[None].requires_grad_()
    path = write_image(image, tmp_path / "a.png")
    assert torch.equal(ts.read_image(path), image[0].detach().float())
    write_image(image * 0, path, overwrite=True)
    assert ts.read_image(path).max() == 0


def save(path, picture, **options):
    picture.save(path, **options)
    return path


def palette_picture():
    picture = Pillow.new("P", (4, 3))
    picture.putpalette([10, 20, 30, 200, 100, 50, 0, 0, 255])
    picture.putdata([0, 1, 2, 1, 2, 0, 0, 1, 2, 2, 1, 0])
    return picture


@pytest.mark.parametrize(
    ("options", "alphas"), [({}, None), ({"transparency": 1}, [255, 0, 255]),
                            ({"transparency": bytes([9, 80, 200])}, [9, 80, 200])]
)  # fmt: skip
def test_palettes_are_looked_up(tmp_path, options, alphas):
    image = ts.read_image(save(tmp_path / "a.png", palette_picture(), **options)) * 255
    assert image[:3, 0, :3].T.round().tolist() == [[10, 20, 30], [200, 100, 50], [0, 0, 255]]
    assert len(image) == (3 if alphas is None else 4)
    if alphas is not None:
        assert image[3, 0, :3].round().tolist() == alphas


@pytest.mark.parametrize(("mode", "key", "channels"), [("L", 7, 2), ("RGB", (7, 7, 7), 4), ("1", 0, 2)])
def test_a_transparent_color_becomes_alpha(tmp_path, mode, key, channels):
    picture = Pillow.new(mode, (4, 3), key)
    picture.putpixel((1, 2), (200, 100, 50) if mode == "RGB" else 255)
    image = ts.read_image(save(tmp_path / "a.png", picture, transparency=key))
    assert len(image) == channels
    assert image[-1, 2].tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize("bits", [2, 4])
def test_shallow_gray_is_scaled_to_the_whole_range(tmp_path, bits):
    largest = 2**bits - 1
    rows = bytes([0, 0b00011011 if bits == 2 else 0x0F])
    header = struct.pack(">IIBBBBB", 8 // bits, 1, bits, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    data = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )
    (tmp_path / "a.png").write_bytes(data)
    expected = [0, 1, 2, 3] if bits == 2 else [0, 15]
    assert (ts.read_image(tmp_path / "a.png")[0, 0] * largest).round().tolist() == expected


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_cmyk_becomes_rgb(tmp_path, suffix):
    picture = Pillow.new("CMYK", (8, 8), (0, 255, 255, 0))
    image = ts.read_image(save(tmp_path / f"a{suffix}", picture))
    assert torch.allclose(image.mean((1, 2)), torch.tensor([1.0, 0, 0]), atol=0.05)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("form", ["8-bit.png", "16-bit.png", "8-bit.tif", "16-bit.tif"])
def test_pictures_are_turned_upright(tmp_path, form, orientation):
    depth, suffix = form.split(".")
    image = values(depth, 3)
    path = write_image(image, tmp_path / f"a.{suffix}", depth=depth)
    tag = Pillow.Exif()
    tag[274] = orientation
    with Pillow.open(path) as opened:
        opened.load()
        upright = Pillow.Image.copy(opened)
    if form == "16-bit.tif":
        rows = (image * 65535).round().permute(1, 2, 0).numpy().astype(np.uint16)
        tifffile.imwrite(path, rows, photometric="rgb", extratags=[(274, "H", 1, orientation, True)])
    elif form == "16-bit.png":
        path.write_bytes(with_exif(path.read_bytes(), tag.tobytes().removeprefix(b"Exif\0\0")))
    else:
        upright.save(path, exif=tag)
    flips = {1: (), 2: (2,), 3: (1, 2), 4: (1,), 5: (), 6: (2,), 7: (1, 2), 8: (1,)}[orientation]
    turned = image.transpose(1, 2) if orientation > 4 else image
    assert torch.equal(ts.read_image(path), turned.flip(flips) if flips else turned)


def with_exif(png, body):
    chunk = struct.pack(">I", len(body)) + b"eXIf" + body + struct.pack(">I", zlib.crc32(b"eXIf" + body))
    return png[:33] + chunk + png[33:]


def test_planar_and_big_endian_tiff_are_read(tmp_path):
    pixels = np.arange(3 * 5 * 6, dtype=np.uint16).reshape(3, 5, 6) * 700
    tifffile.imwrite(tmp_path / "planar.tif", pixels, photometric="rgb", planarconfig="separate")
    tifffile.imwrite(
        tmp_path / "big.tif", np.moveaxis(pixels, 0, 2), photometric="rgb", byteorder=">", bigtiff=True
    )
    expected = torch.from_numpy(pixels.astype(np.float32)) / 65535
    assert torch.equal(ts.read_image(tmp_path / "planar.tif"), expected)
    assert torch.equal(ts.read_image(tmp_path / "big.tif"), expected)


def test_the_preview_behind_a_camera_picture_does_not_matter(tmp_path):
    colors = [Pillow.new("RGB", (16, 16), color) for color in ("red", "blue")]
    colors[0].save(tmp_path / "a.jpg", format="MPO", save_all=True, append_images=colors[1:])
    assert ts.read_image(tmp_path / "a.jpg").mean((1, 2)).round().tolist() == [1, 0, 0]


def test_a_transparent_pixel_keeps_its_color_in_webp(tmp_path):
    image = values("8-bit", 4)
    image[3] = 0
    assert torch.equal(ts.read_image(write_image(image, tmp_path / "a.webp")), image)


def test_sixteen_bit_png_is_what_other_programs_read(tmp_path):
    image = values("16-bit", 1, 12, 12)
    data = write_image(image, tmp_path / "a.png", depth="16-bit").read_bytes()
    with Pillow.open(io.BytesIO(data)) as opened:
        assert (np.asarray(opened) == (image[0] * 65535).round().numpy()).all()


@pytest.mark.parametrize("name", ["brick", "grass", "gravel", "pebbles"])
def test_samples_are_small_pictures(name):
    image = ts.read_image(f"sample:{name}")
    assert image.shape[0] == (3 if name == "pebbles" else 1)


def test_staging_moves_all_files_at_the_end(tmp_path):
    with staging() as put:
        put(tmp_path / "new" / "a.txt", b"a")
        put(tmp_path / "b.txt", b"b")
        assert not (tmp_path / "b.txt").exists()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.txt", "b.txt", "new"]


def stage_two(folder, failure=None):
    with staging() as put:
        put(folder / "new" / "a.txt", b"a")
        put(folder / "b.txt", b"b")
        if failure is not None:
            raise failure


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError])
def test_staging_leaves_nothing_when_the_block_fails(tmp_path, failure):
    with pytest.raises(failure):
        stage_two(tmp_path, failure)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("failure", "told"), [(KeyboardInterrupt(), KeyboardInterrupt), (OSError(28, "No space"), ts.OutputError)]
)
def test_staging_takes_back_what_was_moved(tmp_path, monkeypatch, failure, told):
    """An interruption between two moves must not leave one of two files that belong together."""
    moves = []

    def replace(self, target):
        moves.append(target)
        if len(moves) == 2:
            raise failure
        self.rename(target)

    monkeypatch.setattr("pathlib.Path.replace", replace)
    with pytest.raises(told):
        stage_two(tmp_path)
    assert len(moves) == 2
    assert list(tmp_path.iterdir()) == []


def test_checking_a_place_leaves_nothing(tmp_path):
    check_writable(tmp_path / "a.png", overwrite=False)
    assert list(tmp_path.iterdir()) == []


def test_input_errors_survive_pickling():
    error = ts.InputError("size", "must be 1", "it is 2", "change it")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # noqa: S301 (our own bytes)
