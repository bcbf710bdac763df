"""What was painted in the browser, as targets, regions, holes and fields."""

from __future__ import annotations

import base64
import binascii
import io
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import UnidentifiedImageError
from torch import Tensor

from torchsynth._typing import FieldMap, Region
from torchsynth.errors import InputError
from torchsynth.lattice import Shape

Painted: TypeAlias = NDArray[np.uint8]
"""``(H, W, 4)``: colors, and 255 where something was painted."""

_OPAQUE = 128
_START = "data:image/png;base64,"


def layer_of(value: str | None, shape: Shape, subject: str) -> Painted:
    """What was painted.

    Args:
        value: What the canvas sends: a PNG of the picture's size as a data URL; nothing if nothing was painted.
        shape: Height and width of the picture.
        subject: What was to be painted, for messages.

    Raises:
        InputError: If nothing was painted, or it belongs to a picture of another size.

    Example:
        >>> layer_of("", (2, 4), "target")
        Traceback (most recent call last):
        torchsynth.errors.InputError: target: must be painted, but nothing is painted yet; paint with the brush first
    """
    layer = np.zeros((*shape, 4), np.uint8) if not value else _decoded(value, subject)
    if layer.shape[:2] != shape:
        raise InputError(
            subject, f"must be painted at the output's size, {shape[0]}x{shape[1]}",
            f"it was painted at {layer.shape[0]}x{layer.shape[1]}", "paint it anew, or set the size back",
        )  # fmt: skip
    if not (layer[..., 3] >= _OPAQUE).any():
        raise InputError(subject, "must be painted", "nothing is painted yet", "paint with the brush first")
    return layer


def region_of(layer: Painted) -> Region:
    """Where something was painted.

    Example:
        >>> region_of(np.array([[[0, 0, 0, 255], [0, 0, 0, 0]]], np.uint8)).tolist()
        [[True, False]]
    """
    return torch.from_numpy(layer[..., 3] >= _OPAQUE)


def target_of(layer: Painted, channels: int) -> Float[Tensor, "channels height width"]:
    """The colors that were painted, with as many channels as the sample; opaque where it has an alpha channel.

    Example:
        >>> target_of(np.full((1, 1, 4), 255, np.uint8), 2).flatten().tolist()
        [1.0, 1.0]
    """
    colors = torch.from_numpy(layer[..., :3].copy()).permute(2, 0, 1).float() / 255
    if channels <= 2:
        colors = colors.double().mean(0, keepdim=True).float()
    elif channels > 4:
        raise InputError(
            "target", "can be painted for a gray or color sample", f"this one has {channels} channels",
            "choose another sample",
        )  # fmt: skip
    if channels in (2, 4):
        colors = torch.cat((colors, torch.ones_like(colors[:1])))
    return colors


def field_of(layer: Painted, subject: str) -> FieldMap:
    """A field that was painted in grays: black to white is 0 to 360 degrees, or a quarter to four times.

    What was not painted is left as it is: 0 degrees, once.

    Args:
        layer: What was painted.
        subject: ``angle`` or ``scale``.

    Example:
        >>> field_of(np.array([[[255, 255, 255, 255], [9, 9, 9, 0]]], np.uint8), "scale").tolist()
        [[4.0, 1.0]]
    """
    share = torch.from_numpy(layer[..., :3].astype(np.float64)).mean(2) / 255
    painted = region_of(layer)
    if subject == "angle":
        return torch.where(painted, share * 360, 0.0)
    return torch.where(painted, 4 ** (2 * share - 1), 1.0)


def _decoded(value: str, subject: str) -> Painted:
    try:
        data = base64.b64decode(value.removeprefix(_START), validate=True)
        return np.asarray(Pillow.open(io.BytesIO(data), formats=("PNG",)).convert("RGBA"))
    except (binascii.Error, UnidentifiedImageError, OSError, ValueError):
        raise InputError(subject, "must come from the page", "it is no PNG", "reload the page") from None
