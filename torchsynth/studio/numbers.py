"""The numbers at the side, as they were typed: checked here, so that the page says in its own words what is wrong.

Gradio would refuse a number beyond limits of its own before anybody here is asked, and round one that is not whole.
"""

from __future__ import annotations

from typing import TypeAlias

from torchsynth.errors import InputError
from torchsynth.lattice import Shape
from torchsynth.studio.work import MOST_PIXELS

Number: TypeAlias = int | float | None
"""What a field for a number holds; None if it is empty."""


def asked_size(height: Number, width: Number) -> Shape:
    """The size in the two fields.

    Raises:
        InputError: If one of them holds no size.

    Example:
        >>> asked_size(128, 12.5)
        Traceback (most recent call last):
        torchsynth.errors.InputError: Width: must be a whole number from 1, but it is 12.5; write e.g. 128
    """
    return _whole("Height", height, 1, 128), _whole("Width", width, 1, 128)


def asked_seed(seed: Number) -> int:
    """The seed in its field.

    Raises:
        InputError: If it holds none.

    Example:
        >>> asked_seed(None)
        Traceback (most recent call last):
        torchsynth.errors.InputError: Seed: must be a whole number from 0, but it is empty; write e.g. 0
    """
    return _whole("Seed", seed, 0, 0)


def paper_size(height: Number, width: Number) -> Shape | None:
    """The size of what is painted on; None while it is still being typed, or if the page makes none so large.

    Example:
        >>> paper_size(48, 64), paper_size(None, 64), paper_size(5000, 5000)
        ((48, 64), None, None)
    """
    try:
        rows, columns = asked_size(height, width)
    except InputError:
        return None
    return (rows, columns) if rows * columns <= MOST_PIXELS else None


def _whole(field: str, given: Number, least: int, example: int) -> int:
    if given is None or given < least or given != given // 1:
        fact = "it is empty" if given is None else f"it is {given}"
        raise InputError(field, f"must be a whole number from {least}", fact, f"write e.g. {example}")
    return int(given)
