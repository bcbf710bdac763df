"""The sweep: one pass over the pixels of one level. Every algorithm runs through this loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, repeat
from typing import Annotated, Any, Literal, TypeAlias

import torch
from jaxtyping import Bool, Float, Int64
from pydantic import Field
from torch import Tensor

from torchsynth._typing import Draws, Features, Rows, Sites
from torchsynth.accept import Accept, Best
from torchsynth.canvas import Canvas
from torchsynth.lattice import Reads, only, to_cells
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
from torchsynth.schedule import Order, Reach, Scanline, Schedule, schedule
from torchsynth.schedule import Rows as Span
from torchsynth.search import TSVQ, Exhaustive, Offers, Query, Search, Tree, chance, scatter_draws, spare
from torchsynth.template import Template

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
            for plane in (_plane(layer, level, canvases) for layer in layers)
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

    def visit(sites: Sites, query: Query, blind: Tensor | None) -> tuple[Rows, Tensor | None, Costs]:
        proposals = sweep.search.search(fitted.state, query)
        choice = sweep.accept.choose(proposals.cost)
        rows = proposals.rows_at(choice.place)
        if blind is not None:
            # No neighbor at all: every candidate costs nothing, and any one is as good.
            unseeing = scatter_draws(draws[:, sites[blind]], 1).squeeze(2)
            rows[:, blind] = spare(unseeing, len(candidates))
        return candidates.take(rows), proposals.values_at(choice.place), choice.cost

    reader = _Reader.of(fitted, level, canvases)
    batches = schedule(sweep.order, canvas.shape, reader.reach, canvas.plane.boundary, sweep.rows)
    capacity = max(1, sweep.search.capacity(fitted.state) // len(canvas.source))
    pending: list[tuple[Sites, Rows, Tensor | None]] = []
    for group in batches.groups(capacity, GROUP):
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


Costs: TypeAlias = Float[Tensor, "batch sites"]
"""What the accepted candidates cost."""


@dataclass(frozen=True)
class _Wanted:
    """The neighbors whose sources a search wants to see, for the sites of a group."""

    source: Int64[Tensor, "batch positions"]
    reads: Reads
    spares: Int64[Tensor, "batch sites neighbors"]
    chances: Int64[Tensor, "batch sites neighbors"]

    def offers(self, sizes: list[int]) -> Iterator[Offers]:
        """What they have to offer, piece by piece, each read when it is asked for."""
        given = self.reads.inside
        if given is not None:
            # Where nobody is there, the first stands for one without source: any candidate is as good.
            given = given.clone()
            given[:, 0] |= ~given.any(1)
        pieces = zip(
            _flat_split(self.reads.positions, sizes),
            _split(None if given is None else ~given, sizes, unless=False),
            self.spares.split(sizes, dim=1),
            self.chances.split(sizes, dim=1),
            strict=True,
        )
        for positions, missing, spares, chances in pieces:
            found = self.source.index_select(1, positions).view(spares.shape)
            yield Offers(found, missing, spares, chances)


@dataclass(frozen=True)
class _Gathered:
    """The neighborhoods of a group, complete but for what the sweep itself still changes.

    The columns of ``moving`` layers are filled in when the turn of a piece has come. ``extended`` holds
    the features and, where some do not exist, what they lack.
    """

    extended: Features
    readable: Bool[Tensor, "sites features"] | None
    moving: list[tuple[slice, Plane, Int64[Tensor, "sites neighbors"]]]
    wanted: _Wanted | None

    def queries(self, sizes: list[int]) -> Iterator[tuple[Query, Tensor | None]]:
        """The group's neighborhoods, piece by piece, each read when it is asked for.

        With each piece comes which of its sites have nothing at all to go by, if there are any.
        """
        extended = self.extended.split(sizes, dim=1)
        features = self.features.split(sizes, dim=1)
        readable = _split(self.readable, sizes)
        seeing: list[Tensor | None] = [None] * len(sizes)
        if self.readable is not None and self.wanted is None:
            seeing = _split(self.readable.any(1), sizes)
        offers = repeat(None) if self.wanted is None else self.wanted.offers(sizes)
        moving = [
            (
                self.features[..., columns].split(sizes, dim=1),
                plane,
                _flat_split(positions, sizes),
            )
            for columns, plane, positions in self.moving
        ]
        for piece, (there, sees, offered) in enumerate(zip(readable, seeing, offers, strict=False)):
            for columns, plane, positions in moving:
                columns[piece].copy_(gather(plane, positions[piece], sizes[piece]))
            whole = there is None
            query = Query(features[piece], there, offered, None if whole else extended[piece])
            yield query, None if sees is None else ~sees

    @property
    def features(self) -> Features:
        """The features with the 1 behind them."""
        if self.readable is None:
            return self.extended
        return self.extended[..., : self.readable.shape[1] + 1]

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
        canvas: What is being written.
        bound: For each layer its plane, and whether that plane changes during the sweep.
        wanted: The neighbors whose sources the search wants to see, as a layer.
        candidates: How many candidates there are.
        skips: Whether pixels that are not synthesized yet are left out.
    """

    canvas: Canvas
    bound: list[tuple[Layer, Plane, bool]]
    wanted: Layer | None
    candidates: int
    skips: bool

    @classmethod
    def of(cls, fitted: Fitted, level: int, canvases: Sequence[Canvas]) -> _Reader:
        bound = [(layer, _plane(layer, level, canvases), layer.plane == "result") for layer in fitted.layers]
        template = fitted.sweep.search.wants()
        wanted = None if template is None else Layer(plane="result", template=template)
        return cls(canvases[level], bound, wanted, len(fitted.sites), fitted.sweep.unknown == "skip")

    @property
    def reach(self) -> Reach | None:
        """How far the level reads itself while it is written; None if it does not."""
        moving = [layer for layer, _, moves in self.bound if moves]
        if self.wanted is not None:
            moving.append(self.wanted)
        if not moving:
            return None
        far = torch.cat([layer.template.offsets() for layer in moving]).abs().amax(0)
        if self.canvas.frames is not None:
            # The farthest corner, for the frame that throws it farthest; rounding keeps the order.
            far = (self.canvas.frames.abs().cpu() @ far.double()).amax(0).round().long()
        vertical, horizontal = far.tolist()
        return vertical, horizontal

    def gather(self, sites: Sites, batches: Schedule, draws: Draws) -> _Gathered:
        """Read everything of the sites' neighborhoods that cannot change any more."""
        cells = to_cells(sites, self.canvas.shape[1])
        frames = None if self.canvas.frames is None else self.canvas.frames[sites]
        own: dict[Template, Reads] = {}

        def look(layer: Layer, plane: Plane, moves: bool) -> Reads:
            if not moves:
                return reads_of(layer, plane, cells, frames)
            if layer.template not in own:
                own[layer.template] = self._known(reads_of(layer, plane, cells, frames), sites, batches)
            return own[layer.template]

        every = [look(*layer) for layer in self.bound]
        wanted = None
        if self.wanted is not None:
            own_draws = draws.index_select(1, sites)
            wanted = self._wanted(look(self.wanted, self.canvas.plane, True), own_draws)
        features, readable = self._blank(every)
        moving = []
        spans = _spans([reads.positions.shape[1] * self.canvas.plane.values.shape[2] for reads in every])
        for (_, plane, moves), reads, columns in zip(self.bound, every, spans, strict=True):
            if moves:
                moving.append((columns, plane, reads.positions))
            else:
                features[..., columns] = gather(plane, reads.positions.flatten(), len(sites))
        return _Gathered(features, readable, moving, wanted)

    def _known(self, reads: Reads, sites: Sites, batches: Schedule) -> Reads:
        """Leave out what is not synthesized when the site's turn comes, if that is asked for."""
        if not self.skips:
            return reads
        known = self.canvas.known[reads.positions] | batches.done_before(reads.positions, sites)
        return only(reads, known, self.canvas.shape)

    def _wanted(self, reads: Reads, draws: Draws) -> _Wanted:
        """The neighbors a search wants to see, and random numbers for each of them."""
        scattered = scatter_draws(draws, reads.positions.shape[1])
        return _Wanted(self.canvas.source, reads, spare(scattered, self.candidates), chance(scattered))

    def _blank(self, every: Sequence[Reads]) -> tuple[Features, Bool[Tensor, "sites features"] | None]:
        """Vectors to be filled in, with what stands behind the features; and which features exist."""
        batch, _, channels = self.canvas.plane.values.shape
        readable = _readable(every, channels)
        width = sum(reads.positions.shape[1] for reads in every) * channels
        columns = width + 1 if readable is None else 2 * width + 1
        features = self.canvas.plane.values.new_empty(batch, len(every[0].positions), columns)
        features[..., width] = 1
        if readable is not None:
            features[..., width + 1 :] = ~readable
        return features, readable


def _plane(layer: Layer, level: int, canvases: Sequence[Canvas]) -> Plane:
    """What a layer reads on the output's side."""
    if layer.plane == "target":
        target = canvases[level].target
        assert target is not None, "checked before work starts"  # noqa: S101 (for the type checker)
        return target
    return canvases[level + layer.steps_up].plane


def _spans(widths: Sequence[int]) -> list[slice]:
    """Where blocks of these widths lie, one after the other."""
    stops = list(accumulate(widths))
    return [slice(stop - width, stop) for stop, width in zip(stops, widths, strict=True)]


def _flat_split(
    positions: Int64[Tensor, "sites neighbors"], sizes: list[int]
) -> tuple[Int64[Tensor, " positions"], ...]:
    """Cut positions into pieces, each of them in one line."""
    pieces: tuple[Tensor, ...] = positions.view(-1).split([size * positions.shape[1] for size in sizes])
    return pieces


def _split(flags: Tensor | None, sizes: list[int], unless: bool = True) -> list[Tensor | None]:
    """Cut flags into pieces; a piece in which all are as usual (``unless``) becomes None."""
    if flags is None:
        return [None] * len(sizes)
    # One question to the tensor, not one for each piece.
    usual = (flags == unless).view(len(flags), -1).all(1).tolist()
    spans = _spans(sizes)
    return [None if all(usual[span]) else flags[span] for span in spans]


def _readable(every: Sequence[Reads], channels: int) -> Bool[Tensor, "sites features"] | None:
    """Which features exist, layer after layer; None if all of them do."""
    if all(reads.inside is None for reads in every):
        return None
    blocks = [
        torch.ones_like(reads.positions, dtype=torch.bool) if reads.inside is None else reads.inside
        for reads in every
    ]
    return torch.cat(blocks, dim=1).repeat_interleave(channels, dim=1)
