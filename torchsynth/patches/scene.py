"""The picture that graph cuts put together, and where a further patch fits it.

The picture lies on a torus. One with borders has a margin there that is as wide as a patch and stays
empty, so that patches may stick out: nothing else tells the two apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Complex128, Float64, Int64
from torch import Tensor

from torchsynth._typing import Region
from torchsynth.canvas import UNSET, Canvas
from torchsynth.lattice import Shape
from torchsynth.patches.matching import fast_length, pick
from torchsynth.patches.seam import OLD, Graph, Neighbors, Shown, Sources, seam_cost

# Chances of places are rounded to so many steps, so that they are the same on every machine.
_CHANCES = 2**20


def domain(shape: Shape, boundary: str, patch: Shape) -> Shape:
    """The size of the torus that an output lies on.

    Example:
        >>> domain((20, 20), "open", (8, 6)), domain((20, 20), "torus", (8, 6))
        ((27, 25), (20, 20))
    """
    if boundary == "torus":
        return shape
    return fast_length(shape[0] + patch[0] - 1), fast_length(shape[1] + patch[1] - 1)


@dataclass(frozen=True)
class Patch:
    """A piece of the exemplar, ready to be compared with all places of a torus.

    Args:
        origin: Row and column of its first pixel in the exemplar.
        there: Which of its pixels may be used.
        values: Its colors, in whole numbers.
        here: The transform of ``there``.
        colors: That of each channel, where it is there.
        squares: That of the sum of the channels' squares, where it is there.
    """

    origin: tuple[int, int]
    there: Region
    values: Float64[Tensor, "channels height width"]
    here: Complex128[Tensor, "rows columns"]
    colors: Complex128[Tensor, "channels rows columns"]
    squares: Complex128[Tensor, "rows columns"]

    @classmethod
    def of(
        cls, picture: Float64[Tensor, "channels _h _w"], valid: Region, origin: tuple[int, int], size: Shape, torus: Shape
    ) -> Patch:  # fmt: skip
        """Cut a patch of some size out of an exemplar."""
        rows, columns = (slice(start, start + side) for start, side in zip(origin, size, strict=True))
        values, there = picture[:, rows, columns], valid[rows, columns]
        inside = values * there
        transforms = (
            torch.fft.rfft2(one, s=torus) for one in (there.double(), inside, inside.square().sum(0))
        )
        return cls(origin, there, values, *transforms)


@dataclass
class Scene:
    """One output as it grows; its tensors are written in place.

    Args:
        canvas: The canvas of this output alone.
        sources: The exemplar.
        size: Height and width of the torus.
        wanted: Which of its pixels belong to the output.
        known: Which of these are covered.
        shown: Their colors and sources.
    """

    canvas: Canvas
    sources: Sources
    size: Shape
    wanted: Bool[Tensor, " positions"]
    known: Bool[Tensor, " positions"]
    shown: Shown

    @classmethod
    def of(cls, canvas: Canvas, sources: Sources, size: Shape) -> Scene:
        """An output that nothing is known of."""
        wanted = torch.zeros(size, dtype=torch.bool, device=canvas.source.device)
        wanted[: canvas.shape[0], : canvas.shape[1]] = True
        wanted = wanted.flatten()
        colors = torch.zeros(len(sources.colors), len(wanted), dtype=torch.float64, device=wanted.device)
        shown = Shown(colors, torch.full_like(wanted, UNSET, dtype=torch.int64))
        return cls(canvas, sources, size, wanted, torch.zeros_like(wanted), shown)

    def compare(
        self, patch: Patch, pixels: Bool[Tensor, " positions"]
    ) -> tuple[Float64[Tensor, " positions"], Float64[Tensor, " positions"]]:
        """The sum of squared differences to some pixels, wherever on the torus the patch begins.

        Returns:
            The sums, and how many pixels of the patch each of them counts.
        """
        counted = pixels.view(self.size).double()
        colors = self.shown.colors.unflatten(1, self.size) * counted
        here, pull = torch.fft.rfft2(counted), torch.fft.rfft2(colors)
        spectrum = patch.here.conj() * torch.fft.rfft2(colors.square().sum(0))
        spectrum = spectrum - 2 * (patch.colors.conj() * pull).sum(0) + patch.squares.conj() * here
        return self._back(spectrum), self._back(patch.here.conj() * here)

    def count(self, patch: Patch, pixels: Bool[Tensor, " positions"]) -> Float64[Tensor, " positions"]:
        """How many of some pixels a patch covers, wherever on the torus it begins."""
        return self._back(patch.here.conj() * torch.fft.rfft2(pixels.view(self.size).double()))

    def _back(self, spectrum: Tensor) -> Float64[Tensor, " positions"]:
        sums: Tensor = torch.fft.irfft2(spectrum, s=self.size)
        return sums.round().flatten()

    def lay(self, patch: Patch, place: int, cost: float) -> int:
        """Lay a patch on the scene, cut where it shows least; returns how many pixels it covered first.

        Args:
            patch: The patch.
            place: Flat position on the torus of its first pixel.
            cost: Noted for the pixels that show it.
        """
        cells = self.cells(place, (patch.there.shape[0], patch.there.shape[1]))
        covered = torch.zeros_like(self.known)
        covered[cells[patch.there]] = True
        covered &= self.wanted
        fresh = covered & ~self.known
        colors = torch.zeros_like(self.shown.colors)
        colors[:, cells] = patch.values
        new = fresh | self._preferred(cells, covered, fresh, colors)
        source = torch.zeros_like(self.shown.source)
        height, width = patch.there.shape
        steps = torch.arange(max(height, width), device=cells.device)
        rows, columns = patch.origin[0] + steps[:height], patch.origin[1] + steps[:width]
        source[cells] = rows.unsqueeze(1) * self.sources.shape[1] + columns
        sites = new.nonzero().squeeze(1)
        self.shown.colors[:, sites] = colors[:, sites]
        self.shown.source[sites] = source[sites]
        self.known |= fresh
        self._write(sites, source[sites], cost)
        return int(fresh.sum())

    def _preferred(self, cells: Tensor, covered: Tensor, fresh: Tensor, new: Tensor) -> Tensor:
        """Where the patch is to be shown, of what is there already."""
        overlap = covered & self.known
        # What borders on the old picture outside of the patch stays, and what borders on new pixels goes.
        stays = overlap & self._beside(self.known & ~covered)
        goes = overlap & ~stays & self._beside(fresh)
        free = overlap & ~stays & ~goes
        node = torch.where(goes, 1, 0) + torch.where(free, free.cumsum(0) + 1, 0)
        pairs = [
            Neighbors(0, cells[:-1].flatten(), cells[1:].flatten()).among(overlap),
            Neighbors(1, cells[:, :-1].flatten(), cells[:, 1:].flatten()).among(overlap),
        ]
        side, _ = Graph.of(node, pairs, self.shown, new, self.sources).cut()
        return overlap & side[node]

    def _beside(self, pixels: Bool[Tensor, " positions"]) -> Bool[Tensor, " positions"]:
        grid = pixels.view(self.size)
        return (grid.roll(1, 0) | grid.roll(-1, 0) | grid.roll(1, 1) | grid.roll(-1, 1)).flatten()

    def _write(self, sites: Tensor, source: Tensor, cost: float) -> None:
        width = self.canvas.shape[1]
        positions = sites // self.size[1] * width + sites % self.size[1]
        self.canvas.write(positions, source.unsqueeze(0))
        self.canvas.write_cost(positions, torch.full_like(self.canvas.cost[:, positions], cost))
        self.canvas.known[positions] = True

    def cells(self, place: int, size: Shape) -> Int64[Tensor, "height width"]:
        """The flat positions on the torus under a window that begins somewhere."""
        rows, columns = (
            (start + torch.arange(side, device=self.known.device)) % whole
            for start, side, whole in zip(divmod(place, self.size[1]), size, self.size, strict=True)
        )
        return rows.unsqueeze(1) * self.size[1] + columns

    def seams(self) -> Int64[Tensor, " positions"]:
        """What the seams to the right of each pixel and below it cost."""
        total = torch.zeros_like(self.shown.source)
        grid = torch.arange(len(total), device=total.device).view(self.size)
        for axis in (0, 1):
            pairs = Neighbors(axis, grid.flatten(), grid.roll(-1, axis).flatten()).among(self.known)
            one, other, broken = self.shown.patches(pairs, self.sources)
            total[pairs.first] += seam_cost(one, other) * broken
        return total


def place_by_chance(
    mean: Float64[Tensor, " positions"], allowed: Bool[Tensor, " positions"], spread: float, draw: int
) -> int:
    """A place of small cost C: one with the chance ``exp(-C / spread)``.

    Args:
        mean: The cost of each place.
        allowed: Which of them are considered.
        spread: How much more than the best a place may cost to be still likely.
        draw: A random number below 2**31.

    Source: Kwatra et al. 2003, section 4.

    Example:
        >>> mean = torch.tensor([9.0, 1.0, 1.0]).double()
        >>> place_by_chance(mean, torch.tensor([True, False, True]), 0.5, 2**30)
        2
    """
    excess = (mean - mean[allowed].min()).masked_fill(~allowed, math.inf)
    chances = torch.exp(-excess / spread) if spread > 0 else (excess == 0).double()
    steps = (_CHANCES * chances).round().long()
    return int(pick(steps.unsqueeze(0), torch.tensor([[draw]], device=steps.device)))


assert OLD == 0, "pixels that are tied to nothing else have the old picture's node"  # noqa: S101
