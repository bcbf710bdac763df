"""Make the pictures of how TSVQ works: ``python scripts/tsvq_figures.py --out docs/images``.

* ``tsvq_lloyd.jpg``: Lloyd's steps for one node, from the two perturbed centroids until the distortion
  falls no more. Every point has the color of its nearer centroid, the dashed line lies halfway between
  the two, and the trails show where the centroids have been.
* ``tsvq_tree.jpg``: the tree that the library's own :class:`torchsynth.TSVQ` grows on the same points,
  for depth 1, 2, 3 and so on. Every cell is one leaf; lines lead from each centroid to its two children.

The points are neighborhoods of two features: whole numbers from -128 to 127, drawn from a few clusters
with a fixed seed. Lloyd's iterations are written out here, to show each of them; that they end where the
library's own tree begins is checked.

It needs matplotlib, which the library itself does not: ``pip install -c constraints.txt -e '.[viz]'``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import arguments
import matplotlib as mpl
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from torch import Tensor

import torchsynth as ts
from torchsynth.index import Index
from torchsynth.search import TSVQState
from torchsynth.search.tree import Tree
from torchsynth.viz import left_to_right

# Okabe and Ito's colors, which the color-blind can tell apart.
FIRST, SECOND, DARK = "#0072B2", "#E69F00", "#222222"
LIMITS = (-132, 132)
DEPTHS = (1, 2, 3, 4, 6)
SHOWN = 4
TITLE = 10


def clusters() -> Tensor:
    """Points around a few centers: ``(points, 2)``, whole numbers from -128 to 127."""
    generator = torch.Generator().manual_seed(3)
    centers = torch.tensor([[-90, 78], [-46, 40], [-10, 92], [30, -8], [85, -50], [28, -88]])
    spreads = torch.tensor([[16, 18], [14, 16], [20, 14], [14, 14], [18, 26], [26, 14]])
    noise = torch.randn(6, 70, 2, generator=generator)
    return (centers[:, None] + spreads[:, None] * noise).round().clamp(-128, 127).flatten(0, 1)


def grown(points: Tensor, depth: int) -> TSVQState:
    """The library's tree of these points."""
    index = Index.of_vectors(points.unsqueeze(0), torch.ones(2, dtype=torch.int64))
    return ts.TSVQ(depth=depth).fit(index, complete=True)


@dataclass(frozen=True)
class Step:
    """A pair of centroids, which of them each point is nearer to, and the sum of squared distances."""

    pair: Tensor
    side: Tensor
    distortion: float


def lloyd(points: Tensor) -> list[Step]:
    """Lloyd's iterations for the root of a tree, from its perturbed centroids until they stand still.

    The last step is the pair that the library's own tree has, which is checked.
    """
    mean = points.mean(0).round()
    spread = (points - mean).square().mean(0)
    # As the tree does it: a quarter of the spread to either side, in whole steps.
    shift = (spread.sqrt() / 4).ceil()
    steps = [_assigned(points, torch.stack((mean - shift, mean + shift)))]
    while len(steps) < 2 or steps[-1].distortion < steps[-2].distortion:
        side = steps[-1].side
        means = [points[side == which].mean(0).round() for which in (0, 1)]
        steps.append(_assigned(points, torch.stack(means)))
    last = steps[-1]
    if not last.pair.equal(grown(points, 1).tree.centroids[1:]):
        raise RuntimeError("these are not the centroids of the library's own tree")
    return steps


def _assigned(points: Tensor, pair: Tensor) -> Step:
    distance = (points.unsqueeze(1) - pair).square().sum(2)
    return Step(pair, distance.argmin(1), float(distance.amin(1).sum()))


def draw_lloyd() -> Figure:
    """The start, the first iterations, and the last one."""
    points = clusters()
    steps = lloyd(points)
    last = len(steps) - 1
    shown = [*range(min(SHOWN, last)), last]
    figure = Figure(figsize=(2.8 * len(shown), 3.5), layout="constrained")
    panels = figure.subplots(1, len(shown))
    for axes, number in zip(panels, shown, strict=True):
        _draw_step(axes, points, steps[: number + 1])
        what = "start" if number == 0 else f"iteration {number}" + (", the last" if number == last else "")
        axes.set_title(
            f"{what}\ndistortion {steps[number].distortion / steps[0].distortion:.0%}", fontsize=TITLE
        )
    return figure


def _draw_step(axes: Axes, points: Tensor, steps: list[Step]) -> None:
    pair, side = steps[-1].pair, steps[-1].side
    for which, (color, marker) in enumerate(((FIRST, "o"), (SECOND, "s"))):
        own = points[side == which]
        axes.scatter(own[:, 0], own[:, 1], s=7, c=color, marker=marker, linewidths=0, alpha=0.75)
        trail = torch.stack([step.pair[which] for step in steps])
        axes.plot(trail[:, 0], trail[:, 1], color=DARK, linewidth=1.2)
        axes.plot(
            *pair[which], marker=marker, markersize=10, color=color, markeredgecolor=DARK, markeredgewidth=1.5
        )
    middle, across = pair.mean(0), pair[1] - pair[0]
    along = torch.stack((-across[1], across[0])) / across.norm() * 400
    ends = torch.stack((middle - along, middle + along))
    axes.plot(ends[:, 0], ends[:, 1], color=DARK, linewidth=1, linestyle="--")
    _square(axes)


def draw_tree() -> Figure:
    """The cells of the leaves, and the tree above them, for several depths."""
    points = clusters()
    figure = Figure(figsize=(2.8 * len(DEPTHS), 3.4), layout="constrained")
    panels = figure.subplots(1, len(DEPTHS))
    for axes, depth in zip(panels, DEPTHS, strict=True):
        state = grown(points, depth)
        tree = state.tree
        _draw_cells(axes, points, state)
        _draw_edges(axes, tree)
        leaves = int((tree.children < 0).sum())
        axes.set_title(f"depth {depth}: {leaves} leaves", fontsize=TITLE)
    return figure


def _draw_cells(axes: Axes, points: Tensor, state: TSVQState) -> None:
    """Color the plane, and the points, by the leaf that the tree's own search would arrive at."""
    ticks = torch.linspace(*LIMITS, 331)
    plane = torch.stack(torch.meshgrid(ticks, ticks, indexing="xy"), dim=2).view(-1, 2)
    leaves = _leaf_of(plane, state)
    # Leaves get their colors in the order in which they lie below the root: relatives are alike.
    order = left_to_right(state.tree.children)
    rank = torch.zeros(len(state.tree.children), dtype=torch.int64)
    rank[torch.tensor(order)] = torch.arange(len(order))
    tones = mpl.colormaps["viridis"](np.linspace(0, 0.88, len(order)))
    colors = ListedColormap(tones)
    extent = (*LIMITS, *LIMITS)
    style: Any = {"cmap": colors, "vmin": -0.5, "vmax": len(order) - 0.5}
    cells = rank[leaves].view(len(ticks), len(ticks)).numpy()
    axes.imshow(cells, origin="lower", extent=extent, alpha=0.35, interpolation="nearest", **style)
    own = rank[_leaf_of(points, state)].numpy()
    axes.scatter(points[:, 0], points[:, 1], c=own, s=9, linewidths=0.3, edgecolors="white", **style)
    borders = (cells[1:, 1:] != cells[:-1, 1:]) | (cells[1:, 1:] != cells[1:, :-1])
    shade = np.zeros((*borders.shape, 4))
    shade[borders] = (1, 1, 1, 1)
    axes.imshow(shade, origin="lower", extent=extent, interpolation="nearest")
    _square(axes)


def _leaf_of(points: Tensor, state: TSVQState) -> Tensor:
    """Descend the tree: to the second child where the point is nearer to that."""
    node = torch.zeros(len(points), dtype=torch.int64)
    for _ in range(state.tree.depth):
        nearer = (points * state.nodes.toward[node]).sum(1) > state.nodes.limit[node]
        node = state.nodes.steps[node] + nearer
    return node


def _draw_edges(axes: Axes, tree: Tree) -> None:
    """The tree itself: thick lines near the root, squares for inner nodes, circles for leaves."""
    level = {0: 0}
    for node, first in enumerate(tree.children.tolist()):
        place = tree.centroids[node]
        if first < 0:
            size = 5 if tree.depth < 5 else 3
            axes.plot(*place, "o", markersize=size, color="white", markeredgecolor=DARK, zorder=4)
            continue
        for child in (first, first + 1):
            level[child] = level[node] + 1
            ends = torch.stack((place, tree.centroids[child]))
            axes.plot(ends[:, 0], ends[:, 1], color=DARK, linewidth=max(0.6, 2.4 - 0.5 * level[node]))
        axes.plot(*place, "s", markersize=max(2.5, 6 - level[node]), color=DARK, zorder=3)


def _square(axes: Axes) -> None:
    axes.set(xlim=LIMITS, ylim=LIMITS, aspect="equal", xticks=[], yticks=[])


PICTURES: dict[str, Callable[[], Figure]] = {"tsvq_lloyd": draw_lloyd, "tsvq_tree": draw_tree}


def main() -> None:
    """Make both pictures."""
    parser = argparse.ArgumentParser(description="Make the pictures of how TSVQ works.")
    parser.add_argument("--out", type=Path, required=True, help="the folder to write to")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        options.out.mkdir(parents=True, exist_ok=True)
        for name, draw in PICTURES.items():
            path = options.out / f"{name}.jpg"
            jpeg = {"quality": 78, "subsampling": 2, "optimize": True, "progressive": True}
            draw().savefig(path, dpi=100, bbox_inches="tight", pad_inches=0.05, pil_kwargs=jpeg)
            print(path, f"{path.stat().st_size // 1000} kB", flush=True)


if __name__ == "__main__":
    main()
