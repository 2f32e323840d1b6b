"""How far predictions are off, and what share of people their radii hold, recordings left out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.likely_goals import LikelyGoals, likely_goal_errors, likely_goals
from workbench.estimation.motion_fit import LEVELS, Material, errors_of, fitted, gather
from workbench.estimation.motion_parameters import MotionParameters
from workbench.estimation.motion_queries import (
    HORIZONS_S,
    SCORED_S,
    known_by_then,
    preferred_velocity,
)
from workbench.estimation.quantile_radii import QuantileRadii, multiples

Values = NDArray[np.float64]
Chosen = NDArray[np.bool_]


@final
@dataclass(frozen=True, slots=True)
class Off:
    """Mean distances (m) of one method over `count` questions whose person is seen at horizon_s.

    ade_m: over the times every 0.2 s up to the horizon; fde_m: at the horizon.
    """

    method: str
    questions: str
    horizon_s: float
    count: int
    ade_m: float
    fde_m: float


@final
@dataclass(frozen=True, slots=True)
class Held:
    """Share of `count` questions whose person is within the radius of a level at horizon_s.

    least, of: the smallest share of any recording with at least 100 such questions, and which.
    """

    radii: str
    level: float
    horizon_s: float
    count: int
    share: float
    least: float
    of: str


@final
@dataclass(frozen=True, slots=True)
class MotionScores:
    """Tables of one folder; `held_out` methods are fitted to the other recordings only."""

    off: tuple[Off, ...]
    held: tuple[Held, ...]

    def text(self) -> str:
        """Both tables, in Markdown."""
        lines = [
            "| questions | method | s | n | ADE m | FDE m |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        lines += [
            f"| {o.questions} | {o.method} | {o.horizon_s:g} | {o.count} | {o.ade_m:.3f} | "
            f"{o.fde_m:.3f} |"
            for o in self.off
        ]
        lines += [
            "", "| radii | level | s | n | held | least of a recording |",
            "| --- | --- | --- | --- | --- | --- |",
        ]  # fmt: skip
        lines += [
            f"| {h.radii} | {100 * h.level:g} % | {h.horizon_s:g} | {h.count} | "
            f"{100 * h.share:.1f} % | " + (f"{100 * h.least:.1f} % {h.of} |" if h.of else "|")
            for h in self.held
        ]
        return "\n".join(lines) + "\n"


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Answers:
    """Errors (n, h) and, by level, radii (n, h) of one way to predict."""

    errors: Values
    radii: dict[float, Values]


def score_motion(folder: Path, shipped: MotionParameters) -> MotionScores:
    """Constant velocity, `shipped`, and numbers fitted to the folder's other recordings.

    Constant velocity is the line of least squares through the last second (at least the last two
    measurements), from the last measured place, and is given the same measurements by the same
    time. Fresh questions are those whose last measurement is at most 1.2 s old; radii are scored
    on them. Raises InputError where a table cannot be used, or where only one recording is there.
    """
    material = gather(Path(folder))
    ours = _answers(material, shipped)
    free, toward, likely = _held_out(material, likely_goals(Path(folder), material.queries))
    fresh = material.queries.fresh
    off: list[Off] = []
    questions = [("fresh", fresh)] if fresh.all() else [("fresh", fresh), ("all", fresh | True)]
    for name, chosen in questions:
        off += _off("constant velocity", name, material.baseline_m[chosen])
        off += _off("shipped numbers", name, ours[0].errors[chosen])
        off += _off("recording held out", name, free.errors[chosen])
        if likely is not None:
            off += _off("recording held out, likely goals", name, likely[chosen])
    for_goal = np.isfinite(material.goals_m[:, 0]) & fresh
    if for_goal.any():
        off += _off("constant velocity", "goal known afterwards", material.baseline_m[for_goal])
        off += _off("recording held out", "goal known afterwards", toward.errors[for_goal])
    held = [
        *_held("free, recording held out", material, free, fresh),
        *_held("free, shipped", material, ours[0], fresh),
        *_held("toward the goal, recording held out", material, toward, for_goal),
    ]
    return MotionScores(tuple(off), tuple(held))


def _held_out(
    material: Material, goals: LikelyGoals | None
) -> tuple[_Answers, _Answers, Values | None]:
    """Answers to each question by numbers that were fitted to the other recordings: straight on,
    to the goal known afterwards, and the errors (n, h) where goals are known by probability."""
    names = material.queries.recordings
    parts: list[tuple[Chosen, tuple[_Answers, _Answers]]] = []
    likely = None if goals is None else np.full_like(material.baseline_m, np.nan)
    for index in range(len(names)):
        others = np.arange(len(names)) != index
        asked = material.queries.recording == index
        if asked.any():
            parameters = fitted(material, others, "held out")
            parts.append((asked, _answers(material, parameters)))
            if goals is not None and likely is not None:
                likely[asked] = _likely(material, parameters, goals, np.flatnonzero(asked))
    free = _joined([(asked, both[0]) for asked, both in parts])
    return free, _joined([(asked, both[1]) for asked, both in parts]), likely


def _likely(
    material: Material, parameters: MotionParameters, goals: LikelyGoals, asked: NDArray[np.intp]
) -> Values:
    queries = material.queries
    known = known_by_then(queries, parameters.numbers)
    straight, _ = preferred_velocity(queries, known, parameters.numbers, HORIZONS_S)
    return likely_goal_errors(queries, known, straight, parameters, goals, asked)


def _joined(parts: Sequence[tuple[Chosen, _Answers]]) -> _Answers:
    errors = np.full_like(parts[0][1].errors, np.nan)
    radii = {level: np.full_like(errors, np.nan) for level in LEVELS}
    for asked, answers in parts:
        errors[asked] = answers.errors[asked]
        for level in LEVELS:
            radii[level][asked] = answers.radii[level][asked]
    return _Answers(errors, radii)


def _answers(material: Material, parameters: MotionParameters) -> tuple[_Answers, _Answers]:
    free, toward, speeds = errors_of(material, parameters.numbers, parameters.field)
    leads = material.queries.leads_s
    return (
        _Answers(free, radii_m(parameters.free, leads, speeds)),
        _Answers(toward, radii_m(parameters.toward_goal, leads, speeds)),
    )


def radii_m(radii: QuantileRadii, leads_s: Values, speeds_mps: Values) -> dict[float, Values]:
    """`QuantileRadii.radius_m` for leads_s (n, h) and speeds_mps (n,), by level."""
    knots = np.array(radii.leads_s)
    found = {}
    for level, row in zip(radii.levels, radii.radii_m, strict=True):
        slope = (row[-1] - row[-2]) / (knots[-1] - knots[-2])
        beyond = slope * np.maximum(leads_s - knots[-1], 0.0)
        inside = np.interp(leads_s, knots, np.array(row))
        found[level] = (inside + beyond) * multiples(speeds_mps)[:, None]
    return found


def _off(method: str, questions: str, errors: Values) -> Iterable[Off]:
    for horizon, column in zip(SCORED_S, _columns(), strict=True):
        seen = np.isfinite(errors[:, column])
        if seen.any():
            ade, fde = errors[seen, : column + 1].mean(), errors[seen, column].mean()
            yield Off(method, questions, horizon, int(seen.sum()), float(ade), float(fde))


def _held(name: str, material: Material, answers: _Answers, chosen: Chosen) -> Iterable[Held]:
    recording, names = material.queries.recording, material.queries.recordings
    for level in LEVELS[1:]:
        for horizon, column in zip(SCORED_S, _columns(), strict=True):
            seen = chosen & np.isfinite(answers.errors[:, column])
            if not seen.any():
                continue
            inside = answers.errors[:, column] <= answers.radii[level][:, column]
            shares = [
                (float(inside[seen & (recording == k)].mean()), each)
                for k, each in enumerate(names)
                if (seen & (recording == k)).sum() >= 100
            ]
            least, of = min(shares, default=(1.0, ""))
            share = float(inside[seen].mean())
            yield Held(name, level, horizon, int(seen.sum()), share, least, of)


def _columns() -> list[int]:
    return [int(k) for k in np.searchsorted(HORIZONS_S, np.array(SCORED_S) - 1e-6)]
