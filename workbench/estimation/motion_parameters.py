"""The fitted numbers of how people move, as one TOML file that says where they come from."""

from __future__ import annotations

import importlib.resources
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, final

from workbench.errors import InputError
from workbench.estimation.motion_filter import MotionNumbers
from workbench.estimation.potential_field import Field, Repulsion
from workbench.estimation.quantile_radii import QuantileRadii

_RADII = ("levels", "leads_s", "radii_m")
_FIELD = ("relaxation_s", "softening_m")


@final
@dataclass(frozen=True, slots=True)
class MotionParameters:
    """Everything that a prediction needs, fitted to the same recordings.

    numbers, field: of the model; free, toward_goal: radii of predictions without and with a goal;
    provenance: what they were fitted to, with credit.
    """

    numbers: MotionNumbers
    field: Field
    free: QuantileRadii
    toward_goal: QuantileRadii
    provenance: str

    def toml(self) -> str:
        """The file that `load_motion` reads."""
        motion = [f"{e.name} = {getattr(self.numbers, e.name):g}" for e in fields(MotionNumbers)]
        field = [f"{name} = {getattr(self.field, name):g}" for name in _FIELD]
        laws = {"obstacle": self.field.obstacle, "vehicle": self.field.vehicle}
        parts = [
            "# How people move: fitted by `workbench intent FOLDER --fit`.\n",
            f"provenance = {json.dumps(self.provenance, ensure_ascii=False)}\n",
            "[motion]", *motion, "", "[field]", *field, "",
        ]  # fmt: skip
        for name, law in laws.items():
            parts += [f"[field.{name}]", f"strength_mps2 = {law.strength_mps2:g}"]
            parts += [f"reach_m = {law.reach_m:g}", ""]
        for name, radii in (("free", self.free), ("toward_goal", self.toward_goal)):
            rows = "".join(f"    {list(row)},\n" for row in radii.radii_m)
            parts += [f"[radii.{name}]", f"levels = {list(radii.levels)}"]
            parts += [f"leads_s = {list(radii.leads_s)}", f"radii_m = [\n{rows}]", ""]
        return "\n".join(parts)


def shipped_motion_path() -> Path:
    """The file shipped with this package, fitted to the UCY recordings."""
    return Path(str(importlib.resources.files("workbench.estimation") / "data" / "motion_ucy.toml"))


def shipped_motion() -> MotionParameters:
    """The shipped numbers."""
    return load_motion(shipped_motion_path())


def load_motion(path: Path) -> MotionParameters:
    """Read and check a file of fitted numbers; InputError names the file and what is wrong."""
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(
            f"{path} cannot be read ({fault}); fit one by `workbench intent FOLDER --fit`"
        ) from fault
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise InputError(
            f"{path}: expected TOML, but: {fault}; compare with {shipped_motion_path()}"
        ) from fault
    try:
        return _parameters(document)
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None


def _parameters(document: Mapping[str, Any]) -> MotionParameters:
    _keys("the file", document, ("provenance", "motion", "field", "radii"))
    names = tuple(each.name for each in fields(MotionNumbers))
    motion = _numbers("[motion]", document["motion"], names)
    field = document["field"]
    _keys("[field]", field, (*_FIELD, "obstacle", "vehicle"))
    plain = _numbers("[field]", {name: field[name] for name in _FIELD}, _FIELD)
    laws = {
        name: Repulsion(**_numbers(f"[field.{name}]", field[name], ("strength_mps2", "reach_m")))
        for name in ("obstacle", "vehicle")
    }
    _keys("[radii]", document["radii"], ("free", "toward_goal"))
    radii = {name: _radii(f"[radii.{name}]", table) for name, table in document["radii"].items()}
    return MotionParameters(
        MotionNumbers(**motion),
        Field(plain["relaxation_s"], plain["softening_m"], laws["obstacle"], laws["vehicle"]),
        radii["free"],
        radii["toward_goal"],
        str(document["provenance"]),
    )


def _radii(place: str, table: Any) -> QuantileRadii:
    _keys(place, table, _RADII)
    try:
        levels, leads = (tuple(map(float, table[name])) for name in _RADII[:2])
        rows = tuple(tuple(map(float, row)) for row in table["radii_m"])
    except (TypeError, ValueError) as fault:
        raise InputError(f"{place}: expected lists of numbers ({fault})") from None
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{place} radii_m: expected rows of one length")
    return QuantileRadii(levels, leads, rows)


def _numbers(place: str, table: Any, names: tuple[str, ...]) -> dict[str, float]:
    _keys(place, table, names)
    for name in names:
        if isinstance(table[name], bool) or not isinstance(table[name], int | float):
            raise InputError(f"{place} {name}: expected a number, got {table[name]!r}")
    return {name: float(table[name]) for name in names}


def _keys(place: str, table: Any, names: tuple[str, ...]) -> None:
    if not isinstance(table, Mapping) or set(table) != set(names):
        got = ", ".join(table) if isinstance(table, Mapping) else repr(table)
        raise InputError(f"{place}: expected exactly the keys {', '.join(names)}, got {got}")
