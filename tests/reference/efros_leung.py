"""Efros & Leung 1999 and the GrowImage notes, literally: one image, one pixel, one candidate at a time.

get_unfilled_neighbors, find_matches, random_pick and grow are the functions of the notes. What paper and
notes leave open is settled as follows: values are whole numbers in 256 steps, the window's Gaussian
weights whole numbers in 1024; the center, which is never known, has no weight; candidates are the
sample's positions whose whole window, center included, lies inside and on valid pixels; "at most (1 +
epsilon) times the smallest" (the notes) instead of "less than" (the paper), without which a perfect match
would leave no list. A layer is the unfilled pixels with a filled 8-neighbor as they are when it begins,
those with many first, ties in an order drawn once; each pixel of it sees what was filled before. A window
of no weight matches every candidate and accepts any. Sampling "weighted by d" gives each match the weight
d_min / d in steps of 1/256, rounded half to even.
"""

from __future__ import annotations

import math

import numpy as np

from tests.reference.ashikhmin import around, difference, moved, square


def inside(place, size, torus):
    """The place, brought inside; None if it is outside."""
    (row, column), (height, width) = place, size
    if torus:
        return row % height, column % width
    return (row, column) if 0 <= row < height and 0 <= column < width else None


def visible(filled, place, offsets, torus):
    """The offsets that lead to a filled pixel, each with that pixel; as often as a small torus repeats it."""
    pairs = [(offset, inside(moved(place, offset), filled.shape, torus)) for offset in offsets]
    return [(offset, there) for offset, there in pairs if there is not None and filled[there]]


def candidates(valid, window):
    """The sample's positions whose whole window lies inside and on valid pixels, in raster order."""
    offsets = square(window)
    return [place for place in np.ndindex(valid.shape) if on_valid(valid, place, offsets)]


def on_valid(valid, place, offsets):
    return len(visible(valid, place, offsets, False)) == len(offsets)


def get_unfilled_neighbors(filled, order, torus):
    """One layer, in the order in which it is visited."""
    assert filled.any(), "nothing to grow from"
    unfilled = [place for place in np.ndindex(filled.shape) if not filled[place]]
    neighbors = {place: len(visible(filled, place, around(3), torus)) for place in unfilled}
    layer = [place for place in unfilled if neighbors[place] > 0]
    return sorted(layer, key=lambda place: (-neighbors[place], order[place]))


def onion(known, order, torus):
    """All unknown pixels, layer by layer, where every visit fills its pixel."""
    filled = known.copy()
    while not filled.all():
        for place in get_unfilled_neighbors(filled, order, torus):
            yield place
            filled[place] = True


def gaussian(window, sigma):
    """The whole-number weight of each offset of the window but its center."""
    return {(dy, dx): round(1024 * math.exp(-(dy**2 + dx**2) / (2 * sigma**2))) for dy, dx in around(window)}


def find_matches(template, image, sample, choices, weight, epsilon):
    """The candidates nearly as good as the best, in raster order, each after its difference."""
    found = []
    for candidate in choices:
        error = 0
        for offset, there in template:
            error += weight[offset] * difference(image[there], sample[moved(candidate, offset)])
        found.append((error, candidate))
    least = min(error for error, _ in found)
    return [(error, candidate) for error, candidate in found if error <= (1.0 + epsilon) * least]


def random_pick(matches, r, weighted):
    """One of the matches; ``r`` is a random whole number below 2 ** 31."""
    if not weighted:
        return matches[(r * len(matches)) >> 31]
    least = min(error for error, _ in matches)
    shares = [256 if least == 0 else round(256 * least / error) for error, _ in matches]
    mark, total = (r * sum(shares)) >> 31, 0
    for match, share in zip(matches, shares, strict=True):
        total += share
        if total > mark:
            return match
    raise AssertionError("the shares add up to more than the mark")


def grow(
    sample, valid, image, known, *, window, sigma, epsilon, max_error, growth, torus, order, draw, weighted=False
):  # fmt: skip
    """GrowImage: the image, the source of each grown pixel, and how many layers were visited.

    ``draw(row, column, layer)`` gives the random whole numbers; layers count from 1.
    """
    image, filled = image.copy(), known.copy()
    source = np.full((*known.shape, 2), -1)
    choices, weight = candidates(valid, window), gaussian(window, sigma)
    layers = 0
    while not filled.all():
        layers += 1
        progress = False
        for place in get_unfilled_neighbors(filled, order, torus):
            template = visible(filled, place, around(window), torus)
            total = sum(weight[offset] for offset, _ in template)
            matches = find_matches(template, image, sample, choices, weight, epsilon)
            error, best = random_pick(matches, int(draw(*place, layers)), weighted)
            if total == 0 or error < max_error * (total * sample.shape[2] * 255**2):
                image[place], source[place], filled[place] = sample[best], best, True
                progress = True
        if not progress:
            max_error *= growth
    return image, source, layers
