"""How people move when nobody knows their goal: position, preferred velocity, and wavering.

The velocity is w + d: a preferred velocity w that a person keeps for long, and a deviation d that
dies out soon. Both are Ornstein-Uhlenbeck processes, each axis alone, dw = -w dt / preferred_s +
noise and likewise d with wavering_s, with standard deviations preferred_mps and wavering_mps; what
is measured is the position, with the deviation measurement_m. The Kalman filter of that model is
exact for any spacing of measurements.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack

Values = NDArray[np.float64]
STATES = 3
"""Position, preferred velocity, deviation from it; per axis, all axes with one covariance."""


@final
@dataclass(frozen=True, slots=True)
class MotionNumbers:
    """Numbers of the motion model.

    measurement_m, preferred_mps, preferred_s, wavering_mps, wavering_s: see the module;
    standing_mps: of a person who seems to move this fast, half is believed; trusted_s: a velocity
    this long after the last measurement is believed by half. Raises InputError unless all are
    above 0.
    """

    measurement_m: float
    preferred_mps: float
    preferred_s: float
    wavering_mps: float
    wavering_s: float
    standing_mps: float
    trusted_s: float

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not 0.0 < value < math.inf:
                raise InputError(f"{each.name}: expected a number above 0, got {value}")

    @property
    def row(self) -> tuple[float, ...]:
        """The seven numbers, in the order of the fields."""
        return tuple(getattr(self, each.name) for each in fields(self))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What the filter knows at t_s, the last measurement.

    mean: (3, 2), position (m), preferred velocity and deviation (m/s); covariance: (3, 3), the same
    for both axes.
    """

    t_s: float
    mean: Values
    covariance: Values

    @property
    def velocity_mps(self) -> Values:
        """(2,), preferred velocity and deviation together."""
        velocity: Values = self.mean[1] + self.mean[2]
        return velocity


@functools.cache
def filter_step() -> ca.Function:
    """CasADi function of one prediction over a time and one measurement at its end.

    Inputs: mean (3, 2), covariance (3, 3), elapsed (s), place (1, 2) in m, numbers (7,); outputs:
    mean, covariance. The transition is exact: over dt a process with time constant T keeps
    e = exp(-dt/T) of its velocity and moves by T (1 - e) of it; its noise has the variances
    s^2 (1 - e^2) of the velocity, s^2 T^2 (2 dt/T - 3 + 4 e - e^2) of the position and s^2 T
    (1 - e)^2 between them. The update is Joseph's form, symmetric and positive by construction.
    """
    mean, covariance = ca.SX.sym("mean", 3, 2), ca.SX.sym("covariance", 3, 3)
    elapsed, place = ca.SX.sym("elapsed"), ca.SX.sym("place", 1, 2)
    numbers = ca.SX.sym("numbers", len(fields(MotionNumbers)))
    noise = numbers[0] ** 2
    preferred = _wander(elapsed, numbers[1], numbers[2])
    wavering = _wander(elapsed, numbers[3], numbers[4])
    F = ca.vertcat(
        ca.horzcat(1.0, preferred[0], wavering[0]),
        ca.horzcat(0.0, preferred[1], 0.0),
        ca.horzcat(0.0, 0.0, wavering[1]),
    )
    Q = ca.vertcat(
        ca.horzcat(preferred[2] + wavering[2], preferred[3], wavering[3]),
        ca.horzcat(preferred[3], preferred[4], 0.0),
        ca.horzcat(wavering[3], 0.0, wavering[4]),
    )
    ahead = ca.mtimes(F, mean)
    spread = ca.mtimes([F, covariance, F.T]) + Q
    gain = spread[:, 0] / (spread[0, 0] + noise)
    keep = ca.SX.eye(3)
    keep[:, 0] -= gain
    after = ahead + ca.mtimes(gain, place - ahead[0, :])
    left = ca.mtimes([keep, spread, keep.T]) + noise * ca.mtimes(gain, gain.T)
    return ca.Function(
        "motion_filter", [mean, covariance, elapsed, place, numbers],
        [ca.densify(after), ca.densify(left)],
        ["mean", "covariance", "elapsed", "place", "numbers"], ["after", "left"],
    )  # fmt: skip


def _wander(elapsed: Any, deviation: Any, constant: Any) -> tuple[Any, ...]:
    """Way per velocity, what is kept, and the variances of way, both and velocity.

    Written in 1 - e = -expm1(-dt/T): the variance of the way, of third order in dt/T, stays right
    for short times.
    """
    ratio = elapsed / constant
    lost = -ca.expm1(-ratio)
    variance = deviation**2
    way = constant * lost
    place = (constant * deviation) ** 2 * (2.0 * (ratio - lost) - lost**2)
    return way, 1.0 - lost, place, variance * way * lost, variance * lost * (2.0 - lost)


@functools.cache
def forecast_step() -> ca.Function:
    """CasADi function of where a person will be, the goal not known.

    Inputs: mean (3, 2) at the last measurement, age (s) of it, ahead (s), numbers (7,); outputs:
    place (1, 2) in m, velocity (1, 2) in m/s that is believed now. With L = age + ahead, v the
    estimated velocity, T = preferred_s and tau = wavering_s:
    place = p + g (T (1 - exp(-L/T)) w + tau (1 - exp(-L/tau)) d),
    g = |v|^2 / (|v|^2 + standing^2) / (1 + (age / trusted)^4). Most of those who hardly move stand,
    and who was measured long ago may have turned or stopped.
    """
    mean, numbers = ca.SX.sym("mean", 3, 2), ca.SX.sym("numbers", len(fields(MotionNumbers)))
    age, ahead = ca.SX.sym("age"), ca.SX.sym("ahead")
    square = ca.sumsqr(mean[1, :] + mean[2, :])
    believed = square / (square + numbers[5] ** 2) / (1.0 + (age / numbers[6]) ** 4)

    def way(lead: Any, row: int, constant: Any) -> Any:
        return -constant * ca.expm1(-lead / constant) * mean[row, :]

    lead = age + ahead
    moved = way(lead, 1, numbers[2]) + way(lead, 2, numbers[4])
    velocity = mean[1, :] + mean[2, :] * ca.exp(-age / numbers[4])
    return ca.Function(
        "motion_forecast", [mean, age, ahead, numbers],
        [mean[0, :] + believed * moved, believed * velocity],
        ["mean", "age", "ahead", "numbers"], ["place", "velocity"],
    )  # fmt: skip


def begin(place_m: Sequence[float] | Values, numbers: MotionNumbers) -> tuple[Values, Values]:
    """Mean (3, 2) and covariance (3, 3) after the first measurement: at the place, velocity 0."""
    mean = np.zeros((STATES, 2))
    mean[0] = place_m
    deviations = (numbers.measurement_m, numbers.preferred_mps, numbers.wavering_mps)
    return mean, np.diag(np.square(deviations))


def estimate(history: PersonTrack, numbers: MotionNumbers) -> Estimate:
    """The estimate after the last measurement of a history; InputError if it has none."""
    if not len(history.t_s):
        raise InputError(
            f"{history.agent!r} in {history.recording!r}: expected at least one measurement; "
            "ask about people once they have been seen"
        )
    mean, covariance = begin(history.xy_m[0], numbers)
    step, row = filter_step(), numbers.row
    for elapsed, place in zip(np.diff(history.t_s), history.xy_m[1:], strict=True):
        after, left = step(mean, covariance, elapsed, place[None, :], row)
        mean, covariance = after.full(), left.full()
    return Estimate(float(history.t_s[-1]), mean, covariance)


def estimates(tracks: Sequence[PersonTrack], numbers: MotionNumbers) -> list[list[Estimate]]:
    """`estimate` after every measurement of every track, all tracks side by side; tracks may not
    be empty."""
    count = len(tracks)
    step = filter_step().map(count)
    first = [begin(track.xy_m[0], numbers) for track in tracks]
    mean, covariance = (np.hstack([each[k] for each in first]) for k in (0, 1))
    row = np.repeat(np.array(numbers.row)[:, None], count, axis=1)
    found = [[Estimate(float(t.t_s[0]), *begin(t.xy_m[0], numbers))] for t in tracks]
    for k in range(1, max(len(track.t_s) for track in tracks)):
        going = [index for index, track in enumerate(tracks) if len(track.t_s) > k]
        elapsed, place = np.ones((1, count)), np.zeros((1, 2 * count))
        for index in going:
            track = tracks[index]
            elapsed[0, index] = track.t_s[k] - track.t_s[k - 1]
            place[0, 2 * index : 2 * index + 2] = track.xy_m[k]
        after, left = step(mean, covariance, elapsed, place, row)
        mean, covariance = after.full(), left.full()
        for index in going:
            here = mean[:, 2 * index : 2 * index + 2].copy()
            spread = covariance[:, 3 * index : 3 * index + 3].copy()
            found[index].append(Estimate(float(tracks[index].t_s[k]), here, spread))
    return found
