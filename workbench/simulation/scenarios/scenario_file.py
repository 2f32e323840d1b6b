"""A scenario from its TOML file: every key is known, every value has its type."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from workbench.errors import InputError
from workbench.estimation.goals import Goal
from workbench.models.section_reading import (
    as_interval,
    as_number,
    as_table,
    as_text,
    read_file,
    require_keys,
)
from workbench.models.spline_path import SplinePath
from workbench.simulation.scenarios.company import Company, checked
from workbench.simulation.scenarios.people_tables import Surroundings, read_part
from workbench.simulation.scenarios.scenario import (
    Dropout,
    Expected,
    Ghost,
    Occluder,
    Scenario,
    Sensing,
)
from workbench.simulation.scenarios.tables import as_flag, as_rows, as_tables

POLICIES: Final = ("LookAhead", "FailSafe", "both")
"""What [expected] says something of."""
LIBRARY: Final = Path(__file__).parent / "library"

_Value = TypeVar("_Value", Ghost, Occluder)
_NEEDED = ("title", "story", "duration_s", "passed_m", "waypoints", "expected")
_OPTIONAL = ("sensing", "goals", "people")
_FIGURES = ("position_m", "heading_rad", "speed_mps", "dropped", "person_m", "person_mps")
_DURATION_S: Final = (0.1, 3600.0)
_WHAT = ("localisation", "people")


def load_scenario(path: str | Path) -> Scenario:
    """The scenario of a file, named after it; docs/scenarios.md has all keys.

    Raises InputError, which names the file and the place, for one that is missing or broken, for
    unknown and missing keys and for values of a wrong type or out of range.
    """
    file = Path(path)
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", file.stem):
        raise InputError(
            f"{file}: expected a name of small letters, digits, - and _ that begins with a letter, "
            f"got {file.stem!r}; rename the file"
        )

    def content(document: Mapping[str, Any]) -> Scenario:
        return _scenario(document, file)

    shipped = LIBRARY / "paper_crossing_simulation.toml"
    return read_file(file, content, what="scenario", shipped=shipped)


def _scenario(document: Mapping[str, object], file: Path) -> Scenario:
    require_keys("the file", document, _NEEDED, _OPTIONAL)
    waypoints = tuple((x, y) for x, y in as_rows("the file", "waypoints", document["waypoints"], 2))
    path = SplinePath.through(waypoints)
    duration_s = as_number("the file", "duration_s", document["duration_s"])
    if not _DURATION_S[0] <= duration_s <= _DURATION_S[1]:
        raise InputError(
            f"duration_s: expected {_DURATION_S[0]:g} to {_DURATION_S[1]:g} s, got {duration_s:g}; "
            "some ten seconds are usual"
        )
    return Scenario(
        name=file.stem,
        title=as_text("the file", "title", document),
        story=" ".join(as_text("the file", "story", document).split()),
        waypoints=waypoints,
        duration_s=duration_s,
        passed_m=_passed_m(document, path),
        cast=checked(_company(document, Surroundings(path, file.parent)), path),
        sensing=_sensing(as_table("sensing", document.get("sensing", {}))),
        goals=_goals(document),
        expected=_expected(as_table("expected", document["expected"])),
    )


def _passed_m(document: Mapping[str, object], path: SplinePath) -> float:
    passed_m = as_number("the file", "passed_m", document["passed_m"])
    if not 0.0 < passed_m < path.length_m:
        raise InputError(
            f"passed_m: expected a station between 0 and {path.length_m:.1f} m, the path's length, "
            f"got {passed_m:g}"
        )
    return passed_m


def _company(document: Mapping[str, object], around: Surroundings) -> Company:
    tables = as_tables("[[people]]", document.get("people", []))
    parts = (
        read_part(f"[[people]] number {k}", each, around) for k, each in enumerate(tables, start=1)
    )
    return Company(tuple(parts))


def _expected(table: Mapping[str, object]) -> Mapping[str, Expected]:
    require_keys("[expected]", table, POLICIES)
    words = {each.value: each for each in Expected}
    for key, word in table.items():
        if not isinstance(word, str) or word not in words:
            raise InputError(f"[expected] {key}: expected one of {', '.join(words)}, got {word!r}")
    return {key: words[str(table[key])] for key in POLICIES}


def _goals(document: Mapping[str, object]) -> tuple[Goal, ...]:
    found = []
    for k, table in enumerate(as_tables("[[goals]]", document.get("goals", [])), start=1):
        where = f"[[goals]] number {k}"
        require_keys(where, table, ("name", "x_m", "y_m", "spread_m"))
        x_m, y_m, spread_m = (
            as_number(where, key, table[key]) for key in ("x_m", "y_m", "spread_m")
        )
        found.append(Goal(as_text(where, "name", table), x_m, y_m, spread_m))
    names = [goal.name for goal in found]
    if len(set(names)) < len(names):
        raise InputError(f"[[goals]]: expected names that differ, got {', '.join(names)}")
    return tuple(found)


def _sensing(table: Mapping[str, object]) -> Sensing:
    where, lists = "[sensing]", ("dropouts", "ghosts", "occluders")
    others = ("delay_s", "watched_m", "assumes_unseen", *lists)
    require_keys(where, table, (), (*_FIGURES, *others))
    given: dict[str, Any] = {
        key: as_number(where, key, table[key]) for key in (*_FIGURES, "watched_m") if key in table
    }
    for key, value in given.items():
        if value < 0.0 or (key == "dropped" and value >= 1.0) or (key == "watched_m" and not value):
            wanted = {"dropped": "of at least 0, below 1", "watched_m": "above 0"}
            fits = wanted.get(key, "of at least 0")
            raise InputError(f"{where} {key}: expected a number {fits}, got {value:g}")
    if "delay_s" in table:
        given["delay_s"] = as_interval(where, "delay_s", table["delay_s"])
        if given["delay_s"][0] < 0.0:
            raise InputError(f"{where} delay_s: expected 0 s or more, got {table['delay_s']!r}")
    if "assumes_unseen" in table:
        given["assumes_unseen"] = as_flag(where, "assumes_unseen", table["assumes_unseen"])
    dropouts = as_tables("[[sensing.dropouts]]", table.get("dropouts", []))
    given["dropouts"] = tuple(_dropout(k, each) for k, each in enumerate(dropouts, start=1))
    given["ghosts"] = _records(Ghost, "ghosts", table)
    given["occluders"] = _records(Occluder, "occluders", table)
    _in_order(given["dropouts"], given["ghosts"], given["occluders"])
    return Sensing(**given)


def _dropout(number: int, table: Mapping[str, object]) -> Dropout:
    where = f"[[sensing.dropouts]] number {number}"
    require_keys(where, table, ("what", "from_s", "until_s"))
    what = as_text(where, "what", table)
    if what not in _WHAT:
        raise InputError(f"{where} what: expected one of {', '.join(_WHAT)}, got {what!r}")
    return Dropout(what, *(as_number(where, key, table[key]) for key in ("from_s", "until_s")))


def _records(
    kind: Callable[..., _Value], name: str, table: Mapping[str, object]
) -> tuple[_Value, ...]:
    keys = [each.name for each in dataclasses.fields(kind)]  # type: ignore[arg-type]
    found = []
    for k, row in enumerate(as_tables(f"[[sensing.{name}]]", table.get(name, [])), start=1):
        where = f"[[sensing.{name}]] number {k}"
        require_keys(where, row, keys)
        found.append(kind(**{key: as_number(where, key, row[key]) for key in keys}))
    return tuple(found)


def _in_order(
    dropouts: tuple[Dropout, ...], ghosts: tuple[Ghost, ...], occluders: tuple[Occluder, ...]
) -> None:
    periods = [(each.from_s, each.until_s) for each in dropouts]
    periods += [(each.from_s, each.until_s) for each in ghosts]
    for from_s, until_s in periods:
        if not from_s < until_s:
            raise InputError(
                f"[sensing]: expected from_s < until_s, got {from_s:g} and {until_s:g}"
            )
    for box in occluders:
        if not (box.x_min_m < box.x_max_m and box.y_min_m < box.y_max_m):
            raise InputError(f"[sensing]: expected a box with min < max on both axes, got {box}")
