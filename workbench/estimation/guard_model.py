"""A person's guard as a function of their measured motion, its area, and the guards by kind."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.estimation.guard_motion import Floats, Motion, MotionRows, motion_at
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import Disc, Guard, MotionLimits

FAMILIES = (("ped", "sitting"), ("cyclist", "skater"))
"""Kinds that move alike."""


SLOW_MPS, NEW_S = 2.0, 1.0
"""Scales on which being slow and being new to the sensor fade."""


@final
@dataclass(frozen=True, slots=True)
class VelocityError:
    """How wrong a measured velocity can be soon, as a sum of what the past shows (`Motion`).

    q' = base + per_speed |w| + slow exp(-|w| / SLOW_MPS) + per_unsteady u + noise n
    + new exp(-seen / NEW_S) + per_missed m + per_missed_long M + per_scatter s + per_fastest f,
    with u, n, m, M, s, f the unsteady_mps, noise_gain, missed_mps, missed_long_mps, scatter_m and
    fastest_mps. `per_` are factors (per_scatter 1/s), noise_m is m, the rest m/s.
    Raises InputError for a number that is negative or not finite.
    """

    base_mps: float
    per_speed: float
    slow_mps: float
    per_unsteady: float
    noise_m: float
    new_mps: float
    per_missed: float
    per_missed_long: float
    per_scatter: float
    per_fastest: float

    def __post_init__(self) -> None:
        if not all(math.isfinite(number) and number >= 0.0 for number in self.numbers()):
            raise InputError(f"expected finite numbers >= 0, got {self}")

    def numbers(self) -> tuple[float, ...]:
        """The coefficients in the order of `terms`."""
        return tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    @staticmethod
    def terms(motion: Motion) -> Floats:
        """What each coefficient is multiplied by, (n, 10)."""
        return np.column_stack([
            np.ones(len(motion.speed_mps)),
            motion.speed_mps,
            np.exp(-motion.speed_mps / SLOW_MPS),
            motion.unsteady_mps,
            motion.noise_gain,
            np.exp(-motion.seen_s / NEW_S),
            motion.missed_mps,
            motion.missed_long_mps,
            motion.scatter_m,
            motion.fastest_mps,
        ])  # fmt: skip

    def of(self, motion: Motion) -> Floats:
        """q' for each row, (n,) m/s."""
        # Not a matrix product: its rounding depends on how many rows there are.
        return np.asarray((self.terms(motion) * np.array(self.numbers())).sum(axis=1))

    def scaled(self, factor: float) -> VelocityError:
        """All coefficients `factor` times as large."""
        return VelocityError(*(factor * number for number in self.numbers()))


@final
@dataclass(frozen=True, slots=True)
class GuardModel:
    """The guard of a person of one kind as a function of their measured motion.

    With w the velocity over the last LONG_S and l its lag (`Motion`): position in disc(newest
    measurement, r), velocity in disc(c w, q), q = max(q' + A l, (1 - c) |w|), the second so that w
    itself is inside; from there on |a| <= A and |v| <= V. No velocity known: disc(0, V).
    position_m r; error q' (`VelocityError`); kept c: people stop more than they double their
    speed; limits: V, A; provenance: what it was fitted to.
    Raises InputError for a number that is negative or not finite, and for kept > 1.
    """

    position_m: float
    error: VelocityError
    kept: float
    limits: MotionLimits
    provenance: str

    def __post_init__(self) -> None:
        limits = self.limits
        numbers = (self.position_m, self.kept, limits.speed_mps, limits.acceleration_mps2)
        if not all(math.isfinite(n) and n >= 0.0 for n in numbers) or self.kept > 1.0:
            raise InputError(f"expected finite numbers >= 0 and kept <= 1, got {self}")

    def velocity_error(self, motion: Motion) -> Floats:
        """q for each row, (n,) m/s."""
        q = np.maximum(self.fitted_error(motion), (1.0 - self.kept) * motion.speed_mps)
        return np.asarray(np.where(motion.known, q, self.limits.speed_mps))

    def fitted_error(self, motion: Motion) -> Floats:
        """The first of the two terms of q, (n,) m/s."""
        return np.asarray(self.error.of(motion) + self.limits.acceleration_mps2 * motion.lag_s)

    def radii(self, motion: Motion, reach_s: Floats) -> tuple[Floats, Floats]:
        """Radius of the acceleration and of the speed disc, (n,) m, reach_s (n,) after the newest
        measurement: r + q t + A t^2 / 2 and r + V t."""
        grown = self.velocity_error(motion) + 0.5 * self.limits.acceleration_mps2 * reach_s
        return self.position_m + grown * reach_s, self.position_m + self.limits.speed_mps * reach_s

    def scaled(self, factor: float) -> GuardModel:
        """The model with all that the acceleration disc grows from `factor` times as large."""
        return dataclasses.replace(
            self,
            position_m=self.position_m * factor,
            error=self.error.scaled(factor),
            limits=dataclasses.replace(
                self.limits, acceleration_mps2=self.limits.acceleration_mps2 * factor
            ),
        )

    def guard(self, history: PersonTrack, t_s: float, *, body_radius_m: float) -> Guard | None:
        """The guard of a person at t_s from the measurements at or before it; None without any.

        `at_s` is the newest measurement's time relative to t_s, thus <= 0: `guard_disc` from 0 on
        is where the body is from t_s on.
        """
        history = history.until(t_s)
        if not len(history.t_s):
            return None
        return self.guards(history, np.array([t_s]), body_radius_m=body_radius_m)[0]

    def guards(
        self, history: PersonTrack, times_s: Floats, *, body_radius_m: float
    ) -> tuple[Guard, ...]:
        """`guard` at each of times_s, (n,), none before the first measurement."""
        motion = motion_at(history, times_s)
        centres, errors = self.kept * motion.velocity_mps, self.velocity_error(motion)
        return tuple(
            Guard(
                -float(age),
                Disc(float(x), float(y), self.position_m + body_radius_m),
                Disc(float(vx), float(vy), float(q)),
                self.limits,
            )
            for age, (x, y), (vx, vy), q in zip(
                motion.age_s, motion.place_m, centres, errors, strict=True
            )
        )


def guard_areas(model: GuardModel, rows: MotionRows) -> Floats:
    """Area of where each row's person can be at its horizon, (n,) m^2, without the body."""
    motion, reach = rows.motion, rows.reach_s
    grown, fast = model.radii(motion, reach)
    return common_area(model.kept * motion.speed_mps * reach, grown, fast)


def is_inside(model: GuardModel, rows: MotionRows) -> Floats:
    """Whether each row's later position is in both discs, (n,) of 1.0 and 0.0."""
    grown, fast = model.radii(rows.motion, rows.reach_s)
    accelerated, moved = distances(model.kept, rows)
    return np.asarray((accelerated <= grown) & (moved <= fast), np.float64)


def distances(kept: float, rows: MotionRows) -> tuple[Floats, Floats]:
    """Of the later position to the centres of both discs, (n,) m each."""
    ahead = kept * rows.motion.velocity_mps * rows.reach_s[:, None]
    return np.hypot(*(rows.moved_m - ahead).T), np.hypot(*rows.moved_m.T)


def common_area(apart: Floats, first: Floats, second: Floats) -> Floats:
    """Area of the intersection of two discs, (n,): centres `apart`, radii `first` and `second`.

    The smaller disc where one holds the other, 0 where they are disjoint, else the two sectors
    less the kite: a^2 acos(x / a) + b^2 acos((d - x) / b) - d y with x = (d^2 + a^2 - b^2) / (2 d)
    and y = sqrt(a^2 - x^2).
    """
    # Discs whose edges nearly touch from within count as held: exact to 1e-12 of their sizes.
    held = apart <= np.abs(first - second) + 1e-12 * (first + second)
    met = ~held & (apart < first + second)
    d, a, b = (np.where(met, values, 1.0) for values in (apart, first, second))
    x = np.clip((d * d + a * a - b * b) / (2.0 * d), -a, a)
    y = np.sqrt(a * a - x * x)
    sectors = a * a * np.arccos(x / a) + b * b * np.arccos(np.clip((d - x) / b, -1.0, 1.0))
    small = np.minimum(first, second)
    return np.asarray(np.where(held, np.pi * small * small, np.where(met, sectors - d * y, 0.0)))


@final
@dataclass(frozen=True, slots=True)
class GuardFit:
    """A model for each kind; a kind that has none gets its family's, or else the widest one."""

    models: Mapping[str, GuardModel]

    def of(self, kind: str) -> GuardModel:
        """The model of `kind`, of its family, or the one that reaches farthest (2 s, 1.5 m/s)."""
        near = [self.models[k] for k in (kind, *family(kind)) if k in self.models]
        return near[0] if near else max(self.models.values(), key=_reach)


def family(kind: str) -> tuple[str, ...]:
    """The kinds that move alike, `kind` among them."""
    return next((kinds for kinds in FAMILIES if kind in kinds), (kind,))


def _reach(model: GuardModel) -> float:
    row = np.ones(1)
    motion = Motion(
        0.0 * row, np.zeros((1, 2)), np.array([[1.5, 0.0]]), 1.5 * row, 0.0 * row, row, row,
        np.ones(1, np.bool_), row, 0.0 * row, 0.0 * row, 0.0 * row, 1.5 * row,
    )  # fmt: skip
    grown, fast = model.radii(motion, 2.0 * row)
    return min(float(grown[0]), float(fast[0]))
