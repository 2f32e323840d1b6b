"""Pressing on a bound: each distance is driven up where the bound is tightest."""

from __future__ import annotations

import numpy as np

from workbench.sensitivity.ascent import Goals, Pairs, Reached, ascend, joined
from workbench.sensitivity.examination import Examiner
from workbench.sensitivity.examine_pairs import Trial
from workbench.sensitivity.second_order import second_order_steps
from workbench.sensitivity.vectorised import Array, Index


def ratios(distances: Array, bound: Array) -> Array:
    """distance / bound; 0 for 0 / 0, inf for a run that left the finite numbers."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = distances / bound
    found = np.where((bound == 0.0) & (distances == 0.0), 0.0, found)
    return np.where(np.isfinite(distances), found, np.inf)


def pressed(
    trial: Trial, *, pairs: Pairs, differences: Array, bound: Array, method: Examiner
) -> tuple[Pairs, Array]:
    """Pairs that press harder than `pairs` do, and their differences (M, K+1, n).

    First by gradient steps from the best pair at the tightest instants of each coordinate; then,
    with those found and at the instants that are tightest now, by second-order steps from several
    different pairs. Without rounds of either kind nothing is run. Parameters go to the ends of
    their ranges where that helps.
    """
    flow, box = trial.flow, trial.box
    found, its = pairs.take(np.arange(0)), differences[:0]
    for starts, climb, rounds in (
        (1, ascend, method.rounds),
        (method.starts, second_order_steps, method.second_order_rounds),
    ):
        if not rounds:
            continue
        pool, signed = joined([pairs, found]), np.concatenate([differences, its])
        worst = ratios(np.fmax.reduce(np.abs(signed), axis=0), bound)
        goals, rows = _goals(pool, signed, _aims(worst, method.goals_per_coordinate), starts)
        start = _with_best_ranges(trial, goals, pool.take(rows))
        more = climb(
            flow, box, goals=goals, start=start, rounds=rounds, move_first=method.any_centre
        )
        found = joined([found, more])
        its = np.concatenate([its, more.differences(flow)])
    return found, its


def _aims(worst: Array, count: int) -> list[tuple[int, int]]:
    """(coordinate, instant): half of them tightest of all, the rest tightest in equal windows."""
    steps, size = worst.shape[0] - 1, worst.shape[1]
    windows = np.array_split(np.arange(1, steps + 1), min(count - count // 2, steps))
    chosen = []
    for i in range(size):
        order = 1 + np.argsort(-worst[1:, i], kind="stable")
        spread = [window[np.argmax(worst[window, i])] for window in windows]
        chosen += [(i, int(k)) for k in np.union1d(order[: count // 2], spread)]
    return chosen


def _goals(
    pool: Pairs, signed: Array, aims: list[tuple[int, int]], starts: int
) -> tuple[Goals, Index]:
    """Up to `starts` different pairs for each aim, and the sign in which each is ahead."""
    rows, goals = [], []
    for i, k in aims:
        for row in _different(pool, signed[:, k, i], starts):
            rows.append(row)
            goals.append((i, k, -1.0 if signed[row, k, i] < 0.0 else 1.0))
    coordinate, instant, sign = zip(*goals, strict=True)
    return Goals(np.array(coordinate), np.array(instant), np.array(sign)), np.array(rows)


def _different(pool: Pairs, signed: Array, starts: int) -> list[int]:
    """The rows furthest ahead that point into different orthants or have different signs."""
    order = np.argsort(-np.nan_to_num(np.abs(signed), posinf=0.0), kind="stable")
    if starts == 1:
        return [int(order[0])]
    chosen: list[int] = []
    seen: set[tuple[float, ...]] = set()
    for row in order[: 50 * starts].tolist():
        way = np.sign(pool.second[row] - pool.first[row])
        key = (float(np.sign(signed[row])), *way.tolist())
        if key not in seen:
            seen.add(key)
            chosen.append(row)
        if len(chosen) == starts:
            break
    return chosen


def _with_best_ranges(trial: Trial, goals: Goals, start: Pairs) -> Pairs:
    """One sweep through the ends of the parameters' ranges; the better one is kept."""
    best = Reached(start, goals.values(start.differences(trial.flow)))
    for column, ranged in enumerate(trial.ranges):
        for end in {ranged.lower, ranged.upper} if ranged.lower < ranged.upper else ():
            parameters = best.pairs.parameters.copy()
            parameters[:, column] = end
            candidate = Pairs(best.pairs.first, best.pairs.second, parameters)
            best = best.or_better(candidate, goals.values(candidate.differences(trial.flow)))
    return best.pairs
