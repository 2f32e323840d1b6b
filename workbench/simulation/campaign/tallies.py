"""Rows of a survey summed up: by contender and plant, with intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.stats import beta

from workbench.simulation.campaign.contenders import CONTENDERS, judged, judged_half
from workbench.simulation.campaign.rows import Row

_RESAMPLES: Final = 2000
_BLOCK: Final = 50
_FEWEST: Final = 20


@final
@dataclass(frozen=True, slots=True)
class Rate:
    """Something per km, with a 95 % bootstrap interval that draws scenarios; NaN without a way, the
    interval alone with fewer than 20 scenarios."""

    per_km: float
    low: float
    high: float


@final
@dataclass(frozen=True, slots=True)
class Tally:
    """A contender on a plant.

    runs, contacts, avoidable: of all its scenarios, of a baseline those of the judged half;
    avoidable_most: 95 % upper bound on the share of scenarios with an avoidable contact (Clopper
    and Pearson, one-sided; of draws that are independent, which points of a Sobol sequence are
    not); hardest_mps: fastest contact. needless, stops: per km, of the judged half for everybody;
    judged: scenarios of it. standing: share of the time at standstill, before it set off as well;
    mean_mps; set_off, passed: shares of runs. invalid, out_of_region, unproved: shares of all
    decisions; violations, alerts: counts.
    """

    plant: str
    contender: str
    runs: int
    contacts: int
    avoidable: int
    avoidable_most: float
    hardest_mps: float
    needless: Rate
    stops: Rate
    judged: int
    km: float
    standing: float
    mean_mps: float
    set_off: float
    passed: float
    decisions: int
    invalid: float
    out_of_region: float
    unproved: float
    violations: int
    alerts: int


def tallies(rows: Iterable[Row]) -> list[Tally]:
    """By plant, contenders in their usual order; only those with rows."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if not judged(row.contender, row.index):
            continue
        groups.setdefault((row.plant, row.contender), []).append(row)
    order = sorted(groups, key=lambda each: (each[0], CONTENDERS.index(each[1])))
    return [_tally(*key, groups[key]) for key in order]


def worst(rows: Sequence[Row], most: int) -> list[Row]:
    """Drives that should not be: avoidable contacts of whoever is to brake, fastest first; then
    those with most needless stops."""
    braking = [row for row in rows if row.contender != CONTENDERS[-1]]
    contacts = sorted((r for r in braking if r.avoidable), key=lambda r: -r.contact_mps)
    needless = sorted(
        (r for r in braking if r.needless_stops and not r.avoidable),
        key=lambda r: -r.needless_stops,
    )
    return [*contacts[:most], *needless[: max(0, most - len(contacts))]]


def _tally(plant: str, contender: str, rows: Sequence[Row]) -> Tally:
    runs, contacts = len(rows), [row for row in rows if row.contact]
    avoidable = sum(row.avoidable for row in rows)
    judged = [row for row in rows if judged_half(row.index)]
    time_s, km = sum(row.time_s for row in rows), sum(row.way_m for row in rows) / 1000.0
    decisions = sum(row.safe + row.unproved + row.invalid for row in rows)
    ways = [row.way_m for row in judged]
    return Tally(
        plant, contender, runs, len(contacts), avoidable, upper_bound(avoidable, runs),
        max((row.contact_mps for row in contacts), default=0.0),
        rate([row.needless_stops for row in judged], ways),
        rate([row.stops for row in judged], ways), len(judged), km,
        sum(row.waited_s + row.stood_s for row in rows) / time_s, 1000.0 * km / time_s,
        sum(row.set_off for row in rows) / runs, sum(row.passed for row in rows) / runs,
        decisions,
        sum(row.invalid for row in rows) / decisions,
        sum(row.out_of_region for row in rows) / decisions,
        sum(row.unproved for row in rows) / decisions,
        sum(row.violations for row in rows), sum(row.alerts for row in rows),
    )  # fmt: skip


def upper_bound(found: int, of: int) -> float:
    """95 % upper confidence bound on a share (Clopper and Pearson, one-sided)."""
    return 1.0 if found >= of else float(beta.ppf(0.95, found + 1, of - found))


def rate(counts: Sequence[int], ways_m: Sequence[float]) -> Rate:
    """Sum of counts per km of the sum of ways; scenarios are drawn with replacement, 2000 times."""
    values, km = np.asarray(counts, float), np.asarray(ways_m, float) / 1000.0
    if not len(km) or km.sum() <= 1e-4:
        return Rate(math.nan, math.nan, math.nan)
    per_km = float(values.sum() / km.sum())
    if len(km) < _FEWEST:
        return Rate(per_km, math.nan, math.nan)
    chance, found = np.random.default_rng(1), []
    for _ in range(_RESAMPLES // _BLOCK):
        drawn = chance.integers(0, len(km), (_BLOCK, len(km)))
        found.append(values[drawn].sum(axis=1) / np.maximum(km[drawn].sum(axis=1), 1e-6))
    low, high = np.quantile(np.concatenate(found), (0.025, 0.975))
    return Rate(per_km, float(low), float(high))
