"""A computation in a thread of its own, with pictures of how far it is, and a way to end it."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

from torchsynth._typing import Image
from torchsynth.synthesis import Progress

T = TypeVar("T")

PAUSE = 0.2
"""Seconds between two pictures: more often, drawing them would slow down what they show."""


_live: set[Ticket] = set()
"""The computations of all visitors that have not ended: a thread in the middle of one would break the exit."""


class CancelledError(Exception):
    """The visitor ended the computation."""


class Ticket:
    """The way to end one computation.

    Example:
        >>> ticket = Ticket()
        >>> ticket.cancel()
        >>> ticket.cancelled, ticket.ended
        (True, False)
    """

    def __init__(self) -> None:
        self._cancelled = threading.Event()
        self._ended = threading.Event()

    def cancel(self) -> None:
        """Have the computation end at its next step."""
        self._cancelled.set()

    def end(self) -> None:
        """Note that it has ended."""
        self._ended.set()

    def wait(self, seconds: float) -> bool:
        """Wait until it has ended; whether it has."""
        return self._ended.wait(seconds)

    @property
    def cancelled(self) -> bool:
        """Whether it was asked to end."""
        return self._cancelled.is_set()

    @property
    def ended(self) -> bool:
        """Whether it has ended, for whatever reason."""
        return self._ended.is_set()


def end_all(patience: float = 5.0) -> None:
    """End all computations, and wait until they have ended.

    Args:
        patience: Seconds to wait for each.

    Example:
        >>> end_all()
    """
    for ticket in tuple(_live):
        ticket.cancel()
        ticket.wait(patience)


@dataclass(frozen=True)
class Snapshot:
    """How far a computation is.

    Args:
        level: The level it is at, 0 the finest.
        sweep: The sweep within it.
        done: Output pixels that are done, of all levels and sweeps.
        total: How many there are.
        image: What the level shows now.
        begins: Whether nothing of this sweep is done yet.
    """

    level: int
    sweep: int
    done: int
    total: int
    image: Image
    begins: bool


@dataclass(frozen=True)
class Finished(Generic[T]):
    """The end of a computation: what it returned, and the seconds it took."""

    value: T
    seconds: float


_Told: TypeAlias = "Snapshot | Finished[T] | BaseException"


def followed(
    work: Callable[[Progress], T], ticket: Ticket, pause: float = PAUSE
) -> Iterator[Snapshot | Finished[T]]:
    """Run something and follow it.

    Args:
        work: What is run, in a thread of its own; it is given the function it has to report to.
        ticket: Ends it.
        pause: Seconds between two snapshots; each sweep's beginning is always shown.

    Yields:
        Snapshots, and at the end what came out.

    Raises:
        CancelledError: If the ticket was cancelled; the computation has ended then.
        BaseException: Whatever the computation raised.

    Example:
        >>> [one.value for one in followed(lambda progress: 42, Ticket())]
        [42]
    """
    told: queue.SimpleQueue[Snapshot | Finished[T] | BaseException] = queue.SimpleQueue()
    reporter = _Reporter(ticket, told.put, pause)
    _live.add(ticket)
    threading.Thread(target=_run, args=(work, reporter, ticket, told.put), daemon=True).start()
    try:
        while True:
            news = told.get()
            if isinstance(news, BaseException):
                raise news
            yield news
            if isinstance(news, Finished):
                return
    finally:
        ticket.cancel()  # whoever followed it has left: nobody would see what comes of it


def _run(
    work: Callable[[Progress], T], reporter: _Reporter, ticket: Ticket, tell: Callable[[_Told[T]], None]
) -> None:
    begun = time.perf_counter()
    try:
        value = work(reporter)
        if ticket.cancelled:
            raise CancelledError
        tell(Finished(value, time.perf_counter() - begun))
    except BaseException as error:
        tell(error)
    finally:
        ticket.end()
        _live.discard(ticket)


class _Reporter:
    """What a synthesis reports to: it passes a picture on now and then, and ends what is cancelled."""

    def __init__(self, ticket: Ticket, tell: Callable[[Snapshot], None], pause: float) -> None:
        self._ticket, self._tell, self._pause = ticket, tell, pause
        self._last = 0.0
        self._at: tuple[int, int] | None = None

    def __call__(self, level: int, sweep: int, done: int, total: int, preview: Callable[[], Image]) -> None:
        if self._ticket.cancelled:
            raise CancelledError
        begins, self._at = (level, sweep) != self._at, (level, sweep)
        now = time.perf_counter()
        if begins or now - self._last >= self._pause:
            self._tell(Snapshot(level, sweep, done, total, preview().clone(), begins))
            self._last = time.perf_counter()
