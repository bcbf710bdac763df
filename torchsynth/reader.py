"""The output side of neighborhoods: reading a level while it is being written.

Sites come in groups. What cannot change while a group is visited is read for all of it at once: finished
planes, positions, which neighbors exist, random numbers. The rest is read piece by piece, when it is the
turn of a piece.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, repeat
from typing import TypeAlias

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from torchsynth._typing import Draws, Features, Sites
from torchsynth.canvas import Canvas
from torchsynth.lattice import Reads, only, to_cells
from torchsynth.neighborhood import STEPS, Layer, Plane, feature_positions, gather, in_memory, reads_of
from torchsynth.schedule import Reach, Schedule
from torchsynth.search import Offers, Query, Search, chance, scatter_draws, spare
from torchsynth.template import Template

Costs: TypeAlias = Float[Tensor, "batch sites"]
"""What the accepted candidates cost."""


@dataclass(frozen=True)
class _Wanted:
    """The neighbors whose sources a search wants to see, for the sites of a group."""

    source: Int64[Tensor, "batch positions"]
    reads: Reads
    spares: Int64[Tensor, "batch sites neighbors"]
    chances: Int64[Tensor, "batch sites neighbors"] | None

    def offers(self, sizes: list[int]) -> Iterator[Offers]:
        """What they have to offer, piece by piece, each read when it is asked for."""
        given = self.reads.inside
        if given is not None:
            # Where nobody is there, the first stands for one without source: any candidate is as good.
            given = given.clone()
            given[:, 0] |= ~given.any(1)
        pieces = zip(
            in_memory(self.reads.positions, len(self.source), self.source.shape[1], 1).split(sizes, dim=1),
            _split(None if given is None else ~given, sizes, unless=False),
            self.spares.split(sizes, dim=1),
            repeat(None) if self.chances is None else self.chances.split(sizes, dim=1),
            strict=False,
        )
        for positions, missing, spares, chances in pieces:
            yield Offers(self.source.take(positions), missing, spares, chances)


@dataclass(frozen=True)
class _Moving:
    """Features that are read when the turn of their piece has come: from what is being written."""

    plane: Plane
    positions: Int64[Tensor, "batch sites features"]

    def pieces(self, sizes: list[int]) -> Iterator[Features]:
        """Piece by piece, each read when it is asked for."""
        for positions in self.positions.split(sizes, dim=1):
            yield gather(self.plane, positions)


@dataclass(frozen=True)
class _Resting:
    """Features that no sweep changes: they are read already."""

    features: Features

    def pieces(self, sizes: list[int]) -> Iterator[Features]:
        """Piece by piece."""
        yield from self.features.split(sizes, dim=1)


@dataclass(frozen=True)
class Gathered:
    """The neighborhoods of a group, complete but for what the sweep itself still changes.

    Args:
        blocks: The features, side by side; behind them a 1 and, where some do not exist, what is missing.
        readable: Which features exist; None if all do.
        wanted: What a search wants to see.
        asked: The vectors of all pieces that have been queried.
    """

    blocks: list[_Moving | _Resting]
    readable: Bool[Tensor, "sites features"] | None
    wanted: _Wanted | None
    asked: list[Features] = field(default_factory=list)

    def queries(self, sizes: list[int]) -> Iterator[tuple[Query, Tensor | None]]:
        """The group's neighborhoods, piece by piece, each read when it is asked for.

        With each piece comes which of its sites have nothing at all to go by, if there are any.
        """
        readable = _split(self.readable, sizes)
        seeing: list[Tensor | None] = [None] * len(sizes)
        if self.readable is not None and self.wanted is None:
            seeing = _split(self.readable.any(1), sizes)
        offers = repeat(None) if self.wanted is None else self.wanted.offers(sizes)
        blocks = zip(*(block.pieces(sizes) for block in self.blocks), strict=True)
        for there, sees, offered, parts in zip(readable, seeing, offers, blocks, strict=False):
            extended = parts[0] if len(parts) == 1 else torch.cat(parts, dim=2)
            self.asked.append(extended)
            features = extended if self.readable is None else self._features(extended)
            query = Query(features, there, offered, None if there is None else extended)
            yield query, None if sees is None else ~sees

    def _features(self, extended: Features) -> Features:
        """The features with the 1 behind them."""
        if self.readable is None:
            return extended
        return extended[..., : self.readable.shape[1] + 1]

    def distance(self, costs: Costs, weights: Float[Tensor, " features"]) -> Costs:
        """The accepted costs of all that was asked, as mean squared differences per compared value.

        In squared units of [0, 1].
        """
        asked = self._features(torch.cat(self.asked, dim=1))
        common = (asked[..., :-1].square() * weights).sum(2)
        compared = weights.sum()
        if self.readable is not None:
            compared = self.readable[: costs.shape[1]].to(weights) @ weights
        return (costs + common) / (compared * STEPS**2).clamp(min=1)


@dataclass(frozen=True)
class Reader:
    """The output side of a neighborhood: its layers, bound to the planes of one output.

    Args:
        canvas: What is being written.
        bound: For each layer its plane, and whether that plane changes during the sweep.
        wanted: The neighbors whose sources the search wants to see, as a layer.
        chances: Whether the search wants a random number with each of them, beside the spare candidate.
        candidates: The exemplar position of each candidate.
        skips: Whether pixels that are not synthesized yet are left out.
    """

    canvas: Canvas
    bound: list[tuple[Layer, Plane, bool]]
    wanted: Layer | None
    chances: bool
    candidates: Sites
    skips: bool

    @classmethod
    def of(
        cls,
        layers: Sequence[Layer],
        level: int,
        canvases: Sequence[Canvas],
        search: Search,
        candidates: Sites,
        skips: bool,
    ) -> Reader:
        """Bind the layers of a level to its planes, and what the search wants to see."""
        bound = [(layer, plane_of(layer, level, canvases), layer.plane == "result") for layer in layers]
        wanted = search.wants()
        offering = None if wanted is None else Layer(plane="result", template=wanted)
        return cls(canvases[level], bound, offering, search.takes_chances, candidates, skips)

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

    def gather(self, sites: Sites, batches: Schedule, draws: Draws) -> Gathered:
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
        readable = _readable(every, [plane.values.shape[2] for _, plane, _ in self.bound])
        blocks: list[_Moving | _Resting] = []
        for (_, plane, moves), reads in zip(self.bound, every, strict=True):
            positions = feature_positions(plane, reads.positions)
            blocks.append(_Moving(plane, positions) if moves else _Resting(gather(plane, positions)))
        self._append_one(blocks, readable, sites)
        return Gathered(blocks, readable, wanted)

    def _append_one(
        self,
        blocks: list[_Moving | _Resting],
        readable: Bool[Tensor, "sites features"] | None,
        sites: Sites,
    ) -> None:
        """Put the 1 behind the features, and what is missing of them."""
        last, values = blocks[-1], self.canvas.plane.values
        if readable is None and isinstance(last, _Moving):
            # It can be read with them: one call less for each piece.
            ones = feature_positions(last.plane, torch.full_like(sites, values.shape[1] - 1).unsqueeze(1))
            blocks[-1] = _Moving(last.plane, torch.cat((last.positions, ones[..., -1:]), dim=2))
            return
        tail = values.new_ones(len(values), len(sites), 1)
        if readable is not None:
            tail = torch.cat((tail, (~readable).to(tail).expand(len(values), -1, -1)), dim=2)
        blocks.append(_Resting(tail))

    def _known(self, reads: Reads, sites: Sites, batches: Schedule) -> Reads:
        """Leave out what is not synthesized when the site's turn comes, if that is asked for."""
        if not self.skips:
            return reads
        known = self.canvas.known[reads.positions] | batches.done_before(reads.positions, sites)
        return only(reads, known, self.canvas.shape)

    def _wanted(self, reads: Reads, draws: Draws) -> _Wanted:
        """The neighbors a search wants to see, and random numbers for each of them."""
        scattered = scatter_draws(draws, reads.positions.shape[1])
        chances = chance(scattered) if self.chances else None
        spares = self.candidates.take(spare(scattered, len(self.candidates)))
        return _Wanted(self.canvas.source, reads, spares, chances)


def plane_of(layer: Layer, level: int, canvases: Sequence[Canvas]) -> Plane:
    """What a layer reads on the output's side."""
    canvas = canvases[level + layer.steps_up]
    plane = canvas.target if layer.plane == "target" else canvas.guide if layer.is_guide else canvas.plane
    assert plane is not None, "checked before work starts"  # noqa: S101 (for the type checker)
    return plane


def _spans(widths: Sequence[int]) -> list[slice]:
    """Where blocks of these widths lie, one after the other."""
    stops = list(accumulate(widths))
    return [slice(stop - width, stop) for stop, width in zip(stops, widths, strict=True)]


def _split(flags: Tensor | None, sizes: list[int], unless: bool = True) -> list[Tensor | None]:
    """Cut flags into pieces; a piece in which all are as usual (``unless``) becomes None."""
    if flags is None:
        return [None] * len(sizes)
    # One question to the tensor, not one for each piece.
    usual = (flags == unless).view(len(flags), -1).all(1).tolist()
    spans = _spans(sizes)
    return [None if all(usual[span]) else flags[span] for span in spans]


def _readable(every: Sequence[Reads], channels: Sequence[int]) -> Bool[Tensor, "sites features"] | None:
    """Which features exist, layer after layer, of so many channels each; None if all of them do."""
    if all(reads.inside is None for reads in every):
        return None
    blocks = [
        torch.ones_like(reads.positions, dtype=torch.bool) if reads.inside is None else reads.inside
        for reads in every
    ]
    return torch.cat(
        [block.repeat_interleave(each, dim=1) for block, each in zip(blocks, channels, strict=True)], dim=1
    )
