"""All measures at once: of some outputs, against the exemplar they were made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias, get_args

import torch
from jaxtyping import Float64
from torch import Tensor

from torchsynth._typing import Image, SourceMap
from torchsynth.checks import check_image, check_type
from torchsynth.errors import InputError
from torchsynth.lattice import Boundary, Shape
from torchsynth.metrics.copying import (
    copied,
    coverage,
    matched_windows,
    repetition,
    run_length,
    source_windows,
)
from torchsynth.metrics.seams import seam_ratio
from torchsynth.metrics.sharpness import gradient_distance, sharpness
from torchsynth.metrics.statistics import PATCH, patch_distances

Row: TypeAlias = dict[str, float | list[float] | None]
"""The measures of one output as plain numbers, for tables and JSON."""

SMALLEST_SIDE = 2 * PATCH
"""What can be measured has to have so many pixels: half an exemplar holds a patch."""

# A map may leave so much of the contrast unexplained: seams that are blurred leave less, another picture more.
_UNEXPLAINED = 0.9
_SLACK = 2 / 255


@dataclass(frozen=True)
class Measures:
    """What was measured: one number for each output, or a row of them.

    Args:
        patch_distance: See :func:`patch_distance`; 1 is as close as two real crops.
        patch_distances: The same at each level, the finest first.
        sharpness: See :func:`sharpness`; 1 is as sharp as the exemplar.
        gradient_distance: See :func:`gradient_distance`; 0 is the same distribution.
        copied: See :func:`copied`; 0 is nothing that comes back as it is.
        repetition: See :func:`repetition`; 0 is nothing that comes twice.
        run_length: See :func:`run_length`, in pixels; None without a source map.
        coverage: See :func:`coverage`; 1 is all of the exemplar. None without a source map.
        seam: See :func:`seam_ratio`, top to bottom and left to right; 1 is a seam that cannot be seen.

    Example:
        >>> exemplar = torch.rand(3, 32, 32)
        >>> measure(exemplar, exemplar).patch_distances.tolist()
        [[0.0]]
    """

    patch_distance: Float64[Tensor, " batch"]
    patch_distances: Float64[Tensor, "batch levels"]
    sharpness: Float64[Tensor, " batch"]
    gradient_distance: Float64[Tensor, " batch"]
    copied: Float64[Tensor, " batch"]
    repetition: Float64[Tensor, " batch"]
    run_length: Float64[Tensor, " batch"] | None
    coverage: Float64[Tensor, " batch"] | None
    seam: Float64[Tensor, "batch 2"]

    def rows(self) -> list[Row]:
        """The measures of each output, by name; all numbers are finite.

        Example:
            >>> exemplar = torch.rand(3, 32, 32)
            >>> measure(exemplar, exemplar).rows()[0]["sharpness"]
            1.0
        """
        columns = {one.name: getattr(self, one.name) for one in fields(self)}
        return [
            {name: None if column is None else column[item].tolist() for name, column in columns.items()}
            for item in range(len(self.copied))
        ]


def measure(
    image: Tensor, exemplar: Tensor, source: Tensor | None = None, *, boundary: Boundary = "open"
) -> Measures:
    """Measure outputs against their exemplar.

    Args:
        image: The outputs, ``(C, H, W)`` or ``(B, C, H, W)``, 14x14 or larger.
        exemplar: The exemplar of all of them, or one for each, of as many channels.
        source: Their source maps, ``(2, OH, OW)`` or ``(B, 2, OH, OW)``. Without it copies are looked for in
            the pictures, which finds fewer of some and more of others (see :func:`matched_windows`), and
            ``run_length`` and ``coverage`` are None.
        boundary: That of the outputs: on a ``torus``, runs go on beyond the border.

    Raises:
        InputError: If the pictures are too small or do not go together, if the source map does not belong
            to them, or if there is no such boundary.

    Example:
        >>> import torch, torchsynth as ts
        >>> exemplar = torch.rand(1, 24, 24)
        >>> result = ts.synthesize(exemplar, (20, 20), ts.recipes.ashikhmin())
        >>> found = measure(result.image, exemplar, result.source)
        >>> found.patch_distance.shape, found.run_length.item() > 1
        (torch.Size([1]), True)
    """
    check_pictures(image, exemplar, ("image", "exemplar"))
    if boundary not in get_args(Boundary):
        raise InputError(
            "boundary", f"must be one of {', '.join(get_args(Boundary))}", f"it is {boundary!r}",
            "pass that of the recipe",
        )  # fmt: skip
    images, exemplars = (one if one.ndim == 4 else one.unsqueeze(0) for one in (image, exemplar))
    if source is None:
        return _measured(images, exemplars, None, matched_windows(images, exemplars), boundary)
    check_type(source, Tensor, "source", "pass result.source")
    check_sources(source, images, exemplars, "source")
    sources = source if source.ndim == 4 else source.unsqueeze(0)
    return _measured(images, exemplars, sources, source_windows(sources), boundary)


def check_pictures(image: Tensor, exemplar: Tensor, subjects: tuple[str, str]) -> None:
    """Pictures can be compared if both are large enough and have the same channels.

    Args:
        image: The outputs.
        exemplar: The exemplar.
        subjects: How messages call the two.

    Raises:
        InputError: If they cannot.

    Example:
        >>> check_pictures(torch.zeros(3, 20, 20), torch.zeros(3, 16, 16), ("image", "exemplar"))
    """
    for one, subject in zip((image, exemplar), subjects, strict=True):
        check_image(one, subject)
        height, width = one.shape[-2:]
        if min(height, width) < SMALLEST_SIDE:
            raise InputError(
                subject, f"must have at least {SMALLEST_SIDE} pixels a side to be measured",
                f"it is {height}x{width}", "measure a larger picture",
            )  # fmt: skip
    channels, wanted = image.shape[-3], exemplar.shape[-3]
    if channels != wanted:
        raise InputError(
            subjects[0], f"must have as many channels as the exemplar, {wanted}", f"it has {channels}",
            "convert one of them",
        )  # fmt: skip
    outputs, exemplars = (len(one) if one.ndim == 4 else 1 for one in (image, exemplar))
    if exemplars not in (1, outputs):
        raise InputError(
            subjects[1], f"must be one picture, or {outputs}: one for each output",
            f"there are {exemplars}", "pass one exemplar",
        )  # fmt: skip


def check_sources(source: Tensor, image: Image, exemplar: Image, subject: str) -> None:
    """A source map belongs to a picture if it leads to about its colors.

    Not to exactly the same: seams may have been blurred, and JPEG changes all pixels.

    Args:
        source: The source map.
        image: The outputs.
        exemplar: The exemplar of all of them, or one for each.
        subject: How messages call the source map.

    Raises:
        InputError: If it does not.

    Example:
        >>> check_sources(torch.zeros(1, 2, 4, 4).long(), torch.ones(1, 1, 4, 4), torch.ones(1, 1, 1, 1), "map")
    """
    maps = _as_maps(source, subject)
    if len(maps) != len(image) or maps.shape[2:] != image.shape[2:]:
        raise InputError(
            subject, f"must have the size of the output, {_sized(image.shape)}",
            f"it has {_sized(maps.shape)}", "pass the source map that was written with it",
        )  # fmt: skip
    height, width = exemplar.shape[2:]
    least, most = maps.amin((0, 2, 3)).tolist(), maps.amax((0, 2, 3)).tolist()
    half = (maps < 0).any(1) & ~(maps == -1).all(1)
    if most[0] >= height or most[1] >= width or min(least) < -1 or bool(half.any()):
        raise InputError(
            subject, f"must lead into the exemplar, {height}x{width}, or be -1",
            f"it reaches from {least[0]}, {least[1]} to {most[0]}, {most[1]}",
            "pass the exemplar that the output was made from",
        )  # fmt: skip
    for item, one in enumerate(maps):
        _check_colors(one, image[item], exemplar[item if len(exemplar) > 1 else 0], subject)


def _as_maps(source: Tensor, subject: str) -> Tensor:
    if source.dtype != torch.int64:
        raise InputError(subject, "must be int64", f"its dtype is {source.dtype}", "convert it with .long()")
    if source.ndim not in (3, 4) or source.shape[-3] != 2:
        raise InputError(
            subject, "must have shape (2, OH, OW) or (B, 2, OH, OW)", f"its shape is {tuple(source.shape)}",
            "pass rows and columns of the exemplar",
        )  # fmt: skip
    return source if source.ndim == 4 else source.unsqueeze(0)


def _check_colors(source: Tensor, image: Tensor, exemplar: Tensor, subject: str) -> None:
    copied_from = source[0] >= 0
    rows, columns = source[:, copied_from]
    wanted, found = exemplar.double()[:, rows, columns], image.double()[:, copied_from]
    if not wanted.numel():
        return
    contrast = (wanted - wanted.mean(1, keepdim=True)).abs().mean()
    apart = (found - wanted).abs().mean()
    if apart > _UNEXPLAINED * contrast + _SLACK:
        raise InputError(
            subject, "must lead to the colors of the output",
            f"they differ by {apart:.2f} in the mean", "pass the map, the output and the exemplar of one run",
        )  # fmt: skip


def _measured(
    image: Image, exemplar: Image, source: SourceMap | None, windows: Tensor, boundary: Boundary
) -> Measures:
    levels = patch_distances(image, exemplar)
    height, width = exemplar.shape[2:]
    return Measures(
        patch_distance=levels.mean(1),
        patch_distances=levels,
        sharpness=sharpness(image, exemplar),
        gradient_distance=gradient_distance(image, exemplar),
        copied=copied(windows),
        repetition=repetition(windows),
        run_length=None if source is None else run_length(source, boundary),
        coverage=None if source is None else coverage(source, (height, width)),
        seam=seam_ratio(image),
    )


def _sized(shape: Sequence[int] | Shape) -> str:
    """A batch of maps or pictures, as an error says it."""
    outputs = f"{shape[0]} outputs of " if shape[0] > 1 else ""
    return f"{outputs}{shape[-2]}x{shape[-1]}"
