"""Moving pictures of a synthesis as it grows."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import torch
from jaxtyping import UInt8
from PIL import Image as Pillow
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.errors import InputError
from torchsynth.io import check_writable, staging
from torchsynth.lattice import Shape
from torchsynth.viz.paper import shown, stretched

SIDES = {".gif": 65535, ".png": 2**31 - 1, ".apng": 2**31 - 1, ".webp": 16383}
"""By extension: the longest side of an animation in pixels."""

MOST = 80
"""About so many frames are kept, evenly spread over the pixels that are visited."""

_BUDGET = 2**28
_FEWEST = 12
_CHANNELS = 4
_STEP, _LAST = 80, 2000
_OPTIONS: dict[str, dict[str, Any]] = {
    ".gif": {"format": "GIF"},
    ".png": {"format": "PNG"},
    ".apng": {"format": "PNG"},
    ".webp": {"format": "WEBP", "lossless": True},
}


class Recorder:
    """Keeps pictures of one synthesis while it goes on: pass it as its ``progress``.

    Of coarse levels there are fewer frames than of fine ones, in proportion to their pixels; of every level
    there is at least the one it starts from. Of large or many outputs less than :data:`torchsynth.viz.animation.MOST` are kept, so that
    they take no more than a quarter of a gibibyte.

    Example:
        >>> import tempfile, torchsynth as ts
        >>> recorder = Recorder()
        >>> recipe = ts.recipes.wei_levoy(levels=2, neighborhood=5)
        >>> result = ts.synthesize(torch.rand(1, 16, 16), (20, 24), recipe, progress=recorder)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     written = recorder.save(Path(folder, "growing.gif"))
        >>> frames = list(recorder.frames())  # in 8 bits
        >>> len(frames) > 5, bool((frames[-1] - result.image).abs().max() < 1 / 255)
        (True, True)
    """

    def __init__(self) -> None:
        self._kept: list[UInt8[Tensor, "batch channels height width"]] = []
        self._most = MOST
        self._taken = -1
        self._level: int | None = None

    def __call__(self, level: int, _sweep: int, done: int, total: int, preview: Callable[[], Image]) -> None:
        """Keep the picture as it stands, if it is time for one; see :data:`torchsynth.synthesis.Progress`."""
        taken = done * self._most // max(1, total)
        if taken == self._taken and level == self._level:
            return
        image = preview().detach().cpu()
        if not self._kept:
            # What the finest level will take; uint8 is a byte for each value.
            self._most = min(MOST, max(_FEWEST, _BUDGET // (image.numel() * 4**level)))
        image = image if image.shape[1] <= _CHANNELS else image[:, :1]
        self._kept.append((image.double() * 255).round().clamp(0, 255).to(torch.uint8))
        self._taken, self._level = taken, level

    @property
    def size(self) -> Shape:
        """Height and width of the frames: those of the finest level.

        Raises:
            InputError: If nothing was recorded.
        """
        if not self._kept:
            raise InputError(
                "animation", "must be recorded before it is saved", "no frame was",
                "pass the recorder as progress=... to a synthesis first",
            )  # fmt: skip
        height, width = max(tuple(one.shape[-2:]) for one in self._kept)
        return height, width

    def frames(self, item: int = 0) -> Iterator[Image]:
        """The pictures of one output, ``(1, C, H, W)`` each, coarse levels enlarged; no two alike in a row.

        Args:
            item: Which of the outputs that were made together.

        Raises:
            InputError: If nothing was recorded, or there is no such output.
        """
        size, outputs = self.size, len(self._kept[0])
        if not 0 <= item < outputs:
            raise InputError(
                "item", f"must be from 0 to {outputs - 1}, one of the outputs made together", f"it is {item}",
                "choose one of them",
            )  # fmt: skip
        # One at a time: as floats, all of them would take four times as much memory.
        ones = [kept[item : item + 1] for kept in self._kept]
        return (
            stretched(one.float() / 255, size)
            for number, one in enumerate(ones)
            if number == 0 or not one.equal(ones[number - 1])
        )

    def save(
        self, path: str | Path, item: int = 0, last: Tensor | None = None, overwrite: bool = False
    ) -> Path:
        """Write an animation, whole or not at all.

        Args:
            path: Where to: ``.gif`` (256 colors), or ``.png``, ``.apng`` or ``.webp`` without loss.
            item: Which of the outputs that were made together.
            last: The finished picture, if it is not the last that was recorded, as when seams are blurred.
            overwrite: Whether a file that is there already may be replaced.

        Returns:
            The path.

        Raises:
            InputError: If nothing was recorded, or the file's name has another ending.
            OutputError: If the file exists, or cannot be written.
        """
        target = Path(path)
        check_animation(target, self.size)
        check_writable(target, overwrite=overwrite)
        finished = [] if last is None else [last.view(1, *last.shape[-3:])]
        frames = chain(self.frames(item), finished)
        with staging() as put:
            put(target, encode_animation(frames, target))
        return target


def check_animation(path: Path, size: Shape) -> None:
    """Whether the format that the extension names can hold an animation of this size.

    Raises:
        InputError: If it cannot.

    Example:
        >>> check_animation(Path("growing.gif"), (64, 64))
    """
    suffix = path.suffix.lower()
    if suffix not in SIDES:
        raise InputError(
            str(path), f"an animation must end in one of {' '.join(SIDES)}",
            f"it ends in {suffix!r}" if suffix else "it has no extension", "rename it",
        )  # fmt: skip
    if max(size) > SIDES[suffix]:
        raise InputError(
            str(path), f"the sides of a {suffix} animation have at most {SIDES[suffix]} pixels",
            f"the picture is {size[0]}x{size[1]}", "write .png",
        )  # fmt: skip


def encode_animation(frames: Iterable[Image], path: Path) -> bytes:
    """The bytes of an animation, which shows its last frame for two seconds and begins again.

    Args:
        frames: ``(1, C, H, W)`` each, values in [0, 1], all of one size.
        path: The extension decides the format.

    Example:
        >>> encode_animation([torch.zeros(1, 1, 4, 4), torch.ones(1, 1, 4, 4)], Path("flash.gif"))[:3]
        b'GIF'
    """
    suffix, file = path.suffix.lower(), io.BytesIO()
    first, *rest = _paletted(_pictures(frames)) if suffix == ".gif" else _pictures(frames)
    durations = [_STEP] * len(rest) + [_LAST]
    first.save(file, save_all=True, append_images=rest, duration=durations, loop=0, **_OPTIONS[suffix])
    return file.getvalue()


def _pictures(frames: Iterable[Image]) -> list[Pillow.Image]:
    """Frames for Pillow, no two alike in a row: gray ones if all are."""
    pixels = [(shown(frame)[0].double() * 255).round().clamp(0, 255).to(torch.uint8) for frame in frames]
    pixels = [one for number, one in enumerate(pixels) if number == 0 or not one.equal(pixels[number - 1])]
    gray = all(bool((one == one[:1]).all()) for one in pixels)
    return [
        Pillow.fromarray((one[0] if gray else one.permute(1, 2, 0).contiguous()).numpy()) for one in pixels
    ]


def _paletted(pictures: list[Pillow.Image]) -> list[Pillow.Image]:
    """Colors reduced to the 256 that suit the finished picture best: one palette, so that nothing flickers."""
    if pictures[-1].mode == "L":
        return pictures
    palette = pictures[-1].quantize(dither=Pillow.Dither.NONE)
    return [picture.quantize(palette=palette, dither=Pillow.Dither.NONE) for picture in pictures]
