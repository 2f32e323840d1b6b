"""A dynamic single-track car: mass, yaw inertia and tyres that slip, saturate and lag; compiled."""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, final

import casadi as ca

from workbench.errors import InputError
from workbench.models.section_reading import (
    as_table,
    read_file,
    read_section,
    require_keys,
    require_positive,
)
from workbench.simulation.plants.chassis import Motion, Start, not_finite
from workbench.simulation.plants.compiled import Stepped, stepping

GRAVITY_MPS2: Final = 9.81
STEP_S: Final = 0.0025
"""Longest step of integration."""
_BODY = ("mass_kg", "yaw_inertia_kgm2", "rolling_share", "front_drive", "front_brake")
_TYRES = ("front_per_rad", "rear_per_rad", "friction", "shape", "relaxation_m", "damping_s_per_m",
          "fade_mps")  # fmt: skip
_NAMES = (*_BODY, *_TYRES, "front_m", "rear_m", "limit_rad")


@final
@dataclass(frozen=True, slots=True)
class Body:
    """What moves: mass, load of the front axle over the weight, yaw inertia about the centre of
    mass, rolling resistance over the weight, shares of drive and brake forces at the front."""

    mass_kg: float
    front_load: float
    yaw_inertia_kgm2: float
    rolling_share: float
    front_drive: float
    front_brake: float
    provenance: str

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg", "yaw_inertia_kgm2", "front_load")
        shares = (self.front_load, self.rolling_share, self.front_drive, self.front_brake)
        if not all(0.0 <= share <= 1.0 for share in shares) or self.front_load == 1.0:
            raise InputError(f"expected shares within [0, 1], front_load inside, got {shares!r}")


@final
@dataclass(frozen=True, slots=True)
class Tyres:
    """Those of an axle: cornering stiffness over load, friction, shape C of the magic formula,
    relaxation length; damping (slip per m/s of side slip) of a standing tyre and the speed at which
    that has faded."""

    front_per_rad: float
    rear_per_rad: float
    friction: float
    shape: float
    relaxation_m: float
    damping_s_per_m: float
    fade_mps: float
    provenance: str

    def __post_init__(self) -> None:
        require_positive(self, *_TYRES)
        if self.shape >= 2.0:
            raise InputError(f"shape: expected less than 2, got {self.shape!r}; 1.3 is usual")


@final
@dataclass(frozen=True, slots=True)
class SingleTrack:
    """The parameters of the model; change parts with `dataclasses.replace`."""

    body: Body
    tyres: Tyres

    @property
    def understeer_s2pm(self) -> float:
        """K of yaw rate = v steering / (L + K v^2) in steady cornering with small slip, s^2 / m.

        K = (1 / c_front - 1 / c_rear) / g with c, cornering stiffness over axle load.
        """
        return (1.0 / self.tyres.front_per_rad - 1.0 / self.tyres.rear_per_rad) / GRAVITY_MPS2


def gem_e2_single_track_path() -> Path:
    """The parameter file shipped with this package."""
    return Path(str(files("workbench.simulation.plants") / "data" / "gem_e2_single_track.toml"))


def load_single_track(path: str | Path) -> SingleTrack:
    """Read and check a parameter file. Raises InputError."""
    return read_file(path, _sections, what="single-track", shipped=gem_e2_single_track_path())


def _sections(document: Mapping[str, Any]) -> SingleTrack:
    require_keys("the file", document, ("body", "tyres"), what="section")
    return SingleTrack(
        read_section(Body, "body", as_table("body", document["body"])),
        read_section(Tyres, "tyres", as_table("tyres", document["tyres"])),
    )


@final
class SingleTrackChassis:
    """x = (x, y, heading, v_x, v_y, yaw rate, steering, slip front, slip rear): see `field`.

    parameters: of body and tyres; wheelbase_m and steering_limit_rad as of the vehicle file;
    step_s: longest step of the Runge-Kutta integration. Raises InputError without a C compiler.
    """

    __slots__ = ("_motion", "_moved", "_rear", "_step")

    def __init__(
        self, parameters: SingleTrack, wheelbase_m: float, steering_limit_rad: float, *,
        start: Start, step_s: float = STEP_S,
    ) -> None:  # fmt: skip
        start.require_possible(wheelbase_m, steering_limit_rad)
        values = parameter_values(parameters, wheelbase_m, steering_limit_rad)
        self._rear, self._step = values[-2], step_s
        turning = start.yaw_rate_radps(wheelbase_m)
        place = (start.x_m, start.y_m, start.heading, start.speed_mps)
        state = (*place, self._rear * turning, turning, start.road_wheel_rad, 0.0, 0.0)
        advance = stepping([field()], "single_track.c", {"WB_LIMIT": len(_NAMES) - 1})
        self._moved = Stepped(advance, state, values)
        self._motion: Motion | None = None

    @property
    def motion(self) -> Motion:
        """Where it is and how it moves; its acceleration is the mean of the latest advance."""
        if self._motion is None:
            x, y, heading, along, side, turning, steering, _, _ = self._moved.x
            self._motion = Motion(
                x, y, heading, along, side - self._rear * turning, turning, steering,
                self._moved.acceleration_mps2,
            )  # fmt: skip
        return self._motion

    def advance(
        self, acceleration_mps2: float, steering_rate_radps: float, duration_s: float
    ) -> None:
        """Go on for a time. Raises InputError where the state is no longer finite."""
        if duration_s <= 0.0:
            return
        steps = ctypes.c_longlong(math.ceil(duration_s / self._step - 1e-9))
        asked = acceleration_mps2, steering_rate_radps
        self._motion = None
        if not self._moved.advance(asked, duration_s, steps):
            raise not_finite(acceleration_mps2, steering_rate_radps)


def parameter_values(
    parameters: SingleTrack, wheelbase_m: float, steering_limit_rad: float
) -> list[float]:
    """p of `field`: body, tyres, distances of the axles from the centre of mass, steering limit."""
    body, tyres = dataclasses.asdict(parameters.body), dataclasses.asdict(parameters.tyres)
    rear_m = wheelbase_m * parameters.body.front_load
    own = [body[name] for name in _BODY] + [tyres[name] for name in _TYRES]
    return [*own, wheelbase_m - rear_m, rear_m, steering_limit_rad]


@functools.cache
def field() -> ca.Function:
    """x' = f(x, u, p), u = (acceleration a by the wheels' torque, steering rate).

    m (v_x' - r v_y) = X_f cos d - Y_f sin d + X_r, m (v_y' + r v_x) = X_f sin d + Y_f cos d + Y_r,
    I r' = a_f (X_f sin d + Y_f cos d) - b Y_r. Side force of an axle with load F: Y = -D sin(C
    atan(B s)), D = sqrt((mu F)^2 - X^2), C B mu = stiffness over load; s' = (w - |u| s) / sigma
    with the tyre's velocities u along and w across itself, the slip angle's tangent w / |u| where
    that rests (Bernard and Clover, SAE 950311), valid through standstill, with a damping of
    w that fades with speed. v_x' >= 0 at v_x = 0.
    """
    x, u, p = ca.SX.sym("x", 9), ca.SX.sym("u", 2), ca.SX.sym("p", len(_NAMES))
    at = dict(zip(_NAMES, ca.vertsplit(p), strict=True))
    _, _, heading, along, side, turning, steering, slip_front, slip_rear = ca.vertsplit(x)
    mass, front, rear = at["mass_kg"], at["front_m"], at["rear_m"]
    d = ca.fmax(ca.fmin(steering, at["limit_rad"]), -at["limit_rad"])
    # Brakes hold a standing car with what is needed, which is nothing.
    asked = ca.if_else(along > 0.0, u[0], ca.fmax(u[0], 0.0))
    share = ca.if_else(asked > 0.0, at["front_drive"], at["front_brake"])
    loads = [mass * GRAVITY_MPS2 * arm / (front + rear) for arm in (rear, front)]
    pulls = [_within(mass * asked * part, at["friction"] * load)
             for part, load in zip((share, 1.0 - share), loads, strict=True)]  # fmt: skip
    nose = side + front * turning
    rolls = [ca.cos(d) * along + ca.sin(d) * nose, along]
    skids = [ca.cos(d) * nose - ca.sin(d) * along, side - rear * turning]
    slips = [slip_front, slip_rear]
    side_forces = [
        _side_force(at, at[stiffness], load, pull, slip + _damping(at, along) * skid)
        for stiffness, load, pull, slip, skid in zip(
            ("front_per_rad", "rear_per_rad"), loads, pulls, slips, skids, strict=True
        )
    ]
    across = pulls[0] * ca.sin(d) + side_forces[0] * ca.cos(d)
    ahead = pulls[0] * ca.cos(d) - side_forces[0] * ca.sin(d) + pulls[1]
    gains = ahead / mass + turning * side - at["rolling_share"] * GRAVITY_MPS2
    back = side - rear * turning
    rates = [
        along * ca.cos(heading) - back * ca.sin(heading),
        along * ca.sin(heading) + back * ca.cos(heading),
        turning,
        ca.if_else(along > 0.0, gains, ca.fmax(gains, 0.0)),
        (across + side_forces[1]) / mass - turning * along,
        (front * across - rear * side_forces[1]) / at["yaw_inertia_kgm2"],
        u[1],
        *((skid - ca.fabs(roll) * slip) / at["relaxation_m"]
          for skid, roll, slip in zip(skids, rolls, slips, strict=True)),
    ]  # fmt: skip
    return ca.Function("single_track", [x, u, p], ca.cse([ca.vertcat(*rates)]))


def _within(value: ca.SX, most: ca.SX) -> ca.SX:
    return ca.fmax(ca.fmin(value, most), -most)


def _damping(at: Mapping[str, ca.SX], along: ca.SX) -> ca.SX:
    """Of a tyre that hardly rolls, s / m; none from fade_mps on."""
    slow = ca.fmin(ca.fabs(along) / at["fade_mps"], 1.0)
    return at["damping_s_per_m"] * 0.5 * (1.0 + ca.cos(math.pi * slow))


def _side_force(
    at: Mapping[str, ca.SX], stiffness: ca.SX, load: ca.SX, pull: ca.SX, slip: ca.SX
) -> ca.SX:
    grip = at["friction"] * load
    left = ca.sqrt(ca.fmax(grip * grip - pull * pull, 0.0))
    return -left * ca.sin(at["shape"] * ca.atan(stiffness / (at["shape"] * at["friction"]) * slip))
