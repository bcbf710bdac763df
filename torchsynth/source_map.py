"""Source maps in files: what ``--source-map`` writes."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
import torch
from jaxtyping import Int64
from numpy.typing import NDArray
from torch import Tensor

from torchsynth._typing import SourceMap
from torchsynth.errors import InputError
from torchsynth.io import reason
from torchsynth.lattice import Shape

# What NumPy and zipfile raise, according to which byte is wrong.
_DAMAGED = (ValueError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, MemoryError)
_ARRAYS = {"source": 3, "exemplar_size": 1}  # and how many dimensions they have


def read_source_map(path: Path) -> tuple[SourceMap, Shape]:
    """Read where each pixel of an output was copied from.

    Args:
        path: An ``.npz`` file that ``torchsynth synthesize --source-map`` wrote.

    Returns:
        The map, ``(1, 2, OH, OW)``, and height and width of the exemplar.

    Raises:
        InputError: If the file is missing, damaged, or no such file.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder, "map.npz")
        ...     np.savez(path, source=np.zeros((2, 3, 4), np.int32), exemplar_size=np.array([5, 6], np.int32))
        ...     source, size = read_source_map(path)
        >>> source.shape, size
        (torch.Size([1, 2, 3, 4]), (5, 6))
    """
    try:
        with path.open("rb") as file:
            arrays = _arrays(file)
    except OSError as error:
        raise InputError(str(path), "must be a readable .npz file", reason(error), "check the path") from None
    except _DAMAGED:
        raise _wrong(path, "it is damaged, or another kind of file") from None
    for name, dimensions in _ARRAYS.items():
        if name not in arrays:
            raise _wrong(path, f"it holds no {name!r}")
        if arrays[name].ndim != dimensions or arrays[name].dtype.kind not in "iu" or not arrays[name].size:
            raise _wrong(path, f"its {name!r} has shape {arrays[name].shape} and dtype {arrays[name].dtype}")
    source, size = (torch.from_numpy(arrays[name].astype(np.int64)) for name in _ARRAYS)
    if len(source) != 2 or len(size) != 2:
        raise _wrong(path, f"its arrays have shapes {tuple(source.shape)} and {tuple(size.shape)}")
    return source.unsqueeze(0), (int(size[0]), int(size[1]))


def encode_source_map(source: Int64[Tensor, "2 height width"], exemplar_size: Shape) -> bytes:
    """The bytes of a file that :func:`read_source_map` reads.

    Args:
        source: The map of one output.
        exemplar_size: Height and width of the exemplar.

    Example:
        >>> encode_source_map(torch.zeros(2, 3, 4, dtype=torch.int64), (5, 6))[:2]
        b'PK'
    """
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        source=source.cpu().numpy().astype(np.int32),
        exemplar_size=np.array(exemplar_size, dtype=np.int32),
    )
    return buffer.getvalue()


def _arrays(file: BinaryIO) -> dict[str, NDArray[np.generic]]:
    loaded = np.load(file, allow_pickle=False)
    if not isinstance(loaded, np.lib.npyio.NpzFile):
        return {}
    return {name: loaded[name] for name in _ARRAYS if name in loaded.files}


def _wrong(path: Path, fact: str) -> InputError:
    return InputError(
        str(path), "must be a source map, as 'synthesize --source-map' writes it", fact, "write it again"
    )
