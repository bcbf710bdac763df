"""The trees of TSVQ: what kinds of neighborhoods an exemplar has, as splitting them finds them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor

from torchsynth._typing import Image
from torchsynth.codebook import Codebook, PackedTree, Training
from torchsynth.errors import InputError
from torchsynth.neighborhood import Layer
from torchsynth.viz.lettering import LINE, caption, check_matplotlib, lettering
from torchsynth.viz.paper import GAP, Laid, block, enlarged, paper, shown, stacked

STEPS = 4
"""How far below the root a drawing goes, if nothing else is said."""

_SIDE = 54
_THICKEST = 13
_LINK = 30
_EMPTY = (0.88, 0.88, 0.88)
_SELF = (0.00, 0.45, 0.70)
_INK = (0.35, 0.35, 0.35)


def draw_tree(codebook: Codebook, level: int = 0, steps: int = STEPS, channels: int | None = None) -> Image:
    """The top of a TSVQ tree: every node as the mean neighborhood of its vectors, with their number.

    The lines between nodes are the thicker the more vectors go that way. A neighborhood is drawn layer below
    layer, a coarser one with larger pixels; the pixel whose neighborhood it is is blue where it is not
    compared itself, and what is not compared is gray. Means are pale, so all are shown in full contrast: the
    least value of any of them as black, the greatest as white.

    Args:
        codebook: What :func:`torchsynth.train` made.
        level: The pyramid level whose tree is drawn.
        steps: How many steps below the root, 1 to 6: each doubles the width.
        channels: Of the exemplar; it has to be given if the recipe compares guides.

    Returns:
        ``(B, 3, H, W)``: one for each exemplar the codebook was trained on.

    Raises:
        InputError: If there is no tree for this level, or matplotlib is missing.

    Example:
        >>> import torchsynth as ts
        >>> book = ts.train(torch.rand(3, 32, 32), ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=5))
        >>> draw_tree(book, steps=2).shape[:2]
        torch.Size([1, 3])
    """
    check_matplotlib("tree")
    if not 1 <= steps <= 6:
        raise InputError("steps", "must be from 1 to 6", f"it is {steps}", "choose a number between them")
    training = _training(codebook, level)
    tree = codebook.trees[training]
    portrait = _Portrait.of(training, tree.centroids.shape[1], channels)
    drawing = _Drawing(tree, portrait, sizes_of(tree), min(steps, max(1, tree.unpack().depth)))
    return stacked([drawing.page(root, level) for root in range(tree.roots)])


def left_to_right(children: Int[Tensor, " nodes"], node: int = 0) -> list[int]:
    """The leaves below a node, those of the first child before those of the second.

    Args:
        children: Of every node the first of its two adjacent children, or -1 for a leaf.
        node: Where to begin.

    Example:
        >>> left_to_right(torch.tensor([1, 3, -1, -1, -1]))
        [3, 4, 2]
    """
    first = int(children[node])
    return [node] if first < 0 else left_to_right(children, first) + left_to_right(children, first + 1)


def _training(codebook: Codebook, level: int) -> Training:
    levels = sorted({training.level for training in codebook.trees})
    found = [training for training in codebook.trees if training.level == level]
    if not found:
        raise InputError(
            "level", f"must be one of {', '.join(map(str, levels))}, whose trees are in the codebook",
            f"it is {level}", "choose one of them",
        )  # fmt: skip
    return found[0]


def sizes_of(tree: PackedTree) -> list[int]:
    """How many vectors are below each node; with ``central`` leaves, how many leaves.

    Example:
        >>> import torchsynth as ts
        >>> book = ts.train(torch.rand(1, 16, 16), ts.recipes.wei_levoy_tsvq(levels=1, neighborhood=5))
        >>> sizes_of(next(iter(book.trees.values())))[0]  # places of a 5x5 square, without its lower half
        168
    """
    sizes = tree.counts.long().tolist()
    for node, first in reversed(list(enumerate(tree.children.tolist()))):  # children come after their parents
        if first >= 0:
            sizes[node] = sizes[first] + sizes[first + 1]
    return sizes


@dataclass(frozen=True)
class _Portrait:
    """How vectors are drawn: the layers they are made of, and how large a pixel is."""

    layers: tuple[Layer, ...]
    channels: tuple[int, ...]
    factor: int

    @classmethod
    def of(cls, training: Training, features: int, channels: int | None) -> _Portrait:
        lengths = [len(layer.template.offsets()) for layer in training.layers]
        guided = sum(length for layer, length in zip(training.layers, lengths, strict=True) if layer.is_guide)
        plain = sum(lengths) - guided
        if guided and plain and channels is None:
            raise InputError(
                "channels", "must be given to draw a tree over guides", "it is None",
                "pass the number of channels of the exemplar",
            )  # fmt: skip
        own = (channels or 0) if guided else features // plain
        guide = (features - plain * own) // guided if guided else 0
        widest = max(_extent(layer)[1] for layer in training.layers)
        counts = tuple(guide if layer.is_guide else own for layer in training.layers)
        return cls(training.layers, counts, max(1, _SIDE // widest))

    def of_vector(self, vector: Float[Tensor, " features"]) -> Float[Tensor, "3 height width"]:
        """A vector of values in [0, 1] as a picture."""
        pieces, start = [], 0
        for layer, channels in zip(self.layers, self.channels, strict=True):
            stop = start + len(layer.template.offsets()) * channels
            values = vector[start:stop].view(1, -1, channels)
            pieces.append(enlarged(_window(layer, values), self.factor << min(layer.steps_up, 1)))
            start = stop
        width = max(piece.shape[2] for piece in pieces)
        tops = [sum(piece.shape[1] + self.factor for piece in pieces[:n]) for n in range(len(pieces))]
        height = tops[-1] + pieces[-1].shape[1]
        places = zip(pieces, tops, strict=True)
        return paper((height, width), (Laid(one, top, (width - one.shape[2]) // 2) for one, top in places))


def _extent(layer: Layer) -> tuple[int, int]:
    """Height and width of a layer's window, in pixels of the synthesized level."""
    offsets = layer.template.offsets()
    sides = offsets.amax(0).clamp(min=0) - offsets.amin(0).clamp(max=0) + 1
    return int(sides[0]) << min(layer.steps_up, 1), int(sides[1]) << min(layer.steps_up, 1)


def _window(layer: Layer, values: Float[Tensor, "1 neighbors channels"]) -> Float[Tensor, "3 height width"]:
    """The values of one layer, each at its offset."""
    offsets = layer.template.offsets()
    first = offsets.amin(0).clamp(max=0)
    shape = offsets.amax(0).clamp(min=0) - first + 1
    window = block(_EMPTY, (int(shape[0]), int(shape[1]))).clone()
    window[:, -first[0], -first[1]] = torch.tensor(_SELF)
    colors = shown(values.transpose(1, 2).unsqueeze(2))[0, :, 0]
    rows, columns = (offsets - first).unbind(1)
    window[:, rows, columns] = colors
    return window


@dataclass(frozen=True)
class _Drawing:
    """A tree on paper: a row for each step, and nodes above the middle of what is below them."""

    tree: PackedTree
    portrait: _Portrait
    sizes: Sequence[int]
    steps: int

    def page(self, root: int, level: int) -> Float[Tensor, "3 height width"]:
        """The tree below one root."""
        seen = self.tree.centroids[[node for node, _, _ in self._nodes(root)]]
        portraits = partial(self._of, least=float(seen.min()), greatest=float(seen.max()))
        height, width = portraits(root).shape[1:]
        slot, pitch = max(width, _SIDE) + GAP, height + LINE + _LINK
        across = max(4, 2**self.steps) * slot
        head = caption(self._title(root, level), across - GAP)
        top = 2 * GAP + head.shape[1]
        links, nodes = [], [Laid(head, GAP, GAP)]
        for node, step, place in self._nodes(root):
            row, half = top + step * pitch, across // 2 ** (step + 1)
            middle = GAP // 2 + half * (2 * place + 1)
            if step > 0:
                share = self.sizes[node] / self.sizes[root]
                links += _link(row, middle, half if place % 2 == 0 else -half, share)
            words = lettering(f"{self.sizes[node]:,}" + ("" if self._ends(node, step) else " ..."))
            nodes.append(Laid(portraits(node), row, middle - width // 2))
            nodes.append(Laid(words, row + height, middle - words.shape[2] // 2))
        return paper((top + self.steps * pitch + height + LINE + GAP, across + GAP), links + nodes)

    def _of(self, node: int, least: float, greatest: float) -> Tensor:
        vector = (self.tree.centroids[node].float() - least) / max(1.0, greatest - least)
        return self.portrait.of_vector(vector)

    def _ends(self, node: int, step: int) -> bool:
        """Whether nothing is below a node that is not shown."""
        return step < self.steps or int(self.tree.children[node]) < 0

    def _nodes(self, root: int) -> Iterator[tuple[int, int, int]]:
        """Nodes with the step they are at and their place in its row, which leaves room for missing ones."""
        row = [(root, 0)]
        for step in range(self.steps + 1):
            yield from ((node, step, place) for node, place in row)
            row = [
                (int(self.tree.children[node]) + side, 2 * place + side)
                for node, place in row
                if int(self.tree.children[node]) >= 0
                for side in (0, 1)
            ]

    def _title(self, root: int, level: int) -> str:
        leaves = left_to_right(self.tree.children, root)
        shown_all = all(self._ends(node, step) for node, step, _ in self._nodes(root))
        return (
            f"level {level}: {self.sizes[root]:,} neighborhoods in {len(leaves):,} leaves; "
            f"each node shows the mean of those below it, in full contrast"
            + ("" if shown_all else " (... where the tree goes on)")
        )


def _link(row: int, middle: int, parent: int, share: float) -> list[Laid]:
    """From the words under a parent, so many pixels to the right, down to the top of a child."""
    thick = max(1, round(_THICKEST * share))
    bend = row - _LINK // 2 - thick // 2
    left, right = sorted((middle, middle + parent))
    pieces = (
        (row - _LINK, middle + parent - thick // 2, bend - row + _LINK + thick, thick),
        (bend, left - thick // 2, thick, right - left + thick),
        (bend, middle - thick // 2, row - bend, thick),
    )
    return [Laid(block(_INK, (height, width)), top, start) for top, start, height, width in pieces]
