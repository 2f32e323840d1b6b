"""The finalists of a sweep drive scenarios: what comes of it, counted as in a survey.

bundles/POINT                           each with its own gains, as `build_rig` makes it
drives/POINT/FIRST-LAST.parquet         one row per drive
"""

from __future__ import annotations

import dataclasses
import functools
import math
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.runtime import load_bundle
from workbench.simulation.campaign.contenders import Field
from workbench.simulation.campaign.parts import Parts
from workbench.simulation.campaign.rows import Row, drive_all
from workbench.simulation.campaign.workers import Workers
from workbench.simulation.gain_sweep.deciding import finalists
from workbench.simulation.gain_sweep.drives_section import Drives
from workbench.simulation.gain_sweep.gains import GAINS, with_gains
from workbench.simulation.gain_sweep.store import SweepStore
from workbench.simulation.rig import Rig, Trial
from workbench.simulation.scenarios.shipped import named
from workbench.simulation.simulated import HORIZON_S, build_rig

_PART: Final = 4
_LEAST_KM: Final = 1e-4


@final
@dataclass(frozen=True, slots=True)
class DriveTask:
    """Drives of one point for a worker, which sees the sweep's folder; gains in the order of
    `GAINS`."""

    folder: str
    point: int
    gains: tuple[float, ...]
    drives: Drives
    first: int
    last: int

    @property
    def numbers(self) -> range:
        """Of its drives."""
        return range(self.first, self.last + 1)


def drive_missing(store: SweepStore, crew: Workers, advance: Callable[[int], None]) -> None:
    """Build what is missing, drive what is missing; advance called with the drives done more."""
    tasks = missing_drives(store)
    first = {task.point: task for task in reversed(tasks)}
    for _ in crew.done(build_point, list(first.values())):
        pass
    for task, rows in crew.done(drive_part, tasks):
        records = [dataclasses.asdict(row) for row in rows]
        _parts(store.folder, task.point).write(task.numbers, records)
        advance(len(task.numbers))


def missing_drives(store: SweepStore) -> list[DriveTask]:
    """What the finalists of a finished sweep did not drive yet, in parts."""
    plan = store.plan()
    if plan.drives is None:
        return []
    rows = store.rows()
    known = {int(row["point"]): row for row in rows}
    return [
        DriveTask(
            str(store.folder), point, _gains(known[point]), plan.drives, part.start, part.stop - 1
        )
        for point in finalists(rows, plan)
        for part in _parts(store.folder, point).missing(plan.drives.count)
    ]


def build_point(task: DriveTask) -> None:
    """What a worker does first: the bundle of the task's gains, unless it is there."""
    place = _bundle(task)
    if place.exists():
        return
    place.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=place.parent) as beside:
        built = Path(beside) / place.name
        build_rig(built, vehicle=_vehicle(task), horizon_s=HORIZON_S)
        built.rename(place)


def drive_part(task: DriveTask) -> list[Row]:
    """What a worker does then: the drives of a task."""
    rig = _rig(dataclasses.replace(task, first=0, last=0))
    return drives_of(rig, task.drives, task.numbers)


def drives_of(rig: Rig, drives: Drives, numbers: Iterable[int]) -> list[Row]:
    """What came of these drives of a vehicle, by their numbers; the same ones give the same."""
    field, rows = Field({HORIZON_S: rig}, {}), []
    for number in numbers:
        scenario, seed = drives.drive(number)
        rows += drive_all(
            number, Trial(named(scenario), drives.plant, seed), (drives.policy,), field
        )
    return rows


def driven_figures(store: SweepStore) -> dict[int, dict[str, float]]:
    """By point, where the study has drives. Raises InputError where some are missing."""
    plan, missing = store.plan(), missing_drives(store)
    if plan.drives is None:
        return {}
    if missing:
        left = sum(len(task.numbers) for task in missing)
        raise InputError(
            f"{store.folder}: expected finalists that drove all their scenarios, got {left} drives "
            f"too few; `workbench gains sweep STUDY --out {store.folder}` goes on"
        )
    return {
        point: summed([Row(**row) for row in _parts(store.folder, point).rows()])
        for point in finalists(store.rows(), plan)
    }


def summed(rows: Sequence[Row]) -> dict[str, float]:
    """The figures of drives: rates over all of them together, as `Tally` has them; without any way
    or time there is none."""
    km, time_s = sum(row.way_m for row in rows) / 1000.0, sum(row.time_s for row in rows)
    needless = sum(row.needless_stops for row in rows)
    still_s = sum(row.waited_s + row.stood_s for row in rows)
    return {
        "needless_per_km": needless / km if km > _LEAST_KM else math.nan,
        "standing": still_s / time_s if time_s > 0.0 else math.nan,
        "contacts": float(sum(row.contact for row in rows)),
        "avoidable": float(sum(row.avoidable for row in rows)),
        "driven_km": km,
        "driven_mps": 1000.0 * km / time_s if time_s > 0.0 else math.nan,
    }


def _gains(row: dict[str, Any]) -> tuple[float, ...]:
    return tuple(float(row[name]) for name in GAINS)


def _vehicle(task: DriveTask) -> Vehicle:
    own = SweepStore(Path(task.folder)).vehicle()
    gains = dict(zip(GAINS, task.gains, strict=True))
    return with_gains(own, gains, own.operation.reference_speed_mps)


def _bundle(task: DriveTask) -> Path:
    return Path(task.folder) / "bundles" / f"{task.point:07d}"


@functools.lru_cache(maxsize=2)
def _rig(task: DriveTask) -> Rig:
    """Of a point, once per process."""
    return Rig(load_bundle(_bundle(task)), _vehicle(task))


def _parts(folder: Path, point: int) -> Parts:
    return Parts(folder / "drives" / f"{point:07d}", _PART)
