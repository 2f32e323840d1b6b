"""Margins of the lateral loop from the roots of one polynomial: python-control's figures, fast."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import frequencies
from workbench.models.gains.routh import Reason, conditions

_REAL: Final = 1e-7
Array = NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True)
class LoopScore:
    """Of one loop: whether and why (un)stable, exact; the rest NUMERICAL, NaN where not stable.

    decay_per_s: minus the largest real part of the poles, known either way.
    """

    reason: Reason
    decay_per_s: float
    phase_deg: float
    delay_margin_s: float
    disk: float

    @property
    def stable(self) -> bool:
        """Asymptotically, by Hurwitz' conditions in rational arithmetic."""
        return self.reason is Reason.STABLE


def loop_score(loop: LateralLoop) -> LoopScore:
    """Stability and margins of the loop broken open at the steering rate.

    With L = N / D the crossovers are the real roots of |N(jw)|^2 = |D(jw)|^2, a polynomial in w.
    """
    reason, poles = conditions(loop).reason(), loop.poles()
    decay = -poles[0].real
    if reason is not Reason.STABLE:
        return LoopScore(reason, decay, math.nan, math.nan, math.nan)
    whole = np.array([float(c) for c in loop.polynomial()])
    top, bottom = whole[1:], np.zeros(len(whole))
    bottom[0] = whole[0]
    crossed = _crossovers(top, bottom)
    values = np.polyval(top, 1j * crossed) / np.polyval(bottom, 1j * crossed)
    phases = np.degrees(np.angle(-values))
    phase = min(phases.tolist(), key=abs, default=math.inf)
    delays = np.radians(phases % 360.0) / crossed
    grid = 1j * frequencies(poles)
    response = np.polyval(top, grid) / np.polyval(bottom, grid)
    peak = float(np.abs((1.0 - response) / (1.0 + response)).max())
    return LoopScore(reason, decay, phase, min(delays.tolist(), default=math.inf), 2.0 / peak)


@final
@dataclass(frozen=True, slots=True)
class SpeedScore:
    """Of the speed loop: whether it is stable, exact; margins NaN where not."""

    stable: bool
    phase_deg: float
    delay_margin_s: float


def speed_margins(proportional_per_s: float, integral_per_s2: float) -> SpeedScore:
    """Of the loop (kp + ki / s) / s: v' = kp (v_ref - v) + ki J, J' = v_ref - v, without limits.

    s^2 + kp s + ki is stable where kp, ki > 0, without an integral where kp > 0. |L| = 1 at
    w^2 = (kp^2 + sqrt(kp^4 + 4 ki^2)) / 2, where the phase is atan(kp w / ki) above -180 degrees.
    """
    kp, ki = proportional_per_s, integral_per_s2
    if not (kp > 0.0 and ki >= 0.0):
        return SpeedScore(False, math.nan, math.nan)
    crossed = math.sqrt((kp**2 + math.hypot(kp**2, 2.0 * ki)) / 2.0)
    phase = math.atan2(kp * crossed, ki)
    return SpeedScore(True, math.degrees(phase), phase / crossed)


def _crossovers(top: Array, bottom: Array) -> Array:
    """Frequencies (rad/s) at which the magnitude is 1."""
    excess = np.polysub(_squared(top), _squared(bottom))
    roots = np.roots(excess)
    real = (np.abs(roots.imag) <= _REAL * np.abs(roots)) & (roots.real > 0.0)
    return np.unique(roots.real[real])


def _squared(polynomial: Array) -> Array:
    """|p(jw)|^2 as a polynomial in w."""
    powers = np.arange(len(polynomial))[::-1]
    turned = polynomial * 1j**powers
    return np.asarray(np.polymul(turned, np.conj(turned)).real, dtype=np.float64)
