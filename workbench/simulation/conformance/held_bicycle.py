"""Recorded cars: windows of their motion, and the bicycle that holds what it has at the beginning.

Nobody recorded what these cars were told, so the model holds the steering angle and (if asked) the
acceleration of the window's first sample: W then bounds what the driver did besides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import casadi as ca
import numpy as np

from workbench.controllers.symbols import clip
from workbench.errors import InputError
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode
from workbench.models.vehicle_sections import Uncertainty
from workbench.sets import Box
from workbench.simulation.conformance.windows import LONGEST_GAP_S, Array, Measured, Window
from workbench.simulation.recording import Recording

STEERING_LIMIT_RAD: Final = 0.6
_MOST_RAD: Final = 0.55
_LEAST_SPEED_MPS: Final = 0.1
_CREEP_MPS: Final = 1e-3
# Below it the steering angle that follows from the yaw rate is noise.
_STEERS_MPS: Final = 1.0


@final
@dataclass(frozen=True, slots=True)
class DriveErrors:
    """How far off recorded motion may be (magnitudes): what a window's initial set is made of.

    position_m: of the reference point along and across, at both ends of a comparison together;
    measured on the recordings fitted to: a standing car's place slides by 0.1 m and more;
    heading_rad; speed_mps; yaw_rate_radps: the steering angle is atan(L yaw rate / v).
    """

    position_m: float = 0.2
    heading_rad: float = 0.01
    speed_mps: float = 0.05
    yaw_rate_radps: float = 0.01


@final
@dataclass(frozen=True, slots=True)
class HeldBicycle:
    """The bicycle whose steering angle and acceleration stay, but for W, as they were.

    along' = v cos(h) - b h' sin(h), across' = v sin(h) + b h' cos(h), h' = v tan(clip(steering))/L,
    steering' = w_u, raw speed q' = a + w_a, v = max(q, 0), a' = 0; in the frame of the window's
    first pose. wheelbase_m: L; ahead_m: b, of the reference point before the rear axle.
    lever_m: metres that a radian of heading costs.
    """

    wheelbase_m: float
    ahead_m: float
    lever_m: float

    @property
    def outputs(self) -> tuple[str, ...]:
        """Position and heading: what the car sweeps."""
        return ("along", "across", "heading")

    @property
    def weights(self) -> tuple[float, ...]:
        """Metres; a radian at the front bumper."""
        return (1.0, 1.0, self.lever_m)

    @property
    def fitted(self) -> tuple[str, ...]:
        """W and the wheelbase: without a controller nothing reads N."""
        return ("acceleration_mps2", "steering_rate_radps", "wheelbase_m")

    def ode(self, uncertainty: Uncertainty) -> Ode:
        """The equations above; a bound of 0 adds no signal."""
        names = ("along", "across", "steering", "speed", "heading", "acceleration")
        units = ("m", "m", "rad", "m/s", "rad", "m/s^2")
        x = [ca.SX.sym(name) for name in names]
        _, _, steering, speed, heading, acceleration = x
        wheelbase = ca.SX.sym("wheelbase")
        disturbances: list[tuple[Ranged, ca.SX]] = []

        def disturbance(name: str, unit: str, bound: float) -> ca.SX:
            if bound == 0.0:
                return ca.SX(0)
            symbol = ca.SX.sym(name)
            disturbances.append((Ranged(name, unit, 0.0, -bound, bound), symbol))
            return symbol

        moving = ca.fmax(speed, 0)
        limit = ca.SX(STEERING_LIMIT_RAD)
        turning = moving * ca.tan(clip(steering, -limit, limit)) / wheelbase
        rates = (
            moving * ca.cos(heading) - self.ahead_m * turning * ca.sin(heading),
            moving * ca.sin(heading) + self.ahead_m * turning * ca.cos(heading),
            disturbance("steering_rate_disturbance", "rad/s", uncertainty.steering_rate_radps),
            acceleration
            + disturbance("acceleration_disturbance", "m/s^2", uncertainty.acceleration_mps2),
            turning,
            ca.SX(0),
        )
        spread = uncertainty.wheelbase_m
        parameter = Ranged(
            "wheelbase", "m", self.wheelbase_m, self.wheelbase_m - spread, self.wheelbase_m + spread
        )
        symbols = [symbol for _, symbol in disturbances]
        return Ode(
            "bicycle holding steering and acceleration",
            tuple(Signal(n, u) for n, u in zip(names, units, strict=True)),
            (parameter,),
            tuple(ranged for ranged, _ in disturbances),
            ca.vertcat(*x),
            wheelbase,
            ca.vertcat(*symbols) if symbols else ca.SX(0, 1),
            ca.vertcat(*rates),
        )


@final
@dataclass(frozen=True, slots=True)
class DriveWindows:
    """How windows are cut from recordings: disjoint, v <= speed_max_mps throughout.

    holds_acceleration: whether the model goes on with the first sample's acceleration, else with 0.
    """

    times_s: Array
    speed_max_mps: float
    errors: DriveErrors
    holds_acceleration: bool

    def of(self, recordings: tuple[Recording, ...]) -> Measured:
        """All windows of these recordings."""
        windows = [window for each in recordings for window in self._windows(each)]
        return Measured(self.times_s, tuple(windows))

    def _windows(self, recording: Recording) -> Iterator[Window]:
        table = _table(recording)
        times, place, length = table[:, 0], 0, float(self.times_s[-1])
        while place < len(times):
            end = int(np.searchsorted(times, times[place] + length - 1e-9))
            if end >= len(times):
                return
            part = table[place : end + 1]
            whole = np.diff(part[:, 0]).max(initial=0.0) <= LONGEST_GAP_S
            if whole and part[:, 4].max() <= self.speed_max_mps:
                yield self._window(recording, part)
                place = end
            else:
                place += 1

    def _window(self, recording: Recording, part: Array) -> Window:
        start, first = part[0, 0], part[0]
        at = self.times_s + start
        x, y, heading = (np.interp(at, part[:, 0], part[:, k]) for k in (1, 2, 3))
        east, north, turn = x - first[1], y - first[2], first[3]
        measured = np.column_stack([
            math.cos(turn) * east + math.sin(turn) * north,
            -math.sin(turn) * east + math.cos(turn) * north,
            heading - turn,
        ])  # fmt: skip
        initial = self._initial(recording, first)
        held = dict(zip(initial.names, initial.center, strict=True))["acceleration"]
        gaps = _gaps(part, at, wheelbase_m=recording.shape.wheelbase_m, held_mps2=held)
        return Window(recording.name, float(start), initial, measured, gaps)

    def _initial(self, recording: Recording, first: Array) -> Box:
        wheelbase, speed = recording.shape.wheelbase_m, max(float(first[4]), _LEAST_SPEED_MPS)
        steering = math.atan(wheelbase * float(first[6]) / speed)
        error = math.atan(wheelbase * self.errors.yaw_rate_radps / speed)
        # A standing car that "goes on braking" would have no way of going off, to first order.
        standing = first[4] < _LEAST_SPEED_MPS
        centre = {
            "along": 0.0, "across": 0.0, "heading": 0.0, "speed": max(float(first[4]), _CREEP_MPS),
            "steering": 0.0 if standing else min(max(steering, -_MOST_RAD), _MOST_RAD),
            "acceleration": 0.0 if standing or not self.holds_acceleration else float(first[5]),
        }  # fmt: skip
        radius = {
            "along": self.errors.position_m, "across": self.errors.position_m,
            "heading": self.errors.heading_rad, "speed": self.errors.speed_mps,
            "steering": error, "acceleration": 0.0,
        }  # fmt: skip
        return Box.around(centre, radius=radius)


def _gaps(part: Array, at: Array, *, wheelbase_m: float, held_mps2: float) -> Array:
    """Acceleration less the held one, steering rate by differences; unknown while hardly moving."""
    speed, acceleration, yaw_rate = (np.interp(at, part[:, 0], part[:, k]) for k in (4, 5, 6))
    moving = speed > _STEERS_MPS
    steering = np.where(moving, np.arctan(wheelbase_m * yaw_rate / np.where(moving, speed, 1.0)),
                        np.nan)  # fmt: skip
    return np.column_stack([
        acceleration[1:] - held_mps2, np.diff(steering) / np.diff(at), np.full(len(at) - 1, np.nan)
    ])  # fmt: skip


def _table(recording: Recording) -> Array:
    """t, x, y, heading, v, a, yaw rate of each sample. Raises InputError without the last two."""
    rows = []
    for sample in recording.vehicle:
        further = (sample.acceleration_mps2, sample.yaw_rate_radps)
        if None in further:
            raise InputError(
                f"{recording.name}: expected the columns a and yaw_rate in the table of vehicles; "
                "without them nobody knows what the car was about to do"
            )
        rows.append((sample.t_s, sample.x_m, sample.y_m, sample.heading_rad, sample.speed_mps,
                     *further))  # fmt: skip
    return np.array(rows, dtype=np.float64)
