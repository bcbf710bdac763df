"""Growing a tree of centroids, level by level.

All nodes of a level are split at once: two perturbed centroids each, then Lloyd iterations (assign every
vector to the nearer child, move the children to the means of their vectors). The vectors of a node are
laid side by side, in blocks of one size, so that both steps are a product for each block.

Centroids are rounded to whole matching steps, as the vectors are. Every distance is then an exact sum of
whole numbers, and the same tree grows on every machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

# Lloyd's iteration always ends, but nothing is gained by the last of many rounds.
_MOST_ROUNDS = 100
# Vectors handled at once: bounds memory, not the result.
CHUNK = 1 << 11
# Vectors in a block, where groups are large enough.
_BLOCK = 32


@dataclass(frozen=True)
class Tree:
    """A trained codebook: nodes in the order they grew, the roots (one for each exemplar) first.

    Args:
        centroids: Of every node: whole numbers.
        children: The first of the two adjacent children of every node, or -1 for a leaf.
        members: Vectors sorted by leaf, ascending within a leaf.
        starts: Where the members of a node begin; for leaves.
        counts: How many vectors a node stands for.
        depth: The number of steps from a root to the deepest leaf.
    """

    centroids: Float[Tensor, "nodes features"]
    children: Int64[Tensor, " nodes"]
    members: Int64[Tensor, " vectors"]
    starts: Int64[Tensor, " nodes"]
    counts: Int64[Tensor, " nodes"]
    depth: int

    def beside(self, vectors: Tensor) -> Tree:
        """The tree on the device of some vectors, its centroids in their dtype."""
        return replace(
            self,
            centroids=self.centroids.to(vectors),
            children=self.children.to(vectors.device),
            members=self.members.to(vectors.device),
            starts=self.starts.to(vectors.device),
            counts=self.counts.to(vectors.device),
        )


@dataclass(frozen=True)
class Limits:
    """How far a tree grows.

    Args:
        depth: How often a node may be split on the way from the root.
        codewords: The most leaves, or None.
        min_leaf: The fewest vectors of a leaf.
        enough: A node with so few vectors is not split.
        threshold: A node's iterations end when its distortion falls by less than this share.
    """

    depth: int
    codewords: int | None
    min_leaf: int
    enough: int
    threshold: float


@dataclass(frozen=True)
class Blocks:
    """Ranges of places, cut into blocks of one size.

    Args:
        owner: Which range each block is a piece of, ascending.
        places: Of each block; where its range has ended, the place at which that began.
        there: Which of them belong to the range.
    """

    owner: Int64[Tensor, " blocks"]
    places: Int64[Tensor, "blocks size"]
    there: Bool[Tensor, "blocks size"]

    @classmethod
    def of(cls, starts: Int64[Tensor, " ranges"], counts: Int64[Tensor, " ranges"], size: int) -> Blocks:
        """Cut ranges.

        Example:
            >>> Blocks.of(torch.tensor([4, 0]), torch.tensor([1, 3]), 2).places.tolist()
            [[4, 4], [0, 1], [2, 0]]
        """
        pieces = (counts + (size - 1)).div(size, rounding_mode="floor")
        owner = torch.arange(len(counts), device=counts.device).repeat_interleave(pieces)
        # The place of the first block of a range, counted from the range's own beginning.
        first = (pieces - pieces.cumsum(0)).index_select(0, owner)
        first += torch.arange(len(owner), device=counts.device)
        within = (first * size).unsqueeze(1) + torch.arange(size, device=counts.device)
        there = within < counts.index_select(0, owner).unsqueeze(1)
        return cls(owner, starts.index_select(0, owner).unsqueeze(1) + within * there, there)


def block_size(vectors: int, groups: int) -> int:
    """How many vectors to put into a block: a power of two, such that padding at most doubles them.

    Example:
        >>> block_size(1000, 9), block_size(1000, 200), block_size(1000, 900)
        (32, 4, 1)
    """
    mean = max(1, vectors // groups)
    return int(min(_BLOCK, 1 << (mean.bit_length() - 1)))


def grow(
    vectors: Float[Tensor, "vectors features"], weights: Float[Tensor, " features"], exemplars: int,
    limits: Limits,
) -> Tree:  # fmt: skip
    """Grow a tree for each exemplar.

    Args:
        vectors: All exemplars' candidates, one after the other: whole numbers from -128 to 127.
        weights: How much each feature's squared difference counts.
        exemplars: How many exemplars there are.
        limits: How far to go.
    """
    number = len(vectors) // exemplars
    node = torch.arange(len(vectors), device=vectors.device).div(number, rounding_mode="floor")
    level = torch.arange(exemplars, device=vectors.device)
    sums = vectors.view(exemplars, number, -1).sum(1, dtype=torch.float64)
    centroids = (sums / number).round().to(vectors.dtype)
    children = torch.full_like(level, -1)
    depth = 0
    for _ in range(limits.depth):
        level = _worth_splitting(vectors, weights, node, centroids, children, level, limits)
        if len(level) == 0:
            break
        pairs, side, inside = _split(vectors, weights, node, centroids[level], level, limits.threshold)
        accepted = side.bincount(minlength=2 * len(pairs)).view(-1, 2).amin(1) >= limits.min_leaf
        # The accepted pairs are numbered behind all nodes there are, in the order of their parents.
        first = len(centroids) + 2 * (accepted.cumsum(0) - 1)
        children[level[accepted]] = first[accepted]
        parent = side.div(2, rounding_mode="floor")
        moved = accepted[parent]
        node[inside[moved]] = first[parent[moved]] + side[moved] % 2
        grown = pairs[accepted].flatten(0, 1)
        depth += len(grown) > 0
        level = torch.arange(len(centroids), len(centroids) + len(grown), device=node.device)
        centroids = torch.cat((centroids, grown))
        children = torch.cat((children, torch.full_like(level, -1)))
    counts = node.bincount(minlength=len(centroids))
    starts = counts.cumsum(0) - counts
    return Tree(centroids, children, node.argsort(stable=True), starts, counts, depth)


def only_central(tree: Tree, vectors: Tensor, weights: Tensor) -> Tree:
    """The same tree with one member in each leaf: the one nearest to the centroid."""
    nodes = torch.arange(len(tree.counts), device=vectors.device)
    leaf = nodes.repeat_interleave(tree.counts)
    node = torch.empty_like(leaf).index_copy_(0, tree.members, leaf)
    distance = _own_distance(vectors, weights, node, tree.centroids).index_select(0, tree.members)
    # Sorted by distance and then, stably, by leaf: the first of each leaf is its central member.
    near = distance.argsort(stable=True)
    order = near[leaf[near].argsort(stable=True)]
    filled = (tree.counts > 0).long()
    central = tree.members[order[tree.starts[filled > 0]]]
    return replace(tree, members=central, starts=filled.cumsum(0) - filled, counts=filled)


def bisector(
    first: Float[Tensor, "pairs features"], second: Float[Tensor, "pairs features"],
    weights: Float[Tensor, " features"],
) -> tuple[Float[Tensor, "pairs features"], Float[Tensor, " pairs"]]:  # fmt: skip
    """``|x - a|^2 > |x - b|^2`` exactly when ``2 x.(b - a) > |b|^2 - |a|^2``: one product for each x.

    Example:
        >>> bisector(torch.tensor([[1.0]]), torch.tensor([[3.0]]), torch.tensor([1.0]))
        (tensor([[4.]]), tensor([8.]))
    """
    toward = (second - first) * (2 * weights)
    return toward, second.square() @ weights - first.square() @ weights


def _worth_splitting(
    vectors: Tensor, weights: Tensor, node: Tensor, centroids: Tensor, children: Tensor,
    level: Tensor, limits: Limits,
) -> Tensor:  # fmt: skip
    """Which nodes of a level to split: of those that hold enough, the most distorted ones."""
    counts = node.bincount(minlength=len(centroids))[level]
    level = level[(counts > limits.enough) & (counts >= 2 * limits.min_leaf)]
    if limits.codewords is None:
        return level
    spare = max(0, limits.codewords - int((children < 0).sum()))
    distance = _own_distance(vectors, weights, node, centroids)
    distortion = node.bincount(distance, minlength=len(centroids))[level]
    worst = distortion.sort(descending=True, stable=True).indices[:spare]
    return level[worst.sort().values]


def _own_distance(vectors: Tensor, weights: Tensor, node: Tensor, centroids: Tensor) -> Tensor:
    """The squared distance of each vector to its node's centroid."""
    chunks = zip(vectors.split(CHUNK), node.split(CHUNK), strict=True)
    return torch.cat(
        [(chunk - centroids.index_select(0, own)).square_() @ weights for chunk, own in chunks]
    ).double()


@dataclass(frozen=True)
class _Level:
    """Nodes that are being split, and blocks of their vectors.

    Args:
        vectors: All vectors.
        weights: How much each feature's squared difference counts.
        which: The vectors in each block.
        there: Where the block is filled.
        owner: Which of the nodes each block belongs to.
        blocks: Which blocks of the whole level these are.
        nodes: Which nodes of the whole level these are.
    """

    vectors: Float[Tensor, "vectors features"]
    weights: Float[Tensor, " features"]
    which: Int64[Tensor, "blocks size"]
    there: Bool[Tensor, "blocks size"]
    owner: Int64[Tensor, " blocks"]
    blocks: Int64[Tensor, " blocks"]
    nodes: Int64[Tensor, " nodes"]

    @classmethod
    def of(cls, vectors: Tensor, weights: Tensor, node: Tensor, level: Tensor) -> _Level:
        """The nodes of a level, and the vectors that are in one of them."""
        counts = node.bincount(minlength=int(level.max()) + 1)
        starts = (counts.cumsum(0) - counts)[level]
        counts = counts[level]
        blocks = Blocks.of(starts, counts, block_size(int(counts.sum()), len(level)))
        which = node.argsort(stable=True)[blocks.places]
        numbers = torch.arange(len(which), device=which.device)
        nodes = torch.arange(len(level), device=which.device)
        return cls(vectors, weights, which, blocks.there, blocks.owner, numbers, nodes)

    def only(self, moving: Tensor) -> _Level:
        """Some of the nodes."""
        kept = moving[self.owner].nonzero().squeeze(1)
        return replace(
            self,
            which=self.which.index_select(0, kept),
            there=self.there.index_select(0, kept),
            owner=(moving.cumsum(0) - 1)[self.owner[kept]],
            blocks=self.blocks[kept],
            nodes=self.nodes[moving],
        )

    def chunks(self) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """A few blocks at a time: their vectors, whether each is there, and their nodes."""
        few = max(1, CHUNK // self.which.shape[1])
        for which, there, owner in zip(
            self.which.split(few), self.there.split(few), self.owner.split(few), strict=True
        ):
            yield self.vectors.index_select(0, which.view(-1)).view(*which.shape, -1), there, owner

    def sums(self) -> _Sums:
        """Exact sums over each node's vectors."""
        vectors = self.vectors.new_zeros(len(self.nodes), self.vectors.shape[1], dtype=torch.float64)
        squares, counts = vectors.clone(), vectors.new_zeros(len(vectors))
        for chunk, there, owner in self.chunks():
            taken = there.to(chunk.dtype).unsqueeze(1)
            counts.index_add_(0, owner, there.sum(1).double())
            vectors.index_add_(0, owner, torch.bmm(taken, chunk).squeeze(1).double())
            squares.index_add_(0, owner, torch.bmm(taken, chunk.square_()).squeeze(1).double())
        return _Sums(vectors, squares, counts)

    def assigned(self, pairs: Tensor, sums: _Sums) -> _Assignment:
        """Assign all vectors to the nearer child of their node, to the first among equals."""
        toward, limit = bisector(pairs[:, 0], pairs[:, 1], self.weights)
        second, counts = torch.zeros_like(sums.vectors), torch.zeros_like(sums.counts)
        sides = []
        for chunk, there, owner in self.chunks():
            # Queries as rows: the other way around, this product is ten times slower.
            products = torch.bmm(toward.index_select(0, owner).unsqueeze(1), chunk.transpose(1, 2)).squeeze(1)
            side = products > limit.index_select(0, owner).unsqueeze(1)
            taken = (side & there).to(chunk.dtype).unsqueeze(1)
            second.index_add_(0, owner, torch.bmm(taken, chunk).squeeze(1).double())
            counts.index_add_(0, owner, taken.sum((1, 2)).double())
            sides.append(side)
        return _Assignment(
            torch.cat(sides),
            torch.stack((sums.vectors - second, second), dim=1),
            torch.stack((sums.counts - counts, counts), dim=1),
        )


@dataclass(frozen=True)
class _Sums:
    """Exact sums over the vectors of some nodes.

    Args:
        vectors: Of the vectors.
        squares: Of their features' squares.
        counts: How many there are.
    """

    vectors: Float[Tensor, "nodes features"]
    squares: Float[Tensor, "nodes features"]
    counts: Float[Tensor, " nodes"]

    def only(self, moving: Tensor) -> _Sums:
        """Those of some of the nodes."""
        return _Sums(self.vectors[moving], self.squares[moving], self.counts[moving])

    def perturbed(self, centroids: Tensor) -> Tensor:
        """Two starting centroids for each node, a quarter of the spread to either side of its own."""
        counts = self.counts.unsqueeze(1)
        spread = self.squares - (2 * self.vectors - counts * centroids) * centroids
        # Whole steps, and at least one wherever the vectors differ at all.
        step = ((spread / counts).sqrt_() / 4).ceil_().to(centroids.dtype)
        return torch.stack((centroids - step, centroids + step), dim=1)


@dataclass(frozen=True)
class _Assignment:
    """Which vectors are nearer to the second child of their node, and exact sums over each child's vectors.

    Args:
        second: Whether a vector goes to the second child, in blocks.
        sums: Of the vectors of each child.
        counts: How many these are.
    """

    second: Bool[Tensor, "blocks size"]
    sums: Float[Tensor, "nodes 2 features"]
    counts: Float[Tensor, "nodes 2"]

    def means(self, pairs: Tensor) -> Tensor:
        """The means, rounded to whole steps; a child without vectors stays where it is."""
        means = (self.sums / self.counts.unsqueeze(2)).round_().to(pairs.dtype)
        return torch.where((self.counts > 0).unsqueeze(2), means, pairs)

    def distortion(self, pairs: Tensor, sums: _Sums, weights: Tensor) -> Tensor:
        """The summed squared distances of each node's vectors to the child each is assigned to."""
        cross = (self.sums * pairs) @ weights.double()
        lengths = (pairs.square() @ weights).double() * self.counts
        return sums.squares @ weights.double() - (2 * cross - lengths).sum(1)

    def only(self, moving: Tensor) -> _Assignment:
        """That of some of the nodes; without the vectors."""
        return _Assignment(self.second[:0], self.sums[moving], self.counts[moving])


def _split(
    vectors: Tensor, weights: Tensor, node: Tensor, centroids: Tensor, level: Tensor, threshold: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Lloyd's iterations for all nodes of a level.

    Returns:
        The centroids of each node's two children; the child of each vector that is in one of the nodes,
        counted through the pairs; and which vectors these are.
    """
    every = moving = _Level.of(vectors, weights, node, level)
    sums = every.sums()
    pairs = sums.perturbed(centroids)
    found = every.assigned(pairs, sums)
    before = found.distortion(pairs, sums, weights)
    final, second = pairs.clone(), found.second
    for _ in range(_MOST_ROUNDS):
        pairs = found.means(pairs)
        found = moving.assigned(pairs, sums)
        final[moving.nodes], second[moving.blocks] = pairs, found.second
        after = found.distortion(pairs, sums, weights)
        falls = before - after > threshold * before
        if not bool(falls.any()):
            break
        if not bool(falls.all()):
            moving, sums, found = moving.only(falls), sums.only(falls), found.only(falls)
        pairs, before = pairs[falls], after[falls]
    side = (2 * every.owner).unsqueeze(1) + second
    return final, side[every.there], every.which[every.there]
