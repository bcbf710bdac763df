"""Kwatra et al. 2003, literally: one image, one patch, one offset, one arc at a time.

What the paper leaves open is settled as follows. Values are whole numbers in 256 steps, and the cost of a seam
is rounded to whole numbers of 1/64, at least one. The gradient at a pixel is its difference to the pixel on
the other side of the seam. Across an old seam a patch goes on as the sample does; where that ends, it has
the color that is there. A pixel of the overlap that borders on the old picture outside of the patch stays
old, or else, if it borders on pixels that only the patch covers, becomes new. Of several cheapest cuts, the
one that shows least of the new patch. While the output is not covered, places are considered that cover
something new and have some share of the patch on what is known, if there are any, and of these the ones that
cover at least half as much as the best. Chances are counted in steps of 2 ** -20. Afterwards patches are
laid over the window of the worst seams that was not mended yet, where they fit that window, and not where
the same patch was laid before. The picture lies on a torus; with borders it has an empty margin there.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

OLD, NEW = "old", "new"


def norm(vector):
    return math.sqrt(sum(int(value) ** 2 for value in vector))


def seam_cost(one, other):
    """The cost of a seam between two pixels of which patch ``one`` shows the first, ``other`` the second."""
    shown = norm(one[0] - other[0]) + norm(one[1] - other[1])
    slopes = norm(one[1] - one[0]) + norm(other[1] - other[0])
    return max(1, round(64 * shown / (1 + 2 * slopes)))


def shortest_path(rest):
    """The nodes from OLD to NEW along arcs that can carry more; None if there is no way."""
    before, waiting = {OLD: None}, [OLD]
    for node in waiting:
        for further, capacity in rest[node].items():
            if capacity > 0 and further not in before:
                before[further] = node
                waiting.append(further)
    if NEW not in before:
        return None
    path = [NEW]
    while path[0] != OLD:
        path.insert(0, before[path[0]])
    return path


def cheapest_cut(arcs):
    """The nodes on the side of NEW, by augmenting shortest paths; arcs run both ways."""
    rest = {OLD: {}, NEW: {}}
    for one, other, capacity in arcs:
        for a, b in ((one, other), (other, one)):
            rest.setdefault(a, {})
            rest[a][b] = rest[a].get(b, 0) + capacity
    while (path := shortest_path(rest)) is not None:
        steps = list(itertools.pairwise(path))
        least = min(rest[a][b] for a, b in steps)
        for a, b in steps:
            rest[a][b] -= least
            rest[b][a] += least
    side = [NEW]
    for node in side:
        side += [further for further in rest if further not in side and rest[further].get(node, 0) > 0]
    return set(side)


class Collage:
    """The picture as it grows, by cell of the torus."""

    def __init__(self, sample, valid, size, torus):
        self.sample, self.valid, self.size, self.torus = sample, valid, size, torus
        self.wanted = set(itertools.product(range(size[0]), range(size[1])))
        self.source = {}
        self.laid = []
        self.mended = set()

    def color(self, cell):
        return self.sample[self.source[cell]]

    def moved(self, cell, step):
        return ((cell[0] + step[0]) % self.torus[0], (cell[1] + step[1]) % self.torus[1])

    def continued(self, cell, step, otherwise):
        """What the patch of a cell shows one step further on."""
        y, x = self.source[cell][0] + step[0], self.source[cell][1] + step[1]
        inside = 0 <= y < self.valid.shape[0] and 0 <= x < self.valid.shape[1]
        return self.sample[y, x] if inside and self.valid[y, x] else self.color(otherwise)

    def patches(self, first, second, step):
        """What the patches of two neighbors show at both of them, and whether they differ."""
        (y, x), after = self.source[first], self.source[second]
        one = (self.color(first), self.continued(first, step, second))
        other = (self.continued(second, (-step[0], -step[1]), first), self.color(second))
        return one, other, after != (y + step[0], x + step[1])

    def cells(self, place, patch):
        """The cells under a patch, each with its pixel of the sample."""
        return {self.moved(place, offset): pixel for offset, pixel in patch.items()}

    def lay(self, cells):
        covered = {cell: pixel for cell, pixel in cells.items() if cell in self.wanted}
        overlap = [cell for cell in covered if cell in self.source]
        fresh = {cell for cell in covered if cell not in self.source}
        node = {}
        for cell in overlap:
            beside = [self.moved(cell, step) for step in ((0, 1), (0, -1), (1, 0), (-1, 0))]
            stays = any(one in self.source and one not in covered for one in beside)
            goes = any(one in fresh for one in beside)
            node[cell] = OLD if stays else NEW if goes else cell
        arcs = []
        for cell, step in itertools.product(overlap, ((1, 0), (0, 1))):
            second = self.moved(cell, step)
            if second not in node:
                continue
            new = (self.sample[covered[cell]], self.sample[covered[second]])
            one, other, differ = self.patches(cell, second, step)
            if differ:
                seam = (cell, second)
                arcs.append((node[cell], seam, seam_cost(one, new)))
                arcs.append((seam, node[second], seam_cost(other, new)))
                arcs.append((seam, NEW, seam_cost(one, other)))
            elif node[cell] != node[second]:
                arcs.append((node[cell], node[second], seam_cost(one, new)))
        arcs = [arc for arc in arcs if {arc[0], arc[1]} != {OLD, NEW} and arc[0] != arc[1]]
        side = cheapest_cut(arcs)
        for cell, pixel in covered.items():
            if cell in fresh or node[cell] in side:
                self.source[cell] = pixel
        return len(fresh)

    def means(self, patch, counted):
        """For each place: how many of the cells the patch covers there, and its mean squared difference to them."""
        found = {}
        for place in itertools.product(range(self.torus[0]), range(self.torus[1])):
            there = [(c, pixel) for c, pixel in self.cells(place, patch).items() if c in counted]
            cost = sum(int(((self.color(c) - self.sample[pixel]) ** 2).sum()) for c, pixel in there)
            found[place] = (len(there), cost / max(1, len(there)) / self.sample.shape[2])
        return found

    def worst(self, window, torus):
        """The cells of the window with the most expensive seams, and None if there are none."""
        costs = {}
        for cell, step in itertools.product(self.source, ((1, 0), (0, 1))):
            second = self.moved(cell, step)
            if second in self.source:
                one, other, differ = self.patches(cell, second, step)
                if differ:
                    costs[cell] = costs.get(cell, 0) + seam_cost(one, other)
        if not set(costs) - self.mended:
            self.mended = set()
        costs = {cell: cost for cell, cost in costs.items() if cell not in self.mended}
        if not costs:
            return None
        windows = {}
        for y, x in itertools.product(range(self.size[0]), range(self.size[1])):
            if torus or (y + window[0] <= self.size[0] and x + window[1] <= self.size[1]):
                offsets = itertools.product(range(window[0]), range(window[1]))
                windows[y, x] = [self.moved((y, x), offset) for offset in offsets]
        best = max(windows, key=lambda place: sum(costs.get(cell, 0) for cell in windows[place]))
        self.mended |= set(windows[best])
        return set(windows[best])


def by_chance(means, allowed, spread, r):
    """One of the allowed places, in raster order; ``r`` is a random whole number below 2 ** 31."""
    least = min(means[place][1] for place in allowed)
    steps = [round(2**20 * math.exp(-(means[place][1] - least) / spread)) for place in allowed]
    mark, total = (r * sum(steps)) >> 31, 0
    for place, number in zip(allowed, steps, strict=True):
        total += number
        if total > mark:
            return place
    raise AssertionError("the steps add up to more than the mark")


def graphcut(sample, valid, size, around, *, patch, overlap, k, refinements, torus, draw):
    """The source of each pixel. ``draw()`` gives the next random whole number."""
    usable = sample[valid]
    spread = k * sum(len(usable) * int((one**2).sum()) - int(one.sum()) ** 2 for one in usable.T)
    spread /= len(usable) ** 2 * sample.shape[2]
    collage = Collage(sample, valid, size, around)
    origins = [
        (y, x)
        for y, x in itertools.product(
            *(range(side - one + 1) for side, one in zip(valid.shape, patch, strict=True))
        )
        if patch == valid.shape or valid[y : y + patch[0], x : x + patch[1]].all()
    ]

    def step(mending):
        (top, left), r = origins[(draw() * len(origins)) >> 31], draw()
        offsets = itertools.product(range(patch[0]), range(patch[1]))
        pixels = {(y, x): (top + y, left + x) for y, x in offsets if valid[top + y, left + x]}
        if mending:
            window = [max(1, min(-(-one // 3), side)) for one, side in zip(patch, size, strict=True)]
            region = collage.worst(window, torus)
            if region is None:
                return
            means = collage.means(pixels, region)
            before = [((y + top) % around[0], (x + left) % around[1]) for y, x in collage.laid]
            allowed = [
                place for place, (count, _) in means.items() if count == len(region) and place not in before
            ]
            if not allowed:
                return
        else:
            means = collage.means(pixels, set(collage.source))
            open_ = collage.wanted - set(collage.source)
            new = {place: len(open_ & set(collage.cells(place, pixels))) for place in means}
            some = [place for place in means if new[place]]
            enough = [place for place in some if means[place][0] >= overlap * len(pixels)]
            allowed = enough or [place for place in some if means[place][0]] or some
            most = max(new[place] for place in allowed)
            allowed = [place for place in allowed if 2 * new[place] >= most]
        place = by_chance(means, allowed, spread, r)
        collage.laid.append((place[0] - top, place[1] - left))
        collage.lay(collage.cells(place, pixels))

    while set(collage.source) != collage.wanted:
        step(False)
    for _ in range(refinements):
        step(True)
    return np.array([[collage.source[y, x] for x in range(size[1])] for y in range(size[0])])
