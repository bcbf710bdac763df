"""Image files as bytes: to arrays in the file's own depth and back, without loss where the format allows.

Pillow does what it can do exactly. It cuts 16-bit color to 8 bits and has no float color at all, so
those go to kornia_rs (PNG) and tifffile (TIFF).
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from typing import Any, Literal, TypeAlias

import kornia_rs.io
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageOps, UnidentifiedImageError

Depth: TypeAlias = Literal["1-bit", "8-bit", "16-bit", "float"]
"""How a file stores one value."""

Pixels: TypeAlias = NDArray[Any]
"""``(H, W, C)``: uint8 for 1-bit and 8-bit files, uint16, or float32."""

LARGEST: dict[Depth, int] = {"1-bit": 1, "8-bit": 2**8 - 1, "16-bit": 2**16 - 1, "float": 1}
"""The value that stands for 1.0."""

DEPTHS: dict[str, tuple[Depth, ...]] = {
    ".png": ("1-bit", "8-bit", "16-bit"),
    ".tif": ("1-bit", "8-bit", "16-bit", "float"),
    ".tiff": ("1-bit", "8-bit", "16-bit", "float"),
    ".bmp": ("1-bit", "8-bit"),
    ".webp": ("8-bit",),
    ".jpg": ("8-bit",),
    ".jpeg": ("8-bit",),
}
"""By extension: the depths that can be written, the best last."""

CHANNELS: dict[str, tuple[int, ...]] = {
    ".png": (1, 2, 3, 4), ".webp": (1, 3, 4), ".bmp": (1, 3), ".jpg": (1, 3), ".jpeg": (1, 3),
}  # fmt: skip
"""By extension: how many channels can be written; any number where nothing is said."""

SIDES: dict[str, int] = {".webp": 16383, ".jpg": 65500, ".jpeg": 65500}
"""By extension: the longest side in pixels, where the format has a limit that a picture may reach."""

_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP")
_OPTIONS: dict[str, dict[str, Any]] = {
    "WEBP": {"lossless": True, "exact": True},
    "JPEG": {"quality": 95, "subsampling": 0},
}
_TIFF_BEGINNINGS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNG_BEGINNING = b"\x89PNG\r\n\x1a\n"
_PNG_COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
_WITH_ALPHA = {"1": "LA", "L": "LA", "P": "RGBA", "PA": "RGBA", "RGB": "RGBA"}
_FILTER_UP = 2


class UnknownFormatError(ValueError):
    """The bytes are in none of the formats that are read."""


def decode(data: bytes) -> tuple[Pixels, Depth]:
    """The upright pixels of an image file, and how deep it stores them.

    Palette colors and transparent colors are looked up; CMYK and the like become RGB.

    Raises:
        UnknownFormatError: If the bytes are no PNG, JPEG, TIFF, BMP or WebP file.
        ValueError: If they are, but damaged or of a kind that cannot be read without loss.

    Example:
        >>> pixels, depth = decode(encode(np.full((2, 3, 1), 500, np.uint16), ".png", "16-bit"))
        >>> pixels.shape, pixels[0, 0, 0].item(), depth
        ((2, 3, 1), 500, '16-bit')
    """
    with warnings.catch_warnings():
        # Pillow warns about damaged metadata, of which nothing but the pixels is used here.
        warnings.simplefilter("ignore")
        try:
            pixels = _decode(data)
        except UnidentifiedImageError:
            raise UnknownFormatError("it is none of these, or too damaged to tell") from None
        except Exception as error:
            # Decoders raise whatever they trip over in a damaged file: struct.error, zlib.error, ...
            raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None
    shaped = pixels if pixels.ndim == 3 else pixels[:, :, None]
    if shaped.dtype == np.bool_:
        return shaped.astype(np.uint8), "1-bit"
    depths: dict[str, Depth] = {"uint8": "8-bit", "uint16": "16-bit", "float32": "float"}
    if shaped.dtype.name not in depths:
        raise ValueError(f"values of type {shaped.dtype} are not supported")
    return shaped, depths[shaped.dtype.name]


def pixels_in_header(file: io.BytesIO | io.BufferedReader) -> int | None:
    """How many pixels an image file says it has, without decoding it; None if it does not say.

    Example:
        >>> pixels_in_header(io.BytesIO(encode(np.zeros((2, 3, 1), np.uint8), ".png", "8-bit")))
        6
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with Pillow.open(file) as image:
                return image.width * image.height
        except Pillow.DecompressionBombError:
            return 2 * (Pillow.MAX_IMAGE_PIXELS or 0)  # it has more, which Pillow does not tell
        except Exception:
            return None


def encode(pixels: Pixels, suffix: str, depth: Depth) -> bytes:
    """An image file as bytes.

    Args:
        pixels: Of the type that belongs to the depth.
        suffix: The extension, in lower case; it decides the format.
        depth: One of the format's.

    Example:
        >>> encode(np.zeros((2, 3, 1), np.uint8), ".bmp", "8-bit")[:2]
        b'BM'
    """
    deep, channels = depth in ("16-bit", "float"), pixels.shape[2]
    if suffix in (".tif", ".tiff") and (deep or channels not in (1, 3, 4)):
        return _encode_tiff(pixels)
    if deep:
        return _encode_png16(pixels)
    squeezed = pixels[:, :, 0] if channels == 1 else pixels
    picture = Pillow.fromarray(squeezed * 255 if depth == "1-bit" else squeezed)
    if depth == "1-bit":
        picture = picture.convert("1", dither=Pillow.Dither.NONE)
    name = Pillow.registered_extensions()[suffix]
    file = io.BytesIO()
    picture.save(file, format=name, **_OPTIONS.get(name, {}))
    return file.getvalue()


def _decode(data: bytes) -> Pixels:
    if data.startswith(_TIFF_BEGINNINGS):
        deep = _decode_tiff(data)
        if deep is not None:
            return deep
    with Pillow.open(io.BytesIO(data), formats=_FORMATS) as opened:
        frames = getattr(opened, "n_frames", 1)
        if frames > 1 and opened.format != "MPO":  # a camera's JPEG with a preview behind the picture
            raise ValueError(f"it holds {frames} pictures")
        if opened.format == "PNG" and data[24] == 16:
            return _decode_png16(data, opened)
        return _plain_pixels(ImageOps.exif_transpose(opened))


def _plain_pixels(opened: Pillow.Image) -> Pixels:
    """What Pillow reads without loss."""
    mode = opened.mode
    if mode in _WITH_ALPHA and ("transparency" in opened.info or mode == "PA"):
        opened = opened.convert(_WITH_ALPHA[mode])
    elif mode in ("P", "CMYK", "YCbCr", "LAB", "HSV", "RGBX"):
        opened = opened.convert("RGB")
    elif mode not in ("1", "L", "LA", "RGB", "RGBA", "F") and not mode.startswith("I;16"):
        raise ValueError(f"pixels of Pillow's mode {mode} are not supported")
    pixels = np.asarray(opened)
    return pixels.astype(np.uint16) if mode.startswith("I;16") else pixels


def _decode_png16(data: bytes, opened: Pillow.Image) -> Pixels:
    if "transparency" in opened.info:
        raise ValueError("16-bit PNG with one transparent color is not supported")
    channels = {kind: count for count, kind in _PNG_COLOR_TYPES.items()}[data[25]]
    if channels == 1:
        return _plain_pixels(ImageOps.exif_transpose(opened))
    if channels == 2:
        # Four bytes a pixel, filtered alike: read as 8-bit RGBA, they are the same four bytes.
        header = data[12:24] + bytes((8, _PNG_COLOR_TYPES[4])) + data[26:29]
        disguised = data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]
        with Pillow.open(io.BytesIO(disguised), formats=("PNG",)) as inner:
            pixels = np.array(inner).view(">u2").astype(np.uint16)
    else:
        size, mode = (opened.height, opened.width), {3: "rgb", 4: "rgba"}[channels]
        pixels = np.asarray(kornia_rs.io.decode_image_png_u16(data, size, mode))
    return _upright(pixels, opened.getexif().get(274, 1))


def _decode_tiff(data: bytes) -> Pixels | None:
    """The pixels of a TIFF file; None if Pillow reads them as well."""
    import tifffile  # rarely needed, and slow to import

    with tifffile.TiffFile(io.BytesIO(data)) as file:
        if len(file.pages) > 1:
            raise ValueError(f"it holds {len(file.pages)} pictures")
        page = file.pages.first
        if page.bitspersample <= 8 and page.samplesperpixel <= 4:
            return None
        if page.photometric not in (tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.RGB):
            kind = tifffile.PHOTOMETRIC(page.photometric).name
            raise ValueError(f"{page.bitspersample}-bit TIFF of the kind {kind} is not supported")
        if page.samplesperpixel == 1 and page.dtype in (np.uint16, np.float32):
            return None
        pixels = page.asarray()
        pixels = pixels.transpose(1, 2, 0) if page.axes == "SYX" else pixels
        orientation = page.tags.valueof("Orientation", default=1)
    return _upright(pixels.astype(pixels.dtype.newbyteorder("=")), int(orientation))


def _upright(pixels: Pixels, orientation: int) -> Pixels:
    """Undo a camera's orientation tag, as Pillow's ``exif_transpose`` does."""
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels


def _encode_tiff(pixels: Pixels) -> bytes:
    import tifffile

    channels = pixels.shape[2]
    extra = ["unassalpha"] if channels in (2, 4) else ["unspecified"] * (channels - 1)
    file = io.BytesIO()
    tifffile.imwrite(
        file,
        pixels if channels > 1 else pixels[:, :, 0],
        photometric="rgb" if channels in (3, 4) else "minisblack",
        planarconfig="contig" if channels > 1 else None,
        extrasamples=None if channels in (1, 3) else extra,
        metadata=None,
        compression="zlib",
    )
    return file.getvalue()


def _encode_png16(pixels: Pixels) -> bytes:
    """Any 16-bit PNG: Pillow has only gray, kornia_rs only color and no way to tell a full disk."""
    height, width, channels = pixels.shape
    rows = np.ascontiguousarray(pixels).astype(">u2").view(np.uint8).reshape(height, -1)
    above = np.concatenate([np.zeros_like(rows[:1]), rows[:-1]])
    lines = np.concatenate([np.full((height, 1), _FILTER_UP, np.uint8), rows - above], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 16, _PNG_COLOR_TYPES[channels], 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes())), (b"IEND", b""))
    return _PNG_BEGINNING + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )
