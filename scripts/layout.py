"""How the scripts beside this file lay pictures out: in rows and columns on white, with labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Pixels: TypeAlias = NDArray[np.float32]
"""A picture to be shown: ``(height, width, 3)``, values in [0, 1]."""

GAP = 8
_LETTERS = 11
_LABEL = 16


def shown(image: torch.Tensor) -> Pixels:
    """An image tensor, gray or RGB, as a picture."""
    pixels: Pixels = image.expand(3, -1, -1).permute(1, 2, 0).to(torch.float32).numpy()
    return pixels


def enlarged(picture: Pixels, side: int) -> Pixels:
    """The picture with each pixel as a square block, so that ``side`` is reached."""
    return picture.repeat(side // len(picture), axis=0).repeat(side // picture.shape[1], axis=1)


def framed(picture: Pixels, height: int, width: int) -> Pixels:
    """The picture in the middle of a white one."""
    frame = np.ones((height, width, 3), dtype=np.float32)
    top, left = (height - picture.shape[0]) // 2, (width - picture.shape[1]) // 2
    frame[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
    return frame


def labelled(picture: Pixels, text: str) -> Pixels:
    """The picture with a line of text above it."""
    label = Image.new("L", (picture.shape[1], _LABEL), 255)
    pen, font = ImageDraw.Draw(label), ImageFont.load_default(_LETTERS)
    pen.text((picture.shape[1] / 2, _LABEL / 2), text, 0, font, anchor="mm")
    line = np.asarray(label, dtype=np.float32)[..., None].repeat(3, axis=2) / 255
    return np.concatenate((line, picture))


def in_a_row(pictures: Sequence[Pixels]) -> Pixels:
    """Pictures side by side, at the same scale, on white."""
    height = max(len(picture) for picture in pictures)
    gap = np.ones((height, GAP, 3), dtype=np.float32)
    pieces = [piece for one in pictures for piece in (gap, framed(one, height, one.shape[1]))]
    return np.concatenate(pieces[1:], axis=1)


def in_a_column(pictures: Sequence[Pixels]) -> Pixels:
    """Pictures below each other, at the same scale, on white."""
    return in_a_row([picture.swapaxes(0, 1) for picture in pictures]).swapaxes(0, 1)
