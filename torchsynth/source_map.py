"""Source maps in files: what ``--source-map`` writes."""

from __future__ import annotations

import hashlib
import io
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from torchsynth._typing import SourceMap
from torchsynth.errors import InputError
from torchsynth.io import reason
from torchsynth.lattice import Shape

# What NumPy and zipfile raise, according to which byte is wrong.
_DAMAGED = (ValueError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, MemoryError)
_ARRAYS = {"source": 3, "exemplar_size": 1}  # and how many dimensions they have


@dataclass(frozen=True)
class SavedSource:
    """A source map from a file.

    Args:
        source: The map, ``(1, 2, OH, OW)``.
        exemplar: Height and width of the exemplar.
        sha256: Of the file's bytes.
    """

    source: SourceMap
    exemplar: Shape
    sha256: str


def read_source_map(path: Path) -> SavedSource:
    """Read where each pixel of an output was copied from.

    Args:
        path: An ``.npz`` file that ``torchsynth synthesize --source-map`` wrote.

    Raises:
        InputError: If the file is missing, damaged, or no such file.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder, "map.npz")
        ...     np.savez(path, source=np.zeros((2, 3, 4), np.int32), exemplar_size=np.array([5, 6], np.int32))
        ...     saved = read_source_map(path)
        >>> saved.source.shape, saved.exemplar
        (torch.Size([1, 2, 3, 4]), (5, 6))
    """
    try:
        data = path.read_bytes()
        arrays = _arrays(io.BytesIO(data))
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
    digest = hashlib.sha256(data).hexdigest()
    return SavedSource(source.unsqueeze(0), (int(size[0]), int(size[1])), digest)


def encode_source_map(source: SourceMap, exemplar: Shape) -> bytes:
    """The content of the file that :func:`read_source_map` reads.

    Args:
        source: The map of one output, ``(1, 2, OH, OW)``.
        exemplar: Height and width of the exemplar.

    Example:
        >>> encode_source_map(torch.zeros(1, 2, 3, 4, dtype=torch.int64), (5, 6))[:2]
        b'PK'
    """
    buffer = io.BytesIO()
    rows_and_columns = source[0].cpu().numpy().astype(np.int32)
    np.savez_compressed(buffer, source=rows_and_columns, exemplar_size=np.array(exemplar, dtype=np.int32))
    return buffer.getvalue()


def _arrays(file: io.BytesIO) -> dict[str, NDArray[np.generic]]:
    loaded = np.load(file, allow_pickle=False)
    if not isinstance(loaded, np.lib.npyio.NpzFile):
        return {}
    return {name: loaded[name] for name in _ARRAYS if name in loaded.files}


def _wrong(path: Path, fact: str) -> InputError:
    return InputError(
        str(path), "must be a source map, as 'synthesize --source-map' writes it", fact, "write it again"
    )
