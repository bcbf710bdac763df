"""Image analogies, literally: Hertzmann et al. 2001, section 3, and section 4.1 of the improved Wei & Levoy.

A' is to A as B' is to B. B' is made one pixel at a time, row by row, by exhaustive search, and optionally
with the preference for coherence: the best of the candidates that continue the patch of a neighbor is taken
instead of the best of all, if its squared difference is at most ``1 + kappa * 2 ** -level`` times as large
(level 0 is the finest). What is left open is settled as in ``wei_levoy``, and further: all pixels and
channels count the same; the level's own neighborhoods in B are square, center included; the pyramids of A
and A' are mirrored at the border, those of B and of the noise, which has the histograms of A', go around
on a torus; candidates are the positions whose neighborhoods, of all kinds, lie inside. What lies outside of
B and B' does not count. On a torus each row starts half a causal neighborhood further right; what is not
synthesized there is compared as noise, but offers no coherent candidate. Nor does a neighbor whose patch
goes on where there is no candidate. Among equals the first candidate in raster order wins, and a coherent
one that is as good as the best of all is taken.
"""

from __future__ import annotations

import numpy as np

from tests.reference import improved_wei_levoy
from tests.reference.ashikhmin import above, around, causal, mothers, moved, square, valid
from tests.reference.efros_leung import visible
from tests.reference.improved_wei_levoy import prepared, scan
from tests.reference.wei_levoy import pyramid


def synthesize(
    a, a_prime, b, noise, levels, neighborhood, parent, guide, coarse_guide=None, torus=False, kappa=None,
    tileable=False,
):  # fmt: skip
    """The finest level's sources in A', (OH, OW, 2).

    ``tileable`` leaves the last rows of each level, on a torus, to a pass that compares what is known of the
    square around a pixel, and goes on to the first rows.

    ``a`` is (G, H, W), ``a_prime`` (C, H, W), ``b`` (G, OH, OW) and ``noise`` (C, OH, OW), all in float64.
    ``neighborhood`` is causal, of B'; ``parent`` square, of B' one level up; ``guide`` square, of B;
    ``coarse_guide`` square, of B one level up. What is None is not compared. ``kappa`` None means no
    preference for coherence.
    """
    return canvases(
        a, a_prime, b, noise, levels, neighborhood, parent, guide, coarse_guide, torus, kappa, tileable
    )[0].source  # fmt: skip


def canvases(
    a, a_prime, b, noise, levels, neighborhood, parent, guide, coarse_guide=None, torus=False, kappa=None,
    tileable=False,
):  # fmt: skip
    """All levels of B', from fine to coarse."""
    results = prepared(pyramid(a_prime, levels, "reflect"), noise, torus)
    guides = prepared(pyramid(a, levels, "reflect"), b, torus, matched=False)
    for level in reversed(range(levels)):
        layers = [(results[level], causal(neighborhood), False), (guides[level], side(guide), False)]
        if level + 1 < levels:
            layers += [
                (results[level + 1], side(parent), True),
                (guides[level + 1], side(coarse_guide), True),
            ]
        fill(results[level], layers, neighborhood, None if kappa is None else kappa * 2.0**-level, tileable)
    return results


def side(size):
    return [] if size is None else square(size)


def fill(result, layers, neighborhood, extra, tileable=False):
    """One level of B', row by row; ``layers`` are canvas, offsets, and whether it is one level up."""
    height, half = len(result.known), neighborhood // 2
    bottom = half if tileable else 0
    begin = max(0, height - bottom)
    visit(result, scan(result, range(begin), half), layers, neighborhood, extra)
    last, first = range(begin, height), range(min(bottom, height))
    band = [*last, *(row for row in first if row not in last)]
    # These rows count from the first of them: it starts at the left.
    places = ((band[row], column) for row, column in scan(result, range(len(band)), half))
    visit(result, places, [(result, around(neighborhood), False), *layers[1:]], neighborhood, extra, True)


def visit(result, places, layers, neighborhood, extra, only_known=False):
    choices = candidates(layers)
    for place in places:
        known = result.known if only_known else None
        costs = {one: difference(layers, place, one, result, known) for one in choices}
        best = min(choices, key=costs.get)
        if extra is not None:
            offers = coherent(result, place, causal(neighborhood), choices)
            best = preferred(best, offers, costs, extra)
        result.set(place, best)
        result.known[place] = True


def candidates(layers):
    """The positions in A', and so in A, whose neighborhoods lie inside, in raster order."""
    samples, offsets = {True: None}, {False: [], True: []}
    for canvas, compared, up in layers:
        if compared:
            samples[up] = canvas.sample
            offsets[up] += compared
    return valid(samples[False], samples[True], offsets[False], offsets[True])


def difference(layers, place, candidate, result, known):
    """The squared differences; of B' itself only those of known pixels, unless all count."""
    total = 0
    for canvas, offsets, up in layers:

        def seen(offset, canvas=canvas):
            there = canvas.at(*moved(place, offset))
            left_out = there is not None and known is not None and canvas is result and not known[there]
            return None if left_out else there

        total += mothers(canvas, place, candidate, offsets) if up else above(canvas, seen, candidate, offsets)
    return total


def coherent(result, place, offsets, choices):
    """The candidates that continue the patches of synthesized neighbors, in raster order."""
    neighbors = visible(result.known, place, offsets, result.torus)
    found = {moved(result.source[there], (-dy, -dx)) for (dy, dx), there in neighbors}
    return [one for one in choices if one in found]


def preferred(best, offers, costs, extra):
    """The best coherent candidate, unless it is too much worse than the best of all."""
    if not offers:
        return best
    favorite = min(offers, key=costs.get)
    return favorite if costs[favorite] <= costs[best] * (1 + extra) else best


def morphology(image, size, operation):
    """``erosion`` or ``dilation`` of (C, H, W) by a square, of which only what lies inside counts."""
    choose = {"erosion": np.min, "dilation": np.max}[operation]
    result, half = np.empty_like(image), size // 2
    for row, column in np.ndindex(image.shape[1:]):
        rows, columns = (slice(max(0, at - half), at + half + 1) for at in (row, column))
        result[:, row, column] = choose(image[:, rows, columns], axis=(1, 2))
    return result


def improved(
    exemplar, noise, levels, causal, parent, weighting, noncausal, *, operation, size, neighborhood, guide,
    second_noise=None,
):  # fmt: skip
    """Section 4.1, on a torus: the sources of the output in the exemplar, and those of Ss in Sa.

    With non-causal passes the analogy is tileable: else it would undo the seam of Ss. Its output starts as the second noise, the first one again if there is none.
    """
    eroded = morphology(np.asarray(exemplar), size, operation)
    source = improved_wei_levoy.synthesize(eroded, noise, levels, causal, parent, weighting, noncausal)
    guided = eroded[:, source[..., 0], source[..., 1]]
    start = noise if second_noise is None else second_noise
    return (
        synthesize(
            eroded, exemplar, guided, start, 1, neighborhood, None, guide, torus=True, tileable=noncausal
        ),
        source,
    )
