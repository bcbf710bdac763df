"""Efros & Freeman 2001, literally: one image, one block, one pixel, one cut at a time.

What the paper leaves open is settled as follows: values are whole numbers in 256 steps; the pixel on a cut
shows the new block, and where there are several cuts a pixel has to lie beyond all of them; of equally cheap
cuts the lowest column (or row) is taken, beginning at the far end. A block that fits perfectly does not
stand alone, unless ``verbatim`` says so: the smallest error above 0 counts for the tolerance. With borders,
blocks stick out of the image, which costs nothing. On a torus they are spread evenly, and those that
reach around it also overlap the first ones. In transfer, overlap and target count in thousandths.
"""

from __future__ import annotations

import itertools

import numpy as np


def starts(side, block, overlap, torus):
    """Where blocks begin along one side."""
    if torus:
        number = -(-side // (block - overlap))
        return [number_ * side // number for number_ in range(number)]
    found = [0]
    while found[-1] + block < side:
        found.append(found[-1] + block - overlap)
    return found


def candidates(valid, block):
    """The sample's positions at which a whole block lies on valid pixels, in raster order."""
    height, width = valid.shape
    corners = itertools.product(range(height - block + 1), range(width - block + 1))
    return [(y, x) for y, x in corners if valid[y : y + block, x : x + block].all()]


def error_of(sample, corner, wanted):
    """The weighted squared difference between the sample's block there and what is wanted."""
    total = 0
    for (dy, dx), terms in wanted.items():
        pixel = sample[corner[0] + dy, corner[1] + dx]
        total += sum(weight * int(((pixel - value) ** 2).sum()) for weight, value in terms)
    return total


def pick(errors, tolerance, verbatim, r):
    """One of the candidates that fit nearly best; ``r`` is a random whole number below 2 ** 31."""
    counted = [error for error in errors.values() if verbatim or error > 0]
    limit = (1.0 + tolerance) * min(counted) if counted else 0.0
    near = [corner for corner, error in errors.items() if error <= limit]
    return near[(r * len(near)) >> 31]


def cut(error):
    """The cheapest path down a strip (rows x columns), by the paper's recurrence: a column for each row."""
    rows, columns = error.shape
    upto = error.astype(object)
    for y, x in itertools.product(range(1, rows), range(columns)):
        upto[y, x] = error[y, x] + min(upto[y - 1, max(0, x - 1) : x + 2])
    path = [min(range(columns), key=lambda x: upto[-1, x])]
    for y in range(rows - 2, -1, -1):
        near = range(max(0, path[0] - 1), min(columns, path[0] + 2))
        path.insert(0, min(near, key=lambda x: upto[y, x]))
    return path


def beyond(error, above, left, below, right):
    """Where the new block is shown, given how wide the overlaps on its sides are."""
    block = len(error)
    shown = np.ones((block, block), dtype=bool)
    strips = {
        "left": (error[:, :left], left, lambda line, depth: (line, depth)),
        "right": (error[:, ::-1][:, :right], right, lambda line, depth: (line, block - 1 - depth)),
        "above": (error.T[:, :above], above, lambda line, depth: (depth, line)),
        "below": (error[::-1].T[:, :below], below, lambda line, depth: (block - 1 - depth, line)),
    }
    for strip, width, place in strips.values():
        if width > 0:
            for line, first in enumerate(cut(strip)):
                for depth in range(first):
                    shown[place(line, depth)] = False
    return shown


def quilt(sample, valid, size, *, block, overlap, torus, tolerance, verbatim, draw, image=None, source=None,
          target=None, region=None, shares=(1, 0), repeated=False):  # fmt: skip
    """One pass: the image and the source of each pixel. ``draw(block)`` gives the random whole numbers."""
    height, width = size
    image = np.zeros((height, width, sample.shape[2]), dtype=int) if image is None else image.copy()
    source = np.full((height, width, 2), -1) if source is None else source.copy()
    laid = np.zeros(size, dtype=bool)
    tops, lefts = (starts(side, block, overlap, torus) for side in size)
    corners = candidates(valid, block)
    for number, ((i, top), (j, left)) in enumerate(itertools.product(enumerate(tops), enumerate(lefts))):
        under = {}
        for dy, dx in itertools.product(range(block), repeat=2):
            y, x = ((top + dy) % height, (left + dx) % width) if torus else (top + dy, left + dx)
            if y < height and x < width:
                under[dy, dx] = (y, x)
        wanted = {}
        for offset, there in under.items():
            terms = [(shares[0], image[there])] if repeated or laid[there] else []
            if target is not None and region[there]:
                terms.append((shares[1], target[there]))
            wanted[offset] = terms
        errors = {corner: error_of(sample, corner, wanted) for corner in corners}
        y, x = pick(errors, tolerance, verbatim, draw(number))
        difference = np.zeros((block, block), dtype=int)
        for (dy, dx), there in under.items():
            difference[dy, dx] = ((sample[y + dy, x + dx] - image[there]) ** 2).sum()
        around = (
            block - (top - tops[i - 1]) if i else 0,
            block - (left - lefts[j - 1]) if j else 0,
            max(0, top + block - height) if torus else 0,
            max(0, left + block - width) if torus else 0,
        )
        shown = beyond(difference, *around)
        for (dy, dx), there in under.items():
            laid[there] = True
            if shown[dy, dx]:
                image[there], source[there] = sample[y + dy, x + dx], (y + dy, x + dx)
    return image, source


def transfer(sample, valid, target, region, *, passes, block, overlap, torus, tolerance, verbatim, draw):
    """Texture transfer: passes with ever smaller blocks. ``draw(pass, block)`` gives the random numbers."""
    image = source = None
    for number in range(passes):
        side = round(block * (2 / 3) ** number)
        alpha = 0.8 * number / (passes - 1) + 0.1 if passes > 1 else 0.1
        shares = (round(1000 * alpha), 1000 - round(1000 * alpha))
        image, source = quilt(
            sample, valid, target.shape[:2], block=side, overlap=max(1, round(side * overlap / block)), torus=torus,
            tolerance=tolerance, verbatim=verbatim, draw=lambda one, number=number: draw(number, one), image=image,
            source=source, target=target, region=region, shares=shares, repeated=number > 0,
        )  # fmt: skip
    return image, source
