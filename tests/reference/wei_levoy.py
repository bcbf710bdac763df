"""Wei & Levoy 2000, literally: one sample, one pixel at a time, one candidate at a time.

Table 1 of the paper and section 2.3 for several resolutions, with what the paper leaves open settled
as follows: each row of a toroidal output starts ``h`` columns further right than the one above (``h``
is half the neighborhood); values are compared as whole numbers in 256 steps; ties go to the first
candidate in raster order; with an open border, neighbors outside do not count.
"""

from __future__ import annotations

import numpy as np
import torch
from kornia.contrib import histogram_matching
from kornia.geometry import pyrdown


def synthesize(exemplar, noise, levels, causal, parent, torus=True, lonely=None):
    """``exemplar`` and ``noise`` are (C, H, W) in float64; returns the finest level's sources.

    The pair (row, column) of each output pixel. ``lonely`` is what a pixel without any neighbor takes:
    the paper, whose outputs are toroidal, does not say.
    """
    samples = pyramid(exemplar, levels, "reflect")
    outputs = pyramid(noise, levels, "circular" if torus else "reflect")
    outputs = [match(output, sample) for output, sample in zip(outputs, samples, strict=True)]
    coarse_sample = coarse_output = source = None
    for level in reversed(range(levels)):
        sample, output = whole_numbers(samples[level]), whole_numbers(outputs[level])
        source = level_sources(sample, output, coarse_sample, coarse_output, causal, parent, torus, lonely)
        coarse_sample, coarse_output = sample, output
    return source


def level_sources(sample, output, coarse_sample, coarse_output, causal, parent, torus, lonely):
    """Synthesize one level into ``output``, in place; returns where each pixel came from."""
    height, width = output.shape[1:]
    source = np.full((height, width, 2), -1)
    candidates = list(interior(sample, coarse_sample, causal, parent))
    for row in range(height):
        for step in range(width):
            column = (step + row * (causal // 2)) % width if torus else step
            wanted = neighborhood(output, coarse_output, row, column, causal, parent, torus)
            best = None
            for r, c in candidates:
                offered = neighborhood(sample, coarse_sample, r, c, causal, parent, False)
                cost = sum(
                    (a - b) ** 2
                    for one, other in zip(wanted, offered, strict=True)
                    if one is not None
                    for a, b in zip(one, other, strict=True)
                )
                if best is None or cost < best[0]:
                    best = cost, (r, c)
            if not any(wanted):
                best = 0, lonely
            source[row, column] = best[1]
            output[:, row, column] = sample[:, best[1][0], best[1][1]]
    return source


def neighborhood(image, coarse, row, column, causal, parent, torus):
    """The compared pixels around a place; None for one that lies outside."""
    half = causal // 2
    places = [(dy, dx) for dy in range(-half, 1) for dx in range(-half, half + 1) if (dy, dx) < (0, 0)]
    pixels = [pixel(image, row + dy, column + dx, torus) for dy, dx in places]
    if coarse is not None:
        around = range(-(parent // 2), parent // 2 + 1)
        pixels += [pixel(coarse, row // 2 + dy, column // 2 + dx, torus) for dy in around for dx in around]
    return pixels


def pixel(image, row, column, torus):
    height, width = image.shape[1:]
    if torus:
        return image[:, row % height, column % width].tolist()
    if 0 <= row < height and 0 <= column < width:
        return image[:, row, column].tolist()
    return None


def interior(sample, coarse, causal, parent):
    """The exemplar positions whose whole neighborhood, at both levels, lies inside."""
    for row in range(sample.shape[1]):
        for column in range(sample.shape[2]):
            if None not in neighborhood(sample, coarse, row, column, causal, parent, False):
                yield row, column


def pyramid(image, levels, border):
    images = [torch.as_tensor(image)[None]]
    for _ in range(levels - 1):
        images.append(pyrdown(images[-1], border_type=border))
    return [level[0].numpy() for level in images]


def match(image, reference):
    planes = zip(torch.as_tensor(image), torch.as_tensor(reference), strict=True)
    return torch.stack([histogram_matching(*pair) for pair in planes]).numpy()


def whole_numbers(image):
    return np.clip(np.round(image * 255), 0, 255).astype(int)
