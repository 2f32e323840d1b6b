"""Values of a scenario file that are lists, flags and lists of tables."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.errors import InputError
from workbench.models.section_reading import as_interval, as_number, as_numbers
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point


def as_point(where: str, key: str, value: object) -> Point:
    """The value, which must be a list of two finite numbers."""
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where} {key}: expected two numbers [a, b], got {value!r}")
    return as_number(where, key, value[0]), as_number(where, key, value[1])


def as_rows(where: str, key: str, value: object, length: int) -> tuple[tuple[float, ...], ...]:
    """The value, which must be a list of lists of `length` finite numbers."""
    if not isinstance(value, list):
        raise InputError(f"{where} {key}: expected a list of lists of numbers, got {value!r}")
    rows = tuple(as_numbers(where, key, each) for each in value)
    for row in rows:
        if len(row) != length:
            raise InputError(f"{where} {key}: expected {length} numbers each, got {list(row)}")
    return rows


def as_tables(where: str, value: object) -> tuple[Mapping[str, object], ...]:
    """The value, which must be a list of tables."""
    if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
        raise InputError(f"{where}: expected a list of tables, got {value!r}")
    return tuple(value)


def as_flag(where: str, key: str, value: object) -> bool:
    """The value, which must be true or false."""
    if not isinstance(value, bool):
        raise InputError(f"{where} {key}: expected true or false, got {value!r}")
    return value


def as_limits(where: str, table: Mapping[str, object], default: MotionLimits) -> MotionLimits:
    """The table's limits = [speed m/s, acceleration m/s^2], or the default."""
    if "limits" not in table:
        return default
    return MotionLimits(*as_point(where, "limits", table["limits"]))


def as_period(where: str, key: str, value: object) -> tuple[float, float]:
    """The value, which must be [from, until] with from < until."""
    low, high = as_interval(where, key, value)
    if low == high:
        raise InputError(f"{where} {key}: expected from < until, got {value!r}")
    return low, high
