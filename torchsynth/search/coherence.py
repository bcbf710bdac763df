"""Coherent candidates: where the neighbors were copied from, moved along by one neighbor's distance.

If a neighbor at ``p + offset`` was copied from the exemplar pixel ``s``, then ``s - offset`` is the pixel
that continues the same patch at ``p``. A dozen such candidates replace the search of all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from torchsynth._typing import Offsets
from torchsynth.index import Index
from torchsynth.neighborhood import Layer
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Offers, Proposals, Query, Volume, table_fits
from torchsynth.template import Template

# From such a share of the positions on, the table has a row for each of them.
_NEARLY_ALL = 0.75


@dataclass(frozen=True)
class CoherenceState:
    """What is computed of the candidates, once.

    Args:
        index: The candidates.
        steps: For each neighbor by how much the position that continues its patch is behind its source.
        there: Lines that say whether there is a candidate at a position, each with room behind its last one.
            Positions before the first are negative, and so end up in the room of the line before, or, as
            negative places count from the end, of the last line.
        lines: Which line of ``there`` each neighbor has to look at, by where it begins; None if there is
            but one.
        table: Minus twice each weighted candidate, and behind it its weighted squared length, which a
            query's last 1 picks up; behind that, unless every query is complete, minus its weighted
            squares, for the features that a query lacks. None where it would take too much memory: then
            candidates are read when they are proposed.
        rows: For each position which of the candidates is there, any where there is none. None if the
            table has a row for each position, with zeros where there is no candidate: that spares a
            look-up, where nearly all positions are candidates.
        begins: Which row, or candidate, is the first of each exemplar; None if all samples share one.
        limits: For each position the chance above which a candidate is replaced; None if none is.
    """

    index: Index
    steps: Int64[Tensor, " neighbors"]
    there: Bool[Tensor, " entries"]
    lines: Int64[Tensor, " neighbors"] | None
    table: Float[Tensor, "rows extended"] | None
    rows: Int64[Tensor, " positions"] | None
    begins: Int64[Tensor, "exemplars 1 1"] | None
    limits: Int64[Tensor, " positions"] | None


class Coherence(Part):
    """Propose only continuations of the patches around a pixel; fast, and it keeps objects whole.

    A candidate whose neighborhood is not wholly inside the exemplar is replaced by a random one that
    is. The same candidate may be proposed by several neighbors: proposals cost nothing twice, so
    duplicates are not removed; the first of equally good ones wins.

    Args:
        template: Which neighbors propose a candidate, usually the ones that are compared. A template
            with center lets the pixel's present source compete, in a second pass or on a finer level.
        spare_bottom: Replace a candidate by a random one with the probability that the paper gives,
            certain at the exemplar's lowest row and zero at its highest. Visible effect: a feature at
            the exemplar's bottom is repeated less often, and patches are smaller.

    Source:
        M. Ashikhmin, *Synthesizing natural textures*, I3D 2001, section 3.

    Example:
        >>> from torchsynth.template import Causal
        >>> len(Coherence(template=Causal(size=5)).wants().offsets())
        12
    """

    kind: Literal["coherence"] = "coherence"

    largest_term: ClassVar[int] = 3 * 128**2
    """The most that one feature adds to a sum: ``|x|^2 - 2 q.x``, with both from -128 to 127."""

    has_sources: ClassVar[bool] = True
    """Whether what it proposes are exemplar pixels."""

    tree_search: ClassVar[None] = None
    """There are no trees that a codebook might hold."""

    template: Template
    spare_bottom: bool = False

    def wants(self) -> Template:
        """The neighbors whose sources have to be known."""
        return self.template

    @property
    def takes_chances(self) -> bool:
        """Whether each offer needs a random number."""
        return self.spare_bottom

    def fit(self, index: Index, complete: bool) -> CoherenceState:
        """Prepare the candidates.

        Args:
            index: The candidates.
            complete: Whether every feature of every query will be readable.
        """
        offsets = self.template.offsets().to(index.sites.device)
        there, lines = _continuations(index, offsets)
        number, positions = len(index.sites), math.prod(index.shape)
        height = positions if number > _NEARLY_ALL * positions else number
        size = index.exemplars * height * _columns(len(index.weights), complete)
        table = _table(index, height, complete) if table_fits(size * index.dtype.itemsize) else None
        each = torch.arange(number, device=offsets.device)
        rows = _spread(index, each) if table is None or height == number else None
        begins = torch.arange(index.exemplars, device=offsets.device) * (number if table is None else height)
        return CoherenceState(
            index=index,
            steps=_flat(offsets, index),
            there=there,
            lines=lines,
            table=table,
            rows=rows,
            begins=begins.view(-1, 1, 1) if index.exemplars > 1 else None,
            limits=_spread(index, _limits(index)) if self.spare_bottom else None,
        )

    def memory(self, volume: Volume) -> int:
        """About how many bytes fitting takes, and at most so many."""
        table = volume.candidates * _columns(volume.features, volume.complete) * volume.item
        # Lines are there twice while they are put together; the rest is a whole number for each pixel.
        lines = 2 * volume.pixels * (1 + _beyond(self.template.offsets(), volume.layers))
        return lines + 16 * volume.pixels + (table if table_fits(table) else 0)

    def capacity(self, state: CoherenceState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        columns = len(state.index.weights) * 3 if state.table is None else state.table.shape[1]
        row = len(state.steps) * columns * state.index.dtype.itemsize
        return max(1, MEMORY_BUDGET // (2 * row))

    def search(self, state: CoherenceState, query: Query) -> Proposals:
        """Propose one candidate for each wanted neighbor.

        Returns:
            Costs ``(B, sites, neighbors)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite for neighbors that offer none.
        """
        offers = _offered(query)
        source, there = _continued(state, offers)
        source = torch.where(there, source, offers.spares)
        if state.limits is not None and offers.chances is not None:
            source = torch.where(offers.chances > state.limits.take(source), offers.spares, source)
        cost = _costs(state, query, source)
        if offers.missing is not None:
            cost.masked_fill_(offers.missing, float("inf"))
        return Proposals(cost, source)

    def continued(self, state: CoherenceState, query: Query) -> Proposals:
        """Propose what the neighbors' patches go on with, and nothing in place of what is no candidate.

        Returns:
            As :meth:`search` does; infinite where there is no continuation.
        """
        offers = _offered(query)
        source, there = _continued(state, offers)
        if offers.missing is not None:
            there &= ~offers.missing
        source = torch.where(
            there, source, state.index.sites[0]
        )  # anything that has a cost: it will not count
        return Proposals(_costs(state, query, source).masked_fill_(~there, float("inf")), source)


def _offered(query: Query) -> Offers:
    assert query.offers is not None, "the sweep reads what a search wants"  # noqa: S101 (for the type checker)
    return query.offers


def _columns(features: int, complete: bool) -> int:
    """How many columns the table has."""
    return features + 1 if complete else 2 * features + 1


def _table(index: Index, height: int, complete: bool) -> Float[Tensor, "rows extended"]:
    """The table of :class:`CoherenceState`: of each exemplar as many rows as it has candidates, or positions."""
    weights, features = index.weights.to(index.dtype), len(index.weights)
    table = weights.new_zeros(index.exemplars, height, _columns(features, complete))
    rows = torch.arange(height, device=table.device) if height == len(index.sites) else index.sites
    for some in index.slices():
        vectors, here = index.vectors(some), rows[some]
        squares = vectors.square().mul_(weights)
        table[..., :features].index_copy_(1, here, vectors.mul_(-2 * weights))
        table[..., features].index_copy_(1, here, squares.sum(2))
        if not complete:
            table[..., features + 1 :].index_copy_(1, here, squares.neg_())
    return table.flatten(0, 1)


def _continued(
    state: CoherenceState, offers: Offers
) -> tuple[Int64[Tensor, "batch sites neighbors"], Bool[Tensor, "batch sites neighbors"]]:
    """The position that continues each neighbor's patch, and whether there is a candidate.

    Where a neighbor has no source, there is none: -1 is beyond the left border of the first row, and what
    continues it reaches beyond that border as well.
    """
    source = offers.source - state.steps
    return source, state.there.take(source if state.lines is None else source + state.lines)


def _costs(state: CoherenceState, query: Query, source: Tensor) -> Float[Tensor, "batch sites neighbors"]:
    """What the proposed candidates cost, given where they are."""
    rows = source if state.rows is None else state.rows.take(source)
    if state.begins is not None:
        rows = rows + state.begins
    if state.table is None:
        return _read_costs(state.index, query, rows)
    queries = query.features if query.extended is None else query.extended
    features, table = queries.shape[2], state.table
    if features < table.shape[1]:
        table = table[:, :features]
    proposed = torch.embedding(table, rows).flatten(0, 1)
    # Queries as rows: the other way around, long ones take twice the time.
    return torch.bmm(queries.reshape(-1, 1, features), proposed.transpose(1, 2)).view_as(source)


def _read_costs(index: Index, query: Query, rows: Tensor) -> Float[Tensor, "batch sites neighbors"]:
    """The same by the candidates themselves: ``(x - 2 q).x`` is ``|x|^2 - 2 q.x``."""
    proposed, weights = index.at(rows), index.weights.to(index.dtype)
    counting = weights if query.readable is None else query.readable * weights
    terms = (proposed - 2 * query.features[..., :-1].unsqueeze(2)).mul_(proposed)
    return torch.matmul(terms, counting.unsqueeze(-1)).squeeze(-1)


def _flat(offsets: Offsets, index: Index) -> Int64[Tensor, " neighbors"]:
    """How far each offset goes in the exemplar's flat positions."""
    return offsets[:, 0] * index.shape[1] + offsets[:, 1]


def _continuations(
    index: Index, offsets: Offsets
) -> tuple[Bool[Tensor, " entries"], Int64[Tensor, " neighbors"] | None]:
    """Whether there is a candidate that continues a patch, for each neighbor and each position.

    The position is that of the neighbor's source less its offset, in flat positions. These go around the
    exemplar's left and right border; but such a position is a candidate only if its own neighborhood
    reaches beyond that border, which those that are compared do not. So one line serves all neighbors that
    are compared; any other has a line of its own, without the candidates that it would reach around.

    Returns:
        The lines, and for each neighbor where its own begins; see :class:`CoherenceState`.
    """
    height, width = index.shape
    room = int(_flat(offsets, index).abs().max()) + 1
    line = torch.zeros(height * width + room, dtype=torch.bool, device=offsets.device)
    line[index.sites] = True
    rows, columns = index.sites // width, index.sites % width
    first, last = torch.stack((rows.amin(), columns.amin())), torch.stack((rows.amax(), columns.amax()))
    sides = torch.tensor((height, width), device=offsets.device)
    within = ((first + offsets >= 0) & (last + offsets < sides)).all(1)
    lines, begins = [line], torch.zeros_like(offsets[:, 0])
    for neighbor in (~within).nonzero().squeeze(1).tolist():
        down, across = offsets[neighbor].tolist()
        inside = (
            (rows + down >= 0) & (rows + down < height) & (columns + across >= 0) & (columns + across < width)
        )
        begins[neighbor] = len(lines) * len(line)
        lines.append(line.index_fill(0, index.sites[~inside], False))
    return torch.cat(lines), begins if len(lines) > 1 else None


def _beyond(offsets: Offsets, layers: Sequence[Layer]) -> int:
    """How many neighbors lie farther away than what is compared, and may need a line of their own."""
    compared = [layer.template.offsets() for layer in layers if layer.steps_up == 0]
    reach = torch.cat((*compared, torch.zeros_like(offsets[:1])))
    return int(((offsets < reach.amin(0)) | (offsets > reach.amax(0))).any(1).sum())


def _spread(index: Index, numbers: Int64[Tensor, " candidates"]) -> Int64[Tensor, " positions"]:
    """A number of each candidate, laid out by position; zero where there is none."""
    spread = numbers.new_zeros(math.prod(index.shape))
    return spread.index_copy_(0, index.sites, numbers)


def _limits(index: Index) -> Int64[Tensor, " candidates"]:
    """``rand**d > d`` exactly when ``rand > d**(1 / d)``, where d is how far above the lowest row one is."""
    rows = index.sites // index.shape[1]
    distance = (rows.max() - rows).double() / (rows.max() - rows.min()).clamp(min=1)
    limits: Tensor = distance ** (1 / distance.clamp(min=1e-9))
    if bool(rows.max() == rows.min()):
        limits = torch.ones_like(limits)  # no row is nearer to the bottom than another
    return (limits * 2**31).round().long()
