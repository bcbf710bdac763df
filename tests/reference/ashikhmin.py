"""Ashikhmin 2001, literally: one sample, one pixel at a time, one candidate at a time.

Section 3 for the algorithm, its tileable variant and the rule against the sample's bottom; section 4 for
painted targets; the report on both algorithms, section 2.2 e, for several levels. What they leave open is
settled as follows: each row of a toroidal output starts ``h`` columns further right than the one above;
values are compared as whole numbers in 256 steps; among equals the candidate of the first neighbor wins;
without a noise start, pixels that are not synthesized yet are neither compared nor offer candidates.
"""

from __future__ import annotations

import numpy as np

HERE = (0, 0)


class Canvas:
    """One level: values, where they come from, and which pixels are synthesized."""

    def __init__(self, sample, size, torus):
        self.sample, self.torus = sample, torus
        self.value = np.zeros((*size, sample.shape[2]), dtype=int)
        self.source = np.full((*size, 2), -1)
        self.known = np.zeros(size, dtype=bool)

    def set(self, place, source):
        self.source[place] = source
        self.value[place] = self.sample[tuple(source)]

    def at(self, row, column):
        """The place, brought inside; None if it is outside."""
        height, width = self.known.shape
        if self.torus:
            return row % height, column % width
        return (row, column) if 0 <= row < height and 0 <= column < width else None


def square(size):
    half = range(-(size // 2), size // 2 + 1)
    return [(dy, dx) for dy in half for dx in half]


def causal(size):
    return [offset for offset in square(size) if offset < HERE]


def anticausal(size):
    return [offset for offset in square(size) if offset >= HERE]


def around(size):
    return [offset for offset in square(size) if offset != HERE]


def valid(sample, coarse, result, parent):
    """The sample's positions whose neighborhoods lie inside, in raster order."""
    height, width = sample.shape[:2]
    places = [(r, c) for r in range(height) for c in range(width) if within(sample, r, c, result)]
    if coarse is None:
        return places
    return [(r, c) for r, c in places if within(coarse, r // 2, c // 2, parent)]


def within(sample, row, column, offsets):
    height, width = sample.shape[:2]
    return all(0 <= row + dy < height and 0 <= column + dx < width for dy, dx in [*offsets, HERE])


def difference(one, other):
    return int(((one.astype(int) - other) ** 2).sum())


def sweep(
    canvas, rows, half, draw, compared, offering, *, noise, spare_bottom=False, coarse=None, parent=(),
    target=None, painted=None, below=(),
):  # fmt: skip
    """Visit the given rows; ``coarse`` is the finished coarser canvas, ``draw`` the random numbers."""
    width = canvas.known.shape[1]
    coarse_sample = None if coarse is None else coarse.sample
    choices = valid(canvas.sample, coarse_sample, [*compared, *below], parent)
    for number, row in enumerate(rows):
        for step in range(width):
            place = row, (step + number * half) % width if canvas.torus else step

            def seen(offset, place=place):
                there = canvas.at(*moved(place, offset))
                return there if there is not None and (noise or canvas.known[there]) else None

            def cost(candidate, place=place, seen=seen):
                total = above(canvas, seen, candidate, compared)
                if coarse is not None:
                    total += mothers(coarse, place, candidate, parent)
                return total + painting(canvas, place, candidate, below, target, painted)

            offers = candidates(canvas, place, seen, choices, draw, offering, spare_bottom)
            canvas.set(place, min(offers, key=cost))
            canvas.known[place] = True


def candidates(canvas, place, seen, choices, draw, offering, spare_bottom):
    """What continues the neighbors' patches, without duplicates; a random position if nothing does."""
    lowest, highest = choices[-1][0], choices[0][0]
    found = []
    for number, (dy, dx) in enumerate(offering):
        neighbor = seen((dy, dx))
        if neighbor is None:
            continue
        spare = choices[draw.spare(*place, number, len(choices))]
        row, column = canvas.source[neighbor] - (dy, dx)
        candidate = (row, column) if (row, column) in choices else spare
        if spare_bottom:
            distance = (lowest - candidate[0]) / max(1, lowest - highest)
            if draw.chance(*place, number) ** distance > distance:
                candidate = spare
        if candidate not in found:
            found.append(candidate)
    return found or [choices[draw.spare(*place, 0, len(choices))]]


def above(canvas, seen, candidate, compared):
    """The difference to the part of the output that can be seen."""
    pairs = [(moved(candidate, offset), seen(offset)) for offset in compared]
    return sum(
        difference(canvas.sample[twin], canvas.value[there]) for twin, there in pairs if there is not None
    )


def mothers(coarse, place, candidate, parent):
    """The difference to the coarser level around the parent."""
    total = 0
    for offset in parent:
        there = coarse.at(*moved((place[0] // 2, place[1] // 2), offset))
        if there is not None:
            twin = moved((candidate[0] // 2, candidate[1] // 2), offset)
            total += difference(coarse.sample[twin], coarse.value[there])
    return total


def painting(canvas, place, candidate, below, target, painted):
    """The difference to what was painted of the target."""
    total = 0
    for offset in below:
        there = canvas.at(*moved(place, offset))
        if there is not None and painted[there]:
            total += difference(canvas.sample[moved(candidate, offset)], target[there])
    return total


def moved(place, offset):
    return place[0] + offset[0], place[1] + offset[1]


def start(canvas, choices, draw):
    """A random valid position for every pixel."""
    for place in np.ndindex(canvas.known.shape):
        canvas.set(place, choices[draw.start(*place, len(choices))])


def inherit(canvas, coarse):
    """Every pixel begins with the children of its parent's source."""
    limits = np.array(canvas.sample.shape[:2]) - 1
    for row, column in np.ndindex(canvas.known.shape):
        up, left = np.minimum((row // 2, column // 2), np.array(coarse.known.shape) - 1)
        child = 2 * coarse.source[up, left] + (row - 2 * up, column - 2 * left)
        canvas.set((row, column), np.minimum(child, limits))
    canvas.known[:] = True


def synthesize(sample, size, n, draws, *, torus=True, noise=False, tileable=False, spare_bottom=False):
    """Section 3. ``draws()`` gives the random numbers of each sweep; returns the canvas."""
    canvas, half = Canvas(sample, size, torus), n // 2
    height = size[0]
    start(canvas, valid(sample, None, causal(n), ()), draws())
    rows = range(max(0, height - half)) if tileable else range(height)
    sweep(canvas, rows, half, draws(), causal(n), causal(n), noise=noise, spare_bottom=spare_bottom)
    if tileable:
        last, first = range(max(0, height - half), height), range(min(half, height))
        band = [*last, *(row for row in first if row not in last)]
        sweep(canvas, band, half, draws(), around(n), around(n), noise=False, spare_bottom=spare_bottom)
    return canvas


def follow(sample, size, n, draws, target, painted, passes, *, torus=True, noise=False):
    """Section 4: the target is compared below; after the first pass all neighbors offer candidates."""
    canvas, half = Canvas(sample, size, torus), n // 2
    start(canvas, valid(sample, None, square(n), ()), draws())
    for number in range(passes):
        offering = causal(n) if number == 0 else square(n)
        sweep(
            canvas, range(size[0]), half, draws(), causal(n), offering, noise=noise,
            target=target, painted=painted, below=anticausal(n),
        )  # fmt: skip
    return canvas


def multires(samples, sizes, n, parent, draws, *, torus=True, noise=False):
    """The report's section 2.2 e; samples and sizes from fine to coarse, as a pyramid has them."""
    coarse = None
    for sample, size in reversed(list(zip(samples, sizes, strict=True))):
        canvas = Canvas(sample, size, torus)
        if coarse is None:
            start(canvas, valid(sample, None, causal(n), ()), draws())
            sweep(canvas, range(size[0]), n // 2, draws(), causal(n), causal(n), noise=noise)
        else:
            inherit(canvas, coarse)
            sweep(
                canvas, range(size[0]), n // 2, draws(), causal(n), square(n), noise=noise,
                coarse=coarse, parent=square(parent),
            )  # fmt: skip
        coarse = canvas
    return coarse
