"""Copying: how much of the exemplar comes back as it is, how large the pieces are, and how often they come.

What is a copy is told by the source map. Where there is none, pictures are compared with each other: see
:func:`torchsynth.metrics.matched_windows`.
"""

from __future__ import annotations

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from torchsynth._typing import SourceMap
from torchsynth.lattice import Boundary, Shape
from torchsynth.metrics.batches import batch_of
from torchsynth.result import breaks

WINDOW = 11
"""Side of the windows whose copies are counted, in pixels. In outputs of ``ashikhmin`` a tenth to a third of
such windows are copies. In those of ``wei_levoy``, which compares 9x9 pixels, less than one in a hundred is:
smaller windows come back merely because all of their pixels were matched; and of 21x21 pixels there is hardly
one anywhere that is whole."""

_STEPS = 255  # windows of pictures are compared in steps of 8 bits
_FAR = 2**31


def run_length(source: SourceMap, boundary: Boundary = "open") -> Float64[Tensor, " batch"]:
    """How long the pieces are that were copied, in pixels: the mean over pixels and both directions.

    A run is a stretch of a row, or of a column, along which the source goes on. Each pixel counts with the
    length of its run, so the number says what size of piece one looks at when one points at any pixel; many
    single pixels at seams do not hide large patches. 1 means that no pixel goes on with its neighbor.

    It fails where a field turns or scales the output: sources then do not go straight on.

    Args:
        source: The source map; pixels without source (-1) are left out.
        boundary: On a ``torus`` runs go on beyond the border.

    Returns:
        One number for each output; 0 if no pixel has a source.

    Example:
        >>> source = torch.tensor([[[[0, 0, 0, 0]], [[1, 2, 3, 9]]]])
        >>> run_length(source).tolist()  # (3 + 3 + 3 + 1) / 4 along the row, and 1 along the columns
        [1.75]
    """
    copied = source[:, 0] >= 0
    lengths = torch.zeros(copied.shape, dtype=torch.float64, device=source.device)
    for axis, broken in zip((1, 2), breaks(source, boundary), strict=True):
        ends = broken.clone()
        if boundary == "open":
            ends.select(axis, -1).fill_(True)
        lengths += _lengths(ends.movedim(axis, 2)).movedim(2, axis) / 2
    return (lengths * copied).sum((1, 2)) / copied.sum((1, 2)).clamp(min=1)


def coverage(source: SourceMap, exemplar_shape: Shape) -> Float64[Tensor, " batch"]:
    """How much of the exemplar is used, as a share of what so many pixels could use.

    1 means that every pixel of the exemplar is somewhere in the output, or, where the output is smaller, that
    no pixel was copied twice. Pixels drawn at random from an exemplar of the output's size reach 0.63.

    Args:
        source: The source map; pixels without source (-1) are left out.
        exemplar_shape: Height and width that the map refers to.

    Returns:
        One number for each output; 0 if no pixel has a source.

    Example:
        >>> coverage(torch.tensor([[[[0, 0, 0, 0]], [[1, 2, 1, 2]]]]), (1, 8)).tolist()
        [0.5]
    """
    pixels = exemplar_shape[0] * exemplar_shape[1]
    shares = []
    for one in (source[:, 0] * exemplar_shape[1] + source[:, 1]).flatten(1):
        sites = one[one >= 0]
        shares.append(len(sites.unique()) / max(1, min(pixels, len(sites))))
    return torch.tensor(shares, dtype=torch.float64, device=source.device)


def source_windows(source: SourceMap, window: int = WINDOW) -> Int64[Tensor, "batch rows columns"]:
    """Which exemplar window each window of an output was copied from, as one piece.

    Args:
        source: The source map.
        window: The side of the windows; it must fit into the output.

    Returns:
        A number for each place of the window in the output, the same for copies of the same place, and -1
        where it is no copy of one piece.

    Example:
        >>> source_windows(torch.tensor([[[[0, 0, 0], [1, 1, 5]], [[1, 2, 3], [1, 2, 3]]]]), 2).tolist()
        [[[1, -1]]]
    """
    height, width = source.shape[2:]
    rows = torch.arange(height, device=source.device).unsqueeze(1)
    # What stays the same along a piece.
    start = (source[:, 0] - rows + height) * _FAR + source[:, 1] - torch.arange(width, device=source.device)
    kept = [-_largest(-start, window), -_largest(-source[:, 0], window)]
    piece = (_largest(start, window) == kept[0]) & (kept[1] >= 0)
    corner = (source[:, 0] * _FAR + source[:, 1])[:, : piece.shape[1], : piece.shape[2]]
    return torch.where(piece, corner, -1)


def matched_windows(
    image: Tensor, exemplar: Tensor, window: int = WINDOW
) -> Int64[Tensor, "batch rows columns"]:
    """Which window of the exemplar each window of a picture equals, in steps of 8 bits.

    This is for pictures without a source map. Only equal windows count, so JPEG compression or the least
    change of brightness hides all copies; and an exemplar that repeats itself exactly, or a drawing with
    few colors, has copies that nobody made. Windows of one color are never taken for copies.

    Args:
        image: The picture, or a batch of them.
        exemplar: One for all, or one for each.
        window: The side of the windows; it must fit into both.

    Returns:
        A number for each place of the window in the picture, the same for equal ones, and -1 where the
        exemplar has no such window.

    Example:
        >>> matched_windows(torch.tensor([[[[0.1, 0.2, 0.2, 0.9]]]]), torch.tensor([[[[0.2, 0.9]]]]), 1).shape
        torch.Size([1, 1, 4])
    """
    found, exemplars = [], batch_of(exemplar, "exemplar")
    for item, one in enumerate(batch_of(image, "image")):
        other = exemplars[item if len(exemplars) > 1 else 0]
        here, there, flat = _named(one, other, window)
        found.append(torch.where(torch.isin(here, there) & ~flat, here, -1))
    return torch.stack(found)


def copied(windows: Int64[Tensor, "batch rows columns"]) -> Float64[Tensor, " batch"]:
    """The share of an output's windows that are verbatim copies.

    Args:
        windows: From :func:`source_windows` or :func:`matched_windows`.

    Example:
        >>> copied(torch.tensor([[[4, -1, 4, 5]]])).tolist()
        [0.75]
    """
    return (windows >= 0).double().mean((1, 2))


def repetition(windows: Int64[Tensor, "batch rows columns"]) -> Float64[Tensor, " batch"]:
    """The share of an output's windows that are verbatim copies, and of which the output has another one.

    It is never more than :func:`copied`. An output that is larger than the exemplar and made of large pieces
    cannot avoid it.

    Args:
        windows: From :func:`source_windows` or :func:`matched_windows`.

    Example:
        >>> repetition(torch.tensor([[[4, -1, 4, 5]]])).tolist()
        [0.5]
    """
    shares = []
    for one in windows.flatten(1):
        _, names, counts = one[one >= 0].unique(return_inverse=True, return_counts=True)
        shares.append(int((counts[names] > 1).sum()) / len(one))
    return torch.tensor(shares, dtype=torch.float64, device=windows.device)


def _lengths(ends: Tensor) -> Tensor:
    """How long the run of each pixel is, along the last axis, given where runs end.

    Where the last pixel is no end, its run goes on with the first one.
    """
    counts = ends.sum(2, keepdim=True)
    runs = (ends.cumsum(2) - ends.long()) % counts.clamp(min=1)
    ones = torch.ones(ends.shape, dtype=torch.float64, device=ends.device)
    return torch.zeros_like(ones).scatter_add_(2, runs, ones).gather(2, runs)


def _largest(values: Tensor, window: int) -> Tensor:
    return values.unfold(1, window, 1).amax(3).unfold(2, window, 1).amax(3)


def _named(image: Tensor, exemplar: Tensor, window: int) -> tuple[Tensor, Tensor, Tensor]:
    """A number for each window of two pictures, the same for equal ones; and which of the first are flat.

    Windows are named by pairs of smaller ones, which double at each step (Karp, Miller and Rosenberg 1972):
    exact, where hashes could collide.
    """
    both = [(one * _STEPS).round().long() for one in (image, exemplar)]
    names = _renamed([plane.flatten(1).T for plane in both])
    planes = [one.view(plane.shape[1:]) for one, plane in zip(names, both, strict=True)]
    flat = _largest(planes[0][None], window)[0] == -_largest(-planes[0][None], window)[0]
    for axis in (0, 1):
        side = 1
        while side < window:
            step = min(side, window - side)
            planes = _joined(planes, axis, step)
            side += step
    return planes[0], planes[1], flat


def _joined(planes: list[Tensor], axis: int, step: int) -> list[Tensor]:
    """Names for windows that are longer by a step: for pairs of one and the one a step later."""
    pairs = []
    for plane in planes:
        length = plane.shape[axis] - step
        pair = torch.stack((plane.narrow(axis, 0, length), plane.narrow(axis, step, length)), dim=2)
        pairs.append(pair)
    names = _renamed([pair.flatten(0, 1) for pair in pairs])
    return [one.view(pair.shape[:2]) for one, pair in zip(names, pairs, strict=True)]


def _renamed(rows: list[Tensor]) -> list[Tensor]:
    """One number for each row of several tables, the same for equal rows."""
    table = torch.cat(rows)
    names = table[:, 0]
    for column in table.T[1:]:
        # At most as many names as rows, so that a pair of them fits into 63 bits.
        names = (names * (int(column.max()) + 1) + column).unique(return_inverse=True)[1]
    return list(names.split([len(one) for one in rows]))
