"""The picture of the README that is made of whole patches."""

from __future__ import annotations

from layout import Pixels, in_a_row, shown

import torchsynth as ts


def whole() -> Pixels:
    """A sample, and quilting and a graph cut of it, each beside the boundaries of its patches."""
    sample = ts.read_image("sample:brick")
    row = [shown(sample)]
    for recipe in (ts.recipes.quilting(), ts.recipes.graphcut()):
        result = ts.synthesize(sample, (160, 160), recipe, seed=0)
        row += [shown(result.image[0]), shown(ts.viz.draw_patches(result)[0])]
    return in_a_row(row)
