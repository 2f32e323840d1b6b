"""Tables of a TOML file read key by key: unknown, missing and impossible entries are refused."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping

from workbench.errors import InputError


def require_keys(
    where: str, table: Mapping[str, object], expected: Iterable[str],
    optional: Iterable[str] = (), *, what: str = "key",
) -> None:  # fmt: skip
    """Raise InputError unless the table has every key expected and no unknown one."""
    required = tuple(expected)
    known = (*required, *optional)
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
            raise InputError(
                f"unknown {what} {key!r} in {where}; the nearest known one is {near!r}. "
                f"Rename or remove it; {where} has {', '.join(known)}"
            )
    missing = [key for key in required if key not in table]
    if missing:
        raise InputError(f"{where} lacks the {what} {', '.join(missing)}; add it")


def as_table(name: str, value: object) -> Mapping[str, object]:
    """The value, which must be a section."""
    if not isinstance(value, dict):
        raise InputError(
            f"[{name}]: expected a section, got {value!r}; write [{name}] and its keys"
        )
    return value


def as_text(where: str, key: str, table: Mapping[str, object]) -> str:
    """The value of a key, which must be a text that says something."""
    value = table[key]
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{where} {key}: expected a text in quotes, got {value!r}")
    return value


def as_number(where: str, key: str, value: object) -> float:
    """The value, which must be a finite number."""
    # In Python true is the number 1, so a boolean must be refused by name.
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where} {key}: expected a finite number, got {value!r}")
    return float(value)


def as_numbers(where: str, key: str, value: object) -> tuple[float, ...]:
    """The value, which must be a list of finite numbers."""
    if not isinstance(value, list):
        raise InputError(f"{where} {key}: expected a list of numbers, got {value!r}")
    return tuple(as_number(where, key, each) for each in value)


def as_interval(where: str, key: str, value: object) -> tuple[float, float]:
    """The value, which must be [lowest, highest]."""
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{where} {key}: expected [lowest, highest], got {value!r}")
    low, high = as_numbers(where, key, value)
    if low > high:
        raise InputError(f"{where} {key}: expected lowest <= highest, got {value!r}; swap them")
    return low, high
