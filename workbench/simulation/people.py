"""People extrapolated at constant velocity with a growing radius, from the past only.

Stands in until intent is estimated. The prediction is an assumption, not a guarantee: a person who
turns or starts to run leaves the disc.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.runtime import Person
from workbench.simulation.frames import Disc, PersonFrame
from workbench.simulation.recording import PersonSample, Track


@final
@dataclass(frozen=True, slots=True)
class PersonModel:
    """How far a person may be from the straight continuation of their track.

    body_radius_m: disc that contains the body; position_error_m: error of a sample, joint with the
    vehicle's; jitter_m: its part that changes from sample to sample; speed_error_mps: error of a
    velocity that remains with any amount of history; unseen_speed_mps: speed bound for someone seen
    once; acceleration_mps2: change of velocity later on; window_s: history that the velocity is
    fitted to; max_age_s: a person not seen for longer is dropped; provenance: where the figures
    come from. Raises ValueError for a negative or non-finite figure, or an empty window.
    """

    body_radius_m: float
    position_error_m: float
    jitter_m: float
    speed_error_mps: float
    unseen_speed_mps: float
    acceleration_mps2: float
    window_s: float
    max_age_s: float
    provenance: str

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, float) and not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name}: expected a finite number >= 0, got {value!r}")
        if self.window_s == 0.0:
            raise ValueError("window_s: expected more than 0 s of history, got 0.0")

    @classmethod
    def pedestrian(cls) -> PersonModel:
        """Assumed figures for a person on foot who keeps on walking; not fitted to data."""
        return cls(0.3, 0.1, 0.02, 0.1, 2.5, 0.1, 0.5, 0.5, "assumed")

    @classmethod
    def cyclist(cls) -> PersonModel:
        """Assumed figures for a person on wheels, a bicycle long and faster; not fitted to data."""
        return cls(0.9, 0.2, 0.03, 0.2, 7.0, 0.2, 0.5, 0.5, "assumed")


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
        return self.on_foot if kind in ("ped", "sitting") else self.on_wheels


def extrapolate(track: Track, t_s: float, model: PersonModel) -> Person | None:
    """The person at `t_s` from samples at times <= t_s; None when none is younger than max_age_s.

    Velocity: least squares over the samples of the last window_s before the newest one. With d_i
    their times relative to their mean, position jitter moves that slope by at most
    jitter sum|d_i| / sum d_i^2 and lags it by at most acceleration (t_newest - mean); both are
    added to the speed error. A single sample gives velocity 0 and growth unseen_speed_mps. Disc at
    tau after t_s: centre p + v tau, radius r + g tau + g2 tau^2 / 2. The time since the newest
    sample is spent by the same law.
    """
    newest = bisect_right(track.samples, t_s, key=lambda sample: sample.t_s) - 1
    if newest < 0:
        return None
    last = track.samples[newest]
    age = t_s - last.t_s
    if age > model.max_age_s:
        return None
    history = [s for s in track.samples[: newest + 1] if s.t_s >= last.t_s - model.window_s]
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


def seen_people(tracks: Sequence[Track], t_s: float, models: PeopleModel) -> tuple[Person, ...]:
    """Everyone whom `extrapolate` places at `t_s`."""
    people = (extrapolate(track, t_s, models.of(track.kind)) for track in tracks)
    return tuple(person for person in people if person is not None)


def _velocity(history: Sequence[PersonSample], model: PersonModel) -> tuple[float, float, float]:
    if len(history) < 2:
        return 0.0, 0.0, model.unseen_speed_mps
    mean = sum(s.t_s for s in history) / len(history)
    spread = sum((s.t_s - mean) ** 2 for s in history)
    vx = sum((s.t_s - mean) * s.x_m for s in history) / spread
    vy = sum((s.t_s - mean) * s.y_m for s in history) / spread
    jitter = model.jitter_m * sum(abs(s.t_s - mean) for s in history) / spread
    lag = model.acceleration_mps2 * (history[-1].t_s - mean)
    return vx, vy, model.speed_error_mps + jitter + lag


def discs(person: Person, *, horizon_s: float, step_s: float) -> tuple[Disc, ...]:
    """The person's predicted discs (x, y, radius) at 0, step_s, ... up to horizon_s."""
    return tuple(
        (
            person.x_m + person.vx_mps * tau,
            person.y_m + person.vy_mps * tau,
            person.radius_m + person.growth_mps * tau + person.growth_mps2 * tau * tau / 2,
        )
        for tau in (k * step_s for k in range(round(horizon_s / step_s) + 1))
    )


def as_frame(person: Person, *, horizon_s: float, step_s: float) -> PersonFrame:
    """The person as drawn in a report."""
    return PersonFrame(
        person.name,
        person.x_m,
        person.y_m,
        person.radius_m,
        discs(person, horizon_s=horizon_s, step_s=step_s),
    )


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
