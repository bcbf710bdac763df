"""What was painted in the browser, as targets, regions and holes.

The editor shows a small picture enlarged by a whole number, so that there is something to paint on. Here each
pixel of the picture gets what was painted on the middle of its square.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from torchsynth._typing import FieldMap, Region
from torchsynth.errors import InputError
from torchsynth.lattice import Shape

Painted: TypeAlias = NDArray[np.uint8]
"""``(H, W, 4)``: what a layer of the editor holds."""

EDITOR_SIDE = 512
"""The editor enlarges pictures up to so many pixels."""

_OPAQUE = 128


def enlargement(shape: Shape) -> int:
    """By how much the editor enlarges a picture.

    Example:
        >>> enlargement((64, 128)), enlargement((600, 10))
        (4, 1)
    """
    return max(1, EDITOR_SIDE // max(shape))


def enlarged(pixels: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """A picture with every pixel as a square of so many.

    Example:
        >>> enlarged(np.array([[1, 2]], np.uint8), 2).tolist()
        [[1, 1, 2, 2], [1, 1, 2, 2]]
    """
    return pixels.repeat(factor, axis=0).repeat(factor, axis=1)


def layer_of(editor: dict[str, Any] | None, shape: Shape, subject: str) -> Painted:
    """What was painted, at the size of the picture.

    Args:
        editor: The editor's value: a background, and layers of RGBA.
        shape: Height and width of the picture.
        subject: What was to be painted, for messages.

    Returns:
        The layers, the upper ones covering the lower.

    Raises:
        InputError: If nothing was painted.

    Example:
        >>> layer = np.zeros((4, 8, 4), np.uint8)
        >>> layer[:, 4:] = (9, 8, 7, 255)
        >>> layer_of({"layers": [layer]}, (2, 4), "target")[0, :, 0].tolist()
        [0, 0, 9, 9]
    """
    found = np.zeros((*shape, 4), np.uint8)
    for layer in (editor or {}).get("layers", []):
        if layer is not None:
            small = _shrunk(np.asarray(layer, np.uint8), shape)
            found = np.where(small[..., 3:] >= _OPAQUE, small, found)
    if not (found[..., 3] >= _OPAQUE).any():
        raise InputError(subject, "must be painted", "nothing is painted yet", "paint with the brush first")
    return found


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


def _shrunk(layer: NDArray[np.uint8], shape: Shape) -> NDArray[np.uint8]:
    """The middle of each square; whatever the editor made of the size it was given."""
    rows, columns = (
        (np.arange(small) * 2 + 1) * large // (2 * small)
        for small, large in zip(shape, layer.shape[:2], strict=True)
    )
    return layer[rows][:, columns]
