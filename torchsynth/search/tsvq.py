"""Tree-structured vector quantization: descend a binary tree of centroids instead of trying everyone.

The tree is grown level by level. All nodes of a level are split at once: two perturbed centroids each,
then Lloyd iterations (assign every vector to the nearer child, move the children to the means of their
vectors), in which assigning is a gather and averaging a scatter over all vectors of all nodes.

Centroids are rounded to whole matching steps, as the vectors are. Every distance is then an exact sum of
whole numbers, and the same tree grows on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import torch
from jaxtyping import Float, Int64
from pydantic import Field
from torch import Tensor

from torchsynth.neighborhood import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Proposals, Query

# Lloyd's iteration always ends, but nothing is gained by the last of many rounds.
_MOST_ROUNDS = 100
# Down to this depth a tree takes little memory beside the vectors it was trained on.
_SHALLOW = 10
# Vectors handled at once while training: bounds memory, not the result.
_CHUNK = 1 << 14


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
class TSVQState:
    """A tree, and the vectors its leaves refer to.

    Args:
        tree: The codebook.
        vectors: All exemplars' candidates, one after the other.
        weights: How much each feature's squared difference counts.
        toward: For each node, twice the weighted way from its first to its second child.
        limit: What a query's product with that has to exceed to be nearer to the second.
        exemplars: How many exemplars there are.
        leaf_size: The largest number of members of a leaf.
    """

    tree: Tree
    vectors: Float[Tensor, "vectors features"]
    weights: Float[Tensor, " features"]
    toward: Float[Tensor, "nodes features"]
    limit: Float[Tensor, " nodes"]
    exemplars: int
    leaf_size: int


class TSVQ(Part):
    """Search a tree of centroids; fast for large exemplars, and close to exhaustive search.

    Args:
        depth: How often a node may be split on the way from the root. Visible effect: a shallow tree
            compares more members a leaf and is slower but closer to exhaustive search.
        codewords: The most leaves, or None; the nodes of the largest distortion are split first.
        min_leaf: A node is not split if a child would get fewer vectors than this.
        threshold: Lloyd's iterations of a node end when the distortion falls by less than this share.
        beam: How many nodes are kept at each level of the descent. More find better matches, in
            proportion to the time.
        leaf: Which member a leaf proposes: ``nearest`` compares all of them to the query, ``central``
            takes the one nearest to the centroid.

    Source:
        Wei & Levoy 2000, section 4; tree growing by Gersho & Gray, *Vector Quantization and Signal
        Compression*, 1992.

    Example:
        >>> index = Index(torch.tensor([[[0.0], [1.0], [9.0]]]), torch.arange(3), torch.tensor([1]), (1, 3), torch.zeros(1, 3, 1))
        >>> search = TSVQ(depth=2)
        >>> found = search.search(search.fit(index, complete=True), Query(torch.tensor([[[8.0, 1.0]]])))
        >>> found.rows.flatten()[found.cost.flatten().argmin()].item()
        2
    """

    kind: Literal["tsvq"] = "tsvq"

    largest_term: ClassVar[int] = 4 * 128**2
    """The most that one feature adds to a sum: ``(q - x)^2``, or ``2 q.(b - a)``, within -128..127."""

    depth: Annotated[int, Field(ge=1, le=30)] = 8
    codewords: Annotated[int, Field(ge=2)] | None = None
    min_leaf: Annotated[int, Field(ge=1)] = 1
    threshold: Annotated[float, Field(ge=0, lt=1)] = 1e-10
    beam: Annotated[int, Field(ge=1, le=64)] = 1
    leaf: Literal["nearest", "central"] = "nearest"

    def wants(self) -> None:
        """No sources: the neighbors' values are enough."""

    def fit(self, index: Index, complete: bool) -> TSVQState:  # noqa: ARG002 (the descent handles both)
        """Grow the tree, and prepare to search it.

        Args:
            index: The candidates.
            complete: Not needed here.
        """
        return self.prepare(index, self.grow(index))

    def grow(self, index: Index) -> Tree:
        """Train the tree: the part of fitting that takes long, and that a codebook keeps."""
        vectors = index.features.flatten(0, 1)
        weights = index.weights.to(vectors.dtype)
        tree = _grow(vectors, weights, len(index.features), self).beside(vectors)
        return _only_central(tree, vectors, weights) if self.leaf == "central" else tree

    def prepare(self, index: Index, tree: Tree) -> TSVQState:
        """Make a tree of these candidates ready to be searched."""
        vectors = index.features.flatten(0, 1)
        weights = index.weights.to(vectors.dtype)
        tree = tree.beside(vectors)
        leaves = tree.children < 0
        first = tree.children.clamp(min=0)
        toward, limit = _bisector(tree.centroids[first], tree.centroids[(first + 1) * ~leaves], weights)
        largest = int(tree.counts[leaves].max())
        return TSVQState(tree, vectors, weights, toward, limit, len(index.features), largest)

    def copies(self, complete: bool) -> int:  # noqa: ARG002 (the descent handles both)
        """How much memory training takes, in sizes of the candidates' vectors; searching takes less."""
        # A deep tree has up to two nodes for each vector, and their centroids grow in float64.
        shallow = self.depth <= _SHALLOW or (self.codewords or 2**31) <= 2**_SHALLOW
        return 6 if shallow else 16

    def capacity(self, state: TSVQState) -> int:
        """How many queries fit the memory budget: at least one."""
        row = self.beam * max(2, state.leaf_size) * state.vectors.shape[1] * 8
        return max(1, MEMORY_BUDGET // row)

    def search(self, state: TSVQState, query: Query) -> Proposals:
        """Propose the members of the best leaves, the nearest leaf first."""
        batch, sites = query.features.shape[:2]
        queries = query.features[..., :-1].flatten(0, 1)
        roots = torch.arange(batch, device=queries.device) % state.exemplars
        nodes = roots.repeat_interleave(sites)
        counting = state.weights.view(1, 1, -1)
        if query.readable is not None:
            counting = query.readable.repeat(batch, 1).unsqueeze(1) * counting
        if self.beam == 1 and query.readable is None:
            leaves = _descend(state, queries, nodes).unsqueeze(1)
        else:
            leaves = _descend_beam(state.tree, queries, counting, nodes, self.beam)
        cost, vectors = _compare_members(state, queries, counting, leaves)
        rows = vectors % (len(state.vectors) // state.exemplars)
        common = (queries.square().unsqueeze(1) * counting).sum(2)
        shape = (batch, sites, -1)
        return Proposals((cost - common).view(shape), rows.view(shape))


def _descend(state: TSVQState, queries: Tensor, nodes: Tensor) -> Int64[Tensor, " queries"]:
    """Go to the nearer child until there is none."""
    for _ in range(state.tree.depth):
        nearer = (queries * state.toward[nodes]).sum(1) > state.limit[nodes]
        first = state.tree.children[nodes]
        nodes = torch.where(first < 0, nodes, first + nearer)
    return nodes


def _descend_beam(
    tree: Tree, queries: Tensor, counting: Tensor, nodes: Tensor, beam: int
) -> Int64[Tensor, "queries beam"]:
    """The best leaves of each query, nearest centroid first; -1 where there are fewer."""
    kept = nodes.unsqueeze(1)
    for _ in range(tree.depth):
        first = torch.where(kept >= 0, tree.children[kept.clamp(min=0)], -1)
        # A leaf stays as it is; a node is replaced by its two children.
        second = torch.where(first >= 0, first + 1, -1)
        offered = torch.stack((torch.where(first >= 0, first, kept), second), dim=2).flatten(1)
        distance = _distances(tree.centroids, queries, counting, offered)
        # A stable sort: among equals the one that grew first, and what is missing last.
        order = distance.sort(dim=1, stable=True).indices[:, :beam]
        kept = offered.gather(1, order)
    return kept


def _distances(points: Tensor, queries: Tensor, counting: Tensor, chosen: Tensor) -> Tensor:
    """Weighted squared distances of each query to its chosen points; infinite for point -1."""
    difference = points[chosen.clamp(min=0)] - queries.unsqueeze(1)
    distance = (difference.square_() * counting).sum(2)
    return distance.masked_fill_(chosen < 0, float("inf"))


def _compare_members(
    state: TSVQState, queries: Tensor, counting: Tensor, leaves: Tensor
) -> tuple[Tensor, Tensor]:
    """Distances of each query to the members of its leaves, and which vectors these are."""
    tree = state.tree
    counts = torch.where(leaves >= 0, tree.counts[leaves.clamp(min=0)], 0)
    within = torch.arange(int(counts.max()), device=leaves.device)
    there = within < counts.unsqueeze(2)
    places = (tree.starts[leaves.clamp(min=0)].unsqueeze(2) + within) * there
    vectors = torch.where(there, tree.members[places], -1).flatten(1)
    return _distances(state.vectors, queries, counting, vectors), vectors.clamp(min=0)


def _grow(vectors: Tensor, weights: Tensor, exemplars: int, options: TSVQ) -> Tree:
    """Split all nodes of a level at once, level after level."""
    node = torch.arange(len(vectors), device=vectors.device) // (len(vectors) // exemplars)
    level = torch.arange(exemplars, device=vectors.device)
    centroids = _Clusters.of(vectors, weights, node, exemplars).centroids()
    children = torch.full_like(level, -1)
    depth = 0
    for _ in range(options.depth):
        level = _worth_splitting(vectors, weights, node, centroids, children, level, options)
        if len(level) == 0:
            break
        pairs, side, inside = _split(vectors, weights, node, centroids, level, options)
        accepted = side.bincount(minlength=len(pairs)).view(-1, 2).amin(1) >= options.min_leaf
        # The accepted pairs are numbered behind all nodes there are, in the order of their parents.
        number = len(centroids) + 2 * (accepted.cumsum(0) - 1)
        children[level[accepted]] = number[accepted]
        moved = accepted[side // 2]
        node[inside[moved]] = number[side[moved] // 2] + side[moved] % 2
        grown = pairs.view(-1, 2, pairs.shape[1])[accepted].flatten(0, 1)
        depth += len(grown) > 0
        level = torch.arange(len(centroids), len(centroids) + len(grown), device=node.device)
        centroids = torch.cat((centroids, grown))
        children = torch.cat((children, torch.full_like(level, -1)))
    counts = node.bincount(minlength=len(centroids))
    starts = counts.cumsum(0) - counts
    return Tree(centroids, children, node.argsort(stable=True), starts, counts, depth)


@dataclass(frozen=True)
class _Clusters:
    """What is known of groups of vectors: exact sums, so that moving vectors about loses nothing.

    Args:
        sums: Of the vectors.
        squares: Of the vectors' weighted squared lengths.
        counts: How many there are.
        weights: How much each feature's squared difference counts.
    """

    sums: Float[Tensor, "groups features"]
    squares: Float[Tensor, " groups"]
    counts: Int64[Tensor, " groups"]
    weights: Float[Tensor, " features"]

    @classmethod
    def of(cls, vectors: Tensor, weights: Tensor, group: Tensor, groups: int) -> _Clusters:
        empty = torch.zeros(groups, vectors.shape[1], dtype=torch.float64, device=vectors.device)
        counts = torch.zeros(groups, dtype=torch.int64, device=vectors.device)
        clusters = cls(empty, empty.new_zeros(groups), counts, weights.double())
        clusters.add(vectors, group, 1)
        return clusters

    def add(self, vectors: Tensor, group: Tensor, sign: Literal[1, -1]) -> None:
        """Put vectors into their groups, or take them out."""
        for chunk, which in zip(vectors.split(_CHUNK), group.split(_CHUNK), strict=True):
            wide = chunk.double()
            self.sums.index_add_(0, which, wide, alpha=sign)
            self.squares.index_add_(0, which, (wide.square() * self.weights).sum(1), alpha=sign)
            self.counts.index_add_(0, which, torch.ones_like(which), alpha=sign)

    def centroids(self) -> Tensor:
        """The means, rounded to whole steps."""
        return (self.sums / self.counts.clamp(min=1).unsqueeze(1)).round()

    def distortion(self, centroids: Tensor) -> Tensor:
        """The summed squared distances of each group's vectors to its centroid."""
        cross = (centroids * self.sums * self.weights).sum(1)
        return self.squares - 2 * cross + self.counts * (centroids.square() * self.weights).sum(1)


def _worth_splitting(
    vectors: Tensor, weights: Tensor, node: Tensor, centroids: Tensor, children: Tensor,
    level: Tensor, options: TSVQ,
) -> Tensor:  # fmt: skip
    """Which nodes of a level to split: as many of the most distorted ones as there may be leaves."""
    if options.codewords is None:
        return level
    spare = max(0, options.codewords - int((children < 0).sum()))
    distortion = _Clusters.of(vectors, weights, node, len(centroids)).distortion(centroids)[level]
    worst = distortion.sort(descending=True, stable=True).indices[:spare]
    return level[worst.sort().values]


def _split(
    vectors: Tensor, weights: Tensor, node: Tensor, centroids: Tensor, level: Tensor, options: TSVQ
) -> tuple[Tensor, Tensor, Tensor]:
    """Lloyd's iterations for all nodes of a level.

    Returns:
        The centroids of the children, pair after pair; the child of each vector that is in one of the
        nodes; and which vectors these are.
    """
    place = torch.full((len(centroids),), -1, device=node.device)
    place[level] = torch.arange(len(level), device=node.device)
    inside = (place[node] >= 0).nonzero().squeeze(1)
    parent = place[node[inside]]
    pairs = _perturbed(vectors, inside, parent, centroids[level])
    side = 2 * parent + _second_is_nearer(vectors, weights, inside, parent, pairs)
    clusters = _Clusters.of(vectors[inside], weights, side, len(pairs))
    before = clusters.distortion(pairs).view(-1, 2).sum(1)
    moving = torch.ones_like(level, dtype=torch.bool)
    for _ in range(_MOST_ROUNDS):
        moves = (moving.repeat_interleave(2) & (clusters.counts > 0)).unsqueeze(1)
        pairs = torch.where(moves, clusters.centroids(), pairs)
        still = moving[parent].nonzero().squeeze(1)
        now = 2 * parent[still] + _second_is_nearer(vectors, weights, inside[still], parent[still], pairs)
        changed = now != side[still]
        others = vectors[inside[still[changed]]]
        clusters.add(others, side[still[changed]], -1)
        clusters.add(others, now[changed], 1)
        side[still] = now
        after = clusters.distortion(pairs).view(-1, 2).sum(1)
        moving = moving & (before - after > options.threshold * before)
        before = after
        if not bool(moving.any()):
            break
    return pairs, side, inside


def _perturbed(vectors: Tensor, inside: Tensor, parent: Tensor, centroids: Tensor) -> Tensor:
    """Two starting centroids for each node: a quarter of the spread to either side of its own."""
    spread = torch.zeros_like(centroids)
    counts = parent.bincount(minlength=len(centroids)).unsqueeze(1)
    for which, group in zip(inside.split(_CHUNK), parent.split(_CHUNK), strict=True):
        spread.index_add_(0, group, (vectors[which] - centroids[group]).square_())
    # Whole steps, and at least one wherever the vectors differ at all.
    step = ((spread / counts).sqrt() / 4).ceil()
    return torch.stack((centroids - step, centroids + step), dim=1).flatten(0, 1)


def _second_is_nearer(
    vectors: Tensor, weights: Tensor, inside: Tensor, parent: Tensor, pairs: Tensor
) -> Tensor:
    """1 for each vector that is nearer to the second child of its node, 0 for the others and for ties."""
    first, second = pairs.view(-1, 2, pairs.shape[1]).to(vectors.dtype).unbind(1)
    toward, limit = _bisector(first, second, weights)
    nearer = [
        (vectors[which] * toward[group]).sum(1) > limit[group]
        for which, group in zip(inside.split(_CHUNK), parent.split(_CHUNK), strict=True)
    ]
    return torch.cat(nearer).long()


def _bisector(first: Tensor, second: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """``|x - a|^2 > |x - b|^2`` exactly when ``2 x.(b - a) > |b|^2 - |a|^2``: one product for each x."""
    toward = (second - first) * 2 * weights
    return toward, ((second.square() - first.square()) * weights).sum(1)


def _only_central(tree: Tree, vectors: Tensor, weights: Tensor) -> Tree:
    """The same tree with one member in each leaf: the one nearest to the centroid."""
    leaf = torch.repeat_interleave(torch.arange(len(tree.counts), device=vectors.device), tree.counts)
    distance = torch.cat(
        [
            _distances(
                tree.centroids, vectors[members], weights.expand(len(members), -1),
                leaves.unsqueeze(1),
            )[:, 0]
            for members, leaves in zip(tree.members.split(_CHUNK), leaf.split(_CHUNK), strict=True)
        ]
    )  # fmt: skip
    # Sorted by distance and then, stably, by leaf: the first of each leaf is its central member.
    near = distance.argsort(stable=True)
    order = near[leaf[near].argsort(stable=True)]
    filled = (tree.counts > 0).long()
    central = tree.members[order[tree.starts[filled > 0]]]
    return replace(tree, members=central, starts=filled.cumsum(0) - filled, counts=filled)
