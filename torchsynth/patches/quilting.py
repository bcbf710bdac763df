"""Image quilting: overlapping blocks of the exemplar, cut where they differ least."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

import torch
from jaxtyping import Bool
from pydantic import Field, model_validator
from torch import Tensor

from torchsynth.canvas import Canvas
from torchsynth.errors import InputError
from torchsynth.lattice import Boundary, Shape
from torchsynth.neighborhood import STEPS, Plane
from torchsynth.part import Part
from torchsynth.patches.cut import beyond_cuts
from torchsynth.patches.layout import Shape4, Spot, number_of_blocks, spots
from torchsynth.patches.matching import (
    DRAW_BITS,
    Match,
    Matcher,
    Query,
    check_exact,
    fast_length,
    largest_squares,
    matching_bytes,
)
from torchsynth.search.base import MEMORY_BUDGET

Advance: TypeAlias = Callable[[int, int], None]
"""``(pixels, sweep)``: so many more output pixels are done, in the pass of that number."""

# How much overlap and target count is expressed in so many steps.
_SHARES = 1000


class Quilting(Part):
    """Cover the output with square blocks that overlap, each one a random one of those that fit.

    Args:
        block: Side of the blocks in pixels. Visible effect: it should hold the texture's structures; larger
            blocks copy more of the exemplar verbatim.
        overlap: How far neighbors overlap; less than half a block. None means a sixth of the block. Visible
            effect: wider overlaps fit better and take longer.
        tolerance: How much worse than the best a block may fit, as a share of the best one's error. Visible
            effect: larger values repeat less and show more seams.
        verbatim: Whether a block that fits perfectly leaves no choice, as the paper has it. Every block has
            such a continuation, where it was taken from, so that whole regions are copied. Otherwise
            perfect blocks stand beside those that are nearly as good as the best imperfect one.
        passes: Follow a target, in so many passes, each with blocks a third smaller than the one before:
            texture transfer. None follows none.

    Source:
        A. Efros and W. Freeman, *Image quilting for texture synthesis and transfer*, SIGGRAPH 2001:
        section 2 for synthesis, section 3 for transfer.

    Example:
        >>> Quilting(block=36).sides(), Quilting(block=36, passes=3).sides()
        (((36, 6),), ((36, 6), (24, 4), (16, 3)))
    """

    kind: Literal["quilting"] = "quilting"
    block: Annotated[int, Field(ge=3)] = 36
    overlap: Annotated[int, Field(ge=1)] | None = None
    tolerance: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.1
    verbatim: bool = False
    passes: Annotated[int, Field(ge=1, le=20)] | None = None

    @model_validator(mode="after")
    def _cuts_do_not_meet(self) -> Quilting:
        if self.overlap is not None and 2 * self.overlap >= self.block:
            raise ValueError(
                f"blocks overlap by less than half their side, but {self.overlap} is too much for {self.block}"
            )
        if self.sides()[-1][0] < 3:
            raise ValueError(
                f"blocks have a side of 3 pixels or more, but in the last of {self.passes} passes they are "
                f"down to {self.sides()[-1][0]}"
            )
        return self

    @property
    def follows_target(self) -> bool:
        """Whether it needs a target."""
        return self.passes is not None

    @property
    def sweeps(self) -> int:
        """How often it goes over the output."""
        return self.passes or 1

    def sides(self) -> tuple[tuple[int, int], ...]:
        """Side and overlap of the blocks of each pass."""
        sides = [round(self.block * (2 / 3) ** number) for number in range(self.sweeps)]
        wanted = self.overlap or self.block / 6
        return tuple((side, max(1, round(side * wanted / self.block))) for side in sides)

    def check(self, plane: Plane, shape: Shape, boundary: Boundary) -> None:
        """Whether blocks fit the exemplar and the output.

        Args:
            plane: The exemplar's matching side.
            shape: Height and width of the output.
            boundary: ``open`` or ``torus``.

        Raises:
            InputError: If there is no block that may be copied, or if it would overlap itself.
        """
        block = (self.block, self.block)
        if min(plane.shape) < self.block:
            raise InputError(
                "exemplar", f"must hold a block of {self.block}x{self.block}",
                f"it is only {plane.shape[0]}x{plane.shape[1]}", "use smaller blocks or a larger exemplar",
            )  # fmt: skip
        if boundary == "torus" and min(shape) < self.block:
            raise InputError(
                "size", f"must hold a block of {self.block}x{self.block} if the output is to tile",
                f"it is {shape[0]}x{shape[1]}", "use smaller blocks, a larger size, or the boundary 'open'",
            )  # fmt: skip
        period = fast_length(plane.shape[0]), fast_length(plane.shape[1])
        weights = float(self.block * (_SHARES if self.follows_target else 1))
        check_exact(period, weights, largest_squares(plane.shape, plane.values.shape[2]))
        if plane.valid is not None and not bool(Matcher.of(plane).places(block).any()):
            raise InputError(
                "what may be sampled", f"must hold a whole block of {self.block}x{self.block}",
                "none lies inside it", "mark a larger region, or use smaller blocks",
            )  # fmt: skip

    def memory(self, exemplars: Shape4, shape: Shape, boundary: Boundary, outputs: int) -> int:  # noqa: ARG002
        """About how many bytes it takes at its peak, beside the canvas.

        Args:
            exemplars: Their number, channels, height and width.
            shape: Height and width of the output.
            boundary: Not needed here.
            outputs: How many outputs.
        """
        number, channels, height, width = exemplars
        period = fast_length(height), fast_length(width)
        kept = number * math.prod(period) * (channels + 1) * 16
        blocks = outputs * self.block**2 * (channels * 60 + 100)
        return kept + blocks + MEMORY_BUDGET + 2 * matching_bytes(period, channels)

    def write(self, canvas: Canvas, generators: Sequence[torch.Generator], advance: Advance) -> None:
        """Cover a canvas.

        Args:
            canvas: It is written, block by block; it may hold a target.
            generators: One for each output; each is advanced by one draw for each block.
            advance: Told after each block.
        """
        matcher = Matcher.of(canvas.exemplar_plane)
        boundary = canvas.plane.boundary
        for number, (block, overlap) in enumerate(self.sides()):
            quilt = _Quilt(canvas, matcher, block, self.shares(number), number)
            blocks = number_of_blocks(canvas.shape, boundary, block, overlap)
            draws = torch.stack([torch.randint(2**DRAW_BITS, (blocks,), generator=one) for one in generators])
            draws = draws.to(canvas.source.device)
            for spot in spots(canvas.shape, boundary, block, overlap, draws.device):
                queries = list(quilt.queries(spot))
                draw = draws[:, spot.number, None]
                match = matcher.choose(queries, draw, self.tolerance, verbatim=self.verbatim)
                advance(quilt.lay(spot, queries, match), number)

    def shares(self, number: int) -> tuple[int, int]:
        """How much the overlap and the target count in a pass, in thousandths.

        Source: Efros & Freeman 2001, section 3: ``0.8 (i - 1) / (N - 1) + 0.1`` for the overlap.

        Example:
            >>> [Quilting(passes=3).shares(number) for number in range(3)]
            [(100, 900), (500, 500), (900, 100)]
        """
        if self.passes is None:
            return 1, 0
        alpha = round(_SHARES * (0.8 * number / max(1, self.passes - 1) + 0.1))
        return alpha, _SHARES - alpha


@dataclass
class _Quilt:
    """One pass over a canvas.

    ``shares`` is how much overlap and target count, and ``number`` which pass it is.
    """

    canvas: Canvas
    matcher: Matcher
    block: int
    shares: tuple[int, int]
    number: int

    def __post_init__(self) -> None:
        self.laid = torch.zeros_like(self.canvas.known)

    def queries(self, spot: Spot) -> Iterator[Query]:
        """What a block should look like: as what it overlaps, as the pass before, and as the target."""
        overlap, follow = self.shares
        # From the second pass on, blocks are compared with all of what the pass before left, too.
        compared = self.laid[spot.positions] if self.number == 0 else spot.inside
        yield Query(self._square(overlap * compared.double()), self._values(self.canvas.plane, spot))
        target = self.canvas.target
        if target is not None:
            painted = spot.inside
            if target.valid is not None:
                painted = torch.nn.functional.pad(target.valid.flatten(), (0, 1))[spot.positions]
            yield Query(self._square(follow * painted.double()), self._values(target, spot))

    def lay(self, spot: Spot, queries: Sequence[Query], match: Match) -> int:
        """Show the blocks that were found beyond their cuts; returns how many pixels this newly covered."""
        canvas = self.canvas
        width = canvas.exemplar.shape[-1]
        steps = torch.arange(self.block, device=match.site.device)
        source = match.site.unsqueeze(1) + (steps.unsqueeze(1) * width + steps).flatten()
        new = self._beyond(spot, queries[0].values, source)
        sites = spot.positions[spot.inside]
        fresh = int((~self.laid[sites]).sum())
        kept = ~new[:, spot.inside]
        canvas.write(sites, torch.where(kept, canvas.source[:, sites], source[:, spot.inside]))
        weight = (
            sum(float(query.weights.sum()) for query in queries) * canvas.plane.values.shape[2] * STEPS**2
        )
        cost = (match.cost / max(1.0, weight)).unsqueeze(1).to(canvas.cost)
        canvas.write_cost(sites, torch.where(kept, canvas.cost[:, sites], cost))
        canvas.known[sites] = True
        self.laid[sites] = True
        return fresh * len(source)

    def _beyond(self, spot: Spot, there: Tensor, source: Tensor) -> Bool[Tensor, "batch pixels"]:
        plane = self.canvas.exemplar_plane
        outputs = torch.arange(len(source), device=source.device).unsqueeze(1) % len(plane.values)
        found = plane.values[outputs, source].double().transpose(1, 2).unflatten(2, (self.block, self.block))
        # Outside of the output it costs nothing to cut.
        error = (found - there).square().sum(1) * self._square(spot.inside.double())
        return beyond_cuts(error, spot.overlaps).flatten(1)

    def _square(self, pixels: Tensor) -> Tensor:
        return pixels.view(*pixels.shape[:-1], self.block, self.block)

    def _values(self, plane: Plane, spot: Spot) -> Tensor:
        return self._square(plane.values[:, spot.positions].double().transpose(1, 2).contiguous())
