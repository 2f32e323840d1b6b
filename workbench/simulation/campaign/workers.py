"""Where the work of a survey is done: in this process, in local ones, or on a Dask cluster."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final, Protocol, TypeVar, final

from workbench.errors import InputError

_ANSWERS_S: Final = 10.0
_T = TypeVar("_T")
_R = TypeVar("_R")


class Workers(Protocol):
    """Something that does tasks."""

    def done(self, work: Callable[[_T], _R], tasks: Iterable[_T]) -> Iterator[tuple[_T, _R]]:
        """Each task with its result, in the order in which they are done."""


@final
class InProcess:
    """One after the other, here."""

    def done(self, work: Callable[[_T], _R], tasks: Iterable[_T]) -> Iterator[tuple[_T, _R]]:
        """As `Workers` says."""
        for task in tasks:
            yield task, work(task)


@final
class OnDask:
    """By the workers of a Dask client. A task that fails raises here."""

    def __init__(self, client: object) -> None:
        self._client = client

    def done(self, work: Callable[[_T], _R], tasks: Iterable[_T]) -> Iterator[tuple[_T, _R]]:
        """As `Workers` says."""
        from distributed import as_completed

        listed = list(tasks)
        futures = self._client.map(work, listed, pure=False)  # type: ignore[attr-defined]
        of = {future.key: task for future, task in zip(futures, listed, strict=True)}
        for future, result in as_completed(futures, loop=self._client.loop, with_results=True):  # type: ignore[attr-defined]
            yield of[future.key], result
            future.release()


@contextlib.contextmanager
def workers(jobs: int, scheduler: str | None) -> Iterator[Workers]:
    """Workers for a block: this process for one job, local processes for more, the cluster of a
    scheduler's address where one is named; Ctrl-C is then for this process alone. Raises InputError
    where nobody answers there."""
    if scheduler is None and jobs == 1:
        yield InProcess()
        return
    from distributed import Client, LocalCluster

    with contextlib.ExitStack() as stack:
        if scheduler is None:
            cluster = LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
            address: object = stack.enter_context(cluster)
        else:
            _require_answer(scheduler)
            address = scheduler
        client = stack.enter_context(Client(address, set_as_default=False))
        if scheduler is None:
            client.run(_leave_interrupts)
        yield OnDask(client)


def _require_answer(scheduler: str) -> None:
    """Raise InputError unless a Dask scheduler with a worker is there. A client that is refused
    takes half a minute to say so, and one that gets no answer says nothing at all."""
    from distributed.comm import get_address_host_port, normalize_address

    try:
        address = normalize_address(scheduler)
        place = get_address_host_port(address, strict=True)
        socket.create_connection(place, timeout=_ANSWERS_S).close()
        found = asyncio.run(asyncio.wait_for(_identity(address), _ANSWERS_S))
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler: expected the address of a Dask scheduler that answers, got "
            f"{scheduler!r} ({str(error) or 'no answer'}); `dask scheduler` prints its own"
        ) from error
    if not found.get("workers"):
        raise InputError(
            f"--scheduler: expected a Dask scheduler with workers, {scheduler!r} has none; "
            f"`dask worker {scheduler}` starts one"
        )


async def _identity(address: str) -> Mapping[str, object]:
    """What a scheduler says of itself."""
    from distributed.core import rpc

    async with rpc(address) as scheduler:
        found: Mapping[str, object] = await scheduler.identity()
    return found


def _leave_interrupts() -> None:
    """A worker's Ctrl-C: the process that started it tells it to end."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
