"""A person who was more than the guard allowed: what it takes, and the limits from then on."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime import Guard, MotionLimits
from workbench.runtime.policies.guards import Relation, relation_to

_ROUNDING = 1e-9


@final
@dataclass(frozen=True, slots=True)
class LimitsViolation:
    """Somebody whom a guard lost: the record of it.

    name: the person; at_s: when they were seen where the earlier guard does not allow; limits: of
    the earlier guard; needed: the least speed and the least acceleration with which both guards
    can be of the same person.
    """

    name: str
    at_s: float
    limits: MotionLimits
    needed: MotionLimits

    def __str__(self) -> str:
        limits, needed = self.limits, self.needed
        return (
            f"{self.name} at {self.at_s:.3f} s: needs {needed.speed_mps:.2f} m/s and "
            f"{needed.acceleration_mps2:.2f} m/s^2, allowed were {limits.speed_mps:.2f} m/s and "
            f"{limits.acceleration_mps2:.2f} m/s^2"
        )


def limits_violation(name: str, before: Guard, now: Guard) -> LimitsViolation | None:
    """What `now` refutes of the limits of `before`; None where `relation_to` finds no refutation.

    With t = now.at_s - before.at_s, p, w, r, q of `before` and primes for `now`, least limits:
    V = max((|p' - p| - r - r') / t, |w'| - q'), A = max((|p' - p - w t| - r - r' - q t) 2 / t^2,
    (|w' - w| - q - q') / t), neither below what was allowed.
    Raises InputError where `now` is not later: no limits explain two places at one time, nor what
    is not a number; such a measurement is at fault, not the person.
    """
    if relation_to(before, now) is not Relation.OUTSIDE:
        return None
    t = now.at_s - before.at_s
    p, w, p1, w1 = before.position, before.velocity, now.position, now.velocity
    blurred, drift = p.radius + p1.radius, w.radius + w1.radius
    if not t > 0.0:
        raise InputError(
            f"{name}: expected a later guard, got one {t} s after the other that contradicts it; "
            "mend the measurement, no speed explains it"
        )
    speed = max(
        (math.hypot(p1.x - p.x, p1.y - p.y) - blurred) / t,
        math.hypot(w1.x, w1.y) - w1.radius,
    )
    ahead = math.hypot(p1.x - p.x - w.x * t, p1.y - p.y - w.y * t)
    acceleration = max(
        2.0 * (ahead - blurred - w.radius * t) / (t * t),
        (math.hypot(w1.x - w.x, w1.y - w.y) - drift) / t,
    )
    if not (math.isfinite(speed) and math.isfinite(acceleration)):
        raise InputError(f"{name}: expected finite positions and velocities, got {before}, {now}")
    limits = before.limits
    needed = MotionLimits(
        max(limits.speed_mps, speed * (1.0 + _ROUNDING)),
        max(limits.acceleration_mps2, acceleration * (1.0 + _ROUNDING)),
    )
    return LimitsViolation(name, now.at_s, limits, needed)


def widened(limits: MotionLimits, violation: LimitsViolation, *, headroom: float) -> MotionLimits:
    """The person's limits from now on: `headroom` times what was needed where that was more than
    the violated limit, and never less than `limits`.

    headroom: at least 1; one who just exceeded a limit may do more than was seen so far.
    """
    if not (math.isfinite(headroom) and headroom >= 1.0):
        raise InputError(f"headroom: expected a finite number >= 1, got {headroom!r}")
    wider = {
        name: max(getattr(limits, name), headroom * getattr(violation.needed, name))
        for name in ("speed_mps", "acceleration_mps2")
        if getattr(violation.needed, name) > getattr(violation.limits, name)
    }
    return dataclasses.replace(limits, **wider)


def widest(limits: MotionLimits, other: MotionLimits | None) -> MotionLimits:
    """What either allows."""
    if other is None:
        return limits
    return MotionLimits(
        max(limits.speed_mps, other.speed_mps),
        max(limits.acceleration_mps2, other.acceleration_mps2),
    )


def broken_limits(name: str, earlier: Sequence[Guard], now: Guard) -> LimitsViolation | None:
    """The least limits with which all of the earlier guards and this one are of one person."""
    found = [v for v in (limits_violation(name, each, now) for each in earlier) if v is not None]
    if not found:
        return None
    needed = MotionLimits(
        max(each.needed.speed_mps for each in found),
        max(each.needed.acceleration_mps2 for each in found),
    )
    return dataclasses.replace(found[0], needed=needed)
