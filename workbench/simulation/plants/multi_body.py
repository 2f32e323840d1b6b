"""The multi-body car of the package commonroad-vehicle-models with the shuttle's parameters."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, final

from workbench.errors import InputError
from workbench.models.section_reading import (
    as_number,
    as_table,
    as_text,
    read_file,
    require_keys,
)
from workbench.simulation.plants.chassis import Motion, Start, not_finite
from workbench.simulation.plants.compiled import Stepped, stepping
from workbench.simulation.plants.traced import multi_body_field

# Keys of the file and names of the package, section by section; "" for what is set by hand.
_KEYS: Final = {
    "masses": {
        "sprung_kg": "m_s", "front_unsprung_kg": "m_uf", "rear_unsprung_kg": "m_ur",
        "front_load": "", "height_m": "h_s", "centre_height_m": "h_cg",
    },
    "inertias": {
        "roll_kgm2": "I_Phi_s", "pitch_kgm2": "I_y_s", "yaw_kgm2": "I_z",
        "front_axle_kgm2": "I_uf", "rear_axle_kgm2": "I_ur", "wheel_kgm2": "I_y_w",
    },
    "suspension": {
        "front_spring_npm": "K_sf", "rear_spring_npm": "K_sr", "front_damper_nspm": "K_sdf",
        "rear_damper_nspm": "K_sdr", "front_roll_nmprad": "K_tsf", "rear_roll_nmprad": "K_tsr",
        "pin_spring_npm": "K_ras", "pin_damper_nspm": "K_rad", "front_camber_radpm": "D_f",
        "rear_camber_radpm": "D_r",
    },
    "wheels": {
        "track_m": "T_f", "radius_m": "R_w", "tyre_spring_npm": "K_zt", "compliance_mpn": "K_lt",
        "front_brake": "T_sb", "front_drive": "T_se",
    },
    "limits": dict.fromkeys(
        ("acceleration_mps2", "speed_mps", "full_force_mps", "steering_rate_radps"), ""
    ),
}  # fmt: skip
_ZERO: Final = ("I_xz_s", "E_f", "E_r", "h_raf", "h_rar")


def gem_e2_multi_body_path() -> Path:
    """The parameter file shipped with this package."""
    return Path(str(files("workbench.simulation.plants") / "data" / "gem_e2_multi_body.toml"))


def multi_body_parameters(path: str | Path, wheelbase_m: float, steering_limit_rad: float) -> Any:
    """`VehicleParameters` of the package from a parameter file, with the package's own tyres.

    Raises InputError for the file, and where the extra `commonroad` is not installed.
    """
    sections = read_file(path, _sections, what="multi-body", shipped=gem_e2_multi_body_path())
    try:
        from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
    except ImportError as error:
        raise InputError(
            f"the multi-body plant needs the commonroad extra ({error.name} is missing): "
            "pip install 'reach-workbench[commonroad]'"
        ) from None
    p, limits, masses = parameters_vehicle1(), sections["limits"], sections["masses"]
    for section, keys in _KEYS.items():
        for key, name in keys.items():
            if name:
                setattr(p, name, sections[section][key])
    for name in _ZERO:
        setattr(p, name, 0.0)
    p.T_r = p.T_f
    p.m = p.m_s + p.m_uf + p.m_ur
    p.b = wheelbase_m * masses["front_load"]
    p.a = wheelbase_m - p.b
    rate = limits["steering_rate_radps"]
    p.steering.max, p.steering.min = steering_limit_rad, -steering_limit_rad
    p.steering.v_max, p.steering.v_min = rate, -rate
    p.longitudinal.v_min, p.longitudinal.v_max = 0.0, limits["speed_mps"]
    p.longitudinal.v_switch = limits["full_force_mps"]
    p.longitudinal.a_max = limits["acceleration_mps2"]
    return p


def _sections(document: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    require_keys("the file", document, _KEYS, what="section")
    found = {}
    for section, keys in _KEYS.items():
        where, table = f"[{section}]", as_table(section, document[section])
        require_keys(where, table, (*keys, "provenance"))
        as_text(where, "provenance", table)
        found[section] = {key: as_number(where, key, table[key]) for key in keys}
        for key, value in found[section].items():
            if section != "suspension" and not value > 0.0:
                raise InputError(f"{where} {key}: expected a number > 0, got {value!r}")
    return found


@final
class MultiBodyChassis:
    """The package's 29 states and its own field, traced and compiled, in steps that the slip of a
    slow wheel allows; below 0.1 m/s the package's kinematic branch, wheels and lateral speeds then
    following the road.

    wheelbase_m, steering_limit_rad: as of the vehicle file.
    Raises InputError without the extra `commonroad` or a C compiler.
    """

    __slots__ = ("_motion", "_moved", "_rear")

    def __init__(self, wheelbase_m: float, steering_limit_rad: float, *, start: Start) -> None:
        start.require_possible(wheelbase_m, steering_limit_rad)
        parameters = _shipped(wheelbase_m, steering_limit_rad)
        from vehiclemodels.init_mb import init_mb

        self._rear = parameters.b
        x = start.x_m + self._rear * math.cos(start.heading)
        y = start.y_m + self._rear * math.sin(start.heading)
        turning = start.yaw_rate_radps(wheelbase_m)
        speed = math.hypot(start.speed_mps, self._rear * turning)
        slip = math.atan2(self._rear * turning, start.speed_mps)
        core = [x, y, start.road_wheel_rad, speed, start.heading, turning, slip]
        advance = _compiled(wheelbase_m, steering_limit_rad)
        self._moved = Stepped(advance, init_mb(core, parameters), _step_values(parameters))
        self._motion: Motion | None = None

    @property
    def motion(self) -> Motion:
        """Of the middle of the rear axle; its acceleration is the mean of the latest advance."""
        if self._motion is None:
            x, rear = self._moved.x, self._rear
            heading = x[4]
            self._motion = Motion(
                x[0] - rear * math.cos(heading), x[1] - rear * math.sin(heading), heading, x[3],
                x[10] - rear * x[5], x[5], x[2], self._moved.acceleration_mps2,
            )  # fmt: skip
        return self._motion

    def advance(
        self, acceleration_mps2: float, steering_rate_radps: float, duration_s: float
    ) -> None:
        """Go on for a time. Raises InputError where the state is no longer finite."""
        if duration_s <= 0.0:
            return
        self._motion = None
        if not self._moved.advance((steering_rate_radps, acceleration_mps2), duration_s):
            raise not_finite(acceleration_mps2, steering_rate_radps)


def _step_values(p: Any) -> list[float]:
    """p of c/multi_body.c. A wheel's slip settles at I u / (R^2 K F) with K F, the stiffness of its
    longitudinal slip under at most half the weight, and u, its speed."""
    stiffness = p.tire.p_kx1 * 0.5 * p.m * 9.81
    settles = p.I_y_w / (p.R_w * p.R_w * stiffness)
    return [p.a, p.b, p.T_f, p.T_r, p.R_w, p.steering.max, settles]


@functools.cache
def _shipped(wheelbase_m: float, steering_limit_rad: float) -> Any:
    return multi_body_parameters(gem_e2_multi_body_path(), wheelbase_m, steering_limit_rad)


@functools.cache
def _compiled(wheelbase_m: float, steering_limit_rad: float) -> Any:
    parameters = _shipped(wheelbase_m, steering_limit_rad)
    fields = [
        multi_body_field(f"{way}_{pedal}", parameters, creeps=way == "creeping",
                         drives=pedal == "drive")
        for way in ("rolling", "creeping")
        for pedal in ("brake", "drive")
    ]  # fmt: skip
    return stepping(fields, "multi_body.c", {})
