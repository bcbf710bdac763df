"""Graph-cut textures: large patches laid where they fit, and cut along the seams that show least."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import torch
from pydantic import Field
from torch import Tensor

from torchsynth.canvas import Canvas
from torchsynth.errors import InputError
from torchsynth.lattice import Boundary, Shape
from torchsynth.neighborhood import STEPS, Plane
from torchsynth.part import Part
from torchsynth.patches.layout import Shape4
from torchsynth.patches.matching import DRAW_BITS, Matcher, check_exact, largest_squares
from torchsynth.patches.scene import Patch, Scene, domain, place_by_chance
from torchsynth.patches.seam import Sources, check_available

# What SciPy, transforms and flows take, however small the pictures are.
_BUFFERS = 2**26

# The regions that refinements mend have so large a share of a patch's side.
_REGION = 3


class GraphCut(Part):
    """Lay patches on the output until it is covered, and further ones over its worst seams.

    Args:
        patch: Side of the patches in pixels; None means the whole exemplar. Visible effect: smaller patches
            repeat less, and hold less of the texture together; they are cut faster.
        overlap: Share of a patch that has to lie on what is covered already. Visible effect: more of it
            finds better seams, with more patches and in more time.
        k: How choosy patches are about their place: one whose mean squared difference to what it overlaps
            is C has a chance that goes with exp(-C / (k s^2)), with s the exemplar's standard
            deviation. Visible effect: small values take the best place, large ones vary more.
        refinements: How many further patches are laid over the worst seams. Visible effect: they mend what
            fits badly, as long as something fits better.

    Source:
        V. Kwatra, A. Schoedl, I. Essa, G. Turk and A. Bobick, *Graphcut textures: image and video synthesis
        using graph cuts*, SIGGRAPH 2003.

    Example:
        >>> GraphCut().refinements
        12
    """

    kind: Literal["graphcut"] = "graphcut"
    patch: Annotated[int, Field(ge=3)] | None = None
    overlap: Annotated[float, Field(gt=0, le=0.9)] = 0.25
    k: Annotated[float, Field(gt=0, le=100)] = 0.01
    refinements: Annotated[int, Field(ge=0, le=10_000)] = 12

    @property
    def follows_target(self) -> bool:
        """Whether it needs a target."""
        return False

    @property
    def sweeps(self) -> int:
        """How often it goes over the output: to cover it, and to mend it."""
        return 2 if self.refinements else 1

    def size(self, exemplar: Shape, shape: Shape, boundary: Boundary) -> Shape:
        """Height and width of the patches.

        On a torus they are a pixel smaller than the output: where a patch met itself, nothing could be cut.

        Example:
            >>> GraphCut(patch=32).size((64, 24), (128, 128), "open"), GraphCut().size((64, 24), (40, 40), "torus")
            ((32, 24), (39, 24))
        """
        sides = [min(side, self.patch or side) for side in exemplar]
        if boundary == "torus":
            sides = [max(1, min(side, around - 1)) for side, around in zip(sides, shape, strict=True)]
        return sides[0], sides[1]

    def check(self, plane: Plane, shape: Shape, boundary: Boundary) -> None:
        """Whether there are patches, and what cuts them.

        Args:
            plane: The exemplar's matching side.
            shape: Height and width of the output.
            boundary: ``open`` or ``torus``.

        Raises:
            InputError: If SciPy is missing, if patches are larger than the exemplar, or if none may be copied.
        """
        check_available()
        if self.patch is not None and min(plane.shape) < self.patch:
            raise InputError(
                "exemplar", f"must hold a patch of {self.patch}x{self.patch}",
                f"it is only {plane.shape[0]}x{plane.shape[1]}", "use smaller patches or a larger exemplar",
            )  # fmt: skip
        size = self.size(plane.shape, shape, boundary)
        period = domain(shape, boundary, size)
        check_exact(period, math.sqrt(math.prod(shape)), largest_squares(size, plane.values.shape[2]))
        if size != plane.shape and plane.valid is not None and not bool(Matcher.of(plane).places(size).any()):
            raise InputError(
                "what may be sampled", f"must hold a whole patch of {size[0]}x{size[1]}",
                "none lies inside it", "mark a larger region, or set a smaller 'patch'",
            )  # fmt: skip

    def memory(self, exemplars: Shape4, shape: Shape, boundary: Boundary, outputs: int) -> int:  # noqa: ARG002
        """About how many bytes it takes at its peak, beside the canvas: for one output after the other.

        Args:
            exemplars: Their number, channels, height and width.
            shape: Height and width of the output.
            boundary: ``open`` or ``torus``.
            outputs: Not needed here.
        """
        _, channels, height, width = exemplars
        size = self.size((height, width), shape, boundary)
        output = math.prod(domain(shape, boundary, size)) * (channels * 100 + 200)
        # Its transforms, and its colors in float64, more than once.
        exemplar = height * width * (channels + 1) * 48
        return output + exemplar + math.prod(size) * 600 + _BUFFERS

    def write(
        self, canvas: Canvas, generators: Sequence[torch.Generator], advance: Callable[[int, int], None]
    ) -> None:
        """Cover a canvas.

        Args:
            canvas: It is written, patch by patch.
            generators: One for each output; each is advanced by two draws for each patch.
            advance: Told how many pixels are done, and whether in covering (0) or mending (1).
        """
        for number, generator in enumerate(generators):
            collage = _Collage.on(canvas.sample(number), self, generator)
            while not bool((collage.scene.known | ~collage.scene.wanted).all()):
                advance(collage.cover(), 0)
            pixels = math.prod(canvas.shape)
            for turn in range(self.refinements):
                collage.mend()
                advance((turn + 1) * pixels // self.refinements - turn * pixels // self.refinements, 1)
        canvas.known[:-1] = True


@dataclass
class _Collage:
    """One output: the scene, and the patches that were laid on it, by where they put the exemplar."""

    scene: Scene
    part: GraphCut
    size: Shape
    matcher: Matcher
    picture: Tensor
    spread: float
    generator: torch.Generator
    laid: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.mended = torch.zeros_like(self.scene.known)
        self.whole: Patch | None = None

    @classmethod
    def on(cls, canvas: Canvas, part: GraphCut, generator: torch.Generator) -> _Collage:
        """Begin with nothing."""
        plane = canvas.exemplar_plane
        colors = plane.values[0].double().T
        valid = torch.ones(colors.shape[1], dtype=torch.bool, device=colors.device)
        if plane.valid is not None:
            valid = plane.valid.flatten().to(colors.device)
        boundary = canvas.plane.boundary
        size = part.size(plane.shape, canvas.shape, boundary)
        scene = Scene.of(canvas, Sources(colors, plane.shape, valid), domain(canvas.shape, boundary, size))
        usable = colors[:, valid]
        # From whole sums, which are the same in whatever order.
        variance = float((usable.shape[1] * usable.square().sum(1) - usable.sum(1).square()).sum())
        spread = part.k * variance / (usable.shape[1] ** 2 * len(colors))
        picture = colors.unflatten(1, plane.shape)
        return cls(scene, part, size, Matcher.of(plane), picture, spread, generator)

    def cover(self) -> int:
        """Lay a patch that covers something new; returns how many pixels."""
        scene, (patch, draw) = self.scene, self._patch()
        new = scene.count(patch, scene.wanted & ~scene.known)
        costs, known = scene.compare(patch, scene.known)
        enough = known >= self.part.overlap * int(patch.there.sum())
        allowed = next(
            some for some in ((new > 0) & enough, (new > 0) & (known > 0), new > 0) if bool(some.any())
        )
        # Otherwise the best places would be those that add next to nothing.
        allowed &= 2 * new >= new[allowed].max()
        return self._lay(patch, costs / known.clamp(min=1), allowed, draw)

    def mend(self) -> None:
        """Lay a patch over the worst seams, if there are any."""
        scene, (patch, draw) = self.scene, self._patch()
        region = self._worst()
        if region is None:
            return
        costs, known = scene.compare(patch, region)
        allowed = known == int(region.sum())
        for laid in self.laid:
            # The same patch at the same place would change nothing.
            row, column = (
                (one + start) % side for one, start, side in zip(laid, patch.origin, scene.size, strict=True)
            )
            allowed[row * scene.size[1] + column] = False
        if bool(allowed.any()):
            self._lay(patch, costs / known.clamp(min=1), allowed, draw)

    def _patch(self) -> tuple[Patch, int]:
        """The next patch, and a random number for its place."""
        first, second = torch.randint(2**DRAW_BITS, (2,), generator=self.generator).tolist()
        valid = self.scene.sources.valid.view(self.scene.sources.shape)
        if self.size == self.scene.sources.shape:
            self.whole = self.whole or Patch.of(self.picture, valid, (0, 0), self.size, self.scene.size)
            return self.whole, second
        places = self.matcher.places(self.size).nonzero()
        row, column = places[(first * len(places)) >> DRAW_BITS].tolist()
        return Patch.of(self.picture, valid, (row, column), self.size, self.scene.size), second

    def _lay(self, patch: Patch, mean: Tensor, allowed: Tensor, draw: int) -> int:
        channels = len(self.picture)
        place = place_by_chance(mean / channels, allowed, self.spread, draw)
        row, column = divmod(place, self.scene.size[1])
        self.laid.append((row - patch.origin[0], column - patch.origin[1]))
        return self.scene.lay(patch, place, float(mean[place]) / (channels * STEPS**2))

    def _worst(self) -> Tensor | None:
        """The window of the output whose seams cost most, of those that were not mended yet; None if none do."""
        scene = self.scene
        costs = scene.seams()
        if not bool((costs.masked_fill(self.mended, 0) > 0).any()):
            self.mended[:] = False
        costs = costs.masked_fill(self.mended, 0).view(scene.size)
        if not bool((costs > 0).any()):
            return None
        sides = [
            max(1, min(-(-side // _REGION), whole))
            for side, whole in zip(self.size, scene.canvas.shape, strict=True)
        ]
        sums = _window_sums(costs, (sides[0], sides[1]))
        if scene.canvas.plane.boundary == "open":
            sums[scene.canvas.shape[0] - sides[0] + 1 :] = 0
            sums[:, scene.canvas.shape[1] - sides[1] + 1 :] = 0
        place = int(sums.flatten().argmax())
        region = torch.zeros_like(scene.known)
        region[scene.cells(place, (sides[0], sides[1])).flatten()] = True
        self.mended |= region
        return region


def _window_sums(costs: Tensor, size: Shape) -> Tensor:
    """The sum over the window that begins at each pixel of a torus."""
    for axis, side in enumerate(size):
        around = torch.cat((costs, costs.narrow(axis, 0, side)), dim=axis).cumsum(axis)
        upto = torch.cat((torch.zeros_like(around.narrow(axis, 0, 1)), around), dim=axis)
        length = costs.shape[axis]
        costs = upto.narrow(axis, side, length) - upto.narrow(axis, 0, length)
    return costs
