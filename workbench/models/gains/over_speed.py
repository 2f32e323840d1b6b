"""Poles and margins of the lateral loop over speed, with fixed gains and with scheduled ones."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from workbench.errors import InputError
from workbench.models.control_view import margins, stability
from workbench.models.gains.lateral import LateralLoop, Schedule

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_FREQUENCIES: Final = 2000


@final
@dataclass(frozen=True, slots=True)
class DiskMargins:
    """Gain and phase that may change together and at any frequency (Seiler, Packard, Gahinet, An
    Introduction to Disk Margins, 2020; skew 0).

    size: the disk margin alpha, below 2; gain_low, gain_high: factors; phase_deg; at_radps: where
    the loop is nearest to losing it.
    """

    size: float
    gain_low: float
    gain_high: float
    phase_deg: float
    at_radps: float


def disk_margins(loop: control.LTI, frequencies_radps: Array) -> DiskMargins:
    """alpha = 1 / max |(1 - L) / (1 + L)| * 2 over the frequencies; meaningful for a stable loop.

    Rigor NUMERICAL: the largest value is taken on the grid.
    """
    L = np.asarray(loop(1j * frequencies_radps))
    peak = np.abs((1.0 - L) / (1.0 + L))
    worst = int(np.argmax(peak))
    size = 2.0 / float(peak[worst])
    low = (2.0 - size) / (2.0 + size)
    high = 1.0 / low if low > 0.0 else math.inf
    phase = math.degrees(2.0 * math.atan(size / 2.0))
    return DiskMargins(size, max(low, 0.0), high, phase, float(frequencies_radps[worst]))


@final
@dataclass(frozen=True, slots=True)
class SpeedPoint:
    """What one schedule gives at one speed; margins are NaN where the loop is not stable.

    abscissa_per_s: largest real part of the poles; damping: least damping ratio; gain_low,
    gain_high: factors by which the loop gain may fall and rise; delay_s: largest added delay.
    """

    schedule: Schedule
    speed_mps: float
    stable: bool
    abscissa_per_s: float
    damping: float
    gain_low: float
    gain_high: float
    phase_deg: float
    delay_s: float
    crossover_radps: float
    disk: float
    disk_gain_low: float
    disk_gain_high: float
    disk_phase_deg: float

    def row(self) -> dict[str, str | float | bool]:
        """Its fields, the schedule in words."""
        return dataclasses.asdict(self) | {"schedule": self.schedule.value}


@final
@dataclass(frozen=True, slots=True, eq=False)
class OverSpeed:
    """Poles and margins over speed.

    points: one per schedule and speed; speeds_mps (n); poles (n x order): of the fixed gains,
    continued so that each column is one branch.
    """

    loop: LateralLoop
    points: tuple[SpeedPoint, ...]
    speeds_mps: Array
    poles: NDArray[np.complex128]

    def of(self, schedule: Schedule) -> tuple[SpeedPoint, ...]:
        """The points of one schedule, speed rising."""
        return tuple(point for point in self.points if point.schedule is schedule)

    def rows(self) -> list[dict[str, str | float | bool]]:
        """One row per schedule and speed."""
        return [point.row() for point in self.points]

    def plot(self) -> Figure:
        """Poles and margins over speed as a matplotlib figure."""
        from workbench.models.gains.pictures import figure, paint_margins

        return figure(lambda canvas: paint_margins(canvas, self))


def over_speed(loop: LateralLoop, low_mps: float, high_mps: float, *, points: int) -> OverSpeed:
    """All schedules at `points` speeds in [low, high], 0 < low < high.

    `loop` holds the gains at its own speed, from which the schedules start. Raises InputError on
    another range: at a standstill there is nothing to steer, in reverse see the stability map.
    """
    if not 0.0 < low_mps < high_mps:
        raise InputError(f"speeds: expected 0 < LOW < HIGH, in m/s, got {low_mps:g} {high_mps:g}")
    if loop.speed_mps <= 0.0:
        raise InputError(
            f"expected a loop at a speed > 0 to schedule gains from, got {loop.speed_mps:g} m/s"
        )
    speeds = np.linspace(low_mps, high_mps, points)
    found = tuple(_point(s, s.at(loop, float(v)), float(v)) for s in Schedule for v in speeds)
    poles = [np.array(loop.at({"speed": float(v)}).poles()) for v in speeds]
    return OverSpeed(loop, found, speeds, continued(poles))


def _point(schedule: Schedule, loop: LateralLoop, speed_mps: float) -> SpeedPoint:
    poles = loop.poles()
    verdict = stability(poles)
    damping = min(-p.real / abs(p) if abs(p) else 0.0 for p in poles)
    head = (schedule, speed_mps, verdict.stable, poles[0].real, damping)
    if not verdict.stable:
        return SpeedPoint(*head, *(math.nan,) * 9)
    open_loop = loop.open_loop()
    low, high = gain_range(open_loop)
    usual = margins(open_loop)
    disk = disk_margins(open_loop, frequencies(poles))
    return SpeedPoint(
        *head, low, high, usual.phase_margin_deg, usual.delay_margin_s, usual.crossover_radps,
        disk.size, disk.gain_low, disk.gain_high, disk.phase_deg,
    )  # fmt: skip


def gain_range(open_loop: control.LTI) -> tuple[float, float]:
    """Factors about 1 between which the loop gain may change; 0 and infinity where no limit is."""
    gains = control.stability_margins(open_loop, returnall=True)[0]
    below = [float(g) for g in gains if 0.0 < g < 1.0]
    above = [float(g) for g in gains if g >= 1.0]
    return max(below, default=0.0), min(above, default=math.inf)


def frequencies(poles: Sequence[complex]) -> Array:
    """A grid in rad/s about all poles, two decades beyond them."""
    sizes = [abs(pole) for pole in poles if abs(pole) > 0.0]
    return np.logspace(
        math.log10(min(sizes)) - 2.0, math.log10(max(sizes)) + 2.0, _FREQUENCIES, dtype=float
    )


def continued(poles: Sequence[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Each row (k) of poles in the order that moves least from the row before."""
    rows = [poles[0]]
    for row in poles[1:]:
        _, order = linear_sum_assignment(np.abs(rows[-1][:, None] - row[None, :]))
        rows.append(row[order])
    return np.array(rows)
