"""Ashikhmin's candidates (2001, section 3) in a hole, literally: one pixel, one candidate at a time.

The paper's order is by rows, and it fills no holes. Settled here: the order is that of Efros & Leung's
layers, in every pass from the pixels known at the start; the first pass sees only pixels that are known
or filled, the later ones all inside the image, and their pixel offers its own present source, too, in its
place among the neighbors. A neighbor without a source, or whose continuation is no candidate of the
sample, offers a random candidate instead. Values are whole numbers; among equals the candidate of the
first neighbor wins.
"""

from __future__ import annotations

import numpy as np

from tests.reference.ashikhmin import around, square
from tests.reference.efros_leung import candidates, onion, visible
from tests.reference.wei_levoy_fill import nearest, ssd


def fill(sample, valid, image, known, source, *, n, passes, order, spare, torus=False):
    """One level; ``source`` holds the known pixels' sample positions, -1 for none.

    Returns the sources; known pixels keep theirs. ``spare(number, row, column, k, count)`` is the index of the
    candidate that the k-th neighbor offers instead, in pass ``number``.
    """
    image = image.copy()
    source = np.where(known[..., None], source, -1)
    choices = candidates(valid, n)
    for number in range(passes):
        seen = known.copy() if number == 0 else np.ones_like(known)
        offering = around(n) if number == 0 else square(n)
        for place in onion(known, order, torus):
            offers = []
            neighbors = dict(visible(seen, place, offering, torus))
            for k, offset in enumerate(offering):
                if offset in neighbors:
                    offer = continued(source[neighbors[offset]], offset)
                    if offer not in choices:
                        offer = choices[int(spare(number, *place, k, len(choices)))]
                    offers.append(offer)
            template = visible(seen, place, around(n), torus)
            best = nearest(offers, lambda offer, template=template: ssd(template, image, sample, offer))
            source[place], image[place], seen[place] = best, sample[best], True
    return source


def continued(source, offset):
    """Where the neighbor's patch goes on; None if the neighbor has no source."""
    row, column = (int(number) for number in source)
    return None if (row, column) == (-1, -1) else (row - offset[0], column - offset[1])
