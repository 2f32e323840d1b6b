"""What both policies ask of a cycle's times and arithmetic."""

from __future__ import annotations

import math

from workbench.runtime.policies.cycle import Cycle, Hypothesis, Violation
from workbench.runtime.policies.horizon import Timing


def clock_violation(cycle: Cycle, *, clock_s: float) -> Violation | None:
    """CLOCK unless stamp <= started <= finished, and the last is not before clock_s, the latest
    instant known. NaN and infinity violate it."""
    times = (cycle.stamp_s, cycle.started_s, cycle.finished_s)
    ordered = -math.inf < cycle.stamp_s <= cycle.started_s <= cycle.finished_s < math.inf
    if ordered and cycle.finished_s >= clock_s:
        return None
    detail = f"stamp, start and end at {times} s, the clock was at {clock_s!r} s"
    return Violation(Hypothesis.CLOCK, detail, True)


def age_violation(cycle: Cycle, timing: Timing, *, stamp_s: float) -> Violation | None:
    """AGE if the check ended more than the latency after its stamp, or its stamp is not after
    stamp_s, that of the observation before."""
    if not cycle.stamp_s > stamp_s:
        return Violation(Hypothesis.AGE, f"no observation since {stamp_s:.3f} s", False)
    age_s = cycle.finished_s - cycle.stamp_s
    if age_s <= timing.latency_s:
        return None
    detail = f"the check ended {age_s:.3f} s after its stamp, {timing.latency_s:.3f} s are allowed"
    return Violation(Hypothesis.AGE, detail, False)


def arithmetic_violation(cycle: Cycle) -> Violation | None:
    """ARITHMETIC where the cycle names a fault."""
    if cycle.fault is None:
        return None
    return Violation(Hypothesis.ARITHMETIC, cycle.fault, False)
