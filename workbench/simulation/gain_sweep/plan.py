"""A study of gains as a TOML file: which gains, in which cases, and what decides."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_numbers,
    as_table,
    as_text,
    require_keys,
)
from workbench.models.vehicle import gem_e2_path, gem_e2_recommended_path
from workbench.simulation.gain_sweep.drives_section import Drives, drives_section
from workbench.simulation.gain_sweep.figures import DRIVEN, FIGURES, figure
from workbench.simulation.gain_sweep.gains import GAINS
from workbench.simulation.simulated import simulated_path

VEHICLES: Final = {
    "gem_e2": gem_e2_path, "gem_e2_recommended": gem_e2_recommended_path,
    "gem_e2_simulated": simulated_path,
}  # fmt: skip
METHODS: Final = ("grid", "sobol", "tpe", "nsga2")
SEARCHES: Final = ("tpe", "nsga2")
"""Those that draw a point from what the points before it were worth."""
_MOST: Final = 1_000_000


@final
@dataclass(frozen=True, slots=True)
class Start:
    """An initial set: the vehicle's radii times radius_factor, about offset_m, a heading error
    of 0, the case's speed and the steering that its curvature asks for."""

    name: str
    offset_m: float
    radius_factor: float


@final
@dataclass(frozen=True, slots=True)
class Case:
    """What every choice of gains has to cope with: reference speed, curvatures, initial set."""

    speed_mps: float
    curvature_per_m: tuple[float, float]
    start: Start


@final
@dataclass(frozen=True, slots=True)
class Decision:
    """What decides: bounds that every case has to keep, what is traded, what is best.

    at_least, at_most: figure -> bound; trade: figures that span the front; choose: the one of them
    whose best point within the bounds is recommended.
    """

    at_least: Mapping[str, float]
    at_most: Mapping[str, float]
    trade: tuple[str, ...]
    choose: str

    @property
    def order(self) -> tuple[str, ...]:
        """What is compared first, and then."""
        return (self.choose, *(name for name in self.trade if name != self.choose))

    @property
    def named(self) -> tuple[str, ...]:
        """All figures that it names."""
        return tuple(dict.fromkeys((*self.at_least, *self.at_most, *self.trade)))

    def before_drives(self) -> Decision:
        """What of it can be decided without drives."""
        trade = tuple(name for name in self.trade if name in FIGURES)
        return Decision(
            {name: bound for name, bound in self.at_least.items() if name in FIGURES},
            {name: bound for name, bound in self.at_most.items() if name in FIGURES},
            trade,
            next(name for name in self.order if name in FIGURES),
        )


@final
@dataclass(frozen=True, slots=True)
class Plan:
    """A study: ranges (low = high: held) by gain, how points are drawn, cases, what decides.

    count: points beside the vehicle's own gains; a grid has `per_axis` on each axis that varies.
    drives: None where nobody drives.
    """

    name: str
    claim: str
    vehicle: Path
    ranges: Mapping[str, tuple[float, float]]
    method: str
    per_axis: int
    count: int
    seed: int
    cases: tuple[Case, ...]
    decision: Decision
    drives: Drives | None = None

    @property
    def searches(self) -> bool:
        """Whether a point depends on those before it."""
        return self.method in SEARCHES

    @property
    def varied(self) -> tuple[str, ...]:
        """Gains with a range."""
        return tuple(name for name, (low, high) in self.ranges.items() if low < high)


def load_plan(path: Path) -> Plan:
    """Read and check a study file. Raises InputError that names the file and what to mend."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(
            f"{path}: expected a study file, TOML, but: {error}; docs/tutorial-gains.md shows one"
        ) from None
    try:
        return _plan(document, path.parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _plan(document: Mapping[str, object], folder: Path) -> Plan:
    require_keys("the file", document, ("study", "gains", "search", "cases", "decide"),
                 ("drives",), what="section")  # fmt: skip
    study, gains, search = (as_table(k, document[k]) for k in ("study", "gains", "search"))
    require_keys("[study]", study, ("name", "claim"), ("vehicle",))
    require_keys("[gains]", gains, (), tuple(GAINS))
    ranges = {name: _range(name, value) for name, value in gains.items()}
    varied = sum(low < high for low, high in ranges.values())
    if not varied:
        raise InputError(f"[gains]: expected a range [low, high] of one of {', '.join(GAINS)}")
    method, points, seed = _search(search)
    count = points**varied if method == "grid" else points
    if not 1 <= count <= _MOST:
        raise InputError(f"[search] points: expected 1 to {_MOST} points in all, got {count}")
    drives = None
    if "drives" in document:
        drives = drives_section(as_table("drives", document["drives"]))
    return Plan(
        as_text("[study]", "name", study),
        as_text("[study]", "claim", study),
        _vehicle(study.get("vehicle", "gem_e2_simulated"), folder),
        ranges, method, points, count, seed,
        _cases(as_table("cases", document["cases"])),
        _decision(as_table("decide", document["decide"]), drives), drives,
    )  # fmt: skip


def _range(name: str, value: object) -> tuple[float, float]:
    if isinstance(value, list):
        low, high = as_interval("[gains]", name, value)
    else:
        low = high = as_number("[gains]", name, value)
    if name == "look-ahead" and low < 0.0:
        raise InputError(f"[gains] look-ahead: expected distances >= 0 in m, got {low:g}")
    return low, high


def _search(table: Mapping[str, object]) -> tuple[str, int, int]:
    require_keys("[search]", table, ("method", "points"), ("seed",))
    if table["method"] not in METHODS:
        raise InputError(f"[search] method: expected one of {METHODS}, got {table['method']!r}")
    points, seed = (as_number("[search]", key, table.get(key, 1)) for key in ("points", "seed"))
    if points != int(points) or points < 2 or seed != int(seed) or seed < 0:
        raise InputError(
            "[search]: expected whole numbers, points >= 2 (of a grid: per axis) and seed >= 0, "
            f"got {points:g} and {seed:g}"
        )
    return str(table["method"]), int(points), int(seed)


def _vehicle(value: object, folder: Path) -> Path:
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"[study] vehicle: expected a name or a file, got {value!r}")
    if value in VEHICLES:
        return VEHICLES[value]()
    return folder / value


def _cases(table: Mapping[str, object]) -> tuple[Case, ...]:
    require_keys("[cases]", table, ("speeds_mps", "curvatures_per_m", "initial_sets"))
    speeds = as_numbers("[cases]", "speeds_mps", table["speeds_mps"])
    if not speeds or min(speeds) <= 0.0:
        raise InputError(f"[cases] speeds_mps: expected speeds > 0, got {list(speeds)}")
    bends = [
        as_interval("[cases]", "curvatures_per_m", e) for e in _list(table, "curvatures_per_m")
    ]
    starts = [_start(e) for e in _list(table, "initial_sets")]
    if len({start.name for start in starts}) < len(starts):
        raise InputError(
            "[[cases.initial_sets]]: expected a name of its own for each, got one twice"
        )
    return tuple(Case(v, bend, start) for v in speeds for bend in bends for start in starts)


def _list(table: Mapping[str, object], key: str) -> list[object]:
    value = table[key]
    if not isinstance(value, list) or not value:
        raise InputError(f"[cases] {key}: expected a list that is not empty, got {value!r}")
    return value


def _start(value: object) -> Start:
    where = "[[cases.initial_sets]]"
    table = as_table("cases.initial_sets", value)
    require_keys(where, table, ("name", "offset_m", "radius_factor"))
    offset, factor = (as_number(where, key, table[key]) for key in ("offset_m", "radius_factor"))
    if factor <= 0.0:
        raise InputError(f"{where} radius_factor: expected a number > 0, got {factor:g}")
    return Start(as_text(where, "name", table), offset, factor)


def _decision(table: Mapping[str, object], drives: Drives | None) -> Decision:
    require_keys("[decide]", table, ("trade", "choose"), ("at_least", "at_most"))
    trade = table["trade"]
    if not isinstance(trade, list) or not trade:
        raise InputError(f"[decide] trade: expected a list of figures, got {trade!r}")
    names = tuple(figure(str(name)).name for name in trade)
    if table["choose"] not in names:
        raise InputError(
            f"[decide] choose: expected one of those traded, {names}, got {table['choose']!r}"
        )
    bounds = [_bounds(key, table.get(key, {})) for key in ("at_least", "at_most")]
    found = Decision(bounds[0], bounds[1], names, str(table["choose"]))
    unknown = [name for name in found.named if name in DRIVEN]
    if unknown and drives is None:
        raise InputError(
            f"[decide]: expected a section [drives] too, since only drives say {unknown}; add one"
        )
    if not set(names) & set(FIGURES):
        raise InputError(
            f"[decide] trade: expected a figure that every point has, one of {', '.join(FIGURES)}, "
            f"by which finalists are chosen, got {names} alone"
        )
    return found


def _bounds(key: str, value: object) -> dict[str, float]:
    where = f"[decide] {key}"
    table = as_table(f"decide.{key}", value)
    return {figure(name).name: as_number(where, name, bound) for name, bound in table.items()}


def shown_bounds(decision: Decision) -> tuple[str, ...]:
    """The bounds in words."""
    words = [(figure(n), "at least", b) for n, b in decision.at_least.items()]
    words += [(figure(n), "at most", b) for n, b in decision.at_most.items()]
    return tuple(f"{f.label} {how} {bound:g}" for f, how, bound in words)


def as_data(case: Case) -> dict[str, str | float]:
    """The case as columns of a row."""
    low, high = case.curvature_per_m
    return {"speed_mps": case.speed_mps, "curvature_low_per_m": low, "curvature_high_per_m": high,
            "initial_set": case.start.name}  # fmt: skip
