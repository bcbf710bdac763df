"""Images in and out: files to tensors in [0, 1] and back, in their own depth, whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, get_args

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from torchsynth import checks
from torchsynth.codecs import CHANNELS, DEPTHS, LARGEST, SIDES, Depth, UnknownFormatError, decode, encode
from torchsynth.errors import InputError, OutputError
from torchsynth.samples import sample_path


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
        path: As for :func:`torchsynth.read_image`.

    Raises:
        InputError: As for :func:`torchsynth.read_image`.

    Example:
        >>> read_picture("sample:brick").depth
        '8-bit'
    """
    data = _read_bytes(path)
    try:
        pixels, depth = decode(data)
    except UnknownFormatError as error:
        raise InputError(
            str(path), "must be a PNG, JPEG, TIFF, BMP or WebP image", str(error),
            "check the path, or convert the file",
        ) from None  # fmt: skip
    except ValueError as error:
        raise InputError(
            str(path), "must be one whole image that can be read without loss", str(error),
            "repair, convert or shrink the file",
        ) from None  # fmt: skip
    image = torch.from_numpy(np.array(pixels.transpose(2, 0, 1), dtype=np.float32, order="C"))
    return Picture(image / LARGEST[depth], depth, hashlib.sha256(data).hexdigest())


def write_image(image: Tensor, path: str | Path, *, depth: Depth = "8-bit", overwrite: bool = False) -> Path:
    """Write a tensor as an image file, whole or not at all.

    Args:
        image: ``(C, H, W)`` or ``(1, C, H, W)``, float in [0, 1].
        path: Where to; the extension decides the format: ``.png``, ``.tif``, ``.bmp``, ``.webp``
            (lossless) or ``.jpg`` (quality 95, full chroma).
        depth: How to store a value: ``1-bit``, ``8-bit``, ``16-bit`` or ``float``. A format that has no
            such depth gets its best: 8-bit JPEG, BMP and WebP, 16-bit PNG for float values; and 1-bit
            is for one channel only.
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
    if depth not in get_args(Depth):
        raise InputError(
            "depth", f"must be one of {', '.join(get_args(Depth))}", f"it is {depth!r}", "choose one"
        )
    picture = image[0] if image.ndim == 4 and len(image) == 1 else image
    if picture.ndim != 3:
        raise InputError(
            "image", "must be one picture (C, H, W)", f"its shape is {tuple(image.shape)}",
            "write the pictures of a batch one at a time",
        )  # fmt: skip
    target, (channels, height, width) = Path(path), picture.shape
    check_storable(target, channels, (height, width))
    check_writable(target, overwrite=overwrite)
    with staging() as put:
        put(target, encode_image(picture, target, depth))
    return target


def encode_image(image: Float[Tensor, "channels height width"], path: Path, depth: Depth) -> bytes:
    """The bytes of an image file, for use inside :func:`staging`, after the checks.

    Args:
        image: Values in [0, 1].
        path: The extension decides the format.
        depth: As for :func:`torchsynth.write_image`.

    Example:
        >>> encode_image(torch.zeros(1, 2, 2), Path("black.bmp"), "8-bit")[:2]
        b'BM'
    """
    suffix = path.suffix.lower()
    if depth == "1-bit" and len(image) > 1:
        depth = "8-bit"
    depth = depth if depth in DEPTHS[suffix] else DEPTHS[suffix][-1]
    values = image.detach().cpu().permute(1, 2, 0)
    if depth == "float":
        return encode(values.float().contiguous().numpy(), suffix, depth)
    # In float64 every 16-bit value survives the way to [0, 1] and back.
    steps = (values.double() * LARGEST[depth]).round().contiguous().numpy()
    return encode(steps.astype(np.uint16 if depth == "16-bit" else np.uint8), suffix, depth)


def check_storable(path: Path, channels: int, size: tuple[int, int]) -> None:
    """Whether the format that the extension names can hold such a picture.

    Raises:
        InputError: If it cannot, or if the extension is unknown.

    Example:
        >>> check_storable(Path("out.png"), channels=4, size=(64, 64))
    """
    suffix = path.suffix.lower()
    if os.path.isdir(path):
        raise InputError(str(path), "must be a file name", "it is a folder", "add a file name")
    if suffix not in DEPTHS:
        raise InputError(
            str(path), f"must end in one of {' '.join(DEPTHS)}",
            f"it ends in {suffix!r}" if suffix else "it has no extension", "rename the output",
        )  # fmt: skip
    allowed = CHANNELS.get(suffix)
    if allowed is not None and channels not in allowed:
        raise InputError(
            str(path), f"a {suffix} file holds {_either(allowed)} channels",
            f"the picture has {channels}{' (alpha is one of them)' if channels in (2, 4) else ''}",
            "write .tif" if channels > 4 else "write .png or .tif",
        )  # fmt: skip
    if max(size) > SIDES.get(suffix, max(size)):
        raise InputError(
            str(path), f"the sides of a {suffix} file have at most {SIDES[suffix]} pixels",
            f"the picture is {size[0]}x{size[1]}", "write .png or .tif",
        )  # fmt: skip


def check_writable(path: Path, *, overwrite: bool) -> None:
    """Whether a file can be put there, before the work of making it.

    Raises:
        OutputError: If it exists and may not be replaced, or its folder cannot be written.
    """
    if os.path.isdir(path):
        raise OutputError(str(path), "must be a file name", "it is a folder", "add a file name")
    if os.path.exists(path) and not overwrite:
        raise OutputError(
            str(path),
            "must not exist yet",
            "it does",
            "choose another name, or allow it with --overwrite (overwrite=True)",
        )
    temporary = _temporary(path)
    try:
        temporary.touch()
    except OSError as error:
        raise OutputError(
            str(path), "its folder must exist and be writable", f"{path.parent}: {reason(error)}",
            "create the folder, or choose another place",
        ) from None  # fmt: skip
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


Put: TypeAlias = Callable[[Path, bytes], None]
"""``put(path, data)``: have a file written, under a temporary name for now."""


@contextmanager
def staging() -> Iterator[Put]:
    """Write several files, all of them or none.

    Each is written under a temporary name beside its place; a missing folder is made. When the block
    ends well, all are moved to their places; when it does not, whatever the reason, they are removed,
    and so are the folders.

    Raises:
        OutputError: If the disk is full, or anything else keeps a file from being written.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with staging() as put:
        ...         put(Path(folder, "note.txt"), b"done")
        ...     Path(folder, "note.txt").read_text()
        'done'
    """
    # Each step is noted before it is taken, so that an interruption in between is undone as well.
    staged: dict[Path, Path] = {}
    made: list[Path] = []

    def put(path: Path, data: bytes) -> None:
        with _reporting(path):
            if not path.parent.exists():
                made.append(path.parent)
                path.parent.mkdir()
            staged[path] = _temporary(path)
            staged[path].write_bytes(data)

    fresh: list[Path] = []
    try:
        yield put
        for path, temporary in staged.items():
            if not path.exists():
                fresh.append(path)
            with _reporting(path):
                temporary.replace(path)
    except BaseException:
        for leftover in (*staged.values(), *fresh):
            with contextlib.suppress(OSError):
                leftover.unlink()
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


@contextmanager
def _reporting(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(
            str(path), "must be written completely", reason(error),
            "free some space or choose another place; no unfinished file was left",
        ) from None  # fmt: skip


def _read_bytes(path: str | Path) -> bytes:
    try:
        data = (sample_path(str(path)) or Path(path)).read_bytes()
    except OSError as error:
        raise InputError(
            str(path), "must be a readable image file", reason(error), "check the path"
        ) from None
    if not data:
        raise InputError(str(path), "must be an image", "the file is empty", "check the path")
    return data


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def reason(error: OSError) -> str:
    """Why the system refused, in its own words.

    Example:
        >>> reason(FileNotFoundError(2, "No such file or directory"))
        'the system says: no such file or directory'
    """
    return f"the system says: {(error.strerror or str(error)).lower()}"


def _either(numbers: tuple[int, ...]) -> str:
    return " or ".join((", ".join(map(str, numbers[:-1])), str(numbers[-1])))
