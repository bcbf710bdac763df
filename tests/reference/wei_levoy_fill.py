"""Constrained synthesis of Wei & Levoy 2000, section 5.1, literally: one pixel, one candidate at a time.

Known pixels stay; the others are filled from the hole's border inwards, level by level, each level twice.
What the paper leaves open is settled as follows: the order is that of Efros & Leung's layers, in both
passes from the level's own known pixels; the first pass compares known and already filled pixels only,
the second all neighbors in their present state; both compare the square around the parent in the finished
coarser level, too. Neighbors and parents outside do not count. Values are whole numbers; ties go to the
first candidate in raster order.
"""

from __future__ import annotations

import numpy as np

from tests.reference.ashikhmin import around, difference, moved, square
from tests.reference.efros_leung import candidates, on_valid, onion, visible


def mother(place):
    return place[0] // 2, place[1] // 2


def ssd(template, image, sample, candidate):
    """The difference between what is visible in the image and the same around the candidate."""
    return sum(difference(image[there], sample[moved(candidate, offset)]) for offset, there in template)


def nearest(choices, cost):
    best = None
    for candidate in choices:
        total = cost(candidate)
        if best is None or total < best[0]:
            best = total, candidate
    return best[1]


def fill(samples, valids, images, knowns, *, n, parent, orders, torus=False):
    """Pyramids from fine to coarse; returns the finest level's sources, -1 where a pixel was known.

    ``orders`` ranks each level's pixels.
    """
    outputs = [image.copy() for image in images]
    source = None
    for level in reversed(range(len(samples))):
        coarse = level + 1 if level + 1 < len(samples) else None
        choices = candidates(valids[level], n)
        if coarse is not None:
            choices = [one for one in choices if on_valid(valids[coarse], mother(one), square(parent))]
        source = np.full((*knowns[level].shape, 2), -1)
        for seen in (knowns[level].copy(), np.ones_like(knowns[level])):
            for place in onion(knowns[level], orders[level], torus):
                here = visible(seen, place, around(n), torus)
                above = []
                if coarse is not None:
                    everything = np.ones_like(knowns[coarse])
                    above = visible(everything, mother(place), square(parent), torus)

                def cost(candidate, level=level, coarse=coarse, here=here, above=above):
                    total = ssd(here, outputs[level], samples[level], candidate)
                    if coarse is not None:
                        total += ssd(above, outputs[coarse], samples[coarse], mother(candidate))
                    return total

                best = nearest(choices, cost)
                source[place], outputs[level][place], seen[place] = best, samples[level][best], True
    return source
