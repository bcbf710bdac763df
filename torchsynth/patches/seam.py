"""Seams by graph cut: which pixels of an overlap keep the old picture, and which show the new patch.

Every pixel of the overlap is a node, and a cut between two neighbors costs what a seam there would show.
Where a seam is there already, a node of its own stands between the two pixels and is linked to the new
patch at the cost of the old seam: it is paid for as long as the seam stays, and saved when the new patch
covers it.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from torchsynth.errors import InputError
from torchsynth.lattice import Shape

OLD, NEW = 0, 1
"""The nodes that stand for the old picture and for the new patch."""

# Costs are rounded to whole numbers in such steps.
_SCALE = 64

# The flow through the graph has to fit 32 bits.
_MOST = 2**31 - 1


@dataclass(frozen=True)
class Colors:
    """What two patches show at two neighboring pixels, in whole numbers from -128 to 127.

    Args:
        first: At the first pixel.
        second: At the second.
    """

    first: Float64[Tensor, "channels pairs"]
    second: Float64[Tensor, "channels pairs"]


def seam_cost(one: Colors, other: Colors) -> Int64[Tensor, " pairs"]:
    """What a seam between two neighbors costs if one patch shows the first pixel, another the second.

    The patches' distance at both pixels, over 1 plus the gradients of both patches across the seam, each
    counted for both pixels: seams hide in strong edges. The gradient at a pixel is its difference to
    the other one. What nobody would see costs one step all the same, so that seams do not wander about.

    Source: Kwatra et al. 2003, equations 1 and 4.

    Example:
        >>> flat, step = torch.zeros(1, 1).double(), torch.full((1, 1), 3.0).double()
        >>> seam_cost(Colors(flat, flat), Colors(flat, step)).tolist()
        [27]
    """
    shown = (one.first - other.first).square().sum(0).sqrt() + (one.second - other.second).square().sum(
        0
    ).sqrt()
    slopes = sum(((each.second - each.first).square().sum(0).sqrt() for each in (one, other)), 0 * shown)
    return (_SCALE * shown / (1 + 2 * slopes)).round().clamp(min=1).long()


@dataclass(frozen=True)
class Sources:
    """Where the pixels of a picture come from.

    Args:
        colors: Of the exemplar, by flat position.
        shape: Its height and width.
        valid: Which of its pixels may be used.
    """

    colors: Float64[Tensor, "channels positions"]
    shape: Shape
    valid: Bool[Tensor, " positions"]

    def continued(
        self,
        source: Int64[Tensor, " pairs"],
        axis: int,
        step: int,
        otherwise: Float64[Tensor, "channels pairs"],
    ) -> Float64[Tensor, "channels pairs"]:
        """The color that the patch of a pixel has one step further on.

        Args:
            source: Where the pixels come from.
            axis: 0 for rows, 1 for columns.
            step: 1 or -1.
            otherwise: The color where the exemplar does not go on.
        """
        height, width = self.shape
        place = source // width if axis == 0 else source % width
        inside = (place + step >= 0) & (place + step < (height if axis == 0 else width))
        beside = (source + step * (width if axis == 0 else 1)).clamp(0, height * width - 1)
        return torch.where(inside & self.valid[beside], self.colors[:, beside], otherwise)

    def broken(
        self, first: Int64[Tensor, " pairs"], second: Int64[Tensor, " pairs"], axis: int
    ) -> Bool[Tensor, " pairs"]:
        """Whether two neighbors belong to different patches."""
        width = self.shape[1]
        expected = first + (width if axis == 0 else 1)
        return (second != expected) | ((axis == 1) & (second % width == 0))


@dataclass(frozen=True)
class Neighbors:
    """Pairs of neighbors in a picture, each with the pixel to its right or below it.

    Args:
        axis: 0 if the second pixels lie below the first ones, 1 if to the right.
        first: Flat positions.
        second: Flat positions.
    """

    axis: int
    first: Int64[Tensor, " pairs"]
    second: Int64[Tensor, " pairs"]

    def among(self, pixels: Bool[Tensor, " positions"]) -> Neighbors:
        """Those of which both are among some pixels."""
        both = pixels[self.first] & pixels[self.second]
        return Neighbors(self.axis, self.first[both], self.second[both])


@dataclass(frozen=True)
class Shown:
    """A picture that patches make up.

    Args:
        colors: In whole numbers from -128 to 127, by flat position.
        source: Where each pixel comes from.
    """

    colors: Float64[Tensor, "channels positions"]
    source: Int64[Tensor, " positions"]

    def patches(self, pairs: Neighbors, sources: Sources) -> tuple[Colors, Colors, Tensor]:
        """What the patch of the first pixel of each pair shows, and that of the second; and if they differ."""
        first, second = self.colors[:, pairs.first], self.colors[:, pairs.second]
        origins = self.source[pairs.first], self.source[pairs.second]
        one = Colors(first, sources.continued(origins[0], pairs.axis, 1, second))
        other = Colors(sources.continued(origins[1], pairs.axis, -1, first), second)
        return one, other, sources.broken(*origins, pairs.axis)


@dataclass(frozen=True)
class Graph:
    """Nodes joined by arcs that have a capacity both ways.

    Args:
        nodes: How many nodes; the first two are :data:`OLD` and :data:`NEW`.
        ends: The two nodes of each arc.
        capacity: Whole numbers.
    """

    nodes: int
    ends: Int64[Tensor, "2 arcs"]
    capacity: Int64[Tensor, " arcs"]

    @classmethod
    def of(
        cls,
        node: Int64[Tensor, " positions"],
        pairs: list[Neighbors],
        old: Shown,
        new: Float64[Tensor, "channels positions"],
        sources: Sources,
    ) -> Graph:
        """The graph of an overlap.

        Args:
            node: The node of each pixel of the overlap; those that are tied have that of their side.
            pairs: All pairs of neighbors in the overlap.
            old: The picture as it is.
            new: The colors of the new patch.
            sources: Where old colors come from.

        Source: Kwatra et al. 2003, sections 3 and 3.1.
        """
        nodes = max(2, int(node.max()) + 1)
        ends, capacity = [], []
        for some in pairs:
            one, other, broken = old.patches(some, sources)
            fresh = Colors(new[:, some.first], new[:, some.second])
            first, second = node[some.first], node[some.second]
            seams = torch.cumsum(broken, 0) - 1 + nodes
            nodes += int(broken.sum())
            # Without a seam both pixels have one patch; with one, its node comes between them.
            ends.append(torch.stack((first, torch.where(broken, seams, second))))
            capacity.append(seam_cost(one, fresh))
            ends.append(torch.stack((seams, second))[:, broken])
            capacity.append(seam_cost(other, fresh)[broken])
            ends.append(torch.stack((seams, torch.full_like(seams, NEW)))[:, broken])
            capacity.append(seam_cost(one, other)[broken])
        return cls(nodes, torch.cat(ends, dim=1), torch.cat(capacity))

    def cut(self) -> tuple[Bool[Tensor, " nodes"], int]:
        """The cheapest cut between the old picture and the new patch.

        Of several, the one that shows least of the new patch.

        Returns:
            Which nodes lie on the new patch's side, and what the cut costs.

        Example:
            >>> ends = torch.tensor([[0, 2, 3], [2, 3, 1]])
            >>> side, cost = Graph(4, ends, torch.tensor([5, 3, 9])).cut()
            >>> side.tolist(), cost
            ([False, True, False, True], 3)
        """
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import breadth_first_order, maximum_flow

        between = (self.ends.sum(0) != OLD + NEW) & (self.ends[0] != self.ends[1]) & (self.capacity > 0)
        first, second = self.ends[:, between].cpu().numpy()
        capacity = self._fitting().to(torch.int32)[between].cpu().numpy()
        size = (self.nodes, self.nodes)
        arcs = coo_matrix((capacity, (first, second)), shape=size).tocsr()
        arcs = (arcs + arcs.T).tocsr()
        flow = maximum_flow(arcs, OLD, NEW)
        # What could still flow, seen from where it would arrive.
        rest = (arcs - flow.flow).T.tocsr()
        rest.eliminate_zeros()
        reached = breadth_first_order(rest, NEW, directed=True, return_predecessors=False)
        side = torch.zeros(self.nodes, dtype=torch.bool)
        side[torch.from_numpy(reached).long()] = True
        return side.to(self.ends.device), int(flow.flow_value)

    def _fitting(self) -> Int64[Tensor, " arcs"]:
        """The capacities, coarser by a power of 2 if a flow could not be counted otherwise."""
        leaving = int(self.capacity[(self.ends == OLD).any(0)].sum())
        return self.capacity >> max(0, leaving.bit_length() - _MOST.bit_length())


def check_available() -> None:
    """Maximum flows are computed by SciPy, which is an extra.

    Raises:
        InputError: If it is not installed.

    Example:
        >>> check_available()
    """
    if find_spec("scipy") is None:
        raise InputError(
            "recipe", "needs SciPy to cut graphs", "it is not installed",
            'install it with: pip install "torchsynth-textures[graphcut]"',
        )  # fmt: skip
