"""Two ways to say where a person can be at all, from what was measured: under limits that nobody
exceeds, or as recorded people moved."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

from workbench.errors import InputError
from workbench.estimation.guard_model import GuardFit, GuardModel
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import Disc, Guard, MotionLimits

ON_FOOT = ("ped", "sitting")
"""Kinds of people who walk; all others count as on wheels."""
# Of positions within 1e7 m and of their sums, generously.
_ROUNDING_M = 1e-3
_SAME_TIME_S = 1e-9

Sample = tuple[float, float, float]
"""Time (s) and place (m) of one measurement."""


class PersonGuard(Protocol):
    """The guard of one person as a function of what was measured of them."""

    @property
    def limits(self) -> MotionLimits:
        """What a person is held to until they are seen to do more."""

    def guard(self, history: PersonTrack, limits: MotionLimits) -> Guard:
        """The person under `limits` at the newest measurement of a history that has one.

        at_s is that measurement's own time; the discs are of the position, the body not included.
        """
        ...


class Guards(Protocol):
    """The guard of each kind of person."""

    def of(self, kind: str) -> PersonGuard:
        """For `kind`; an unknown kind gets the widest."""
        ...


@final
@dataclass(frozen=True, slots=True)
class LimitsGuard:
    """Everywhere that limits of speed and acceleration allow, whoever the person is.

    limits: V, A; position_error_m: of a measurement; jitter_m: its part that changes from one to
    the next; speed_error_mps: error of a velocity that remains with any amount of history;
    window_s: history that the velocity is fitted to. All are bounds: if they hold and the person
    keeps to the limits, position and velocity are in the discs (ENCLOSED up to rounding, see
    `limits_discs`), and by `guard_disc` so is every later position. Raises InputError for a number
    that is negative or not finite, and for an empty window.
    """

    limits: MotionLimits
    position_error_m: float
    jitter_m: float
    speed_error_mps: float
    window_s: float

    def __post_init__(self) -> None:
        numbers = (
            self.position_error_m, self.jitter_m, self.speed_error_mps, self.window_s,
            self.limits.speed_mps, self.limits.acceleration_mps2,
        )  # fmt: skip
        if not all(math.isfinite(n) and n >= 0.0 for n in numbers) or self.window_s == 0.0:
            raise InputError(f"expected finite numbers >= 0 and a window above 0 s, got {self}")

    def guard(self, history: PersonTrack, limits: MotionLimits) -> Guard:
        """As `PersonGuard` says."""
        newest = float(history.t_s[-1])
        first = int((history.t_s < newest - self.window_s - _SAME_TIME_S).sum())
        rows = zip(history.t_s[first:], history.xy_m[first:], strict=True)
        samples = [(float(t), float(x), float(y)) for t, (x, y) in rows]
        position, velocity = limits_discs(
            samples, limits, jitter_m=self.jitter_m, speed_error_mps=self.speed_error_mps
        )
        place = dataclasses.replace(position, radius=self.position_error_m)
        return Guard(newest, place, velocity, limits)


def limits_discs(
    samples: Sequence[Sample], limits: MotionLimits, *, jitter_m: float, speed_error_mps: float
) -> tuple[Disc, Disc]:
    """Newest place (radius 0) and the disc of the velocity then, under `limits`.

    Velocity: the slope w of least squares is the mean of the true velocity over the samples with
    weights >= 0 (for x' = v the slope is sum d_i x_i / sum d_i^2 = integral of g v, g >= 0 of
    integral 1, d_i the times relative to their mean). The centroid of g is mean + sum d_i^3 /
    (2 sum d_i^2), so that a person within the acceleration limit A has changed velocity since by
    at most A (t_newest - centroid). Jitter moves the slope by at most jitter sum|d_i| / sum d_i^2;
    both and speed_error_mps are added. A single sample gives the disc of all speeds.
    """
    last_s, x, y = samples[-1]
    place = Disc(x, y, 0.0)
    if len(samples) < 2:
        return place, Disc(0.0, 0.0, limits.speed_mps)
    line = fitted_line(samples)
    lag_s = last_s - line.mean_s - line.third / (2.0 * line.spread)
    jitter = jitter_m * line.size / line.spread
    radius = speed_error_mps + jitter + limits.acceleration_mps2 * lag_s
    return place, Disc(line.vx_mps, line.vy_mps, radius)


@final
@dataclass(frozen=True, slots=True)
class Line:
    """Least squares through samples: velocity (m/s), mean_s of the times, and sums over their
    distances d to it: spread of d^2, size of |d|, third of d^3."""

    vx_mps: float
    vy_mps: float
    mean_s: float
    spread: float
    size: float
    third: float


def fitted_line(samples: Sequence[Sample]) -> Line:
    """The line through at least two samples of different times."""
    mean = sum(t for t, _, _ in samples) / len(samples)
    spread = sum((t - mean) ** 2 for t, _, _ in samples)
    vx = sum((t - mean) * x for t, x, _ in samples) / spread
    vy = sum((t - mean) * y for t, _, y in samples) / spread
    size = sum(abs(t - mean) for t, _, _ in samples)
    third = sum((t - mean) ** 3 for t, _, _ in samples)
    return Line(vx, vy, mean, spread, size, third)


@final
@dataclass(frozen=True, slots=True)
class FittedGuard:
    """As far as recorded people got: a share of them was inside, which bounds nobody (SAMPLED).

    The monitor holds limits below those of its bundle to be those of the bundle, which makes it
    larger and never smaller.
    """

    model: GuardModel

    @property
    def limits(self) -> MotionLimits:
        """Those of the fit."""
        return self.model.limits

    def guard(self, history: PersonTrack, limits: MotionLimits) -> Guard:
        """As `PersonGuard` says: `GuardModel.guard` with the limits exchanged."""
        newest = float(history.t_s[-1])
        model = dataclasses.replace(self.model, limits=limits)
        found = model.guard(history, newest, body_radius_m=0.0)
        if found is None:
            raise InputError(f"{history.agent!r}: expected a measurement, got none")
        return dataclasses.replace(found, at_s=newest)


@final
@dataclass(frozen=True, slots=True)
class LimitsGuards:
    """Limits of people on foot and of all others."""

    on_foot: LimitsGuard
    on_wheels: LimitsGuard

    def of(self, kind: str) -> PersonGuard:
        """As `Guards` says; on_wheels is taken to be the wider one."""
        return self.on_foot if kind in ON_FOOT else self.on_wheels


@final
@dataclass(frozen=True, slots=True)
class FittedGuards:
    """Guards of each kind as they were fitted."""

    fit: GuardFit

    def of(self, kind: str) -> PersonGuard:
        """As `Guards` says."""
        return FittedGuard(self.fit.of(kind))


def with_body(guard: Guard, body_radius_m: float) -> Guard:
    """The guard of the whole body, a disc about the position."""
    place = guard.position
    wide = dataclasses.replace(place, radius=place.radius + body_radius_m)
    return dataclasses.replace(guard, position=wide)


def assumed_guard(guard: Guard) -> Guard:
    """Somebody who can do all that a person in `guard` can: with every velocity within the limit,
    and a millimetre more of position, for rounding."""
    p, w = guard.position, guard.velocity
    fastest = math.hypot(w.x, w.y) + guard.limits.speed_mps + _ROUNDING_M
    return dataclasses.replace(
        guard,
        position=dataclasses.replace(p, radius=p.radius + _ROUNDING_M),
        velocity=dataclasses.replace(w, radius=fastest),
    )
