"""Images in and out: files to tensors in [0, 1] and back, in their own depth."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import kornia_rs.io
import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageOps, UnidentifiedImageError
from torch import Tensor

from torchsynth import checks
from torchsynth.errors import InputError, OutputError
from torchsynth.samples import sample_path

Depth: TypeAlias = Literal["1-bit", "8-bit", "16-bit", "float"]
"""How a file stores one value."""

_SCALE: dict[Depth, int] = {"1-bit": 1, "8-bit": 2**8 - 1, "16-bit": 2**16 - 1}

_SAVED_DEPTHS: dict[str, tuple[Depth, ...]] = {
    ".png": ("1-bit", "8-bit", "16-bit"),
    ".tif": ("1-bit", "8-bit", "16-bit", "float"),
    ".tiff": ("1-bit", "8-bit", "16-bit", "float"),
    ".bmp": ("1-bit", "8-bit"),
    ".webp": ("8-bit",),
    ".jpg": ("8-bit",),
    ".jpeg": ("8-bit",),
}
_SAVED_CHANNELS: dict[str, tuple[int, ...]] = {
    ".png": (1, 2, 3, 4), ".webp": (1, 3, 4), ".bmp": (1, 3), ".jpg": (1, 3), ".jpeg": (1, 3),
}  # fmt: skip
_LOSSLESS: dict[str, dict[str, Any]] = {
    ".webp": {"lossless": True, "exact": True},
    ".jpg": {"quality": 95, "subsampling": 0},
    ".jpeg": {"quality": 95, "subsampling": 0},
}


@dataclass(frozen=True)
class Picture:
    """An image file that was read.

    Args:
        image: ``(C, H, W)`` float32 in [0, 1] (whatever the file holds, if it is a float file): gray,
            gray + alpha, RGB or RGBA. Palette colors are looked up, CMYK is converted to RGB.
        depth: How the file stores its values.
        sha256: Of the file's bytes.
    """

    image: Float[Tensor, "channels height width"]
    depth: Depth
    sha256: str


def read_image(path: str | Path) -> Float[Tensor, "channels height width"]:
    """Read an image file as a tensor.

    Args:
        path: A PNG, JPEG, TIFF, BMP or WebP file of any common depth, or ``sample:NAME`` for one of
            the built-in samples.

    Returns:
        ``(C, H, W)`` float32 in [0, 1]: every 8-bit and 16-bit value is kept exactly.

    Raises:
        InputError: If the file is missing, empty, damaged, not an image, or of a kind that cannot be
            read without loss.

    Example:
        >>> read_image("sample:brick").shape
        torch.Size([1, 128, 128])
    """
    return read_picture(path).image


def read_picture(path: str | Path) -> Picture:
    """Read an image file with all that is needed to write results in the same form.

    Args:
        path: As for :func:`read_image`.

    Raises:
        InputError: As for :func:`read_image`.

    Example:
        >>> read_picture("sample:brick").depth
        '8-bit'
    """
    file = sample_path(str(path)) or Path(path)
    try:
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        if file.stat().st_size == 0:
            raise InputError(str(path), "must be an image", "the file is empty", "check the path")
        values, depth = _decode(file)
    except UnidentifiedImageError:
        raise InputError(
            str(path), "must be a PNG, JPEG, TIFF, BMP or WebP image", "it is not an image",
            "check the path, or convert the file",
        ) from None  # fmt: skip
    except OSError as error:
        fact = str(error.strerror or error).lower()
        raise InputError(str(path), "must be a readable image file", fact, "check the file") from None
    except (Pillow.DecompressionBombError, ValueError, SyntaxError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            str(path), "must be an image that can be decoded", str(error), "convert or shrink it"
        ) from None
    pixels = values if values.ndim == 3 else values[:, :, None]
    scale = _SCALE.get(depth, 1)
    image = torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)).astype(np.float32))
    return Picture(image / scale if scale != 1 else image, depth, digest)


def write_image(image: Tensor, path: str | Path, *, depth: Depth = "8-bit", overwrite: bool = False) -> Path:
    """Write a tensor as an image file, whole or not at all.

    Args:
        image: ``(C, H, W)`` or ``(1, C, H, W)``, float in [0, 1].
        path: Where to; the extension decides the format: ``.png``, ``.tif``, ``.bmp``, ``.webp``
            (lossless) or ``.jpg`` (quality 95, full chroma).
        depth: How to store a value. A format that has no such depth gets its best: 8-bit JPEG, BMP and
            WebP, 16-bit PNG for float values.
        overwrite: Whether a file that is there already may be replaced.

    Returns:
        The path.

    Raises:
        InputError: If the image cannot be stored in that format.
        OutputError: If the file exists, or the folder cannot be written.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     written = write_image(torch.zeros(3, 4, 4), Path(folder, "black.png"))
        ...     read_image(written).shape
        torch.Size([3, 4, 4])
    """
    checks.check_image(image, "image")
    picture = image.detach().cpu()
    picture = picture[0] if picture.ndim == 4 and len(picture) == 1 else picture
    target = Path(path)
    check_writable(target, overwrite=overwrite)
    check_storable(picture, target)
    with staging() as put:
        put(target, lambda file: encode_image(picture, file, depth))
    return target


def encode_image(image: Float[Tensor, "channels height width"], file: Path, depth: Depth) -> None:
    """Write an image file plainly: for use inside :func:`staging`, after the checks.

    Args:
        image: Values in [0, 1].
        file: The extension decides the format.
        depth: As for :func:`write_image`.
    """
    suffix = file.suffix.lower()
    depths = _SAVED_DEPTHS[suffix]
    _encode(image.detach().cpu(), file, suffix, depth if depth in depths else depths[-1])


def check_storable(image: Tensor, path: Path) -> None:
    """Whether a format can hold this many channels.

    Raises:
        InputError: If it cannot, or if the extension is unknown.
    """
    suffix = path.suffix.lower()
    if suffix not in _SAVED_DEPTHS:
        raise InputError(
            str(path), f"must end in one of {' '.join(_SAVED_DEPTHS)}",
            f"it ends in {suffix!r}" if suffix else "it has no extension", "rename the output",
        )  # fmt: skip
    allowed = _SAVED_CHANNELS.get(suffix)
    if image.ndim != 3 or (allowed and image.shape[0] not in allowed):
        raise InputError(
            str(path), f"a {suffix} file holds one picture of {allowed or 'any number of'} channels",
            f"the shape is {tuple(image.shape)}", "write a .png or .tif, one picture at a time",
        )  # fmt: skip


def check_writable(path: Path, *, overwrite: bool) -> None:
    """Whether a file can be put there, before the work of making it.

    Raises:
        OutputError: If it exists and may not be replaced, or its folder cannot be written.
    """
    if path.is_dir():
        raise OutputError(str(path), "must be a file name", "it is a folder", "add a file name")
    if path.exists() and not overwrite:
        raise OutputError(
            str(path), "must not exist yet", "it does", "choose another name, or pass overwrite"
        )
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise OutputError(
            str(path), "its folder must exist and be writable",
            f"{path.parent}: {str(error.strerror).lower()}", "create the folder, or choose another",
        ) from None  # fmt: skip


Put: TypeAlias = Callable[[Path, Callable[[Path], object]], None]
"""``put(path, write)``: have ``write`` make the file, under a temporary name for now."""


@contextmanager
def staging() -> Iterator[Put]:
    """Write several files, all of them or none.

    Each is written under a temporary name beside its place. When the block ends well, all are moved to
    their places; when it does not, whatever the reason, they are removed.

    Raises:
        OutputError: If the disk is full, or anything else keeps a file from being written.

    Example:
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with staging() as put:
        ...         put(Path(folder, "note.txt"), lambda file: file.write_text("done"))
        ...     Path(folder, "note.txt").read_text()
        'done'
    """
    staged: list[tuple[Path, Path]] = []

    def put(path: Path, write: Callable[[Path], object]) -> None:
        # The extension stays at the end: encoders choose the format by it.
        temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        staged.append((temporary, path))
        with _reporting(path):
            write(temporary)

    try:
        yield put
        for temporary, path in staged:
            with _reporting(path):
                temporary.replace(path)
    finally:
        for temporary, _ in staged:
            temporary.unlink(missing_ok=True)


@contextmanager
def _reporting(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(
            str(path), "must be written completely", str(error.strerror or error).lower(),
            "free some space or choose another folder; nothing was left behind",
        ) from None  # fmt: skip


def _decode(file: Path) -> tuple[NDArray[Any], Depth]:
    """The pixels of a file, (H, W) or (H, W, C), and their depth."""
    with Pillow.open(file) as opened:
        if getattr(opened, "n_frames", 1) > 1:
            raise ValueError(f"it holds {opened.n_frames} frames, not one")
        deep = _deep_reader(opened)
        if deep is None:
            oriented = ImageOps.exif_transpose(opened)
            return _plain_pixels(oriented)
    values = deep(file)
    if values.dtype == np.uint16:
        return values, "16-bit"
    if values.dtype == np.float32:
        return values, "float"
    raise ValueError(f"values of type {values.dtype} are not supported")


def _deep_reader(opened: Pillow.Image) -> Callable[[Path], NDArray[Any]] | None:
    """Who reads the color depths that Pillow would silently cut to 8 bits."""
    if opened.format == "TIFF":
        bits = opened.tag_v2.get(258, (1,))  # type: ignore[attr-defined]
        return _read_tiff if max(bits) > 8 and opened.mode not in ("I;16", "F") else None
    raw_mode = str(opened.tile[0][3]) if opened.tile else ""
    if opened.format == "PNG" and ";16" in raw_mode and opened.mode in ("RGB", "RGBA"):
        mode = opened.mode.lower()
        return lambda file: np.asarray(kornia_rs.io.read_image_png_u16(str(file), mode))
    if opened.format == "PNG" and ";16" in raw_mode and opened.mode == "LA":
        raise ValueError("16-bit gray with alpha is not supported: convert it to RGBA")
    return None


def _read_tiff(file: Path) -> NDArray[Any]:
    import tifffile  # rarely needed, and slow to import

    return np.asarray(tifffile.imread(file))


def _plain_pixels(opened: Pillow.Image) -> tuple[NDArray[Any], Depth]:
    """What Pillow reads without loss."""
    mode = opened.mode
    if mode == "1":
        return np.asarray(opened, dtype=np.uint8), "1-bit"
    if mode.startswith("I;16"):
        return np.asarray(opened, dtype=np.uint16), "16-bit"
    if mode == "F":
        return np.asarray(opened), "float"
    if mode == "P":
        transparent = "transparency" in opened.info
        opened = opened.convert("RGBA" if transparent else "RGB")
    elif mode in ("CMYK", "YCbCr", "LAB", "HSV", "RGBX"):
        opened = opened.convert("RGB")
    elif mode not in ("L", "LA", "RGB", "RGBA"):
        raise ValueError(f"pixels of Pillow's mode {mode} are not supported")
    return np.asarray(opened), "8-bit"


def _encode(image: Tensor, file: Path, suffix: str, depth: Depth) -> None:
    pixels = image.permute(1, 2, 0).double().numpy()
    if depth == "float":
        values: NDArray[Any] = image.permute(1, 2, 0).contiguous().numpy().astype(np.float32)
    else:
        kind = np.uint16 if depth == "16-bit" else np.uint8
        values = np.ascontiguousarray((pixels * _SCALE[depth]).round().astype(kind))
    channels = values.shape[2]
    if suffix in (".tif", ".tiff") and (depth in ("16-bit", "float") or channels not in (1, 3, 4)):
        _write_tiff(values, file)
    elif depth == "16-bit" and channels in (3, 4):
        mode = {3: "rgb", 4: "rgba"}[channels]
        kornia_rs.io.write_image_png_u16(str(file), values, mode)
    elif depth == "16-bit" and channels == 2:
        # No common writer has 16-bit gray with alpha: the same picture as RGBA.
        rgba = np.ascontiguousarray(values[:, :, [0, 0, 0, 1]])
        kornia_rs.io.write_image_png_u16(str(file), rgba, "rgba")
    else:
        squeezed = values[:, :, 0] if channels == 1 else values
        picture = Pillow.fromarray(squeezed * 255 if depth == "1-bit" else squeezed)
        if depth == "1-bit":
            picture = picture.convert("1", dither=Pillow.Dither.NONE)
        formats = Pillow.registered_extensions()
        picture.save(file, format=formats[suffix], **_LOSSLESS.get(suffix, {}))


def _write_tiff(values: NDArray[Any], file: Path) -> None:
    import tifffile

    channels = values.shape[2]
    extra = {1: 0, 2: 1, 3: 0, 4: 1}.get(channels, channels - 1)
    tifffile.imwrite(
        file,
        values if channels > 1 else values[:, :, 0],
        photometric="rgb" if channels in (3, 4) else "minisblack",
        planarconfig="contig" if channels > 1 else None,
        extrasamples=["unassalpha" if channels in (2, 4) else "unspecified"] * extra or None,
        metadata=None,
        compression="zlib",
    )
