"""When a car stands: derived from its brake's bounds, never chosen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.arc import Interval

# Four additions and divisions of positive numbers err by less than this, relatively.
_ROUNDING = 1.0 + 2.0**-50

GRAIN_S = 1e-6
"""More than the rounding of sums and differences of two instants, whose clock shows below 1e9 s."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BrakeBounds:
    """What BRAKE is known to do: full braking, at least deceleration_min_mps2, builds up within
    build_up_s (s) after at most delay_s (s), and until then the car keeps its speed. Where the
    acceleration is disturbed these are the numbers of an undisturbed brake that is as late. Raises
    InputError unless the first is > 0, the others >= 0."""

    deceleration_min_mps2: float
    delay_s: float
    build_up_s: float

    def __post_init__(self) -> None:
        if not 0.0 < self.deceleration_min_mps2 < math.inf:
            raise InputError(
                f"expected a finite deceleration_min_mps2 > 0, got {self.deceleration_min_mps2!r}"
            )
        if not (0.0 <= self.delay_s < math.inf and 0.0 <= self.build_up_s < math.inf):
            raise InputError(
                f"expected finite delay_s, build_up_s >= 0, got {self.delay_s!r}, "
                f"{self.build_up_s!r}"
            )

    def stop_s(self, speed_mps: float) -> float:
        """Longest time (s) from the command BRAKE, given at up to speed_mps, to standstill.

        delay + build-up + v / decel_min, for v <= 0 too: the speed cannot grow after the delay, has
        not grown before it, and falls by at least decel_min once braking has built up. Rounded up.
        Assumes that the car keeps its speed until braking begins.
        """
        ramp_s = max(speed_mps, 0.0) / self.deceleration_min_mps2
        return (self.delay_s + self.build_up_s + ramp_s) * _ROUNDING


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """How often and how late the monitor answers; all in s.

    period_s: longest time between the stamps of two observations; latency_s: longest time from a
    stamp to the end of its check; send_gap_s: longest time between two turns of the sender. Raises
    InputError for a negative or non-finite time, a gap of 0 or one longer than the period.
    """

    period_s: float
    latency_s: float
    send_gap_s: float

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name}: expected a finite time >= 0 s, got {value!r}")
        # A first TRACK that comes within a gap of its check is then before the switch of its plan.
        if not 0.0 < self.send_gap_s <= self.period_s:
            raise InputError(
                f"expected 0 < send_gap_s <= period_s, got {self.send_gap_s!r} and "
                f"{self.period_s!r}; let the sender turn at least as often as checks are made"
            )

    @property
    def switch_s(self) -> Interval:
        """When a plan switches from TRACK to BRAKE, counted from its stamp.

        [period + latency, period + latency + gap], a few grains wider: the next check has ended
        before the first, and a turn of the sender falls between the two, a grain inside of both.
        """
        first = self.period_s + self.latency_s
        return first * _ROUNDING, (first + self.send_gap_s + 4.0 * GRAIN_S) * _ROUNDING


def fail_safe_horizon_s(
    timing: Timing, brake: BrakeBounds, *, speed_mps: float, accel_max_mps2: float
) -> float:
    """Time (s) from a stamp to the standstill of its plan: how far `FailSafe` must look.

    b + delay + build-up + (v + b a_max) / decel_min with b the end of the switch interval. v
    (speed_mps): upper end of the measured speed; a_max (accel_max_mps2) >= 0: what TRACK may
    accelerate with until the switch, 0 where v bounds the speed of the whole stretch. With b = 0.1
    s (the period alone), 2.8 m/s and the shipped brake it is 1.7 s. Rounded up.
    """
    until_s = timing.switch_s[1]
    fastest_mps = max(speed_mps, 0.0) + until_s * max(accel_max_mps2, 0.0)
    return (until_s + brake.stop_s(fastest_mps * _ROUNDING)) * _ROUNDING
