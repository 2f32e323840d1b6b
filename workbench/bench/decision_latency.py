"""What many decisions of one kernel took and proved: quantiles, shares, the budget to choose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.bench.decision_cost import Calls
from workbench.codegen.decision_source import DecisionSizes
from workbench.reach.tube import Array
from workbench.runtime.layout import TUBES

LIMIT_US: Final = 1000.0
"""What 99.9 % of the decisions shall stay below."""


@final
@dataclass(frozen=True, slots=True)
class Latency:
    """Calls of random scenes with one budget.

    method: kernel and form of the tubes; median_us, p999_us, max_us: of the calls as they came;
    quickest_us: the same three of the quicker of two calls per scene, which leaves out most of what
    other programs took; proved: share that lets both policies go on; by_tube: share that is SAFE,
    tube by tube; kept: share of what the default method and budget prove on the same scenes;
    spent_median, spent_max: attempted steps.
    """

    method: str
    budget: int
    calls: int
    median_us: float
    p999_us: float
    max_us: float
    quickest_us: tuple[float, float, float]
    proved: float
    by_tube: dict[str, float]
    kept: float | None
    spent_median: int
    spent_max: int


def latency(sizes: DecisionSizes, calls: Calls, usual: Calls | None) -> Latency:
    """What the calls took and found, and how much of `usual`, the same scenes, they kept."""
    safe = calls.verdicts == 0.0
    kept = None
    if usual is not None and usual.proved.any():
        kept = float((calls.proved & usual.proved).sum() / usual.proved.sum())
    median_us, p999_us, max_us = _told(calls.first_us)
    return Latency(
        str(sizes.method), sizes.budget, len(calls.spent), median_us, p999_us, max_us,
        _told(calls.quickest_us), float(calls.proved.mean()),
        dict(zip(TUBES, safe.mean(axis=0).tolist(), strict=True)),
        kept, int(np.median(calls.spent)), int(calls.spent.max()),
    )  # fmt: skip


def chosen_budget(sweep: Sequence[Latency]) -> int | None:
    """The largest budget with which 99.9 % of the calls as they came keep the limit; None where
    none does."""
    fitting = [row.budget for row in sweep if row.p999_us <= LIMIT_US]
    return max(fitting, default=None)


def _told(values_us: Array) -> tuple[float, float, float]:
    return float(np.median(values_us)), float(np.quantile(values_us, 0.999)), float(values_us.max())
