"""What the scripts beside this file ask of their arguments, and how they say what is wrong with one.

The functions that read one argument are meant for the ``type`` of :meth:`argparse.ArgumentParser.add_argument`,
so that everything is checked before any work. All complaints are one line, and end the script with code 2.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import torchsynth as ts
from torchsynth.checks import check_size
from torchsynth.wishes import parse_size


def size(text: str) -> tuple[int, int]:
    """Height and width, from ``HxW``."""
    try:
        return check_size(parse_size(text))
    except ts.InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """What reads a whole number of at least, and perhaps at most, so much."""

    def read(text: str) -> int:
        wanted = f"at least {least}" if most is None else f"from {least} to {most}"
        try:
            number = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"must be a whole number {wanted}, but it is {text!r}") from None
        if number < least or (most is not None and number > most):
            raise argparse.ArgumentTypeError(f"must be {wanted}, but it is {number}")
        return number

    return read


def file_to_write(text: str) -> Path:
    """A file in a folder that is there: hours of measuring should not end with a folder that is not."""
    path = Path(text)
    if path.is_dir() or not path.parent.is_dir():
        fact = "is a folder" if path.is_dir() else f"is in a folder that does not exist, {path.parent}"
        raise argparse.ArgumentTypeError(f"must be a file that can be written, but {path} {fact}")
    return path


@contextmanager
def one_line_errors(parser: argparse.ArgumentParser) -> Iterator[None]:
    """Turn what the library or the file system refuses into one line, in place of a traceback."""
    try:
        yield
    except (ts.TorchsynthError, OSError) as error:
        parser.exit(2, f"{parser.prog}: error: {' '.join(str(error).splitlines())}\n")
