"""People from the past of their tracks: where they mean to go, and where they can be at all.

Intent: constant velocity with a growing radius, until intent is estimated. It is an assumption, not
a guarantee: a person who turns or starts to run leaves the disc. Guard: position and velocity in
discs, from which the limits of speed and acceleration give all that can be reached.
"""

from __future__ import annotations

import dataclasses
import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.estimation.people_guards import (
    ON_FOOT,
    LimitsGuard,
    LimitsGuards,
    Sample,
    assumed_guard,
    fitted_line,
    limits_discs,
)
from workbench.runtime import Disc, Guard, MotionLimits, ObservedPerson, Person
from workbench.simulation.recording import PersonSample, Track

# Of positions within 1e7 m and of their sums, generously.
_ROUNDING_M = 1e-3


@final
@dataclass(frozen=True, slots=True)
class PersonModel:
    """How far a person may be from the straight continuation of their track.

    body_radius_m: disc that contains the body; position_error_m: error of a sample, joint with the
    vehicle's; jitter_m: its part that changes from sample to sample; speed_error_mps: error of a
    velocity that remains with any amount of history; unseen_speed_mps: speed bound for someone seen
    once; acceleration_mps2: change of velocity later on; window_s: history that the velocity is
    fitted to; max_age_s: a person not seen for longer is only assumed to be there, gone_age_s: and
    for longer than this is taken to have left; provenance: where the figures come from. Raises
    ValueError for a negative or non-finite figure, an empty window, or gone_age_s < max_age_s.
    """

    body_radius_m: float
    position_error_m: float
    jitter_m: float
    speed_error_mps: float
    unseen_speed_mps: float
    acceleration_mps2: float
    window_s: float
    max_age_s: float
    gone_age_s: float
    provenance: str

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, float) and not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name}: expected a finite number >= 0, got {value!r}")
        if self.window_s == 0.0:
            raise ValueError("window_s: expected more than 0 s of history, got 0.0")
        if self.gone_age_s < self.max_age_s:
            raise ValueError(
                f"gone_age_s: expected at least max_age_s {self.max_age_s}, got {self.gone_age_s}"
            )

    @classmethod
    def pedestrian(cls) -> PersonModel:
        """Assumed figures for a person on foot who keeps on walking; not fitted to data."""
        return cls(0.3, 0.1, 0.02, 0.1, 2.5, 0.1, 0.5, 0.5, 1.0, "assumed")

    @classmethod
    def cyclist(cls) -> PersonModel:
        """Assumed figures for a person on wheels, a bicycle long and faster; not fitted to data."""
        return cls(0.9, 0.2, 0.03, 0.2, 7.0, 0.2, 0.5, 0.5, 1.0, "assumed")


@final
@dataclass(frozen=True, slots=True)
class PeopleModel:
    """The model for each kind: `on_foot` for ped and sitting, `on_wheels` for all others."""

    on_foot: PersonModel
    on_wheels: PersonModel

    @classmethod
    def assumed(cls) -> PeopleModel:
        """`PersonModel.pedestrian` and `PersonModel.cyclist`."""
        return cls(PersonModel.pedestrian(), PersonModel.cyclist())

    def of(self, kind: str) -> PersonModel:
        """The model for `kind`; an unknown kind gets the faster one."""
        return self.on_foot if kind in ON_FOOT else self.on_wheels

    def guards(self, limits: MotionLimits) -> LimitsGuards:
        """The guards under `limits`, of nobody below their kind's unseen_speed_mps."""

        def guard(model: PersonModel) -> LimitsGuard:
            fastest = max(limits.speed_mps, model.unseen_speed_mps)
            return LimitsGuard(
                MotionLimits(fastest, limits.acceleration_mps2), model.position_error_m,
                model.jitter_m, model.speed_error_mps, model.window_s,
            )  # fmt: skip

        return LimitsGuards(guard(self.on_foot), guard(self.on_wheels))


def extrapolate(track: Track, t_s: float, model: PersonModel) -> Person | None:
    """The person at `t_s` from samples at times <= t_s; None when none is younger than gone_age_s.

    Velocity: least squares over the samples of the last window_s before the newest one. With d_i
    their times relative to their mean, position jitter moves that slope by at most
    jitter sum|d_i| / sum d_i^2 and lags it by at most acceleration (t_newest - mean); both are
    added to the speed error. A single sample gives velocity 0 and growth unseen_speed_mps. Disc at
    tau after t_s: centre p + v tau, radius r + g tau + g2 tau^2 / 2. The time since the newest
    sample is spent by the same law.
    """
    history = _history(track, t_s, model)
    if not history:
        return None
    last = history[-1]
    age = t_s - last.t_s
    vx, vy, growth = _velocity(history, model)
    g2 = model.acceleration_mps2
    return Person(
        name=track.name,
        x_m=last.x_m + vx * age,
        y_m=last.y_m + vy * age,
        vx_mps=vx,
        vy_mps=vy,
        radius_m=model.body_radius_m + model.position_error_m + growth * age + g2 * age * age / 2,
        growth_mps=growth + g2 * age,
        growth_mps2=g2,
    )


def guard_at(track: Track, t_s: float, model: PersonModel, limits: MotionLimits) -> Guard | None:
    """The guard of a person at `t_s` from samples at times <= t_s; None as in `extrapolate`.

    Position, at the newest sample: the body's disc around it, widened by position_error_m.
    Velocity: `limits_discs` of the history that `extrapolate` fits. Both are then moved on to t_s
    by the acceleration bound, t later: p + w t within r + q t + A t^2 / 2, w within q + A t.
    The speed limit is not below unseen_speed_mps.
    """
    history = _history(track, t_s, model)
    if not history:
        return None
    fastest = MotionLimits(max(limits.speed_mps, model.unseen_speed_mps), limits.acceleration_mps2)
    place, velocity = limits_discs(
        _rows(history), fastest, jitter_m=model.jitter_m, speed_error_mps=model.speed_error_mps
    )
    position = Disc(place.x, place.y, model.body_radius_m + model.position_error_m)
    return _moved(Guard(0.0, position, velocity, fastest), t_s - history[-1].t_s)


def _moved(guard: Guard, t: float) -> Guard:
    """The guard t later, as one of that time; a millimetre more for rounding, unless t is 0."""
    p, w, limits = guard.position, guard.velocity, guard.limits
    if t == 0.0:
        return guard
    grown = p.radius + (w.radius + 0.5 * limits.acceleration_mps2 * t) * t + _ROUNDING_M
    position = Disc(p.x + w.x * t, p.y + w.y * t, grown)
    velocity = Disc(w.x, w.y, w.radius + limits.acceleration_mps2 * t + _ROUNDING_M)
    return dataclasses.replace(guard, position=position, velocity=velocity)


def seen_people(
    tracks: Sequence[Track], t_s: float, models: PeopleModel, limits: MotionLimits
) -> tuple[ObservedPerson, ...]:
    """Everyone whom `extrapolate` places at `t_s`, with one intent tube and the guard.

    Who has not been seen for max_age_s is handed on as assumed (`assumed_guard`): a track that ends
    says nothing of where its person is.
    """
    people = []
    for track in tracks:
        model = models.of(track.kind)
        person, guard = extrapolate(track, t_s, model), guard_at(track, t_s, model, limits)
        if person is not None and guard is not None:
            lost = t_s - _history(track, t_s, model)[-1].t_s > model.max_age_s
            guard = assumed_guard(guard) if lost else guard
            people.append(ObservedPerson(person.name, (person.intent,), guard, assumed=lost))
    return tuple(people)


def _history(track: Track, t_s: float, model: PersonModel) -> Sequence[PersonSample]:
    """The samples of the last window_s before the newest one; none if that one is too old."""
    newest = bisect_right(track.samples, t_s, key=lambda sample: sample.t_s)
    seen = track.samples[:newest]
    if not seen or t_s - seen[-1].t_s > model.gone_age_s:
        return ()
    return [s for s in seen if s.t_s >= seen[-1].t_s - model.window_s]


def _rows(history: Sequence[PersonSample]) -> list[Sample]:
    return [(sample.t_s, sample.x_m, sample.y_m) for sample in history]


def _velocity(history: Sequence[PersonSample], model: PersonModel) -> tuple[float, float, float]:
    if len(history) < 2:
        return 0.0, 0.0, model.unseen_speed_mps
    line = fitted_line(_rows(history))
    lag = model.acceleration_mps2 * (history[-1].t_s - line.mean_s)
    jitter = model.jitter_m * line.size / line.spread
    return line.vx_mps, line.vy_mps, model.speed_error_mps + jitter + lag


@final
@dataclass(frozen=True, slots=True)
class Body:
    """A car body at a pose: rear-axle point (m), heading (rad) and the rectangle around it (m)."""

    x_m: float
    y_m: float
    heading: float
    front_m: float
    rear_m: float
    half_width_m: float

    def distance(self, x_m: float, y_m: float) -> float:
        """Distance from the rectangle to a point, m; 0 inside."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        dx, dy = x_m - self.x_m, y_m - self.y_m
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        return math.hypot(
            max(along - self.front_m, -self.rear_m - along, 0.0),
            max(abs(across) - self.half_width_m, 0.0),
        )
