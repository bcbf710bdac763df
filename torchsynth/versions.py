"""The versions that decide which bytes come out."""

from __future__ import annotations

import platform
from importlib.metadata import version

_LIBRARIES = ("torchsynth-textures", "torch", "kornia", "numpy")


def versions() -> dict[str, str]:
    """What has to be the same for the same bytes.

    Example:
        >>> sorted(versions())
        ['kornia', 'numpy', 'python', 'torch', 'torchsynth-textures']
    """
    return {name: version(name) for name in _LIBRARIES} | {"python": platform.python_version()}
