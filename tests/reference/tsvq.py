"""Tree-structured vector quantization, literally: one node, one vector, one query at a time.

The report's tables 2.3 and 2.4 (after Wei & Levoy 2000, section 4), with what they leave open settled
as follows: centroids are rounded to whole numbers; the two starting centroids lie a quarter of the
standard deviation, rounded up, to either side of the node's own; ties go to the first child; a node
whose vectors all stay on one side is a leaf.
"""

from __future__ import annotations

import math

import numpy as np


def grow(vectors, weights, depth, threshold=1e-10, min_leaf=1, members=None):
    """The tree below a node as ``(centroid, members, children)``; no children at a leaf."""
    members = list(range(len(vectors))) if members is None else members
    centroid = mean([vectors[one] for one in members])
    return below(vectors, weights, depth, threshold, min_leaf, members, centroid)


def below(vectors, weights, depth, threshold, min_leaf, members, centroid):
    if depth == 0:
        return centroid, members, ()
    pair = perturbed([vectors[one] for one in members], centroid)
    sides, distortion = assign(vectors, weights, members, pair)
    while True:
        pair = [
            mean([vectors[one] for one in side]) if side else old
            for side, old in zip(sides, pair, strict=True)
        ]
        sides, now = assign(vectors, weights, members, pair)
        if not distortion - now > threshold * distortion:
            break
        distortion = now
    if min(map(len, sides)) < min_leaf:
        return centroid, members, ()
    children = tuple(
        below(vectors, weights, depth - 1, threshold, min_leaf, side, own)
        for side, own in zip(sides, pair, strict=True)
    )
    return centroid, members, children


def mean(vectors):
    return np.round(np.sum(vectors, axis=0) / len(vectors))


def perturbed(vectors, centroid):
    spread = sum((vector - centroid) ** 2 for vector in vectors)
    step = np.array([math.ceil(math.sqrt(value / len(vectors)) / 4) for value in spread])
    return [centroid - step, centroid + step]


def assign(vectors, weights, members, pair):
    sides, distortion = ([], []), 0
    for one in members:
        first, second = (distance(vectors[one], point, weights) for point in pair)
        sides[first > second].append(one)
        distortion += min(first, second)
    return sides, distortion


def distance(one, other, weights):
    return int((weights * (one - other) ** 2).sum())


def best_leaves(tree, weights, query, beam=1):
    """Keep the ``beam`` best nodes at each level, down to leaves; the nearest first."""
    kept = [tree]
    while any(node[2] for node in kept):
        offered = [child for node in kept for child in (node[2] or (node,))]
        offered.sort(key=lambda node: distance(query, node[0], weights))
        kept = offered[:beam]
    return kept


def best_member(tree, vectors, weights, query, beam=1):
    """The nearest member of the best leaves."""
    kept = best_leaves(tree, weights, query, beam)
    members = [one for _, leaf, _ in kept for one in leaf]
    return min(members, key=lambda one: distance(query, vectors[one], weights))
