"""The course of a sweep: which pixels it visits next, given what it has filled so far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch

from torchsynth._typing import Region, Sites
from torchsynth.canvas import Canvas
from torchsynth.lattice import Boundary
from torchsynth.schedule import (
    OnionPeel,
    Order,
    Reach,
    Rows,
    Schedule,
    schedule,
    schedule_layer,
    visited_rows,
)


@dataclass
class Course:
    """Where a sweep stands; it is written as the sweep goes on.

    Args:
        order: Who comes first.
        reach: How far the level itself is read while it is written; None if it is not read at all.
        boundary: Whether neighborhoods wrap around.
        rows: Which rows are visited; None means all.
        known: What an onion grows from: the pixels that are given, and then those the sweep has filled.
        waiting: The pixels still to be visited.
        largest: The mean squared difference from which on a candidate is refused, if any is.
        stage: How many stages have been begun: layers of an onion; any other order has only one.
    """

    order: Order
    reach: Reach | None
    boundary: Boundary
    rows: Rows | None
    known: Region
    waiting: Region
    largest: float | None
    stage: int = 0

    @classmethod
    def of(
        cls,
        order: Order,
        reach: Reach | None,
        boundary: Boundary,
        rows: Rows | None,
        given: Region,
        largest: float | None,
    ) -> Course:
        """The beginning: nothing is filled but what is given.

        Example:
            >>> from torchsynth.schedule import Scanline
            >>> given = torch.tensor([[True, False]])
            >>> Course.of(Scanline(), (1, 1), "open", None, given, None).next_stage().sites.tolist()
            [1]
        """
        visited = torch.zeros_like(given)
        visited[visited_rows(rows, len(given))] = True
        return cls(order, reach, boundary, rows, given.clone(), visited & ~given, largest)

    def copy(self) -> Course:
        """The same, to be continued in another way."""
        return replace(self, known=self.known.clone(), waiting=self.waiting.clone())

    def next_stage(self) -> Schedule | None:
        """The pixels that can be scheduled now; None when all have been visited."""
        self.stage += 1
        if not isinstance(self.order, OnionPeel):
            if self.stage > 1:
                return None
            shape = self.known.shape[0], self.known.shape[1]
            return schedule(self.order, shape, self.reach, self.boundary, self.rows, self.waiting)
        rank = self.order.layer(self.known, self.waiting, self.boundary)
        if not bool(rank.any()):
            return None
        return schedule_layer(rank, self.reach or (0, 0), self.boundary)

    def fill(self, sites: Sites) -> None:
        """Note that sites have been filled."""
        self.known.view(-1)[sites.cpu()] = True
        self.waiting.view(-1)[sites.cpu()] = False


def to_visit(canvas: Canvas, rows: Rows | None) -> int:
    """How many pixels of a level a sweep over some rows visits."""
    waiting = ~canvas.given[:-1].view(canvas.shape)
    return int(waiting[visited_rows(rows, canvas.shape[0])].sum())
