"""Coherent candidates: where the neighbors were copied from, moved along by one neighbor's distance.

If a neighbor at ``p + offset`` was copied from the exemplar pixel ``s``, then ``s - offset`` is the pixel
that continues the same patch at ``p``. A dozen such candidates replace the search of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from torchsynth._typing import Offsets
from torchsynth.index import Index
from torchsynth.neighborhood import Layer
from torchsynth.part import Part
from torchsynth.search.base import MEMORY_BUDGET, Offers, Proposals, Query, Volume, table_fits
from torchsynth.template import Template


@dataclass(frozen=True)
class CoherenceState:
    """What is computed of the candidates, once.

    Args:
        index: The candidates.
        continued: Lines that say which candidate is at an exemplar pixel, with room before and behind; -1
            where there is none.
        lines: For each neighbor where its line has the candidate that continues a patch with this neighbor
            at source 0; the one for source ``s`` is ``s`` places behind it.
        table: Minus twice each weighted candidate, and behind it its weighted squared length, which a
            query's last 1 picks up; behind that, unless every query is complete, minus its weighted
            squares, for the features that a query lacks. All candidates of the first exemplar come first.
            None where it would take too much memory: then candidates are read when they are proposed.
        limits: For each candidate the chance above which it is replaced; None if none is.
    """

    index: Index
    continued: Int64[Tensor, " entries"]
    lines: Int64[Tensor, " neighbors"]
    table: Float[Tensor, "rows extended"] | None
    limits: Int64[Tensor, " candidates"] | None


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
        continued, lines = _continuations(index, self.template.offsets().to(index.sites.device))
        size = index.exemplars * len(index.sites) * _columns(len(index.weights), complete)
        return CoherenceState(
            index=index,
            continued=continued,
            lines=lines,
            table=_table(index, complete) if table_fits(size * index.dtype.itemsize) else None,
            limits=_limits(index) if self.spare_bottom else None,
        )

    def memory(self, volume: Volume) -> int:
        """About how many bytes fitting takes, and at most so many."""
        table = volume.candidates * _columns(volume.features, volume.complete) * volume.item
        # Lines are there twice while they are put together.
        lines = 16 * volume.pixels * (1 + _beyond(self.template.offsets(), volume.layers))
        return lines + (table if table_fits(table) else 0)

    def capacity(self, state: CoherenceState) -> int:
        """How many queries, of all samples together, fit the memory budget: at least one."""
        columns = len(state.index.weights) * 3 if state.table is None else state.table.shape[1]
        row = len(state.lines) * columns * state.index.dtype.itemsize
        return max(1, MEMORY_BUDGET // (2 * row))

    def search(self, state: CoherenceState, query: Query) -> Proposals:
        """Propose one candidate for each wanted neighbor.

        Returns:
            Costs ``(B, sites, neighbors)``: weighted squared distances less each query's own squared
            length, which is the same for all its candidates; infinite for neighbors that offer none.
        """
        offers = _offered(query)
        rows = state.continued.take(offers.source + state.lines)
        rows = torch.where(rows < 0, offers.spares, rows)
        if state.limits is not None and offers.chances is not None:
            rows = torch.where(offers.chances > state.limits.take(rows), offers.spares, rows)
        cost = _costs(state, query, rows)
        if offers.missing is not None:
            cost.masked_fill_(offers.missing, float("inf"))
        return Proposals(cost, rows)

    def continued(self, state: CoherenceState, query: Query) -> Proposals:
        """Propose what the neighbors' patches go on with, and nothing in place of what is no candidate.

        Returns:
            As :meth:`search` does; infinite where there is no continuation.
        """
        offers = _offered(query)
        rows = state.continued.take(offers.source + state.lines)
        nothing = rows < 0 if offers.missing is None else (rows < 0) | offers.missing
        rows = rows.clamp(min=0)
        return Proposals(_costs(state, query, rows).masked_fill_(nothing, float("inf")), rows)


def _offered(query: Query) -> Offers:
    assert query.offers is not None, "the sweep reads what a search wants"  # noqa: S101 (for the type checker)
    return query.offers


def _columns(features: int, complete: bool) -> int:
    """How many columns the table has."""
    return features + 1 if complete else 2 * features + 1


def _table(index: Index, complete: bool) -> Float[Tensor, "rows extended"]:
    """The table of :class:`CoherenceState`."""
    weights, features = index.weights.to(index.dtype), len(index.weights)
    table = weights.new_empty(index.exemplars, len(index.sites), _columns(features, complete))
    for some in index.slices():
        vectors, here = index.vectors(some), table[:, some]
        squares = vectors.square().mul_(weights)
        here[..., :features] = vectors.mul_(-2 * weights)
        here[..., features] = squares.sum(2)
        if not complete:
            here[..., features + 1 :] = squares.neg_()
    return table.flatten(0, 1)


def _costs(state: CoherenceState, query: Query, rows: Tensor) -> Float[Tensor, "batch sites neighbors"]:
    """What the proposed candidates cost."""
    exemplars, number = state.index.exemplars, len(state.index.sites)
    if exemplars > 1:  # each sample has an exemplar of its own
        rows = rows + torch.arange(0, exemplars * number, number, device=rows.device).view(-1, 1, 1)
    if state.table is None:
        return _read_costs(state.index, query, rows)
    queries = query.features if query.extended is None else query.extended
    features = queries.shape[2]
    table = state.table if features == state.table.shape[1] else state.table[:, :features]
    proposed = torch.embedding(table, rows).view(-1, rows.shape[2], features)
    return torch.bmm(proposed, queries.reshape(-1, features, 1)).view(rows.shape)


def _read_costs(index: Index, query: Query, rows: Tensor) -> Float[Tensor, "batch sites neighbors"]:
    """The same by the candidates themselves: ``(x - 2 q).x`` is ``|x|^2 - 2 q.x``."""
    proposed, weights = index.at(rows), index.weights.to(index.dtype)
    counting = weights if query.readable is None else query.readable * weights
    terms = (proposed - 2 * query.features[..., :-1].unsqueeze(2)).mul_(proposed)
    return torch.matmul(terms, counting.unsqueeze(-1)).squeeze(-1)


def _continuations(
    index: Index, offsets: Offsets
) -> tuple[Int64[Tensor, " entries"], Int64[Tensor, " neighbors"]]:
    """For each neighbor and each source it may have: the candidate that continues the patch, or -1.

    Returns:
        Lines, and where each neighbor's begins for source 0; see :class:`CoherenceState`. That of source
        ``s`` is the candidate at ``s - offset``, in flat positions. These go around the exemplar's left
        and right border; but such a position is a candidate only if its own neighborhood reaches beyond
        that border, which those that are compared do not. So one line serves all neighbors that are
        compared; any other has a line of its own, without the candidates that it would reach around.
    """
    height, width = index.shape
    flat = offsets[:, 0] * width + offsets[:, 1]
    room = int(flat.abs().max()) + 1
    line = torch.full((height * width + 2 * room,), -1, device=offsets.device)
    line[index.sites + room] = torch.arange(len(index.sites), device=offsets.device)
    rows, columns = index.sites // width, index.sites % width
    first, last = torch.stack((rows.amin(), columns.amin())), torch.stack((rows.amax(), columns.amax()))
    sides = torch.tensor((height, width), device=offsets.device)
    within = ((first + offsets >= 0) & (last + offsets < sides)).all(1)
    lines, starts = [line], room - flat
    for neighbor in (~within).nonzero().squeeze(1).tolist():
        down, across = offsets[neighbor].tolist()
        inside = (
            (rows + down >= 0) & (rows + down < height) & (columns + across >= 0) & (columns + across < width)
        )
        starts[neighbor] += len(lines) * len(line)
        lines.append(line.index_fill(0, index.sites[~inside] + room, -1))
    return torch.cat(lines), starts


def _beyond(offsets: Offsets, layers: Sequence[Layer]) -> int:
    """How many neighbors lie farther away than what is compared, and may need a line of their own."""
    compared = [layer.template.offsets() for layer in layers if layer.steps_up == 0]
    reach = torch.cat((*compared, torch.zeros_like(offsets[:1])))
    return int(((offsets < reach.amin(0)) | (offsets > reach.amax(0))).any(1).sum())


def _limits(index: Index) -> Int64[Tensor, " candidates"]:
    """``rand**d > d`` exactly when ``rand > d**(1 / d)``, where d is how far above the lowest row one is."""
    rows = index.sites // index.shape[1]
    distance = (rows.max() - rows).double() / (rows.max() - rows.min()).clamp(min=1)
    limits: Tensor = distance ** (1 / distance.clamp(min=1e-9))
    if bool(rows.max() == rows.min()):
        limits = torch.ones_like(limits)  # no row is nearer to the bottom than another
    return (limits * 2**31).round().long()
