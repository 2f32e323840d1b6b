"""Pairs drawn ahead by several processes, kept in memory or in a folder, the same in every way."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self, final

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.learning.pairs import PairRuns, PairSource
from workbench.sensitivity.learning.store import PairStore
from workbench.sensitivity.vectorised import Array

_MOST_BYTES: Final = 2**30
# Below this much work left, starting processes costs more than they save.
_WORTH_S: Final = 4.0
_AHEAD: Final = 3


@final
@dataclass(frozen=True, slots=True)
class Workforce:
    """Who draws: `jobs` processes. isolated: never this one, because the simulator is not ours.

    chunk: pairs per block; the blocks of a folder are of this size.
    """

    jobs: int
    chunk: int
    isolated: bool = False

    def __post_init__(self) -> None:
        if self.jobs < 1 or self.chunk < 1:
            raise InputError(
                f"expected at least 1 job and 1 pair per block, got {self.jobs} and {self.chunk}"
            )


@final
class Drawing:
    """The first `total` pairs of a source, drawn when they are asked for; itself a `PairSource`.

    What comes out does not depend on the workforce, on the order of asking or on what a folder held
    before. store: where blocks stay; None for memory, as far as 1 GiB reaches (what does not fit is
    drawn again when it is asked for again). drawn(n): called as n further pairs are there. For a
    `with` block: processes end with it. Raises InputError for pairs beyond `total`.
    """

    def __init__(
        self,
        source: PairSource,
        total: int,
        workforce: Workforce,
        *,
        store: PairStore | None = None,
        drawn: Callable[[int], None] | None = None,
    ) -> None:
        if source.most is not None and total > source.most:
            raise InputError(f"expected at most {source.most} pairs, got {total}")
        self._source, self._total, self._workforce = source, total, workforce
        self._store, self._drawn = store, drawn
        self._kept: dict[int, PairRuns] = {}
        self._kept_bytes = 0
        self._counted: set[int] = set()
        self._due: dict[int, Future[PairRuns]] = {}
        self._pool: ProcessPoolExecutor | None = None
        self._slow = workforce.isolated

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            _end(self._pool)
            self._pool = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the source."""
        return self._source.names

    @property
    def times(self) -> Array:
        """Of the source."""
        return self._source.times

    @property
    def scale(self) -> Array:
        """Of the source."""
        return self._source.scale

    @property
    def distribution(self) -> str:
        """Of the source."""
        return self._source.distribution

    @property
    def most(self) -> int | None:
        """As many as will be drawn."""
        return self._total

    def block(self, start: int, count: int) -> PairRuns:
        """As `PairSource` says."""
        if start < 0 or count < 1 or start + count > self._total:
            raise InputError(
                f"expected pairs below number {self._total}, got {start} to {start + count - 1}"
            )
        size = self._workforce.chunk
        numbers = range(start // size, -(-(start + count) // size))
        chunks = [self._chunk(number) for number in numbers]
        offset = start - numbers.start * size
        ends = [np.concatenate(each)[offset : offset + count] for each in (
            [chunk.first for chunk in chunks], [chunk.second for chunk in chunks],
        )]  # fmt: skip
        return PairRuns(*ends)

    def _rows(self, number: int) -> int:
        size = self._workforce.chunk
        return min(size, self._total - number * size)

    def _chunk(self, number: int) -> PairRuns:
        kept = self._kept.get(number)
        if kept is not None:
            return kept
        runs = self._stored(number)
        if runs is None:
            runs = self._made(number)
        size = runs.first.nbytes + runs.second.nbytes
        if self._store is None and self._kept_bytes + size <= _MOST_BYTES:
            self._kept[number] = runs
            self._kept_bytes += size
        if number not in self._counted:
            self._counted.add(number)
            if self._drawn is not None:
                self._drawn(self._rows(number))
        return runs

    def _stored(self, number: int) -> PairRuns | None:
        if self._store is None or number in self._due:
            return None
        return self._store.read(number, self._rows(number))

    def _made(self, number: int) -> PairRuns:
        force = self._workforce
        if self._slow and self._pool is None and (force.isolated or force.jobs > 1):
            self._pool = _pool(self._source, self._store, force)
        if self._pool is not None:
            return self._from_pool(self._pool, number)
        begun = time.perf_counter()
        runs = drawn_block(self._source, self._store, force.chunk, number, self._rows(number))
        left = self._blocks - len(self._counted) - 1
        self._slow = left * (time.perf_counter() - begun) > _WORTH_S
        return runs

    @property
    def _blocks(self) -> int:
        return -(-self._total // self._workforce.chunk)

    def _from_pool(self, pool: ProcessPoolExecutor, number: int) -> PairRuns:
        for other in self._wanted_next(number):
            if other not in self._due:
                self._due[other] = pool.submit(_work, other, self._rows(other))
        try:
            return self._due.pop(number).result()
        except BrokenProcessPool as error:
            raise InputError(
                "a process that drew pairs died; what it ran ended it, or memory ran out"
            ) from error

    def _wanted_next(self, number: int) -> Iterator[int]:
        """This block and those that will be asked for next, except what is there."""
        yield number
        for other in range(number + 1, min(self._blocks, number + _AHEAD * self._workforce.jobs)):
            stored = self._store is not None and self._store.holds(other)
            if other not in self._kept and not stored:
                yield other


def drawn_block(
    source: PairSource, store: PairStore | None, size: int, number: int, count: int
) -> PairRuns:
    """The first `count` pairs of block `number`, blocks being of `size`; also into the store."""
    runs = source.block(number * size, count)
    if store is not None:
        store.write(number, runs)
    return runs


@final
@dataclass(frozen=True, slots=True)
class _Task:
    source: PairSource
    store: PairStore | None
    size: int


_TASKS: Final[list[_Task]] = []


def _begin(pickled: bytes) -> None:
    """A worker's start: Ctrl-C is its parent's business, standard output the command's, and it does
    not outlive its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _TASKS[:] = [pickle.loads(pickled)]


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(number: int, count: int) -> PairRuns:
    task = _TASKS[0]
    return drawn_block(task.source, task.store, task.size, number, count)


def _pool(source: PairSource, store: PairStore | None, force: Workforce) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(
        force.jobs,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_begin,
        initargs=(pickle.dumps(_Task(source, store, force.chunk)),),
    )


def _end(pool: ProcessPoolExecutor) -> None:
    """Now: whatever is under way is not needed any more."""
    for worker in list((pool._processes or {}).values()):
        with contextlib.suppress(OSError, ValueError):
            worker.kill()
    pool.shutdown(wait=True, cancel_futures=True)
