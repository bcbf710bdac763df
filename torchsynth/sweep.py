"""The sweep: one pass over the pixels of one level. Every algorithm runs through this loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Annotated, Any, TypeAlias

import torch
from jaxtyping import Bool, Float
from pydantic import Field
from torch import Tensor

from torchsynth._typing import Draws, Features, Rows, Sites
from torchsynth.accept import Accept, Best
from torchsynth.canvas import Canvas
from torchsynth.lattice import Reads, to_cells
from torchsynth.neighborhood import (
    STEPS,
    Layer,
    Plane,
    gather,
    gather_candidates,
    layer_weights,
    layers_at,
    reads_of,
)
from torchsynth.part import Part
from torchsynth.schedule import Order, Reach, Scanline, schedule
from torchsynth.search import Exhaustive, Query, Search

# Sites whose unchanging layers are gathered together: enough to make the cost of the calls vanish, few
# enough to bound memory and to report progress often.
GROUP = 1024

Advance: TypeAlias = Callable[[int], None]
"""Told after each group how many more pixels are done."""


Levels: TypeAlias = Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1, strict=False)]


class Sweep(Part):
    """One pass over a level: what is compared, how it is searched, in which order, what is taken.

    Args:
        layers: The neighborhood.
        search: How candidates are found.
        order: Which pixel comes first.
        accept: Which candidate wins.
        levels: The pyramid levels this sweep runs on, 0 the finest; None means all of them.
        normalize: Share each layer's weight out among its neighbors, so that equal weights count the
            same whatever the template sizes. The papers sum plain squared differences.

    Example:
        >>> from torchsynth.template import Causal
        >>> sweep = Sweep(layers=(Layer(plane="result", template=Causal(size=9)),))
        >>> sweep.order.kind, sweep.search.kind, sweep.accept.kind
        ('scanline', 'exhaustive', 'best')
    """

    layers: Annotated[tuple[Layer, ...], Field(min_length=1, strict=False)]
    search: Search = Exhaustive()
    order: Order = Scanline()
    accept: Accept = Best()
    levels: Levels | None = None
    normalize: bool = False

    def runs_at(self, level: int) -> bool:
        """Whether the sweep visits this level."""
        return self.levels is None or level in self.levels


def run_sweep(
    sweep: Sweep,
    level: int,
    canvases: Sequence[Canvas],
    exemplar: Sequence[Plane],
    draws: Draws,
    advance: Advance,
) -> None:
    """Visit every pixel of a level once, in the sweep's order, and write the winners to its canvas.

    Args:
        sweep: What to do.
        level: Which level.
        canvases: The output by level; coarser levels are finished.
        exemplar: The exemplar's planes by level.
        draws: A uniform random number for each sample and pixel, for pixels that have no neighbor.
        advance: Told how many pixels are done; an exception raised in it ends the sweep.
    """
    canvas = canvases[level]
    layers = layers_at(sweep.layers, level, len(canvases))
    index = gather_candidates(layers, layer_weights(layers, sweep.normalize), exemplar, level)
    candidates, weights = index.sites, index.weights.to(index.features.dtype)
    # What a searcher fits is its own affair.
    state: Any = sweep.search.fit(index, complete=canvas.plane.boundary == "torus")
    del index  # the searcher keeps what it needs of the features

    def visit(sites: Sites, query: Query) -> tuple[Rows, Costs]:
        proposals = sweep.search.search(state, query)
        choice = sweep.accept.choose(proposals.cost)
        source = candidates.take(proposals.rows_at(choice.place))
        if query.readable is not None and not bool((seeing := query.readable.any(1)).all()):
            # No neighbor at all: every candidate costs nothing, and any one is as good.
            blind = draws[:, sites[~seeing]]
            source[:, ~seeing] = candidates[(blind * len(candidates)).long()]
        return source, choice.cost

    reader = _Reader.of(layers, level, [other.plane for other in canvases])
    batches = schedule(sweep.order, canvas.shape, reader.reach, canvas.plane.boundary)
    capacity = max(1, sweep.search.capacity(state) // len(canvas.source))
    pending: list[tuple[Sites, Rows]] = []
    for group in batches.groups(capacity, GROUP):
        group_sites = group.sites.to(candidates.device)
        gathered, costs = reader.gather(group_sites), []
        pieces = zip(group_sites.split(group.sizes), gathered.queries(group.sizes), strict=True)
        for (sites, query), ends_batch in zip(pieces, group.ends_batch, strict=True):
            source, cost = visit(sites, query)
            pending.append((sites, source))
            costs.append(cost)
            if ends_batch:  # gather before scatter: a batch sees nothing of itself
                for written in pending:
                    canvas.write(*written)
                pending.clear()
        canvas.write_cost(group_sites, gathered.distance(torch.cat(costs, dim=1), weights))
        advance(len(group_sites))


Costs: TypeAlias = Float[Tensor, "batch sites"]
"""What the accepted candidates cost."""


@dataclass(frozen=True)
class _Gathered:
    """The neighborhoods of a group, complete but for what the sweep itself still changes.

    The columns of ``moving`` layers are filled in when the turn of a piece has come.
    """

    features: Features
    readable: Bool[Tensor, "sites features"] | None
    moving: list[tuple[slice, Plane, Reads]]

    def queries(self, sizes: list[int]) -> Iterator[Query]:
        """The group's neighborhoods, piece by piece, each read when it is asked for."""
        features = self.features.split(sizes, dim=1)
        readable = _split(self.readable, sizes)
        moving = [
            (
                self.features[..., columns].split(sizes, dim=1),
                plane,
                reads.positions.split(sizes),
                _split(reads.inside, sizes),
            )
            for columns, plane, reads in self.moving
        ]
        for piece, there in enumerate(readable):
            for columns, plane, positions, inside in moving:
                columns[piece].copy_(gather(plane, Reads(positions[piece], inside[piece])))
            yield Query(features[piece], there)

    def distance(self, costs: Costs, weights: Float[Tensor, " features"]) -> Costs:
        """The accepted costs as mean squared differences per compared value, in units of [0, 1].

        To be called when all pieces have been queried: every site's vector is then what it matched.
        """
        common = (self.features[..., :-1].square() * weights).sum(2)
        compared = weights.sum() if self.readable is None else self.readable.to(weights) @ weights
        return (costs + common) / (compared * STEPS**2).clamp(min=1)


@dataclass(frozen=True)
class _Reader:
    """The output side of a neighborhood: its layers, bound to the planes of one output.

    Args:
        canvas: The plane that is being written.
        bound: For each layer its plane, and whether that plane changes during the sweep.
    """

    canvas: Plane
    bound: list[tuple[Layer, Plane, bool]]

    @classmethod
    def of(cls, layers: Sequence[Layer], level: int, planes: Sequence[Plane]) -> _Reader:
        bound = [(layer, planes[level + layer.steps_up], layer.plane == "result") for layer in layers]
        return cls(planes[level], bound)

    @property
    def reach(self) -> Reach | None:
        """How far the level reads itself while it is written; None if it does not."""
        offsets = [layer.template.offsets() for layer, _, moves in self.bound if moves]
        if not offsets:
            return None
        vertical, horizontal = torch.cat(offsets).abs().amax(0).tolist()
        return vertical, horizontal

    def gather(self, sites: Sites) -> _Gathered:
        """Read everything of the sites' neighborhoods that cannot change any more."""
        cells = to_cells(sites, self.canvas.shape[1])
        every = [reads_of(layer, plane, cells) for layer, plane, _ in self.bound]
        batch, _, channels = self.canvas.values.shape
        widths = [reads.positions.shape[1] * channels for reads in every]
        features = self.canvas.values.new_empty(batch, len(sites), sum(widths) + 1)
        features[..., -1] = 1
        moving = []
        for (_, plane, moves), reads, columns in zip(self.bound, every, _spans(widths), strict=True):
            if moves:
                moving.append((columns, plane, reads))
            else:
                features[..., columns] = gather(plane, reads)
        return _Gathered(features, _readable(every, widths), moving)


def _spans(widths: Sequence[int]) -> list[slice]:
    """Where blocks of these widths lie, one after the other."""
    stops = list(accumulate(widths))
    return [slice(stop - width, stop) for stop, width in zip(stops, widths, strict=True)]


def _split(flags: Tensor | None, sizes: list[int]) -> list[Tensor | None]:
    """Cut flags into pieces; a piece in which all are True becomes None."""
    if flags is None:
        return [None] * len(sizes)
    return [None if bool(piece.all()) else piece for piece in flags.split(sizes)]


def _readable(every: Sequence[Reads], widths: Sequence[int]) -> Bool[Tensor, "sites features"] | None:
    """Which features exist, layer after layer; None if all of them do."""
    if all(reads.inside is None for reads in every):
        return None
    blocks = []
    for reads, width in zip(every, widths, strict=True):
        there = torch.ones_like(reads.positions, dtype=torch.bool)
        inside = there if reads.inside is None else reads.inside
        blocks.append(inside.repeat_interleave(width // inside.shape[1], dim=1))
    return torch.cat(blocks, dim=1)
