"""The built-in samples: small free textures, so that there is something to try things on.

``brick``, ``grass`` and ``gravel`` are crops of the CC0 textures that scikit-image distributes;
``pebbles`` was made by ``scripts/make_samples.py`` of the project's repository. See ``data/ORIGIN.md``.
"""

from __future__ import annotations

import difflib
from importlib.resources import files
from pathlib import Path

from torchsynth.errors import InputError

PREFIX = "sample:"
"""What the path of a built-in sample begins with."""

SAMPLES: dict[str, str] = {
    "brick": "a brick wall, gray (regular)",
    "grass": "grass, gray (stochastic)",
    "gravel": "gravel, gray (irregular objects)",
    "pebbles": "colored pebbles, RGB (irregular objects), computed",
}
"""The samples by name, with one line about each."""


def sample_path(path: str) -> Path | None:
    """The file behind ``sample:NAME``, or None if the path does not begin with ``sample:``.

    Raises:
        InputError: If there is no such sample.

    Example:
        >>> sample_path("sample:grass").name
        'grass.png'
    """
    if not path.startswith(PREFIX):
        return None
    name = path.removeprefix(PREFIX)
    if name not in SAMPLES:
        close = difflib.get_close_matches(name, SAMPLES, n=1)
        raise InputError(
            path, f"must be one of the samples {', '.join(SAMPLES)}", "there is no such sample",
            f"did you mean {PREFIX}{close[0]}?" if close else "list them with 'torchsynth samples'",
        )  # fmt: skip
    return Path(str(files("torchsynth") / "data" / f"{name}.png"))
