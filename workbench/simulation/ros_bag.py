"""ROS 1 and 2 bags as recordings: the tables of docs/data-format.md out of chosen topics."""

from __future__ import annotations

import csv
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

from workbench.errors import InputError
from workbench.simulation.recording import (
    PEOPLE_COLUMNS,
    SHAPE_COLUMNS,
    VEHICLE_COLUMNS,
    Recording,
    load_recording,
)
from workbench.simulation.ros_topics import LOG_TIME, PeopleTopic, TopicMap, VehicleTopic

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys.store import Typestore

_NS: Final = 1_000_000_000
Table = list[list[str | float]]


@final
@dataclass(frozen=True, slots=True)
class BagTables:
    """Rows of `vehicles`, `peds` and `shapes`, each with its header row first.

    repeated: rows left out because the same agent had one with that time before.
    """

    vehicles: Table
    peds: Table
    shapes: Table
    repeated: int

    def write(self, folder: Path) -> Path:
        """Write the tables as a folder of recordings; returns it."""
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("vehicles", "peds", "shapes"):
            with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows(getattr(self, name))
        return folder


def recording_of_bag(bag: Path, topics: TopicMap) -> Recording:
    """The bag as a recording of the bag's name. Raises InputError as `read_bag`, and for tables
    that are no recording."""
    tables = read_bag(bag, topics)
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        return load_recording(tables.write(Path(folder)), bag.stem)


def read_bag(bag: Path, topics: TopicMap) -> BagTables:
    """The tables of one bag: a .bag file (ROS 1) or a folder or file of ROS 2.

    Times count in s from the bag's first message. Headings are unwrapped, and rows stand in order
    of time; a second row of an agent at one time is left out. Positions are taken as they are: no
    transforms between frames are applied. Raises InputError for what is no bag, for a topic or
    field that is not there, and for a value that is no finite number.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError

    store = _store(topics)
    try:
        with AnyReader([bag], default_typestore=store) as reader:
            origin_ns = reader.start_time
            vehicle = _vehicle_rows(reader, topics.vehicle, origin_ns, bag.stem)
            people = _people_rows(reader, topics.people, origin_ns, bag.stem)
    except (AnyReaderError, OSError) as error:
        raise InputError(
            f"expected a ROS bag at {bag}, got {error}; give a .bag file or a folder of ROS 2"
        ) from error
    vehicles, twice = _in_order(vehicle)
    peds, again = _in_order(people)
    _unwrap(vehicles)
    shape: list[str | float]
    shape = [bag.stem, topics.vehicle.agent, *(topics.shape[name] for name in SHAPE_COLUMNS[2:])]
    return BagTables(
        [[*VEHICLE_COLUMNS, *topics.vehicle.further], *vehicles],
        [[*PEOPLE_COLUMNS], *peds],
        [[*SHAPE_COLUMNS], shape],
        twice + again,
    )


def _store(topics: TopicMap) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = {store.value: store for store in Stores}
    if topics.distro not in known:
        raise InputError(f"distro: expected one of {', '.join(known)}, got {topics.distro!r}")
    store = get_typestore(known[topics.distro])
    for name, text in topics.definitions.items():
        try:
            store.register(get_types_from_msg(text, name))
        except Exception as error:
            # The parser has no error of its own for what it cannot read.
            raise InputError(
                f"[definitions] {name}: expected the text of a message, got {error}; copy its .msg"
            ) from error
    return store


def _messages(reader: AnyReader, topic: str) -> Iterator[tuple[int, Any]]:
    """(time in the bag in ns, message) of one topic."""
    connections = [each for each in reader.connections if each.topic == topic]
    if not connections:
        listed = ", ".join(sorted({each.topic for each in reader.connections})) or "none"
        raise InputError(f"expected a topic {topic!r} in the bag, it has {listed}; change the map")
    try:
        for connection, at_ns, content in reader.messages(connections=connections):
            yield at_ns, reader.deserialize(content, connection.msgtype)
    except KeyError as error:
        raise InputError(
            f"topic {topic!r}: expected a type with a known definition, got {error}; add it to "
            "[definitions], or name the distro that has it"
        ) from error


def _vehicle_rows(reader: AnyReader, of: VehicleTopic, origin_ns: int, name: str) -> Table:
    rows: Table = []
    for at_ns, message in _messages(reader, of.topic):
        t_s = _time_s(message, of.t, at_ns, origin_ns)
        heading = _heading(_field(message, of.heading, of.topic), of)
        numbers = [_number(message, field, of.topic) for field in (of.x, of.y)]
        more = [_number(message, field, of.topic) for field in (of.v, *of.further.values())]
        rows.append([name, of.agent, of.kind, t_s, *numbers, heading, *more])
    return rows


def _people_rows(reader: AnyReader, of: PeopleTopic | None, origin_ns: int, name: str) -> Table:
    rows: Table = []
    if of is None:
        return rows
    for at_ns, message in _messages(reader, of.topic):
        t_s = _time_s(message, of.t, at_ns, origin_ns)
        items = [message] if of.items is None else _field(message, of.items, of.topic)
        for item in items:
            agent = str(_field(item, of.agent, of.topic))
            place = [_number(item, field, of.topic) for field in (of.x, of.y)]
            rows.append([name, agent, of.kind, t_s, *place])
    return rows


def _field(message: Any, path: str, topic: str) -> Any:
    """What stands at a path of names with dots; numbers in it count items of a list."""
    value = message
    for name in path.split("."):
        try:
            value = value[int(name)] if name.isdecimal() else getattr(value, name)
        except (AttributeError, IndexError, TypeError) as error:
            has = ", ".join(getattr(value, "__dataclass_fields__", ())) or repr(value)[:80]
            raise InputError(
                f"topic {topic!r}, field {path!r}: expected {name!r}, got {has}; change the map"
            ) from error
    return value


def _number(message: Any, path: str, topic: str) -> float:
    value = _field(message, path, topic)
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"topic {topic!r}, field {path!r}: expected a finite number, got {value!r:.80}; name "
            "another field, or cut the bag"
        )
    return number


def _heading(value: Any, of: VehicleTopic) -> float:
    """A number as it is; of a quaternion the angle about the vertical axis."""
    if isinstance(value, int | float) and math.isfinite(value):
        return float(value)
    if all(hasattr(value, name) for name in "xyzw"):
        x, y, z, w = (float(getattr(value, name)) for name in "xyzw")
        # What nobody filled in is all zeros, and no rotation.
        if abs(x * x + y * y + z * z + w * w - 1.0) < 1e-3:
            return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    raise InputError(
        f"topic {of.topic!r}, field {of.heading!r}: expected a finite number or a quaternion of "
        f"length 1, got {value!r:.80}; change the map"
    )


def _time_s(message: Any, path: str, at_ns: int, origin_ns: int) -> float:
    if path == LOG_TIME:
        return (at_ns - origin_ns) / _NS
    stamp = _field(message, path, "its stamp")
    return (int(stamp.sec) * _NS + int(stamp.nanosec) - origin_ns) / _NS


def _in_order(rows: Table) -> tuple[Table, int]:
    """Rows by time, without a second one of the same agent at the same time; how many those are."""
    kept: dict[tuple[str | float, str | float], Sequence[str | float]] = {}
    for row in sorted(rows, key=lambda row: row[3]):
        kept.setdefault((row[1], row[3]), row)
    return [list(row) for row in kept.values()], len(rows) - len(kept)


def _unwrap(vehicles: Table) -> None:
    """Headings without jumps by full turns; the table's seventh column."""
    column = VEHICLE_COLUMNS.index("heading")
    before: float | None = None
    for row in vehicles:
        angle = float(row[column])
        if before is not None:
            angle += math.tau * round((before - angle) / math.tau)
        row[column] = before = angle
