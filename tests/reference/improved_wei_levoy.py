"""Wei & Levoy improved, literally: weighting and non-causal neighborhoods; the paper's sections 4.2 and 4.3.

Morphology and the image analogy that undoes it, section 4.1, are in ``analogy``. What the paper leaves open
is settled as in ``wei_levoy``, and further:

Weighting. Squared differences of the parent level count twice, always. From the exemplar's pyramid of
Gaussians every level but the finest is stretched, each channel by itself: ``(level - low) * (high_0 - low_0)
/ (high - low) + low_0``, with the smallest and largest value over the picture; a flat channel stays as it
is. Matching sees the stretched levels, the noise gets their histograms, and the output copies them.

Non-causal neighborhoods. "The bottom part" is as many rows as the causal neighborhood reaches up, the last
``h`` (all rows, if there are no more than that). Its pixels compare, of the square without its center, what
is synthesized at that moment, below and to the right as well; the rest of the square is left out of the sum.
The pass after that compares the whole square as it stands. Both take only candidates whose whole square
lies inside. With an open border there is no bottom part. The bottom part goes on to the first ``h`` rows, which
met noise where the last ones are now. Every row starts at ``h`` times its number in the pass: the first row of
the bottom part starts at the left.

On a torus smaller than the neighborhood a pixel is compared as often as the neighborhood meets it.
"""

from __future__ import annotations

import numpy as np

from tests.reference import ashikhmin
from tests.reference.ashikhmin import Canvas, above, around, mothers, moved, square, valid
from tests.reference.wei_levoy import match, pyramid, whole_numbers


def synthesize(exemplar, noise, levels, causal, parent, weighting, noncausal, torus=True, lonely=None):
    """``exemplar`` and ``noise`` are (C, H, W) in float64; returns the finest level's sources, (H, W, 2).

    ``causal`` is the side of both neighborhoods of the level itself. ``lonely`` is what a pixel without
    anything to compare takes, which only the very first of the coarsest level may be; without it, that is
    the first candidate.
    """
    return canvases(exemplar, noise, levels, causal, parent, weighting, noncausal, torus, lonely)[0].source


def canvases(exemplar, noise, levels, causal, parent, weighting, noncausal, torus=True, lonely=None):
    """All levels, from fine to coarse."""
    samples = pyramid(exemplar, levels, "reflect")
    if weighting:
        samples = [samples[0], *(stretched(sample, samples[0]) for sample in samples[1:])]
    done = []
    for canvas in reversed(prepared(samples, noise, torus)):
        passes(canvas, done[0] if done else None, causal, parent, 2 if weighting else 1, noncausal, lonely)
        done.insert(0, canvas)
    return done


def stretched(level, finest):
    """The level with the finest one's smallest and largest values, channel by channel."""
    planes = []
    for plane, model in zip(level, finest, strict=True):
        low, high = plane.min(), plane.max()
        if high > low:
            plane = (plane - low) * (model.max() - model.min()) / (high - low) + model.min()
        planes.append(plane)
    return np.stack(planes)


def prepared(samples, start, torus, matched=True):
    """A canvas for each level, which shows the start's pyramid, with the samples' histograms or as it is."""
    found = []
    for sample, begin in zip(samples, border_pyramid(start, len(samples), torus), strict=True):
        shown = match(begin, sample) if matched else begin
        canvas = Canvas(pixels(sample), shown.shape[1:], torus)
        canvas.value[:] = pixels(shown)
        found.append(canvas)
    return found


def border_pyramid(image, levels, torus):
    return pyramid(image, levels, "circular" if torus else "reflect")


def pixels(image):
    return whole_numbers(image).transpose(1, 2, 0)


def passes(canvas, coarse, causal, parent, weight, noncausal, lonely):
    """Section 4.2: one level, from the finished coarser one."""
    height, half = len(canvas.known), causal // 2
    upper, rounded = ashikhmin.causal(causal), around(causal)
    bottom = half if noncausal and canvas.torus else 0
    begin = max(0, height - bottom)

    def sweep(places, template, only_known=False):
        parents = [] if coarse is None else square(parent)
        choices = valid(canvas.sample, None if coarse is None else coarse.sample, template, parents)
        for place in places:

            def seen(offset, place=place):
                there = canvas.at(*moved(place, offset))
                return there if there is not None and (canvas.known[there] or not only_known) else None

            def cost(candidate, place=place, seen=seen):
                total = above(canvas, seen, candidate, template)
                return total + (weight * mothers(coarse, place, candidate, parents) if parents else 0)

            alone = not parents and not any(map(seen, template))
            best = lonely if alone and lonely is not None else min(choices, key=cost)
            canvas.set(place, best)
            canvas.known[place] = True

    sweep(scan(canvas, range(begin), half), upper)
    last, first = range(begin, height), range(min(bottom, height))
    band = [*last, *(row for row in first if row not in last)]
    places = ((band[row], column) for row, column in scan(canvas, range(len(band)), half))
    sweep(places, rounded, only_known=True)
    if noncausal:
        sweep(scan(canvas, range(height), half), rounded)


def scan(canvas, rows, half):
    """The places of some rows, one after the other; on a torus each row starts ``half`` further right."""
    width = canvas.known.shape[1]
    for row in rows:
        for step in range(width):
            yield row, (step + row * half) % width if canvas.torus else step
