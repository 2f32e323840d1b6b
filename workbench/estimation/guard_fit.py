"""How far people can get, fitted to recordings: the guard of least area holding a share of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution, minimize

from workbench.errors import InputError
from workbench.estimation.guard_model import (
    GuardFit,
    GuardModel,
    distances,
    family,
    guard_areas,
)
from workbench.estimation.guard_motion import Floats, MotionRows, motion_rows
from workbench.estimation.guard_shipped import shipped_guards
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import MotionLimits

HORIZONS_S = (0.5, 1.0, 2.0)
"""Times ahead at which the fit wants the recorded positions inside."""
FRESH_S = 1.8
"""The fit looks at people measured no longer ago than this."""
ENOUGH_PEOPLE = 100
"""A kind with fewer recorded people is fitted together with its family."""
SHAPE_PEOPLE = 200
"""With fewer people than this only the size and the speed limit of a shipped guard are fitted."""
MARGIN, MARGIN_PEOPLE = 1.05, 10.0
"""The fitted radii grow by MARGIN + MARGIN_PEOPLE / people: few people, much still unseen."""
FAULT_MPS = 12.0
"""Nobody on foot, on a board or on a bicycle among people is this fast: a jump of the labels."""

_AREA_ROWS = 1500
_HARD_SHARE, _HARD_ROWS = 0.02, 200
# Of r, j, q0, q1, q2, A and c in `GuardModel`: where the search looks.
_LOW = np.log([0.02, 0.001, 0.01, 0.01, 0.01, 0.05, 0.4])
_HIGH = np.log([3.0, 0.5, 5.0, 1.0, 2.0, 5.0, 1.0])


def fit_guard(
    tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack], *, inside: float
) -> GuardFit:
    """For each kind the model of least area that has a share `inside` of the positions inside.

    tracks, measured: as `motion_rows`. A kind with fewer than ENOUGH_PEOPLE people is fitted with
    the others of its family. See `fit_model`.
    Rigor: none; a statement about the recordings at hand. Raises InputError without usable rows.
    """
    pairs = list(zip(tracks, measured, strict=True))
    models: dict[str, GuardModel] = {}
    by_kinds: dict[tuple[str, ...], GuardModel] = {}
    for kind in dict.fromkeys(track.kind for track in tracks):
        kinds = fitted_together(tracks, kind)
        if kinds not in by_kinds:
            chosen = [pair for pair in pairs if pair[0].kind in kinds]
            rows = _fitting_rows([pair[0] for pair in chosen], [pair[1] for pair in chosen])
            if not all(len(part.person) for part in rows):
                continue
            known = None if len(chosen) >= SHAPE_PEOPLE else shipped_guards().of(kind)
            by_kinds[kinds] = fit_model(
                rows, inside=inside, known=known, provenance=_provenance(chosen, kinds)
            )
        models[kind] = by_kinds[kinds]
    if not models:
        raise InputError(
            f"expected tracks longer than {HORIZONS_S[-1]} s to fit a guard to, got none; "
            "give recordings with longer tracks"
        )
    return GuardFit(models)


def fitted_together(tracks: Sequence[PersonTrack], kind: str) -> tuple[str, ...]:
    """The kinds whose people `kind` is fitted with: itself, or its family where it has few."""
    if sum(track.kind == kind for track in tracks) >= ENOUGH_PEOPLE:
        return (kind,)
    return family(kind)


def fit_model(
    rows: Sequence[MotionRows], *, inside: float, known: GuardModel | None, provenance: str
) -> GuardModel:
    """The model of least mean area with a share `inside` of every recording inside at each horizon.

    Speed: V is exceeded, on average to a horizon, by a quarter of the share outside at most in the
    worst recording. Shape: `known`, or where the sum of the logarithms of the mean areas at 1 s and
    more is least. Size: scaled (`GuardModel.scaled`) until the share is inside in the worst
    recording: of K + 1 exchangeable recordings the last is the worst with probability 1 / (K + 1).
    Then scaled by MARGIN + MARGIN_PEOPLE / people. Rows faster than FAULT_MPS are faults of the
    measurement and left out here (scores count them).
    Rigor: none; what was outside in the recordings will be outside again.
    """
    rows = [part.take(_speeds(part) <= FAULT_MPS) for part in rows]
    outside = [(1.0 - inside) * np.bincount(part.recording) for part in rows]
    top = max(
        _worst(_speeds(part), part.recording, 0.25 * most)
        for part, most in zip(rows, outside, strict=True)
        if part.horizon_s >= 1.0
    )

    def sized(shape: GuardModel, among: Sequence[MotionRows]) -> GuardModel:
        limits = dataclasses.replace(shape.limits, speed_mps=top)
        shape = dataclasses.replace(shape, limits=limits, provenance=provenance)
        factors = (
            _worst(_needed(shape, part), part.recording, out)
            for part, out in zip(among, outside, strict=True)
        )
        return shape.scaled(max(factors))

    people = max(len(np.unique(part.person)) for part in rows)
    shape = known if known is not None else _least_shape(rows, sized)
    return sized(shape, rows).scaled(MARGIN + MARGIN_PEOPLE / people)


def _least_shape(
    rows: Sequence[MotionRows], sized: Callable[[GuardModel, Sequence[MotionRows]], GuardModel]
) -> GuardModel:
    """The shape of least area: differential evolution from a fixed seed, then Nelder-Mead.

    Quantiles are taken from the hardest rows (`_hard`), areas from 1500 rows per horizon.
    """
    few = [
        part.take(np.arange(0, n, n // _AREA_ROWS + 1))
        for part in rows
        if part.horizon_s >= 1.0 and (n := len(part.person))
    ]
    hard = [_hard(part) for part in rows]

    def shape(logs: Floats) -> GuardModel:
        r, j, q0, q1, q2, most, kept = (float(number) for number in np.exp(logs))
        return GuardModel(r, j, q0, q1, q2, min(kept, 1.0), MotionLimits(0.0, most), "shape")

    def cost(logs: Floats) -> float:
        drawn = sized(shape(logs), hard)
        return float(sum(math.log(guard_areas(drawn, part).mean()) for part in few))

    return shape(_least_cost(cost))


def _least_cost(cost: Callable[[Floats], float]) -> Floats:
    bounds = Bounds(_LOW, _HIGH)
    rough = differential_evolution(
        cost, bounds, maxiter=25, popsize=6, rng=np.random.default_rng(1), polish=False
    )
    fine = minimize(
        cost, rough.x, method="Nelder-Mead", bounds=bounds, options={"maxfev": 400, "fatol": 1e-4}
    )
    return np.asarray(fine.x, np.float64)


def _needed(shape: GuardModel, rows: MotionRows) -> Floats:
    """For each row the smallest factor of `scaled` with which it is in both discs, (n,).

    The radius is the larger of f (r + q' t + A t^2/2) and f (r + A t^2/2) + (1 - c) |w| t, q' being
    the fitted error: e is within it from the smaller of both solutions on. Beyond the speed limit
    only f r helps.
    """
    motion, reach = rows.motion, rows.reach_s
    accelerated, moved = distances(shape.kept, rows)
    bare = shape.position_m + 0.5 * shape.limits.acceleration_mps2 * reach * reach
    least = (1.0 - shape.kept) * motion.speed_mps * reach
    slow = np.minimum(
        accelerated / (bare + shape.fitted_error(motion) * reach), (accelerated - least) / bare
    )
    fast = (moved - shape.limits.speed_mps * reach) / shape.position_m
    return np.maximum(np.maximum(slow, fast), 1e-6)


def _speeds(rows: MotionRows) -> Floats:
    return np.asarray(np.hypot(*rows.moved_m.T) / rows.reach_s)


def _worst(values: Floats, recording: NDArray[np.intp], outside: NDArray[np.floating]) -> float:
    """The smallest bound that in each recording at most `outside` of the values exceed.

    outside: by recording, a count, rounded down; at least one value somewhere counts.
    """
    found = []
    for number, most in enumerate(outside):
        own, at = values[recording == number], int(most + 1e-9)
        if at < len(own):
            found.append(float(np.partition(own, len(own) - 1 - at)[len(own) - 1 - at]))
    return max(found)


def _hard(rows: MotionRows) -> MotionRows:
    """The rows hardest to keep inside, by the error of the continued velocity, kept in part or in
    full, as it is, per speed and per unsteadiness."""
    n, motion = len(rows.person), rows.motion
    many = max(int(_HARD_SHARE * n), _HARD_ROWS)
    if n <= 4 * many:
        return rows
    hard: set[int] = set()
    for kept in (0.5, 0.8, 1.0):
        error = distances(kept, rows)[0] / rows.reach_s
        for scale in (1.0, 0.5 + 0.3 * motion.speed_mps, 0.5 + motion.unsteady_mps):
            hard.update(np.argpartition(error / scale, n - many)[n - many :].tolist())
    chosen: NDArray[np.intp] = np.array(sorted(hard), np.intp)
    return rows.take(chosen)


def _fitting_rows(
    tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack]
) -> list[MotionRows]:
    every = [motion_rows(tracks, measured, horizon) for horizon in HORIZONS_S]
    return [rows.take((rows.motion.age_s <= FRESH_S) & rows.motion.known) for rows in every]


def _provenance(pairs: Sequence[tuple[PersonTrack, PersonTrack]], kinds: Sequence[str]) -> str:
    recordings = {track.recording for track, _ in pairs}
    return f"{len(pairs)} people ({', '.join(kinds)}) in {len(recordings)} recordings"
