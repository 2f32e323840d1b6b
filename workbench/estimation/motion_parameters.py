"""The fitted numbers of how people move, as one TOML file that says where they come from."""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, final

from workbench.errors import InputError
from workbench.estimation.motion_filter import MotionNumbers
from workbench.estimation.potential_field import Field, Repulsion
from workbench.estimation.quantile_radii import QuantileRadii
from workbench.models.section_reading import as_number, as_table, read_file, require_keys

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
    return read_file(path, _parameters, what="motion", shipped=shipped_motion_path())


def _parameters(document: Mapping[str, Any]) -> MotionParameters:
    require_keys("the file", document, ("provenance", "motion", "field", "radii"))
    names = tuple(each.name for each in fields(MotionNumbers))
    motion = _numbers("motion", document["motion"], names)
    field = as_table("field", document["field"])
    require_keys("[field]", field, (*_FIELD, "obstacle", "vehicle"))
    plain = _numbers("field", {name: field[name] for name in _FIELD}, _FIELD)
    laws = {
        name: Repulsion(**_numbers(f"field.{name}", field[name], ("strength_mps2", "reach_m")))
        for name in ("obstacle", "vehicle")
    }
    radii = as_table("radii", document["radii"])
    require_keys("[radii]", radii, ("free", "toward_goal"))
    found = {name: _radii(f"radii.{name}", table) for name, table in radii.items()}
    return MotionParameters(
        MotionNumbers(**motion),
        Field(plain["relaxation_s"], plain["softening_m"], laws["obstacle"], laws["vehicle"]),
        found["free"],
        found["toward_goal"],
        str(document["provenance"]),
    )


def _radii(name: str, value: object) -> QuantileRadii:
    table: Any = as_table(name, value)
    place = f"[{name}]"
    require_keys(place, table, _RADII)
    try:
        levels, leads = (tuple(map(float, table[name])) for name in _RADII[:2])
        rows = tuple(tuple(map(float, row)) for row in table["radii_m"])
    except (TypeError, ValueError) as fault:
        raise InputError(f"{place}: expected lists of numbers ({fault})") from None
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{place} radii_m: expected rows of one length")
    return QuantileRadii(levels, leads, rows)


def _numbers(name: str, value: object, keys: tuple[str, ...]) -> dict[str, float]:
    table, where = as_table(name, value), f"[{name}]"
    require_keys(where, table, keys)
    return {key: as_number(where, key, table[key]) for key in keys}
