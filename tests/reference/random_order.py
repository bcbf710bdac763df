"""Random order and distorted synthesis, literally: the report on both algorithms, section 3 and 3.1.

Each level is built twice: all pixels from the coarser level alone (the coarsest from the noise), then one
after the other in random order with a symmetric neighborhood. A field of angle and scale turns and scales
the neighborhood in the output; the one in the sample keeps its shape. What is left open is settled as
follows: angles are counter-clockwise as displayed; a distorted offset is rounded to the nearest pixel
(halves to even); a coarser level sees the field's value in the middle of the pixels it covers; values are
compared as whole numbers; ties go to the first candidate in raster order. With Ashikhmin's search both passes
choose among what continues the patches of the pixel and its neighbors, as he does; the coarsest level begins
with random positions, and any other with the children of the coarser level's.
"""

from __future__ import annotations

import math

import numpy as np

from tests.reference import ashikhmin


def square(size, center):
    half = range(-(size // 2), size // 2 + 1)
    return [(dy, dx) for dy in half for dx in half if center or (dy, dx) != (0, 0)]


def distorted(offset, angle, scale):
    turn = math.radians(angle)
    dy, dx = offset
    return (
        round(round(scale * (dy * math.cos(turn) - dx * math.sin(turn)), 6)),
        round(round(scale * (dy * math.sin(turn) + dx * math.cos(turn)), 6)),
    )


def value(image, row, column, torus):
    height, width = image.shape[:2]
    if torus:
        return image[row % height, column % width]
    return image[row, column] if 0 <= row < height and 0 <= column < width else None


def best(sample, coarse_sample, seen, result, parent):
    """The first sample position with the smallest difference; ``seen`` are values in the same order."""
    found = None
    for row in range(sample.shape[0]):
        for column in range(sample.shape[1]):
            offered = [value(sample, row + dy, column + dx, False) for dy, dx in result]
            offered += [value(coarse_sample, row // 2 + dy, column // 2 + dx, False) for dy, dx in parent]
            if any(one is None for one in offered):
                continue
            cost = sum(
                int(((one - other) ** 2).sum())
                for one, other in zip(offered, seen, strict=True)
                if other is not None
            )
            if found is None or cost < found[0]:
                found = cost, (row, column)
    return found[1]


def synthesize(samples, noise, orders, n, parent, torus, field=None):
    """Pyramids of whole numbers (H, W, C), fine to coarse; ``orders`` lists each level's pixels.

    ``field(level)`` gives angle and scale of a pixel of a level. Returns the finest level's sources.
    """
    levels = len(samples)
    outputs = [image.copy() for image in noise]
    mothers = square(parent, center=True)
    source = None
    for level in reversed(range(levels)):
        sample, output = samples[level], outputs[level]
        coarsest = level == levels - 1
        source = np.zeros((*output.shape[:2], 2), dtype=int)

        def look(place, result, above, level=level, output=output):
            angle, scale = field(level)(*place) if field else (0, 1)
            seen = []
            for image, cell, offsets in (
                (output, place, result),
                (None if not above else outputs[level + 1], (place[0] // 2, place[1] // 2), above),
            ):
                for offset in offsets:
                    dy, dx = distorted(offset, angle, scale)
                    seen.append(value(image, cell[0] + dy, cell[1] + dx, torus))
            return seen

        def choose(place, result, above, level=level, sample=sample):
            coarse = samples[level + 1] if above else None
            return best(sample, coarse, look(place, result, above), result, above)

        result = square(n, center=False)
        first = (result, []) if coarsest else ([], mothers)
        at_once = {place: choose(place, *first) for place in orders[level]}
        for place, one in at_once.items():
            source[place], output[place] = one, sample[one]
        for place in orders[level]:
            one = choose(place, result, [] if coarsest else mothers)
            source[place], output[place] = one, sample[one]
    return source


def coherent(samples, sizes, orders, n, parent, draws, torus, field=None):
    """The same with Ashikhmin's candidates; ``draws()`` gives the random numbers of the start and each pass."""
    coarse = None
    for level in reversed(range(len(samples))):
        canvas = ashikhmin.Canvas(samples[level], sizes[level], torus)
        result, mothers = square(n, center=False), [] if coarse is None else square(parent, center=True)
        if coarse is None:
            ashikhmin.start(canvas, ashikhmin.valid(canvas.sample, None, result, ()), draws())
        else:
            ashikhmin.inherit(canvas, coarse)
        turning = field(level) if field else None
        draw = draws()
        first = (result, []) if coarse is None else ([], mothers)
        at_once = {
            place: continued(canvas, coarse, place, *first, n, draw, turning) for place in orders[level]
        }
        for place, source in at_once.items():
            canvas.set(place, source)
        draw = draws()
        for place in orders[level]:
            canvas.set(place, continued(canvas, coarse, place, result, mothers, n, draw, turning))
        coarse = canvas
    return coarse.source


def continued(canvas, coarse, place, result, mothers, n, draw, turning):
    """The best of what continues the patches around a place; ``turning`` gives its angle and scale."""
    coarse_sample = None if coarse is None else coarse.sample
    choices = ashikhmin.valid(canvas.sample, coarse_sample, result, mothers)

    def turned(offset):
        return distorted(offset, *turning(*place)) if turning else offset

    def seen(offset):
        return canvas.at(*ashikhmin.moved(place, turned(offset)))

    def cost(candidate):
        total = ashikhmin.above(canvas, seen, candidate, result)
        for offset in mothers:
            there = coarse.at(*ashikhmin.moved((place[0] // 2, place[1] // 2), turned(offset)))
            if there is not None:
                twin = ashikhmin.moved((candidate[0] // 2, candidate[1] // 2), offset)
                total += ashikhmin.difference(coarse_sample[twin], coarse.value[there])
        return total

    offering = square(n, center=True)
    return min(ashikhmin.candidates(canvas, place, seen, choices, draw, offering, False), key=cost)
