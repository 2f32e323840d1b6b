"""A sweep from its beginning, or from where it was left."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from workbench.simulation.campaign.workers import Workers
from workbench.simulation.gain_sweep.kernels import Kernels
from workbench.simulation.gain_sweep.plan import Plan
from workbench.simulation.gain_sweep.points import points
from workbench.simulation.gain_sweep.scores import score
from workbench.simulation.gain_sweep.store import SweepStore


@final
@dataclass(frozen=True, slots=True)
class Task:
    """Points for one worker, which sees the sweep's folder."""

    folder: str
    first: int
    last: int


def score_part(task: Task) -> list[dict[str, Any]]:
    """What a worker does: every case of the task's points."""
    plan, kernels = _loaded(task.folder)
    indices = range(task.first, task.last + 1)
    return [
        {"point": k, "case": j, **score(kernels, gains, case)}
        for k, gains in zip(indices, points(plan, kernels.vehicle, indices), strict=True)
        for j, case in enumerate(plan.cases)
    ]


def sweep(store: SweepStore, workers: Workers, advance: Callable[[int], None]) -> None:
    """Score what is missing; each part is stored when done, advance called with its points."""
    tasks = [Task(str(store.folder), part.start, part.stop - 1) for part in store.missing()]
    for task, rows in workers.done(score_part, tasks):
        indices = range(task.first, task.last + 1)
        store.write(indices, rows)
        advance(len(indices))


@functools.lru_cache(maxsize=2)
def _loaded(folder: str) -> tuple[Plan, Kernels]:
    """Of a sweep's folder, once per process."""
    store = SweepStore(Path(folder))
    return store.plan(), store.kernels()
