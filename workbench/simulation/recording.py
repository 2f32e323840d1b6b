"""Read one recorded drive (vehicle, people, shape) from a folder of CSV files, checked once, here.

A folder holds, each plain (`.csv`) or compressed (`.csv.gz`), with a header row and SI units:
`vehicles`: recording, agent, kind, t, x, y, heading, v; optional v_lat, a, yaw_rate
`peds`: recording, agent, kind, t, x, y (a recording without people has no rows here)
`shapes`: recording, agent, front, rear, half_width, wheelbase (from the reference point)
`recordings` (optional): recording; gives the list of names
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

from workbench.errors import InputError
from workbench.estimation.tables import Row, Table

VEHICLE_COLUMNS = ("recording", "agent", "kind", "t", "x", "y", "heading", "v")
PEOPLE_COLUMNS = ("recording", "agent", "kind", "t", "x", "y")
SHAPE_COLUMNS = ("recording", "agent", "front", "rear", "half_width", "wheelbase")


@final
@dataclass(frozen=True, slots=True)
class VehicleSample:
    """One recorded state of the reference point; None where the recording has no such column."""

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    lateral_speed_mps: float | None
    acceleration_mps2: float | None
    yaw_rate_radps: float | None


@final
@dataclass(frozen=True, slots=True)
class PersonSample:
    """One recorded position of a person."""

    t_s: float
    x_m: float
    y_m: float


@final
@dataclass(frozen=True, slots=True)
class Track:
    """One person's samples in increasing time; `kind` is ped, cyclist, skater or sitting."""

    name: str
    kind: str
    samples: tuple[PersonSample, ...]


@final
@dataclass(frozen=True, slots=True)
class Shape:
    """Distances from the reference point to front and rear bumper, half width and wheelbase."""

    front_m: float
    rear_m: float
    half_width_m: float
    wheelbase_m: float


@final
@dataclass(frozen=True, slots=True)
class Recording:
    """One vehicle's drive among people; every sample is finite and times increase strictly."""

    name: str
    agent: str
    kind: str
    shape: Shape
    vehicle: tuple[VehicleSample, ...]
    people: tuple[Track, ...]


def load_recording(folder: Path, name: str, *, agent: str | None = None) -> Recording:
    """Read the drive of `agent` (needed only when the recording has several vehicles).

    Raises InputError when a file, column or vehicle is missing, when the name is unknown, when a
    number cannot be used or when time does not increase; the message names the place and the mend.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"expected a folder of recordings at {folder}, found "
            f"{'a file' if folder.exists() else 'nothing'}; "
            "give the folder that holds vehicles.csv.gz"
        )
    vehicles = Table.read(folder, "vehicles", VEHICLE_COLUMNS)
    people = Table.read(folder, "peds", PEOPLE_COLUMNS)
    _known_name(folder, name, (vehicles, people))
    agent, rows = _choose_agent(vehicles, name, agent)
    samples = tuple(_vehicle_sample(row, vehicles) for row in rows)
    _increasing(rows)
    shape = _shape(Table.read(folder, "shapes", SHAPE_COLUMNS), name, agent)
    kind = rows[0].text("kind")
    return Recording(name, agent, kind, shape, samples, tuple(_tracks(people, name)))


def _known_name(folder: Path, name: str, tables: Sequence[Table]) -> None:
    if Table.exists(folder, "recordings"):
        tables = (Table.read(folder, "recordings", ("recording",)), *tables)
    names = sorted({row.text("recording") for table in tables for row in table.rows})
    if name in names:
        return
    if not names:
        raise InputError(f"expected recordings in {folder}, its tables have no rows")
    near = sorted(
        names, key=lambda other: -difflib.SequenceMatcher(None, name.lower(), other.lower()).ratio()
    )
    raise InputError(
        f"no recording {name!r} in {folder}; it has, nearest first: {', '.join(near[:20])}"
        + (f" and {len(near) - 20} more" if len(near) > 20 else "")
    )


def _choose_agent(table: Table, name: str, agent: str | None) -> tuple[str, list[Row]]:
    by_agent: dict[str, list[Row]] = {}
    for row in table.rows:
        if row.text("recording") == name:
            by_agent.setdefault(row.text("agent"), []).append(row)
    if not by_agent:
        others = sorted({row.text("recording") for row in table.rows})
        raise InputError(
            f"{table.path}: recording {name!r} has no vehicle; replay needs one. "
            f"Recordings here with a vehicle: {', '.join(others[:20]) or 'none'}"
        )
    listed = ", ".join(sorted(by_agent))
    if agent is None:
        if len(by_agent) > 1:
            raise InputError(
                f"{table.path}: recording {name!r} has {len(by_agent)} vehicles ({listed}); "
                "say which one to replay (agent)"
            )
        agent = next(iter(by_agent))
    if agent not in by_agent:
        raise InputError(
            f"{table.path}: recording {name!r} has no vehicle {agent!r}; it has {listed}"
        )
    return agent, by_agent[agent]


def _vehicle_sample(row: Row, table: Table) -> VehicleSample:
    def optional(column: str) -> float | None:
        return row.number(column) if column in table.columns else None

    return VehicleSample(
        t_s=row.number("t"),
        x_m=row.number("x"),
        y_m=row.number("y"),
        heading_rad=row.number("heading"),
        speed_mps=row.number("v"),
        lateral_speed_mps=optional("v_lat"),
        acceleration_mps2=optional("a"),
        yaw_rate_radps=optional("yaw_rate"),
    )


def _increasing(rows: Sequence[Row]) -> None:
    for before, after in itertools.pairwise(rows):
        if not after.number("t") > before.number("t"):
            raise InputError(
                f"{after.place('t')}: expected a time after {before.text('t')} (the row before of "
                f"{after.text('agent')!r}), got {after.text('t')}; sort each agent's rows by time "
                "and drop repeated ones"
            )


def _shape(table: Table, name: str, agent: str) -> Shape:
    for row in table.rows:
        if (row.text("recording"), row.text("agent")) == (name, agent):
            break
    else:
        raise InputError(
            f"{table.path}: no row for recording {name!r}, agent {agent!r}; add its front, rear, "
            "half_width and wheelbase in metres"
        )
    front, rear = row.number("front"), row.number("rear")
    half_width, wheelbase = row.number("half_width"), row.number("wheelbase")
    for column, value in (("half_width", half_width), ("wheelbase", wheelbase)):
        if value <= 0.0:
            raise InputError(f"{row.place(column)}: expected metres above zero, got {value}")
    if front + rear <= 0.0:
        raise InputError(
            f"{row.place('front')}: expected front + rear above zero (both measured outward from "
            f"the reference point), got {front} + {rear}"
        )
    return Shape(front, rear, half_width, wheelbase)


def _tracks(table: Table, name: str) -> Iterator[Track]:
    by_agent: dict[str, list[Row]] = {}
    for row in table.rows:
        if row.text("recording") == name:
            by_agent.setdefault(row.text("agent"), []).append(row)
    for agent, rows in by_agent.items():
        samples = tuple(
            PersonSample(row.number("t"), row.number("x"), row.number("y")) for row in rows
        )
        _increasing(rows)
        yield Track(agent, rows[0].text("kind"), samples)
