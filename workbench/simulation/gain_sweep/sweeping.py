"""A sweep from its beginning, or from where it was left."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.simulation.campaign.workers import Workers
from workbench.simulation.gain_sweep.gains import GAINS, Gains, own_gains
from workbench.simulation.gain_sweep.kernels import Kernels
from workbench.simulation.gain_sweep.plan import Plan
from workbench.simulation.gain_sweep.points import points
from workbench.simulation.gain_sweep.scores import score
from workbench.simulation.gain_sweep.searching import Search, rounds
from workbench.simulation.gain_sweep.store import SweepStore

_AT_ONCE: Final = 8
"""Points of a round per task."""


@final
@dataclass(frozen=True, slots=True)
class Task:
    """Points for one worker, which sees the sweep's folder: their gains, in the order of `GAINS`,
    from index `first` on."""

    folder: str
    first: int
    gains: tuple[tuple[float, ...], ...]

    @property
    def indices(self) -> range:
        """Of its points."""
        return range(self.first, self.first + len(self.gains))


def score_part(task: Task) -> list[dict[str, Any]]:
    """What a worker does: every case of the task's points."""
    plan, kernels = _loaded(task.folder)
    return [
        {"point": k, "case": j, **score(kernels, dict(zip(GAINS, gains, strict=True)), case)}
        for k, gains in zip(task.indices, task.gains, strict=True)
        for j, case in enumerate(plan.cases)
    ]


def sweep(store: SweepStore, workers: Workers, advance: Callable[[int], None]) -> None:
    """Score what is missing; each part is stored when done, advance called with its points."""
    plan = store.plan()
    if plan.searches:
        _search(store, workers, advance)
        return
    vehicle = store.vehicle()
    parts = store.missing()
    tasks = [_task(store, part.start, points(plan, vehicle, part)) for part in parts]
    for task, rows in workers.done(score_part, tasks):
        store.write(task.indices, rows)
        advance(len(task.indices))


def _search(store: SweepStore, workers: Workers, advance: Callable[[int], None]) -> None:
    """Round by round; what is stored is told to the sampler again, which then asks for the same as
    if it had never been interrupted."""
    plan, vehicle = store.plan(), store.vehicle()
    known: dict[int, list[dict[str, Any]]] = {}
    for row in store.rows():
        known.setdefault(int(row["point"]), []).append(row)
    search = Search(plan, vehicle)
    for part in rounds(plan.count):
        asked = search.ask(len(part)) if part.start else [own_gains(vehicle)]
        if part.start in known:
            search.require_same(asked, [known[k][0] for k in part])
        else:
            rows = _scored(store, workers, part, asked)
            store.write(part, rows)
            for row in rows:
                known.setdefault(int(row["point"]), []).append(row)
            advance(len(part))
        if part.start:
            search.tell([known[k] for k in part])


def _scored(
    store: SweepStore, workers: Workers, part: range, asked: Sequence[Gains]
) -> list[dict[str, Any]]:
    tasks = [
        _task(store, part.start + k, asked[k : k + _AT_ONCE])
        for k in range(0, len(part), _AT_ONCE)
    ]  # fmt: skip
    done = {task.first: rows for task, rows in workers.done(score_part, tasks)}
    return [row for first in sorted(done) for row in done[first]]


def _task(store: SweepStore, first: int, gains: Sequence[Gains]) -> Task:
    return Task(
        str(store.folder), first, tuple(tuple(each[name] for name in GAINS) for each in gains)
    )


@functools.lru_cache(maxsize=2)
def _loaded(folder: str) -> tuple[Plan, Kernels]:
    """Of a sweep's folder, once per process."""
    store = SweepStore(Path(folder))
    return store.plan(), store.kernels()
