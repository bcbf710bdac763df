"""The sweep: one pass over the pixels of one level. Every algorithm runs through this loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import torch
from jaxtyping import Float
from pydantic import Field, model_validator
from torch import Tensor

from torchsynth._typing import Draws, Sites, Sources
from torchsynth.accept import Accept, Best, Evidence, WithinTolerance
from torchsynth.canvas import Canvas
from torchsynth.course import Course
from torchsynth.index import Index
from torchsynth.neighborhood import (
    STEPS,
    Layer,
    Planes,
    layer_weights,
    layers_at,
)
from torchsynth.part import Part
from torchsynth.reader import Reader, plane_of
from torchsynth.schedule import OnionPeel, Order, Rows, Scanline, Schedule
from torchsynth.search import TSVQ, Exhaustive, PreferCoherent, Query, Search, Tree, chance, draw_at, spare

# Sites whose unchanging layers are gathered together: enough to make the cost of the calls vanish, few
# enough to bound memory and to report progress often.
GROUP = 8192
_GROUP_VALUES = 2**17
_SMALLEST_GROUP = 256
# Progress is told about every so many pixels, so that an animation of a small output has frames, too.
_TOLD = 64


def group_size(outputs: int, features: int) -> int:
    """How many sites are gathered together: fewer for large neighborhoods, and for many outputs.

    Example:
        >>> group_size(1, 13), group_size(8, 65), group_size(1, 10_000)
        (8192, 256, 256)
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
    rows: Annotated[Rows, Field(strict=False)] | None = None
    unknown: Literal["read", "skip"] = "read"
    normalize: bool = False

    @model_validator(mode="after")
    def _refused_pixels_come_again(self) -> Sweep:
        if self.accept.refuses and not isinstance(self.order, OnionPeel):
            raise ValueError(
                "an acceptance with 'max_error' may refuse a pixel, and only the order 'onion_peel' comes back "
                f"to it, but the order is {self.order.kind!r}; set max_error to null"
            )
        return self

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
        exemplar: Planes,
        tree: Tree | None = None,
    ) -> Fitted:
        """Fit a sweep's searcher to the exemplar's planes, at one level of so many canvases.

        A tree that was trained for just this is used in place of training one.
        """
        layers = layers_at(sweep.layers, level, len(canvases))
        index = Index.of(layers, layer_weights(layers, sweep.normalize), exemplar, level)
        complete = sweep.unknown == "read" and all(
            plane.boundary == "torus" and plane.valid is None
            for plane in (plane_of(layer, level, canvases) for layer in layers)
        )
        state: Any
        if tree is not None and isinstance(sweep.search, TSVQ | PreferCoherent):
            state = sweep.search.prepare(index, tree)
        else:
            state = sweep.search.fit(index, complete)
        return cls(sweep, layers, index.sites, index.weights.to(index.dtype), state)

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
    canvas, sweep = canvases[level], fitted.sweep
    visits = _Visits.of(fitted, level, canvases, draws, advance)
    given = canvas.given[:-1].view(canvas.shape).cpu()
    largest = sweep.accept.max_error if isinstance(sweep.accept, WithinTolerance) else None
    boundary = canvas.plane.boundary
    visits.run(Course.of(sweep.order, visits.reader.reach, boundary, sweep.rows, given, largest))


@dataclass(frozen=True)
class _Visits:
    """A sweep on its way: all it needs to visit pixels."""

    fitted: Fitted
    level: int
    canvases: Sequence[Canvas]
    draws: Draws
    advance: Advance
    reader: Reader

    @classmethod
    def of(
        cls, fitted: Fitted, level: int, canvases: Sequence[Canvas], draws: Draws, advance: Advance
    ) -> _Visits:
        sweep = fitted.sweep
        skips = sweep.unknown == "skip"
        reader = Reader.of(fitted.layers, level, canvases, sweep.search, fitted.sites, skips)
        return cls(fitted, level, canvases, draws, advance, reader)

    @property
    def canvas(self) -> Canvas:
        return self.canvases[self.level]

    def run(self, course: Course) -> None:
        """Visit stage after stage, to the end of the course."""
        divisible = self.fitted.sweep.accept.refuses and len(self.canvas.source) > 1
        before = course.copy() if divisible else course
        while (stage := course.next_stage()) is not None:
            sites = stage.sites.to(self.draws.device)
            kept = [tensor[:, sites] for tensor in self._written()] if divisible else []
            known = self.canvas.known.clone() if divisible else None
            if self._visit(stage, course):
                before = course.copy() if divisible else course
                continue
            # One output refuses what another takes. From here on each goes its own way.
            for tensor, value in zip(self._written(), kept, strict=True):
                tensor[:, sites] = value
            if known is not None:
                self.canvas.known.copy_(known)
            for number in range(len(self.canvas.source)):
                self._sample(number).run(before.copy())
            self.canvas.known[:-1] = True
            return

    def _written(self) -> tuple[Tensor, Tensor]:
        return self.canvas.plane.values, self.canvas.source

    def _sample(self, number: int) -> _Visits:
        """The same for one of the outputs; only the last one's progress is told."""
        canvases = [canvas.sample(number) for canvas in self.canvases]
        last = number == len(self.canvas.source) - 1
        draws = self.draws[number : number + 1]
        return _Visits.of(self.fitted, self.level, canvases, draws, self.advance if last else _ignore)

    def _visit(self, stage: Schedule, course: Course) -> bool:
        """Visit the pixels of one stage; tells whether all outputs agree which of them are refused.

        A pixel that comes after a refused one must not see it: after each batch with a refusal, the rest
        is gathered anew.
        """
        batches: Schedule | None = stage
        filled = 0
        while batches is not None:
            visited, refused = self._until_refusal(batches, course)
            sites, rest = batches.sites[:visited], batches.sites[visited:]
            batches = None
            if refused is not None:
                if not bool((refused == refused[:1]).all()):
                    return False
                # The refused ones are in the last batch.
                taken = torch.ones(visited, dtype=torch.bool)
                taken[visited - refused.shape[1] :] = ~refused[0].cpu()
                sites = sites[taken]
                left = torch.zeros_like(course.waiting)
                left.view(-1)[rest] = True
                batches = stage.among(left) if len(rest) > 0 else None
            course.fill(sites)
            self.canvas.known[sites.to(self.draws.device)] = True
            filled += len(sites)
        if self.fitted.sweep.accept.refuses:
            self.advance(filled)
        if (
            filled == 0
            and course.largest is not None
            and isinstance(self.fitted.sweep.accept, WithinTolerance)
        ):
            course.largest *= self.fitted.sweep.accept.growth
        return True

    def _until_refusal(self, batches: Schedule, course: Course) -> tuple[int, Tensor | None]:
        """Visit batch after batch until one refuses something.

        Returns:
            How many pixels were visited, and which outputs refuse which of the last batch, if any do.
        """
        canvas, fitted = self.canvas, self.fitted
        capacity = max(1, fitted.sweep.search.capacity(fitted.state) // len(canvas.source))
        most = group_size(len(canvas.source), len(fitted.weights))
        pending: list[_Visited] = []
        visited = told = 0
        for group in batches.groups(capacity, most):
            group_sites = group.sites.to(fitted.sites.device)
            gathered, costs = self.reader.gather(group_sites, batches, self.draws), []
            refused: Tensor | None = None
            pieces = zip(
                group_sites.split(group.sizes), gathered.queries(group.sizes), group.sizes, group.ends_batch,
                strict=True,
            )  # fmt: skip
            for sites, (query, blind), size, ends_batch in pieces:
                piece = self._match(sites, query, blind, course)
                pending.append(piece)
                costs.append(piece.cost)
                visited += size
                if ends_batch:  # gather before scatter: a batch sees nothing of itself
                    refused = _refused(pending)
                    for one in pending:
                        one.write(canvas)
                    pending.clear()
                    if refused is not None:
                        break
                    told = self._tell(visited, told)
            cost = torch.cat(costs, dim=1)
            canvas.write_cost(group_sites[: cost.shape[1]], gathered.distance(cost, fitted.weights))
            if refused is not None:
                return visited, refused
            told = self._tell(visited, told)
        self._tell(visited, told, rest=True)
        return visited, None

    def _tell(self, visited: int, told: int, *, rest: bool = False) -> int:
        """Tell how many more pixels are done, the rest or once they are enough; returns how many were told."""
        if visited - told < (1 if rest else _TOLD) or self.fitted.sweep.accept.refuses:
            return told  # what may be undone is told when it will not be
        self.advance(visited - told)
        return visited

    def _match(self, sites: Sites, query: Query, blind: Tensor | None, course: Course) -> _Visited:
        """What the sites of a piece take."""
        fitted, sweep = self.fitted, self.fitted.sweep
        evidence = None
        if sweep.accept.weighs:
            query = query._replace(tolerance=sweep.accept.tolerance)
            evidence = self._evidence(sites, query, course)
        proposals = sweep.search.search(fitted.state, query)
        choice = sweep.accept.choose(proposals.cost, evidence)
        source = proposals.source_at(choice.place, fitted.sites)
        if blind is not None:
            # No neighbor at all: every candidate costs nothing, and any one is as good.
            unseeing = draw_at(self.draws[:, sites[blind]], 1)
            source[:, blind] = fitted.sites.take(spare(unseeing, len(fitted.sites)))
        own = proposals.values_at(choice.place)
        return _Visited(sites, source, own, choice.cost, choice.refused)

    def _evidence(self, sites: Sites, query: Query, course: Course) -> Evidence:
        """What the acceptance weighs beside the costs."""
        weights = self.fitted.weights
        common = query.features[..., :-1].square() @ weights
        compared = weights.sum().expand(len(sites))
        if query.readable is not None:
            compared = query.readable.to(weights) @ weights
        # Below place 1: no search uses these.
        draws = chance(draw_at(self.draws[:, sites], -course.stage))
        return Evidence(common, compared, draws, course.largest, float(STEPS**2))


class _Visited(NamedTuple):
    """The pixels of a piece and what they take: see :class:`torchsynth.accept.Choice`."""

    sites: Sites
    source: Sources
    own: Tensor | None
    cost: Tensor
    refused: Tensor | None

    def write(self, canvas: Canvas) -> None:
        """Write what was taken; where outputs disagree, the first one's refusals count."""
        if self.refused is None or not bool(self.refused.any()):
            canvas.write(self.sites, self.source, self.own)
            return
        taken = ~self.refused[0]
        own = None if self.own is None else self.own[:, taken]
        canvas.write(self.sites[taken], self.source[:, taken], own)


def _refused(pieces: Sequence[_Visited]) -> Tensor | None:
    """Which outputs refuse which pixels of some pieces, if any do."""
    flags = [piece.refused for piece in pieces if piece.refused is not None]
    if not flags:
        return None
    refused = torch.cat(flags, dim=1)
    return refused if bool(refused.any()) else None


def _ignore(pixels: int) -> None:
    """Tell nobody."""
