"""Where batches are made: in this process, or on a Ray cluster."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeAlias

from torchsynth.batch.work import Failure, Made, Work, attempt
from torchsynth.errors import InputError

Outcome: TypeAlias = list[Made] | Failure
"""What becomes of a batch."""

Engine: TypeAlias = Callable[[Sequence[Work]], Iterator[Outcome]]
"""What makes batches, and yields each when it is finished, in any order."""

_RETRIES = 3
_IN_FLIGHT = 2
_PATIENCE = 5  # seconds


def in_process(work: Sequence[Work]) -> Iterator[Outcome]:
    """Make one batch after the other, here.

    Args:
        work: The batches.
    """
    yield from map(attempt, work)


def on_ray(address: str | None = None) -> Engine:
    """An engine that makes batches on a Ray cluster: the same bytes as in one process.

    A batch whose worker dies is made again by another, up to three times. The workers need this library, in the
    same version, but none of the files.

    Args:
        address: Of the cluster; None takes the one that ``RAY_ADDRESS`` names, or else starts one on
            this machine.

    Raises:
        InputError: If Ray is not installed, or the cluster cannot be reached.
    """
    ray = _ray()
    if not ray.is_initialized():
        _check_reachable(address)
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is sent anywhere
        try:
            ray.init(address=address, include_dashboard=None if address else False, log_to_driver=False)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise InputError(
                "--ray-address", "must be that of a running Ray cluster", str(error).splitlines()[0],
                "start one with 'ray start --head', or leave the address out",
            ) from None  # fmt: skip
    return lambda work: _spread(ray, work)


def _check_reachable(address: str | None) -> None:
    """Whether something listens at ``HOST:PORT``: Ray itself would go on asking for minutes."""
    host, colon, port = (address or "").rpartition(":")
    if not colon or not port.isdigit() or "/" in host:
        return
    try:
        socket.create_connection((host, int(port)), _PATIENCE).close()
    except (OSError, OverflowError) as error:
        raise InputError(
            "--ray-address", "must be that of a running Ray cluster", f"nothing answers at {address} ({error})",
            "start one with 'ray start --head', or leave the address out",
        ) from None  # fmt: skip


def _spread(ray: Any, work: Sequence[Work]) -> Iterator[Outcome]:  # noqa: ANN401 (an optional module)
    """Keep every worker busy, and hand out what is finished."""
    make = ray.remote(num_cpus=1, max_retries=_RETRIES)(attempt)
    most = max(2, _IN_FLIGHT * int(ray.cluster_resources().get("CPU", 1)))
    waiting = iter(work)
    running: dict[Any, Work] = {}
    try:
        while True:
            for one in islice(waiting, most - len(running)):
                running[make.remote(one)] = one
            if not running:
                return
            finished, _ = ray.wait(list(running), num_returns=1)
            yield _outcome(ray, finished[0], running.pop(finished[0]))
    finally:
        for reference in running:  # nobody waits for these any more
            ray.cancel(reference)


def _outcome(ray: Any, reference: Any, work: Work) -> Outcome:  # noqa: ANN401 (an optional module)
    """What a worker made, or why none did."""
    try:
        outcome: Outcome = ray.get(reference)
    except ray.exceptions.RayError as error:
        said = str(error).splitlines()[0]
        return Failure(work.about, len(work.outputs), f"{type(error).__name__}: {said}")
    return outcome


def _ray() -> Any:  # noqa: ANN401 (an optional module)
    try:
        import ray
    except ImportError:
        raise InputError(
            "--engine ray", "needs the package ray", "it is not installed",
            'install it: pip install "torchsynth-textures[ray]"',
        ) from None  # fmt: skip
    return ray
