"""Tables of a TOML file read key by key: unknown, missing and impossible entries are refused."""

from __future__ import annotations

import dataclasses
import difflib
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from workbench.errors import InputError

_Content = TypeVar("_Content")
_Section = TypeVar("_Section")


def read_file(
    path: str | Path, content: Callable[[Mapping[str, Any]], _Content], *, what: str, shipped: Path
) -> _Content:
    """What `content` makes of a TOML file.

    what: kind of file, for messages, as vehicle; shipped: one to copy and compare with. Raises
    InputError that names the file, for one that is missing or broken or that content refuses.
    """
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such {what} file; copy the shipped one, {shipped}, and edit it"
        ) from None
    except OSError as error:
        raise InputError(
            f"{path}: expected a {what} file that can be read, but: {error.strerror}; name a TOML "
            f"file, as {shipped}"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: expected a TOML file, but: {error}; compare with {shipped}"
        ) from None
    try:
        return content(document)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_section(kind: Callable[..., _Section], name: str, value: object) -> _Section:
    """A dataclass of numbers, yes or no, and a provenance from its section; fields with defaults
    may lack."""
    table, where = as_table(name, value), f"[{name}]"
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    optional = [
        item.name for item in fields
        if item.default is not dataclasses.MISSING and item.name != "provenance"
    ]  # fmt: skip
    require_keys(where, table, [i.name for i in fields if i.name not in optional], optional)
    said = {item.name for item in fields if item.default is True or item.default is False}
    values = {
        key: as_yes_or_no(where, key, table[key]) if key in said else as_number(where, key, value)
        for key, value in table.items()
        if key != "provenance"
    }
    provenance = as_text(where, "provenance", table)
    try:
        return kind(**values, provenance=provenance)
    except InputError as error:
        raise InputError(f"{where} {error}") from None


def require_positive(section: object, *keys: str) -> None:
    """Raise InputError unless these attributes are finite and above 0."""
    for key in keys:
        value = getattr(section, key)
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{key}: expected a number > 0, got {value!r}")


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


def as_yes_or_no(where: str, key: str, value: object) -> bool:
    """The value, which must be true or false."""
    if not isinstance(value, bool):
        raise InputError(f"{where} {key}: expected true or false, got {value!r}")
    return value


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
