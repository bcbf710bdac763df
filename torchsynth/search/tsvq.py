"""Tree-structured vector quantization: descend a binary tree of centroids instead of trying everyone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import torch
from jaxtyping import Float, Int64
from pydantic import Field
from torch import Tensor
from torch.nn.functional import pad

from torchsynth.index import Index
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Proposals, Query, Volume
from torchsynth.search.tree import CHUNK, Blocks, Limits, Tree, bisector, block_size, grow, only_central

# One product with the nodes at the top of the tree is faster than a step for each of their levels.
_TOP = 64
# Without a given depth, leaves as large as this stay leaves. Comparing as many members takes about as long
# as the descent, and leaves that were smaller would find worse matches.
_ENOUGH = 64
_DEEPEST = 30
# Down to this depth a tree takes little memory beside the vectors it was trained on.
_SHALLOW = 10
# Members compared at once: they stay in the innermost caches.
_CHUNK = 1 << 10


@dataclass(frozen=True)
class Nodes:
    """What a descent needs to know of each node. One more at the end stands for nobody.

    Args:
        centroids: Of every node.
        lengths: Their weighted squared lengths; infinite for nobody.
        toward: Twice the weighted way from the first to the second child.
        limit: What a query's product with that has to exceed to be nearer to the second; infinite where
            there are no children.
        steps: The first child, or the node itself where there are none.
        twins: The two nodes that replace each one in a beam: the children; or itself and nobody.
        depth: The number of steps to the deepest leaf.
        top: How many of these steps go to one of the first ``few`` nodes.
        few: How many nodes these are.
    """

    centroids: Float[Tensor, "nodes features"]
    lengths: Float[Tensor, " nodes"]
    toward: Float[Tensor, "nodes features"]
    limit: Float[Tensor, " nodes"]
    steps: Int64[Tensor, " nodes"]
    twins: Int64[Tensor, "nodes 2"]
    depth: int
    top: int
    few: int

    @classmethod
    def of(cls, tree: Tree, weights: Tensor, exemplars: int) -> Nodes:
        """Prepare a tree for descents."""
        leaf = pad(tree.children < 0, (0, 1), value=True)
        own = torch.arange(len(leaf), device=leaf.device)
        nobody = len(leaf) - 1
        centroids = pad(tree.centroids, (0, 0, 0, 1))
        lengths = centroids.square() @ weights
        lengths[nobody] = float("inf")
        steps = torch.where(leaf, own, pad(tree.children, (0, 1)))
        second = steps + ~leaf
        toward, limit = bisector(centroids[steps], centroids[second], weights)
        twins = torch.stack((steps, torch.where(leaf, nobody, second)), dim=1)
        top, few = _top(tree, exemplars)
        limit.masked_fill_(leaf, float("inf"))
        return cls(centroids, lengths, toward, limit, steps, twins, tree.depth, top, few)


@dataclass(frozen=True)
class Leaves:
    """The members of the leaves, in blocks of one size.

    Args:
        places: Where the vectors of each block are; any where it is not full.
        lengths: Their weighted squared lengths; infinite where it is not full.
        first: The first block of each node, for leaves; one more node at the end stands for nobody.
        sizes: How many blocks these are; none for nobody.
    """

    places: Int64[Tensor, "blocks size"]
    lengths: Float[Tensor, "blocks size"]
    first: Int64[Tensor, " nodes"]
    sizes: Int64[Tensor, " nodes"]

    @classmethod
    def of(cls, tree: Tree, members: Tensor, weights: Tensor) -> Leaves:
        """Cut the members of a tree's leaves into blocks."""
        leaf = tree.children < 0
        counts = tree.counts * leaf
        blocks = Blocks.of(tree.starts, counts, block_size(len(members), int(leaf.sum())))
        lengths = torch.cat([chunk.square() @ weights for chunk in members.split(CHUNK)])
        lengths = lengths[blocks.places].masked_fill_(~blocks.there, float("inf"))
        sizes = pad(blocks.owner.bincount(minlength=len(counts)), (0, 1))
        return cls(blocks.places, lengths, sizes.cumsum(0) - sizes, sizes)


@dataclass(frozen=True)
class TSVQState:
    """A tree, and the vectors its leaves refer to.

    Args:
        tree: The codebook.
        nodes: What descents know of it.
        members: The vectors in the order of the tree's members.
        sites: Which exemplar positions they are.
        leaves: How they are shared out among the leaves.
        weights: How much each feature's squared difference counts.
        exemplars: How many exemplars there are.
        own: The mean value of each leaf's members, rounded to whole steps; one more node at the end
            stands for nobody. None where leaves propose members.
    """

    tree: Tree
    nodes: Nodes
    members: Float[Tensor, "vectors features"]
    sites: Int64[Tensor, " vectors"]
    leaves: Leaves
    weights: Float[Tensor, " features"]
    exemplars: int
    own: Float[Tensor, "nodes channels"] | None


@dataclass(frozen=True)
class _Asked:
    """Queries, in the form that distances are computed with.

    Args:
        features: The queries.
        products: Minus twice the weighted queries: a vector's product with that, and its own squared
            length, are its distance, less the query's own squared length.
        counting: How much each feature counts, if that is not the same for all queries.
    """

    features: Float[Tensor, "queries features"]
    products: Float[Tensor, "queries features"]
    counting: Float[Tensor, "queries features"] | None

    def costs(self, which: Tensor | None, vectors: Tensor, lengths: Tensor) -> Tensor:
        """What vectors cost the queries ``which`` they belong to; None means all, one after the other."""
        cost = _product(vectors, self.products, which)
        if self.counting is None:
            return cost.add_(lengths)
        # Unreadable features drop out of the lengths, query by query; what is infinite stays so.
        nobody = lengths == float("inf")
        return cost.add_(_product(vectors.square_(), self.counting, which)).masked_fill_(nobody, float("inf"))

    def costs_of(self, nodes: Nodes, chosen: Int64[Tensor, "queries nodes"]) -> Tensor:
        """What the centroids of some nodes cost each query; nobody's cost is infinite."""
        flat = chosen.reshape(-1)
        centroids = nodes.centroids.index_select(0, flat).view(*chosen.shape, -1)
        return self.costs(None, centroids, nodes.lengths.index_select(0, flat).view_as(chosen))


class TSVQ(Part):
    """Search a tree of centroids; fast for large exemplars, and close to exhaustive search.

    Args:
        depth: How often a node may be split on the way from the root; None goes on wherever a leaf would
            hold more than 64 vectors. Visible effect: a shallow tree compares more members a leaf and is
            slower but closer to exhaustive search.
        codewords: The most leaves, or None; the nodes of the largest distortion are split first.
        min_leaf: A node is not split if a child would get fewer vectors than this.
        threshold: Lloyd's iterations of a node end when the distortion falls by less than this share.
        beam: How many nodes are kept at each level of the descent. More find better matches, in
            proportion to the time.
        leaf: What a leaf proposes: ``nearest`` compares all its members to the query, ``central`` takes
            the one nearest to the centroid, and ``centroid`` proposes no member but their mean, in the
            256 steps of matching. Visible effect of the last: smoother, and no source map.

    Source:
        Wei & Levoy 2000, section 4; tree growing by Gersho & Gray, *Vector Quantization and Signal
        Compression*, 1992.

    Example:
        >>> index = Index.of_vectors(torch.tensor([[[0.0], [1.0], [9.0]]]), torch.tensor([1]))
        >>> search = TSVQ(depth=2)
        >>> found = search.search(search.fit(index, complete=True), Query(torch.tensor([[[8.0, 1.0]]])))
        >>> found.source.flatten()[found.cost.flatten().argmin()].item()
        2
    """

    kind: Literal["tsvq"] = "tsvq"

    largest_term: ClassVar[int] = 4 * 128**2
    """The most that one feature adds to a sum: ``(q - x)^2``, or ``2 q.(b - a)``, within -128..127."""

    depth: Annotated[int, Field(ge=1, le=_DEEPEST)] | None = None
    codewords: Annotated[int, Field(ge=2)] | None = None
    min_leaf: Annotated[int, Field(ge=1)] = 1
    threshold: Annotated[float, Field(ge=0, lt=1)] = 1e-10
    beam: Annotated[int, Field(ge=1, le=64)] = 1
    leaf: Literal["nearest", "central", "centroid"] = "nearest"

    @property
    def has_sources(self) -> bool:
        """Whether what it proposes are exemplar pixels."""
        return self.leaf != "centroid"

    takes_chances: ClassVar[bool] = False
    """Whether each offer needs a random number."""

    @property
    def tree_search(self) -> TSVQ:
        """The search whose trees a codebook may hold."""
        return self

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
        depth, enough = (_DEEPEST, _ENOUGH) if self.depth is None else (self.depth, 1)
        limits = Limits(depth, self.codewords, self.min_leaf, enough, self.threshold)
        tree = grow(vectors, weights, index.exemplars, limits).beside(vectors)
        return only_central(tree, vectors, weights) if self.leaf == "central" else tree

    def prepare(self, index: Index, tree: Tree) -> TSVQState:
        """Lay out a tree of these candidates, and the candidates, for searching."""
        vectors = index.features.flatten(0, 1)
        weights = index.weights.to(vectors.dtype)
        tree = tree.beside(vectors)
        members = vectors.index_select(0, tree.members)
        return TSVQState(
            tree=tree,
            nodes=Nodes.of(tree, weights, index.exemplars),
            members=members,
            sites=index.sites.take(tree.members % len(index.sites)),
            leaves=Leaves.of(tree, members, weights),
            weights=weights,
            exemplars=index.exemplars,
            own=_mean_values(tree, index) if self.leaf == "centroid" else None,
        )

    def memory(self, volume: Volume) -> int:
        """About how many bytes training takes, and at most so many; searching takes less."""
        # A deep tree has up to two nodes for each vector, and their centroids grow in float64.
        deep = self.depth is not None and self.depth > _SHALLOW
        return volume.vectors * (18 if deep and (self.codewords or 2**31) > 2**_SHALLOW else 10)

    def capacity(self, state: TSVQState) -> int:
        """How many queries fit the memory budget: at least one."""
        return max(1, MEMORY_BUDGET // (8 * _numbers_per_query(state, self.beam)))

    def search(self, state: TSVQState, query: Query) -> Proposals:
        """Propose members of the best leaves, the nearest leaf first: the best of each block of members."""
        batch, sites = query.features.shape[:2]
        features = query.features[..., :-1].flatten(0, 1)
        counting = None
        if query.readable is not None:
            counting = (query.readable * state.weights).repeat(batch, 1)
        asked = _Asked(features, features * (-2 * state.weights), counting)
        roots = torch.arange(batch, device=features.device) % state.exemplars
        nodes = roots.repeat_interleave(sites)
        if self.beam == 1 and counting is None:
            leaves = _descend(state.nodes, features, nodes).unsqueeze(1)
        else:
            leaves = _descend_beam(state.nodes, asked, nodes, self.beam)
        shape = (batch, sites, -1)
        if state.own is not None:
            cost = asked.costs_of(state.nodes, leaves)
            own = state.own.index_select(0, leaves.view(-1)).view(*shape[:2], leaves.shape[1], -1)
            return Proposals(cost.view(shape), torch.zeros_like(leaves).view(shape), own)
        cost, source = _best_of_blocks(state, asked, leaves)
        return Proposals(cost.view(shape), source.view(shape))


def _mean_values(tree: Tree, index: Index) -> Float[Tensor, "nodes channels"]:
    """The mean value of each leaf's members, in whole steps: exact sums, so the same on every machine."""
    values = index.values.flatten(0, 1).index_select(0, tree.members).double()
    leaf = torch.arange(len(tree.counts), device=values.device).repeat_interleave(
        tree.counts * (tree.children < 0)
    )
    sums = values.new_zeros(len(tree.counts) + 1, values.shape[1]).index_add_(0, leaf, values)
    counts = pad(tree.counts, (0, 1)).clamp(min=1).unsqueeze(1)
    return (sums / counts).round().to(index.values.dtype)


def _top(tree: Tree, exemplars: int) -> tuple[int, int]:
    """How many levels of the tree, below the roots, are among its first nodes, and how many these are."""
    levels, few = 0, exemplars
    begin = 0
    while levels < tree.depth:
        end = int(tree.children[begin:few].max()) + 2
        if end > max(_TOP, exemplars):
            break
        begin, few, levels = few, end, levels + 1
    return levels, few


def _product(vectors: Tensor, queries: Tensor, which: Tensor | None) -> Tensor:
    """The product of each vector ``(groups, size, features)`` with its group's query."""
    chosen = queries if which is None else queries.index_select(0, which)
    # Queries as rows: the other way around, this product is ten times slower.
    return torch.bmm(chosen.unsqueeze(1), vectors.transpose(1, 2)).squeeze(1)


def _descend(nodes: Nodes, queries: Tensor, at: Tensor) -> Int64[Tensor, " queries"]:
    """Go to the nearer child until there is none."""
    if nodes.top:
        nearer = queries @ nodes.toward[: nodes.few].T > nodes.limit[: nodes.few]
        after = nodes.steps[: nodes.few] + nearer
        at = at.unsqueeze(1)
        for _ in range(nodes.top):
            at = after.gather(1, at)
        at = at.squeeze(1)
    for _ in range(nodes.top, nodes.depth):
        products = nodes.toward.index_select(0, at).mul_(queries).sum(1)
        at = nodes.steps.index_select(0, at) + (products > nodes.limit.index_select(0, at))
    return at


def _descend_beam(nodes: Nodes, asked: _Asked, at: Tensor, beam: int) -> Int64[Tensor, "queries beam"]:
    """The best leaves of each query, nearest centroid first; nobody where there are fewer."""
    kept = at.unsqueeze(1)
    for _ in range(nodes.depth):
        offered = nodes.twins.index_select(0, kept.view(-1)).view(len(kept), -1)
        cost = asked.costs_of(nodes, offered)
        # A stable sort: among equals the one that grew first, and nobody last.
        order = cost.sort(dim=1, stable=True).indices[:, :beam]
        kept = offered.gather(1, order)
    return kept


def _best_of_blocks(state: TSVQState, asked: _Asked, leaves: Tensor) -> tuple[Tensor, Tensor]:
    """The cost and position of the best member in each block, the blocks of each query in a row.

    Blocks, and not leaves, because the number of members differs so much from leaf to leaf.
    """
    blocks, queries, places, most = _blocks_of(state.leaves, leaves)
    costs, sources = [], []
    few = max(1, _CHUNK // state.leaves.places.shape[1])
    for block, query in zip(blocks.split(few), queries.split(few), strict=True):
        members = state.leaves.places.index_select(0, block)
        vectors = state.members.index_select(0, members.view(-1)).view(*members.shape, -1)
        cost = asked.costs(query, vectors, state.leaves.lengths.index_select(0, block))
        smallest, place = cost.min(1)
        costs.append(smallest)
        sources.append(state.sites.index_select(0, members.gather(1, place.unsqueeze(1)).squeeze(1)))
    shape = len(leaves), most
    every = costs[0].new_full(shape, float("inf")).put_(places, torch.cat(costs))
    return every, sources[0].new_zeros(shape).put_(places, torch.cat(sources))


def _blocks_of(leaves: Leaves, chosen: Int64[Tensor, "queries beam"]) -> tuple[Tensor, Tensor, Tensor, int]:
    """The blocks of each query's leaves.

    Returns:
        The blocks, query after query; the query of each; where it lies if there is a row for each query;
        and how long these rows are.
    """
    flat = chosen.view(-1)
    sizes = leaves.sizes.index_select(0, flat)
    stops = sizes.cumsum(0)
    # What turns a block's number among all that are wanted into its number among all there are ...
    shift = leaves.first.index_select(0, flat) - stops + sizes
    rows = sizes.view(chosen.shape).sum(1)
    most = int(rows.max())
    # ... and into its place in a row.
    rows = torch.arange(0, len(rows) * most, most, device=rows.device) - rows.cumsum(0) + rows
    queries = torch.arange(len(rows), device=rows.device)
    owner = queries.repeat_interleave(sizes.view(chosen.shape).sum(1))
    numbers = torch.arange(len(owner), device=rows.device)
    blocks = numbers + shift.repeat_interleave(sizes, output_size=len(owner))
    return blocks, owner, numbers + rows.index_select(0, owner), most


def _numbers_per_query(state: TSVQState, beam: int) -> int:
    """The most numbers that a search holds for each query at once, beyond a chunk of members."""
    # For each block its own number, query and place, its cost and position, and these laid out in rows.
    blocks = 12 * beam * int(state.leaves.sizes.max())
    # The queries in three forms, and the nodes of a step.
    return blocks + (3 + 4 * beam) * state.members.shape[1] + 2 * _TOP
