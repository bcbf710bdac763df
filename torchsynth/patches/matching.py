"""How well a partly known block fits every place of the exemplar, exactly and at once.

The weighted squared difference between a block and the exemplar at place p is ``sum w x^2 - 2 sum w q x +
sum w q^2``, with x the exemplar's values around p. Its first two sums are correlations, made for all places
together by fast Fourier transforms. All numbers are whole; a transform in float64 is off by less than one
half as long as :func:`check_exact` holds, so rounding gives the very sums: they do not depend on batch
sizes, threads or machines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from torchsynth._typing import Draws, Region
from torchsynth.errors import InputError
from torchsynth.lattice import Shape
from torchsynth.neighborhood import STEPS, Plane
from torchsynth.search.base import MEMORY_BUDGET

DRAW_BITS = 31
"""Random numbers that choose a place are whole, from 0 to 2**31 - 1."""

# Whole numbers of matching reach from -128 to 127.
_LARGEST = (STEPS + 1) // 2


@dataclass(frozen=True)
class Query:
    """Blocks as they should be: what is wanted of each pixel, and how much it counts.

    Args:
        weights: Whole numbers, 0 where nothing is wanted; one for all outputs.
        values: Whole numbers from -128 to 127.
    """

    weights: Float64[Tensor, "height width"]
    values: Float64[Tensor, "batch channels height width"]


@dataclass(frozen=True)
class Match:
    """What was found for each output.

    Args:
        site: The flat position in the exemplar of the block's first pixel.
        cost: The weighted sum of squared differences there.
    """

    site: Int64[Tensor, " batch"]
    cost: Float64[Tensor, " batch"]


@dataclass(frozen=True)
class Matcher:
    """An exemplar, or one for each output, ready to be compared with blocks of any size.

    Args:
        shape: Height and width of the exemplar.
        valid: Where it may be used; None means everywhere.
        period: The size of the transforms.
        colors: The transform of every channel.
        squares: The transform of the sum of the channels' squares.
    """

    shape: Shape
    valid: Region | None
    period: Shape
    colors: Tensor
    squares: Tensor

    @classmethod
    def of(cls, plane: Plane) -> Matcher:
        """Transform an exemplar's matching side.

        Example:
            >>> matcher = Matcher.of(Plane(torch.zeros(1, 35, 3), (5, 7), "open"))
            >>> matcher.period
            (5, 8)
        """
        height, width = plane.shape
        picture = plane.values.double().transpose(1, 2).unflatten(2, (height, width))
        period = fast_length(height), fast_length(width)
        colors = torch.fft.rfft2(picture, s=period)
        squares = torch.fft.rfft2(picture.square().sum(1), s=period)
        return cls(plane.shape, plane.valid, period, colors, squares)

    def places(self, block: Shape) -> Bool[Tensor, "rows columns"]:
        """Where a block of the given size lies inside the exemplar, and on valid pixels only."""
        rows, columns = (side - one + 1 for side, one in zip(self.shape, block, strict=True))
        if self.valid is None:
            return torch.ones(rows, columns, dtype=torch.bool, device=self.colors.device)
        missing = (~self.valid).long().cumsum(0).cumsum(1)
        corner = torch.nn.functional.pad(missing, (1, 0, 1, 0))
        height, width = block
        inside = corner[height:, width:] - corner[:-height, width:] - corner[height:, :-width]
        return (inside + corner[:-height, :-width] == 0).to(self.colors.device)

    def costs(
        self, queries: Sequence[Query], outputs: slice = slice(None)
    ) -> Float64[Tensor, "_batch _rows _columns"]:
        """The weighted sum of squared differences between blocks and the exemplar, at every place.

        Args:
            queries: What is compared with the same places; their costs are added up.
            outputs: Which of the outputs.

        Example:
            >>> picture = torch.tensor([[[3.0], [5.0], [9.0]]])
            >>> query = Query(torch.ones(1, 2).double(), torch.tensor([[[[5.0, 8.0]]]]).double())
            >>> Matcher.of(Plane(picture, (1, 3), "open")).costs([query]).tolist()
            [[[13.0, 1.0]]]
        """
        height, width = queries[0].weights.shape
        own = slice(None) if len(self.colors) == 1 else outputs
        found, constant = torch.zeros(()).to(self.squares), torch.zeros(()).to(queries[0].values)
        for query in queries:
            wanted = query.values[outputs]
            pull = torch.fft.rfft2(query.weights * wanted, s=self.period).conj()
            found = found + torch.fft.rfft2(query.weights, s=self.period).conj() * self.squares[own]
            found = found - 2 * (pull * self.colors[own]).sum(1)
            constant = constant + (query.weights * wanted.square()).sum((1, 2, 3))
        sums: Tensor = torch.fft.irfft2(found, s=self.period).round()
        sums = sums[:, : self.shape[0] - height + 1, : self.shape[1] - width + 1]
        return sums + constant.view(-1, 1, 1)

    def choose(self, queries: Sequence[Query], draws: Draws, tolerance: float, *, verbatim: bool) -> Match:
        """A random one of the places that fit nearly best, for every output.

        Args:
            queries: What is compared.
            draws: One random number for each output, ``(B, 1)``, below 2**31.
            tolerance: How much worse than the best a place may fit, as a share.
            verbatim: Whether a perfect match leaves no choice; see :func:`near_best`.
        """
        block = queries[0].weights.shape
        places = self.places((block[0], block[1]))
        found = []
        for outputs in self._chunks(len(draws)):
            costs = self.costs(queries, outputs).masked_fill(~places, math.inf).flatten(1)
            near = near_best(costs, tolerance, verbatim=verbatim)
            place = pick(near.long(), draws[outputs])
            found.append((place, costs.gather(1, place.unsqueeze(1)).squeeze(1)))
        place, cost = (torch.cat(parts) for parts in zip(*found, strict=True))
        columns = places.shape[1]
        return Match(place // columns * self.shape[1] + place % columns, cost)

    def _chunks(self, outputs: int) -> list[slice]:
        """Some outputs at a time, so that their transforms fit the memory budget."""
        size = max(1, MEMORY_BUDGET // matching_bytes(self.period, self.colors.shape[1]))
        return [slice(start, min(start + size, outputs)) for start in range(0, outputs, size)]


def near_best(
    costs: Float64[Tensor, "batch places"], tolerance: float, *, verbatim: bool
) -> Bool[Tensor, "batch places"]:
    """The places that fit nearly best: their cost is at most ``(1 + tolerance)`` times the smallest.

    A block cut out of the exemplar continues perfectly where it was taken from. If that left no choice,
    whole regions would be copied verbatim: so the smallest cost above 0 counts, and perfect places stand
    beside those near it; unless ``verbatim`` takes 0 for what it is.

    Example:
        >>> costs = torch.tensor([[9.0, 10.0, 0.0, 10.2]]).double()
        >>> near_best(costs, 0.125, verbatim=False).tolist(), near_best(costs, 0.125, verbatim=True).tolist()
        ([[True, True, True, False]], [[False, False, True, False]])
    """
    counted = costs if verbatim else costs.masked_fill(costs == 0, math.inf)
    smallest = counted.amin(1, keepdim=True)
    limit = torch.where(smallest.isinf(), 0.0, (1.0 + tolerance) * smallest)
    return (costs <= limit) & costs.isfinite()


def pick(chances: Int64[Tensor, "batch places"], draws: Draws) -> Int64[Tensor, " batch"]:
    """One place for each output, with the chances given, by one random number below 2**31.

    Example:
        >>> pick(torch.tensor([[0, 1, 0, 3]]), torch.tensor([[2**29]])).tolist()
        [3]
    """
    upto = chances.cumsum(1)
    # In two steps, since a product of both may need more than 63 bits.
    high, low = upto[:, -1:] >> DRAW_BITS, upto[:, -1:] & (2**DRAW_BITS - 1)
    mark = high * draws + ((low * draws) >> DRAW_BITS)
    return torch.searchsorted(upto, mark, right=True).squeeze(1)


def check_exact(period: Shape, weights: float, squares: float) -> None:
    """Transforms of whole numbers must be off by less than one half.

    A correlation of a and b by transforms of N numbers is off by at most about ``c u log2(N) norm(a) norm(b)``, with u
    the rounding unit of float64 and c a small constant, here taken as 16; both norms are Euclidean.

    Args:
        period: The size of the transforms.
        weights: The largest possible norm on the block's side.
        squares: The largest possible norm on the exemplar's side.

    Raises:
        InputError: If they could be off by more than a quarter.

    Example:
        >>> check_exact((128, 128), weights=36.0, squares=2.0**14 * 128)
    """
    error = 16 * 2.0**-53 * math.log2(math.prod(period) + 1) * weights * squares
    if error > 0.25:
        raise InputError(
            "exemplar", "must be small enough for exact matching of patches",
            f"at {period[0]}x{period[1]} pixels sums could be off by {error:.1g}",
            "use a smaller exemplar or smaller patches",
        )  # fmt: skip


def largest_squares(shape: Shape, channels: int) -> float:
    """The largest possible norm of the sums of squares of an exemplar's pixels.

    Example:
        >>> largest_squares((3, 3), 1)
        49152.0
    """
    return math.sqrt(math.prod(shape)) * channels * _LARGEST**2


def matching_bytes(period: Shape, channels: int) -> int:
    """About how much one output takes while it is compared.

    Example:
        >>> matching_bytes((8, 8), 1)
        4096
    """
    return math.prod(period) * (32 * channels + 32)


def fast_length(length: int) -> int:
    """The next whole number without prime factors above 5: transforms of such lengths are fast.

    Example:
        >>> [fast_length(length) for length in (1, 7, 97, 128)]
        [1, 8, 100, 128]
    """
    most = length.bit_length()
    odd: list[int] = [3**threes * 5**fives for threes in range(most + 1) for fives in range(most + 1)]
    return min(one << (-(-length // one) - 1).bit_length() for one in odd)
