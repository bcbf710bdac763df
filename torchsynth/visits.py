"""The loop: one pass over the pixels of one level. Every algorithm runs through it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import torch
from torch import Tensor

from torchsynth._typing import Draws, Sites, Sources
from torchsynth.accept import Evidence, WithinTolerance
from torchsynth.canvas import Canvas
from torchsynth.course import Course
from torchsynth.neighborhood import STEPS
from torchsynth.reader import Reader
from torchsynth.schedule import Schedule
from torchsynth.search import Query, chance, draw_at, spare
from torchsynth.sweep import Fitted

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
"""Told now and then how many more pixels are done."""


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

    @cached_property
    def refuses(self) -> bool:
        """Whether a pixel may be left as it is, to come again."""
        return self.fitted.sweep.accept.refuses

    def run(self, course: Course) -> None:
        """Visit stage after stage, to the end of the course."""
        divisible = self.refuses and len(self.canvas.source) > 1
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
        if self.refuses:
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
                    refused = _refused(pending) if self.refuses else None
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
        if visited - told < (1 if rest else _TOLD) or self.refuses:
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
