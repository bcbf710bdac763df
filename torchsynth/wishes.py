"""Controls from files and words, as the command line and records give them."""

from __future__ import annotations

import difflib
import inspect
import os
import re
from collections.abc import Mapping

import torch
from torch import Tensor

from torchsynth import checks
from torchsynth._typing import Region
from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.field import MAKERS
from torchsynth.io import Picture
from torchsynth.lattice import Shape

FIELDS = ("angle", "scale")
"""The controls that may be numbers or words."""

_OPAQUE = 0.5


def is_file(word: str) -> bool:
    """Whether a field is given by a file, not by a number or a maker.

    Example:
        >>> is_file("angles.png"), is_file("45"), is_file("swirl:90")
        (True, False, False)
    """
    return _number(word) is None and word.partition(":")[0] not in MAKERS


def check_field_word(subject: str, word: str) -> None:
    """A field is given by a number, by a maker, or by a file that is there.

    Raises:
        InputError: If it is none of them.

    Example:
        >>> check_field_word("angle", "wave:20")
    """
    if is_file(word) and not os.path.exists(word):
        close = difflib.get_close_matches(word.partition(":")[0], MAKERS, n=1)
        raise InputError(
            subject, f"must be a number, one of the makers {', '.join(MAKERS)}, or a picture file",
            f"it is {checks.shortened(word)}, and there is no such file",
            f"did you mean {close[0]!r}?" if close else "check the path",
        )  # fmt: skip


def parse_size(text: str) -> Shape:
    """Height and width from ``HxW``.

    Raises:
        InputError: If the text does not look like that.

    Example:
        >>> parse_size("192x256")
        (192, 256)
    """
    match = re.fullmatch(r"([+-]?\d{1,100})[xX]([+-]?\d{1,100})", text.strip())
    if match is None:
        raise InputError(
            "size", "must be HxW, height and width in pixels", f"it is {checks.shortened(text)}",
            "write e.g. 256x256",
        )  # fmt: skip
    return int(match[1]), int(match[2])


def controls_from(
    pictures: Mapping[str, Picture], words: Mapping[str, str], channels: int, size: Shape
) -> Controls:
    """Put together what was asked for.

    Args:
        pictures: The files that were read: ``initial``, ``target``, ``target_region``, ``angle``, ``scale``.
        words: Fields given without a file.
        channels: Of the exemplar.
        size: Of the output.

    Raises:
        InputError: If something does not fit.

    Example:
        >>> controls_from({}, {"angle": "45"}, 3, (8, 8)).angle
        45.0
    """
    target, region = _target(pictures, channels)
    fields: dict[str, Tensor | float]
    fields = {name: parse_field(name, word, size) for name, word in words.items()}
    fields |= {name: field_picture(name, pictures[name]) for name in FIELDS if name in pictures}
    initial = pictures["initial"].image if "initial" in pictures else None
    angle, scale = fields.get("angle"), fields.get("scale")
    return Controls(initial=initial, target=target, target_region=region, angle=angle, scale=scale)


def parse_field(subject: str, word: str, size: Shape) -> Tensor | float:
    """A field from a number, or from a maker with its arguments, as in ``wave:30,2``.

    Args:
        subject: What it is called, for messages.
        word: The number or maker.
        size: Of the output.

    Raises:
        InputError: If the maker takes other arguments.

    Example:
        >>> parse_field("scale", "constant:2", (1, 2)).tolist()
        [[2.0, 2.0]]
    """
    number = _number(word)
    if number is not None:
        return number
    name, _, rest = word.partition(":")
    maker = MAKERS[name]
    arguments = [_number(one) for one in rest.split(",")] if rest else []
    try:
        if None in arguments:
            raise TypeError
        inspect.signature(maker).bind(size, *arguments)
    except TypeError:
        wanted = ",".join(list(inspect.signature(maker).parameters)[1:])
        raise InputError(
            subject, f"{name!r} takes the numbers {wanted}", f"it is given {checks.shortened(rest)}",
            f"write {name}:{wanted} with numbers",
        ) from None  # fmt: skip
    made: Tensor = maker(size, *arguments)
    return made


def field_picture(subject: str, picture: Picture) -> Tensor:
    """A field from a picture: float files hold the numbers themselves, others a share of the range.

    Args:
        subject: ``angle`` (black 0, white 360 degrees) or ``scale`` (black 1/4, middle 1, white 4).
        picture: A gray one.

    Raises:
        InputError: If it has colors.

    Example:
        >>> import torch
        >>> field_picture("angle", Picture(torch.tensor([[[0.0, 0.5]]]), "8-bit", "")).tolist()
        [[0.0, 180.0]]
    """
    if len(picture.image) != 1:
        raise InputError(
            subject, "a field's picture must be gray", f"it has {len(picture.image)} channels",
            "convert it to one channel",
        )  # fmt: skip
    values = picture.image[0].double()
    if picture.depth == "float":
        return values
    return values * 360 if subject == "angle" else 4 ** (2 * values - 1)


def _target(pictures: Mapping[str, Picture], channels: int) -> tuple[Tensor | None, Tensor | None]:
    """The target and its painted region, which its alpha channel or a file of its own may mark."""
    if "target" not in pictures:
        if "target_region" in pictures:
            raise InputError(
                "target region", "must come with a target", "there is none", "give --target as well"
            )
        return None, None
    target = pictures["target"].image
    painted = None
    if len(target) == channels + 1 and len(target) in (2, 4):
        target, painted = target[:-1], target[-1] > _OPAQUE
    if "target_region" in pictures:
        if painted is not None:
            raise InputError(
                "target region", "must be marked once", "the target has an alpha channel and a region file",
                "drop one of them",
            )  # fmt: skip
        painted = white(pictures["target_region"])
    if painted is not None:
        checks.check_region(painted, (target.shape[1], target.shape[2]), "target region")
    return target, painted


def white(picture: Picture) -> Tensor:
    """Where a picture is white rather than black; its alpha channel does not count.

    Example:
        >>> import torch
        >>> white(Picture(torch.tensor([[[0.0, 1.0]]]), "8-bit", "")).tolist()
        [[False, True]]
    """
    image = picture.image
    colors = image[:-1] if len(image) in (2, 4) else image
    return colors.mean(0) > _OPAQUE


def hole_word(image: Tensor, word: str) -> tuple[Tensor, Region]:
    """A picture and its hole, where a word says what marks it.

    Args:
        image: ``(C, H, W)``.
        word: ``alpha`` for the pixels that are more transparent than opaque; or a color, ``#rrggbb``.

    Returns:
        The picture, without its alpha channel if that marks the hole; and the hole.

    Raises:
        InputError: If there is no alpha channel, or the word is neither.

    Example:
        >>> import torch
        >>> hole_word(torch.tensor([[[0.0, 1.0]]]), "#ffffff")[1].tolist()
        [[False, True]]
    """
    if word == "alpha":
        if len(image) not in (2, 4):
            raise InputError(
                "hole", "can be the alpha channel of a picture that has one", f"it has {len(image)} channel(s)",
                "give a mask file, or a color such as #ff00ff",
            )  # fmt: skip
        return image[:-1], image[-1] < _OPAQUE
    match = re.fullmatch(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})", word)
    if match is None:
        raise InputError(
            "hole", "must be a picture file, the word alpha, or a color #rrggbb",
            f"it is {checks.shortened(word)}, and there is no such file", "check the path",
        )  # fmt: skip
    color = torch.tensor([int(digits, 16) for digits in match.groups()])
    steps = (image * 255).round()
    colors = steps[:3] if len(image) in (3, 4) else steps[:1].expand(3, -1, -1)
    return image, (colors == color.view(3, 1, 1)).all(0)


def grays_of(picture: Picture) -> int:
    """How many pixels of a mask are neither black nor white.

    Example:
        >>> import torch
        >>> grays_of(Picture(torch.tensor([[[0.0, 0.3, 1.0]]]), "8-bit", ""))
        1
    """
    image = picture.image
    colors = (image[:-1] if len(image) in (2, 4) else image).mean(0)
    return int(((colors > 0) & (colors < 1)).sum())


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
