"""The gallery's picture of what torchsynth.viz draws; see gallery.py. It needs matplotlib, the extra ``viz``."""

from __future__ import annotations

from layout import Pixels, in_a_column, in_a_row, shown

import torchsynth as ts


def figures() -> Pixels:
    """The tree of a sample, the pyramid of an output, and the costs and the coverage of another."""
    brick = ts.read_image("sample:brick")[:, :96, :96].contiguous()
    tree = ts.viz.draw_tree(ts.train(brick, ts.recipes.wei_levoy_tsvq()), steps=3)
    result = ts.synthesize(brick, (72, 96), ts.recipes.wei_levoy(), seed=0)
    return in_a_row([shown(tree[0]), in_a_column([shown(ts.viz.draw_pyramid(result)[0]), of_blocks()])])


def of_blocks() -> Pixels:
    """What the blocks of a quilt cost, and how often each pixel of its sample was copied."""
    sample = ts.read_image("sample:pebbles")[:, :88, :88].contiguous()
    result = ts.synthesize(sample, (88, 88), ts.recipes.quilting(block=24), seed=0)
    return in_a_row([shown(draw(result)[0]) for draw in (ts.viz.draw_cost, ts.viz.draw_coverage)])
