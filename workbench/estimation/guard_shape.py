"""The shape of a guard: of all sums of what the past shows, the one of least area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from workbench.estimation.guard_model import GuardModel, VelocityError
from workbench.estimation.guard_motion import Floats, MotionRows
from workbench.runtime import MotionLimits

TAIL_ROWS = 20
"""The shape is fitted to the hardest rows at each horizon, to this many at least."""

_AREA_ROWS = 1500
_HARD_SHARE, _HARD_ROWS = 0.08, 500
_SOFT = 0.05
_RIDGE = 2e-3
# Where the search starts and looks: logarithms of the ten of `VelocityError`, of r and of A, and
# the logit of c. More than 0.6 m of position error would make the guard useless at short times;
# with next to none, or next to no acceleration, noise would contradict it (`relation_to`).
_ERRORS = 10
_START = np.array([-2.0] * _ERRORS + [-1.5, -2.0, 1.5])
_BOUNDS = [(-7.0, 3.0)] * _ERRORS + [
    (float(np.log(0.05)), float(np.log(0.6))),
    (float(np.log(0.05)), 1.5),
    (-0.5, 6.0),
]


def least_shape(rows: Sequence[MotionRows], *, outside: float) -> GuardModel:
    """The shape (its size is free, its speed limit 0) of least area at its own best size.

    With R the radius of the acceleration disc, e the distance of the later position to its centre
    and h the horizons, it is least in

        sum over h >= 1 s of log mean R^2 + 2 / a sum over h of weight mean max(0, log(e / R)),

    a = `outside`, or more where that is less than TAIL_ROWS. The second term is the mean excess
    beyond the (1 - a) quantile of log(e / R) (Rockafellar and Uryasev, Optimization of conditional
    value-at-risk, Journal of Risk 2(3), 2000): at the minimum over the size alone a share a of the
    rows is outside, and what counts is by how much, on average, so that no single row decides.
    max is softened by 0.05; a small ridge keeps what the rows do not tell near exp(-2).
    rows: one for each horizon, every row of known velocity. Deterministic: L-BFGS from one start.
    """
    parts = [_Part.of(part, outside) for part in rows]
    found = minimize(
        _cost, _START, args=(parts,), jac=True, method="L-BFGS-B", bounds=_BOUNDS,
        options={"maxiter": 200},
    )  # fmt: skip
    numbers = np.exp(found.x)
    error = VelocityError(*(float(number) for number in numbers[:_ERRORS]))
    r, most = float(numbers[_ERRORS]), float(numbers[_ERRORS + 1])
    return GuardModel(r, error, _kept(found.x), MotionLimits(0.0, most), "shape")


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """terms (n, 10), speed (n,), lag (n,), reach (n,), moved and velocity (n, 2)."""

    terms: Floats
    speed: Floats
    lag: Floats
    reach: Floats
    moved: Floats
    velocity: Floats

    @classmethod
    def of(cls, rows: MotionRows) -> _Rows:
        motion = rows.motion
        return cls(
            VelocityError.terms(motion), motion.speed_mps, motion.lag_s, rows.reach_s,
            rows.moved_m, motion.velocity_mps,
        )  # fmt: skip

    def radius(self, logs: Floats) -> tuple[Floats, Floats]:
        """R, (n,), and its derivative by each of the logs, (n, 13)."""
        numbers, kept, t = np.exp(logs), _kept(logs), self.reach
        q = self.terms @ numbers[:_ERRORS] + numbers[-2] * self.lag
        least = (1.0 - kept) * self.speed
        free = q >= least
        slope = np.empty((len(t), len(logs)))
        slope[:, :_ERRORS] = self.terms * numbers[:_ERRORS] * (free * t)[:, None]
        slope[:, -3] = numbers[-3]
        slope[:, -2] = numbers[-2] * (free * self.lag * t + 0.5 * t * t)
        slope[:, -1] = np.where(free, 0.0, -self.speed * t) * kept * (1.0 - kept)
        radius = numbers[-3] + np.maximum(q, least) * t + 0.5 * numbers[-2] * t * t
        return radius, slope

    def error(self, kept: float) -> tuple[Floats, Floats]:
        """e, (n,) (1e-6 m at least), and its derivative by c, (n,)."""
        ahead = self.velocity * self.reach[:, None]
        missed = self.moved - kept * ahead
        error = np.maximum(np.hypot(*missed.T), 1e-6)
        return error, -(missed * ahead).sum(axis=1) / error


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Rows of one horizon: the hardest, out of how many, some for the area, weight over a."""

    hard: _Rows
    count: int
    some: _Rows | None
    weight: float

    @classmethod
    def of(cls, rows: MotionRows, outside: float) -> _Part:
        n, long = len(rows.person), rows.horizon_s >= 1.0
        some = _Rows.of(rows.take(np.arange(0, n, n // _AREA_ROWS + 1))) if long else None
        share = max(outside, min(TAIL_ROWS / n, 0.5))
        # Horizons of 1 s and more have an area, and more say in where the tail lies.
        return cls(_Rows.of(_hard(rows)), n, some, (1.8 if long else 0.4) / share)


def _cost(logs: Floats, parts: Sequence[_Part]) -> tuple[float, Floats]:
    kept = _kept(logs)
    cost, slope = 0.0, np.zeros(len(logs))
    for part in parts:
        radius, by = part.hard.radius(logs)
        error, by_kept = part.hard.error(kept)
        excess = np.log(error / radius) / _SOFT
        cost += part.weight * _SOFT * float(np.logaddexp(0.0, excess).sum()) / part.count
        out = 1.0 / (1.0 + np.exp(-np.clip(excess, -40.0, 40.0)))
        gain = -(out / radius) @ by
        gain[-1] += float((out * by_kept / error).sum()) * kept * (1.0 - kept)
        slope += part.weight / part.count * gain
        if part.some is not None:
            radius, by = part.some.radius(logs)
            mean = float((radius * radius).mean())
            cost += float(np.log(mean))
            slope += 2.0 * (radius @ by) / len(radius) / mean
    away = np.append(logs[:_ERRORS] - _START[:_ERRORS], np.zeros(3))
    return cost + _RIDGE * float(away @ away), slope + 2.0 * _RIDGE * away


def _kept(logs: Floats) -> float:
    return float(1.0 / (1.0 + np.exp(-logs[-1])))


def _hard(rows: MotionRows) -> MotionRows:
    """The rows hardest to keep inside, by the error of the continued velocity, kept in part or in
    full, as it is, per speed, per unsteadiness and per both with the scatter."""
    n, motion = len(rows.person), rows.motion
    many = max(int(_HARD_SHARE * n), _HARD_ROWS)
    if n <= 3 * many:
        return rows
    both = 0.1 + 0.3 * motion.speed_mps + motion.unsteady_mps + motion.scatter_m
    hard: set[int] = set()
    for kept in (0.6, 0.8, 1.0):
        error, _ = _Rows.of(rows).error(kept)
        for scale in (1.0, 0.3 + 0.3 * motion.speed_mps, 0.2 + motion.unsteady_mps, both):
            hard.update(np.argpartition(error / scale, n - many)[n - many :].tolist())
    chosen: NDArray[np.intp] = np.array(sorted(hard), np.intp)
    return rows.take(chosen)
