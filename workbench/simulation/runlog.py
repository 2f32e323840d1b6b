"""The log of a run: JSON lines, first the header, then one line per decision.

Header: {"format": 2, "created_by", "path": [[x, y], ...], ...} plus what the caller adds (settings,
bundle hash, recording). Decision: the fields of `Frame` (without its path) and of `Entry`; both
policies' answers, the verdicts of every nested set, violations and alert among them. Lengths in m,
times in s, rounded to 1e-6, rectangles and discs to 1 mm; what does not exist is null. Format 1
knew one policy and one set.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, final

from workbench import __version__
from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Decision, Observation
from workbench.simulation.frames import (
    Frame,
    LevelVerdicts,
    PersonFrame,
    PolicyAnswer,
    Rectangle,
)

FORMAT = 2


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """One decision: the frame, and what a frame does not show.

    separation_m: distance from car body to the nearest person's body disc at this sample, None when
    nobody is seen; nearest: that person; stamp_s: of the observation, on the monitor's clock, as
    brake_from_s is; elapsed_s: time the decision took; reference_speed_mps;
    clearance_time_s, clearance_person: where the smallest proved clearance lies, None without one;
    brake_from_s: instant of the monitor's clock from which BRAKE is sent, if no later decision says
    otherwise; deciding_level: the nested set whose verdict counts;
    rigor: grade of the decision's mathematics; assumptions: what a SAFE rests on, by name.
    """

    frame: Frame
    separation_m: float | None
    nearest: str | None
    stamp_s: float
    elapsed_s: float
    reference_speed_mps: float
    clearance_time_s: float | None
    clearance_person: str | None
    brake_from_s: float
    deciding_level: str
    rigor: str
    assumptions: tuple[str, ...]

    @classmethod
    def of(
        cls,
        frame: Frame,
        decision: Decision,
        closest: tuple[float, str] | None,
        observation: Observation,
    ) -> Entry:
        """The entry of a decision on `observation`; `closest`: (separation in m, who), None when
        nobody is seen."""
        return cls(
            frame,
            closest[0] if closest else None,
            closest[1] if closest else None,
            observation.stamp_s,
            decision.elapsed_s,
            observation.reference_speed_mps,
            decision.clearance_time_s,
            decision.clearance_person,
            decision.brake_from_s,
            decision.deciding_level,
            decision.rigor.name,
            tuple(assumption.name for assumption in decision.assumptions),
        )


@final
@dataclass(frozen=True, slots=True)
class Log:
    """A log read back: its header and its entries in time order."""

    header: Mapping[str, Any]
    entries: tuple[Entry, ...]


def plain(value: object) -> Any:
    """Nested dataclasses, tuples and enums as JSON values; floats rounded, non-finite ones null."""
    if isinstance(value, bool | int | str | None):
        return value
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Sequence):
        return [plain(item) for item in value]
    return str(getattr(value, "value", value))


def write_log(path: Path, header: Mapping[str, object], entries: Sequence[Entry]) -> Path:
    """Write header and entries to `path` as a whole or not at all; returns the path.

    Written beside the target and renamed, so that no reader sees half a log. Raises InputError when
    the folder cannot be written.
    """
    path = Path(path)
    corners = entries[0].frame.path if entries else ()
    first = {"format": FORMAT, "created_by": f"workbench {__version__}", **header, "path": corners}
    lines = [plain(first), *(_decision_line(entry) for entry in entries)]
    text = "".join(
        json.dumps(line, allow_nan=False, separators=(",", ":")) + "\n" for line in lines
    )
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as stream:
            temporary = stream.name
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as fault:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        raise InputError(
            f"expected a folder that can be written for the log {path}, "
            f"got {fault.strerror or fault}; choose another output folder or change its permissions"
        ) from fault
    return path


def read_log(path: Path) -> Log:
    """Read a log that `write_log` wrote; InputError names the line that is not one."""
    path = Path(path)
    records = list(_records(path))
    if not records or records[0].get("format") != FORMAT:
        came = f"format {records[0].get('format')!r}" if records else "an empty file"
        raise InputError(
            f"{path}: expected a header line with format {FORMAT}, got {came}; make the log again "
            "with this version"
        )
    corners = tuple((x, y) for x, y in records[0].get("path", ()))
    entries = []
    for number, record in enumerate(records[1:], start=2):
        try:
            entries.append(_entry(record, corners))
        except (KeyError, TypeError, ValueError) as fault:
            raise InputError(
                f"{path}, line {number}: expected a decision, got {fault!r}; make the log again"
            ) from fault
    return Log(records[0], tuple(entries))


def _records(path: Path) -> Iterator[dict[str, Any]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"{path}: expected a log of a run (JSON lines), got {fault}") from fault
    for number, line in enumerate(lines, start=1):
        try:
            record = json.loads(line)
        except json.JSONDecodeError as fault:
            raise InputError(f"{path}, line {number}: expected JSON, got {fault}") from fault
        if not isinstance(record, dict):
            raise InputError(f"{path}, line {number}: expected a JSON object, got {line[:40]!r}")
        yield record


def _decision_line(entry: Entry) -> dict[str, Any]:
    line: dict[str, Any] = plain(entry)
    frame = line.pop("frame")
    frame.pop("path")
    frame.pop("decided")
    for name in ("occupancy", "stop_occupancy"):
        frame[name] = _millimetres(frame[name])
    for person in frame["people"]:
        for name in ("predicted", "guarded"):
            person[name] = _millimetres(person[name])
    return {**frame, **line}


def _millimetres(shapes: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[round(number, 3) for number in shape] for shape in shapes]


def _entry(record: dict[str, Any], corners: tuple[tuple[float, float], ...]) -> Entry:
    frame = Frame(
        **{name: record[name] for name in _FRAME_SCALARS},
        verdict=Verdict(record["verdict"]),
        occupancy=_rectangles(record["occupancy"]),
        stop_occupancy=_rectangles(record["stop_occupancy"]),
        people=tuple(map(_person, record["people"])),
        path=corners,
        policies=tuple(
            PolicyAnswer(p["policy"], Verdict(p["verdict"]), p["action"], p["reason"])
            for p in record["policies"]
        ),
        levels=tuple(
            LevelVerdicts(each["tube"], tuple(map(Verdict, each["verdicts"])))
            for each in record["levels"]
        ),
        violations=tuple(record["violations"]),
    )
    return Entry(
        frame,
        **{name: record[name] for name in _ENTRY_SCALARS},
        assumptions=tuple(record["assumptions"]),
    )


def _person(record: dict[str, Any]) -> PersonFrame:
    predicted, guarded = (
        tuple((x, y, r) for x, y, r in record[name]) for name in ("predicted", "guarded")
    )
    # Logs of before intents were estimated have no such key.
    wanted = tuple((goal, probability) for goal, probability in record.get("wanted", ()))
    place = (record["name"], record["x_m"], record["y_m"], record["radius_m"])
    return PersonFrame(*place, predicted, guarded, wanted)


def _rectangles(rows: Sequence[Sequence[float]]) -> tuple[Rectangle, ...]:
    return tuple((x, y, h, a, b) for x, y, h, a, b in rows)


_FRAME_SCALARS = tuple(
    name
    for name in Frame.__dataclass_fields__
    if name
    not in (
        "verdict",
        "occupancy",
        "stop_occupancy",
        "people",
        "path",
        "policies",
        "levels",
        "violations",
        "decided",
    )
)
_ENTRY_SCALARS = tuple(
    name for name in Entry.__dataclass_fields__ if name not in ("frame", "assumptions")
)
