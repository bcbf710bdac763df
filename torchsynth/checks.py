"""What the library accepts: one check for each noun, all of them before any work starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from numbers import Integral, Real
from typing import SupportsFloat, TypeGuard

import torch
from torch import Tensor

from torchsynth.errors import InputError

# torch's CPU generator keeps 32 bits of a seed: more would promise textures that do not differ.
_MAX_SEED = 2**32
_LINE = 60


def check_type(value: object, kind: type, subject: str, remedy: str) -> None:
    """A value is an instance of a class of this library.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_type(3, int, "number", "pass a number")
    """
    if not isinstance(value, kind):
        raise InputError(subject, f"must be a {kind.__name__}", f"it is {value!r}", remedy)


def check_image(image: object, subject: str) -> None:
    """An image is a float tensor ``(C, H, W)`` or ``(B, C, H, W)``, finite, in [0, 1], not empty.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_image(torch.zeros(3, 8, 8), "exemplar")
    """
    if not isinstance(image, Tensor):
        raise InputError(
            subject, "must be a torch.Tensor", f"it is a {type(image).__name__}",
            "read files with torchsynth.read_image, convert arrays with torch.from_numpy",
        )  # fmt: skip
    if image.dtype not in (torch.float32, torch.float64):
        raise InputError(
            subject, "must be float32 or float64 in [0, 1]", f"its dtype is {_name(image.dtype)}",
            "convert it first, e.g. image.float() / 255 for 8-bit values",
        )  # fmt: skip
    if image.ndim not in (3, 4):
        raise InputError(
            subject, "must have shape (C, H, W) or (B, C, H, W)",
            f"its shape is {tuple(image.shape)}", "add or drop dimensions: channels come first",
        )  # fmt: skip
    if image.numel() == 0:
        raise InputError(
            subject, "must have at least one pixel", f"its shape is {tuple(image.shape)}",
            "pass a picture that is not empty",
        )  # fmt: skip
    _check_values(image, subject)


def check_region(region: object, shape: tuple[int, int], subject: str) -> None:
    """A region is a boolean tensor of the image's height and width with at least one True.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_region(torch.ones(4, 5, dtype=torch.bool), (4, 5), "valid")
    """
    if not isinstance(region, Tensor) or region.dtype != torch.bool:
        fact = _name(region.dtype) if isinstance(region, Tensor) else type(region).__name__
        raise InputError(
            subject, "must be a boolean tensor", f"it is {fact}", "compare it, e.g. picture > 0.5"
        )
    if tuple(region.shape) != shape:
        raise InputError(
            subject, f"must have the image's shape {shape}",
            f"its shape is {tuple(region.shape)}", "crop or resize it to the image",
        )  # fmt: skip
    if not bool(region.any()):
        raise InputError(
            subject, "must be True somewhere", "it is False everywhere", "mark the usable part True"
        )


def check_aligned(picture: Tensor, other: Tensor, subject: str, name: str) -> None:
    """A picture lies upon another: same height and width, and one for all of a batch, or one for each.

    Raises:
        InputError: If it does not.

    Example:
        >>> check_aligned(torch.zeros(3, 4, 5), torch.zeros(1, 4, 5), "guide", "the exemplar")
    """
    if picture.shape[-2:] != other.shape[-2:]:
        raise InputError(
            subject, f"must have the height and width of {name}, {tuple(other.shape[-2:])}",
            f"its shape is {tuple(picture.shape)}", "crop or resize one of them",
        )  # fmt: skip
    pictures, others = (len(one) if one.ndim == 4 else 1 for one in (picture, other))
    if pictures not in (1, others):
        raise InputError(
            subject, f"must be one picture, or {others}: one for each of the batch",
            f"there are {pictures}", "pass one for all of them",
        )  # fmt: skip


def check_target_region(region: object, target: Tensor | None) -> None:
    """A painted region is a boolean tensor of the target's height and width, somewhere True.

    Raises:
        InputError: If it is not, or if there is no target.

    Example:
        >>> check_target_region(torch.ones(4, 5, dtype=torch.bool), torch.zeros(3, 4, 5))
    """
    if region is None:
        return
    if target is None:
        raise InputError(
            "target_region", "must come with the target it is a part of", "there is no target",
            "pass both",
        )  # fmt: skip
    height, width = target.shape[-2:]
    check_region(region, (height, width), "target_region")


def check_hole(hole: object, picture: Tensor | None, subject: str = "hole") -> None:
    """A hole is a boolean ``(H, W)`` that covers some of a picture, but not all of it.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_hole(torch.tensor([[True, False]]), torch.zeros(1, 1, 2))
    """
    if hole is None:
        return
    if picture is None:
        raise InputError(
            subject, "must come with the picture it is in", "there is none", "pass 'initial', too"
        )
    if isinstance(hole, Tensor) and hole.dtype == torch.bool and not bool(hole.any()):
        raise InputError(subject, "must mark something", "it marks nothing", "mark what is to be filled")
    check_region(hole, (picture.shape[-2], picture.shape[-1]), subject)
    if isinstance(hole, Tensor) and bool(hole.all()):
        raise InputError(
            subject, "must leave something of the picture", "it covers all of it",
            "mark less, or synthesize a new picture from another one",
        )  # fmt: skip


def check_place(place: object, subject: str) -> None:
    """A place is a pair of whole numbers, row and column.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_place((0, -3), "at")
    """
    if not isinstance(place, tuple | list) or len(place) != 2 or not all(map(_is_whole, place)):
        raise InputError(
            subject, "must be a row and a column, two whole numbers", f"it is {shortened(place)}",
            "write e.g. (0, 64)",
        )  # fmt: skip


def check_positive(number: object, subject: str) -> None:
    """A number of pixels is a whole number from 1.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_positive(3, "width")
    """
    if not _is_whole(number) or number < 1:
        raise InputError(
            subject, "must be a whole number of pixels, 1 or more", f"it is {shortened(number)}",
            "choose another one",
        )  # fmt: skip


def check_field(field: object, subject: str, bounds: tuple[float, float] | None) -> None:
    """A field is a number, or a tensor ``(H, W)`` of numbers: finite, and within its bounds.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_field(45.0, "angle", None)
    """
    if field is None:
        return
    values = torch.tensor(_as_float(field), dtype=torch.float64) if _is_number(field) else field
    if not isinstance(values, Tensor) or values.dtype == torch.bool or values.is_complex():
        raise InputError(
            subject, "must be a number, or a tensor (H, W) of numbers", f"it is {shortened(field)}",
            "pass one number, or one for each output pixel",
        )  # fmt: skip
    if values.ndim not in (0, 2) or (values.ndim == 0 and isinstance(field, Tensor)) or not values.numel():
        raise InputError(
            subject, "must have shape (H, W)", f"its shape is {tuple(values.shape)}",
            "pass one number for each output pixel",
        )  # fmt: skip
    values = values.double()
    if not bool(values.isfinite().all()):
        raise InputError(
            subject, "must be finite", f"{int((~values.isfinite()).sum())} of its values are NaN or infinite",
            "replace them",
        )  # fmt: skip
    low, high = values.min().item(), values.max().item()
    if bounds is not None and not bounds[0] <= low <= high <= bounds[1]:
        raise InputError(
            subject, f"must lie from {bounds[0]:g} to {bounds[1]:g}",
            f"it is {low:g}" if low == high else f"it reaches from {low:g} to {high:g}",
            "1 keeps the size, 2 doubles it",
        )  # fmt: skip


def check_size(size: object) -> tuple[int, int]:
    """A size is two whole numbers, height and width, each at least 1.

    Raises:
        InputError: If it is not.

    Example:
        >>> check_size((64, 96))
        (64, 96)
    """
    sides = tuple(size) if isinstance(size, Sequence) and not isinstance(size, str) else ()
    whole = [side for side in sides if _is_whole(side)]
    if len(sides) != 2 or len(whole) != 2:
        raise InputError(
            "size", "must be two whole numbers, height and width", f"it is {shortened(size)}",
            "pass e.g. size=(256, 256)",
        )  # fmt: skip
    if min(whole) < 1:
        raise InputError(
            "size", "height and width must be at least 1 pixel", f"they are {whole[0]}x{whole[1]}",
            "ask for at least 1x1",
        )  # fmt: skip
    return int(whole[0]), int(whole[1])


def check_seeds(seed: object, outputs: int | None) -> list[int]:
    """A seed is a whole number from 0 to 2**32 - 1, or a list of them: one for each output.

    Args:
        seed: The seed or seeds. One number stands for ``seed, seed + 1, ...`` where there are several
            outputs.
        outputs: How many outputs there have to be; None if the seeds decide it.

    Raises:
        InputError: If a seed is out of range or there are too many or too few.

    Example:
        >>> check_seeds(7, 3)
        [7, 8, 9]
    """
    several = isinstance(seed, Sequence) and not isinstance(seed, str)
    seeds = list(seed) if isinstance(seed, Sequence) and several else [seed]
    if not seeds:
        raise InputError("seed", "must name at least one output", "the list is empty", "pass a number")
    if outputs is not None and not several and _is_whole(seed):
        seeds = [seed + item for item in range(outputs)]
    for one in seeds:
        if not _is_whole(one) or not 0 <= one < _MAX_SEED:
            raise InputError(
                "seed", "must be a whole number from 0 to 2**32 - 1, or a list of such numbers",
                f"{'one' if len(seeds) > 1 else 'it'} is {shortened(one)}",
                "pass e.g. seed=0",
            )  # fmt: skip
    if outputs is not None and len(seeds) != outputs:
        raise InputError(
            "seed", f"a batch of {outputs} exemplars needs {outputs} seeds",
            f"there are {len(seeds)}", "pass one seed for each exemplar, or a single number",
        )  # fmt: skip
    return [int(one) for one in seeds if _is_whole(one)]


def shortened(value: object, show: Callable[[object], str] = repr) -> str:
    """A value as an error message shows it: on one line, and not a page of it.

    Args:
        value: The value.
        show: How it becomes text.

    Example:
        >>> shortened("a" * 1000)
        "'aaaaaaaaaaaaaaaaaaaaaaaaaaaaa...aaaaaaaaaaaaaaaaaaaaaaaaaaaaa'"
    """
    text = " ".join(show(value).split())
    return text if len(text) <= _LINE else f"{text[: _LINE // 2]}...{text[-_LINE // 2 :]}"


def _is_whole(value: object) -> TypeGuard[int]:
    # NumPy's integers are welcome; True is not a number of pixels.
    return isinstance(value, Integral) and not isinstance(value, bool)


def _as_float(number: SupportsFloat) -> float:
    try:
        return float(number)
    except OverflowError:
        return float("inf")


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool)


def _check_values(image: Tensor, subject: str) -> None:
    finite = image.isfinite()
    if not bool(finite.all()):
        raise InputError(
            subject, "must be finite", f"{int((~finite).sum())} of its values are NaN or infinite",
            "replace them, e.g. with torch.nan_to_num",
        )  # fmt: skip
    low, high = image.min().item(), image.max().item()
    if low < 0 or high > 1:
        raise InputError(
            subject, "values must lie in [0, 1]", f"they reach from {low:g} to {high:g}",
            "rescale them, e.g. divide 8-bit values by 255",
        )  # fmt: skip


def _name(dtype: torch.dtype) -> str:
    return str(dtype).removeprefix("torch.")
