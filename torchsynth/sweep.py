"""The sweep: one pass over the pixels of one level. Every algorithm runs through this loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

import torch
from jaxtyping import Float
from pydantic import Field
from torch import Tensor

from torchsynth._typing import Draws, Rows, Sites
from torchsynth.accept import Accept, Best
from torchsynth.canvas import Canvas
from torchsynth.neighborhood import (
    Layer,
    Plane,
    gather_candidates,
    layer_weights,
    layers_at,
)
from torchsynth.part import Part
from torchsynth.reader import Reader, plane_of
from torchsynth.schedule import Order, Scanline, schedule
from torchsynth.schedule import Rows as Span
from torchsynth.search import TSVQ, Exhaustive, Query, Search, Tree, scatter_draws, spare

# Sites whose unchanging layers are gathered together: enough to make the cost of the calls vanish, few
# enough to bound memory and to report progress often.
GROUP = 8192
_GROUP_VALUES = 2**19
_SMALLEST_GROUP = 256


def group_size(outputs: int, features: int) -> int:
    """How many sites are gathered together: fewer for large neighborhoods, and for many outputs.

    Example:
        >>> group_size(1, 13), group_size(8, 65), group_size(1, 10_000)
        (8192, 1008, 256)
    """
    return min(GROUP, max(_SMALLEST_GROUP, _GROUP_VALUES // (outputs * features)))


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
        levels: The pyramid levels this sweep runs on, 0 the finest; or ``coarsest``, or ``finer`` for all
            others, however many there are; None means all of them.
        rows: The rows to visit, as in a Python slice: ``(0, -2)`` leaves out the last two, ``(-2, None)``
            visits only them; ``(-2, 2)`` goes around the torus, from the last two to the first two. None
            means all.
        unknown: What becomes of neighbors that show only what the level started from: ``read`` compares
            them and takes their offers, ``skip`` leaves them out until they have been synthesized.
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
    levels: Levels | Literal["coarsest", "finer"] | None = None
    rows: Annotated[Span, Field(strict=False)] | None = None
    unknown: Literal["read", "skip"] = "read"
    normalize: bool = False

    def runs_at(self, level: int, levels: int) -> bool:
        """Whether the sweep visits this level of so many."""
        if isinstance(self.levels, str):
            return (level == levels - 1) == (self.levels == "coarsest")
        return self.levels is None or level in self.levels


@dataclass(frozen=True)
class Fitted:
    """A sweep with what its searcher has made of one level's candidates.

    Args:
        sweep: The sweep.
        layers: Those of its layers that exist at this level.
        sites: The flat exemplar position of each candidate.
        weights: How much each feature's squared difference counts.
        state: The searcher's own affair.
    """

    sweep: Sweep
    layers: tuple[Layer, ...]
    sites: Sites
    weights: Float[Tensor, " features"]
    state: Any

    @classmethod
    def to(
        cls,
        sweep: Sweep,
        level: int,
        canvases: Sequence[Canvas],
        exemplar: Sequence[Plane],
        tree: Tree | None = None,
    ) -> Fitted:
        """Fit a sweep's searcher to the exemplar's planes, at one level of so many canvases.

        A tree that was trained for just this is used in place of training one.
        """
        layers = layers_at(sweep.layers, level, len(canvases))
        index = gather_candidates(layers, layer_weights(layers, sweep.normalize), exemplar, level)
        complete = sweep.unknown == "read" and all(
            plane.boundary == "torus" and plane.valid is None
            for plane in (plane_of(layer, level, canvases) for layer in layers)
        )
        state: Any
        if tree is not None and isinstance(sweep.search, TSVQ):
            state = sweep.search.prepare(index, tree)
        else:
            state = sweep.search.fit(index, complete)
        return cls(sweep, layers, index.sites, index.weights.to(index.features.dtype), state)

    def serves(self, sweep: Sweep) -> bool:
        """Whether another sweep of the same level can use what was fitted for this one."""
        same = ("layers", "search", "unknown", "normalize")
        return all(getattr(self.sweep, name) == getattr(sweep, name) for name in same)


def run_sweep(
    fitted: Fitted,
    level: int,
    canvases: Sequence[Canvas],
    draws: Draws,
    advance: Advance,
) -> None:
    """Visit the pixels of a level once, in the sweep's order, and write the winners to its canvas.

    Args:
        fitted: What to do.
        level: Which level.
        canvases: The output by level; coarser levels are finished.
        draws: A random number for each sample and pixel, for pixels that have nothing to go by.
        advance: Told how many pixels are done; an exception raised in it ends the sweep.
    """
    canvas, sweep, candidates = canvases[level], fitted.sweep, fitted.sites

    def visit(sites: Sites, query: Query, blind: Tensor | None) -> tuple[Rows, Tensor | None, Tensor]:
        proposals = sweep.search.search(fitted.state, query)
        choice = sweep.accept.choose(proposals.cost)
        rows = proposals.rows_at(choice.place)
        if blind is not None:
            # No neighbor at all: every candidate costs nothing, and any one is as good.
            unseeing = scatter_draws(draws[:, sites[blind]], 1).squeeze(2)
            rows[:, blind] = spare(unseeing, len(candidates))
        return candidates.take(rows), proposals.values_at(choice.place), choice.cost

    skips = sweep.unknown == "skip"
    reader = Reader.of(fitted.layers, level, canvases, sweep.search, len(candidates), skips)
    batches = schedule(sweep.order, canvas.shape, reader.reach, canvas.plane.boundary, sweep.rows)
    capacity = max(1, sweep.search.capacity(fitted.state) // len(canvas.source))
    pending: list[tuple[Sites, Rows, Tensor | None]] = []
    size = group_size(len(canvas.source), len(fitted.weights))
    for group in batches.groups(capacity, size):
        group_sites = group.sites.to(candidates.device)
        gathered, costs = reader.gather(group_sites, batches, draws), []
        pieces = zip(group_sites.split(group.sizes), gathered.queries(group.sizes), strict=True)
        for (sites, (query, blind)), ends_batch in zip(pieces, group.ends_batch, strict=True):
            source, own, cost = visit(sites, query, blind)
            pending.append((sites, source, own))
            costs.append(cost)
            if ends_batch:  # gather before scatter: a batch sees nothing of itself
                for written in pending:
                    canvas.write(*written)
                pending.clear()
        canvas.write_cost(group_sites, gathered.distance(torch.cat(costs, dim=1), fitted.weights))
        advance(len(group_sites))
    canvas.known[batches.sites.to(candidates.device)] = True
