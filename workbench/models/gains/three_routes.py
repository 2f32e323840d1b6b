"""Points near the boundaries, judged three ways: exact conditions, eigenvalues, the full loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.models.gains.lateral import LateralLoop, axis
from workbench.models.gains.responses import simulated
from workbench.models.gains.routh import Reason, conditions
from workbench.models.gains.stability_map import StabilityMap

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]
# Far below every limit of the loop, far above rounding.
_SMALL: Final = 1e-6
_SHARE: Final = 0.05
_LONGEST_S: Final = 60.0


@final
@dataclass(frozen=True, slots=True)
class Checked:
    """One point: the exact reason, the poles' largest real part, and the rate found in a run.

    where: the values that differ from the study's, with units; simulated_per_s: growth rate (below
    0: decay) of the deviation over the second half of a run of the nonlinear loop from 1e-6.
    """

    where: str
    reason: Reason
    abscissa_per_s: float
    simulated_per_s: float

    @property
    def agree(self) -> bool:
        """Whether all three say stable, or all three not."""
        stable = self.reason is Reason.STABLE
        return stable == (self.abscissa_per_s < 0.0) == (self.simulated_per_s < 0.0)

    def row(self) -> dict[str, str | float | bool]:
        """One line of a table."""
        return {
            "point": self.where,
            "exact conditions": self.reason.short,
            "largest real part of the poles (1/s)": self.abscissa_per_s,
            "growth in a run of the full loop (1/s)": self.simulated_per_s,
            "agree": self.agree,
        }


def checked_points(vehicle: Vehicle, maps: Sequence[StabilityMap]) -> tuple[Checked, ...]:
    """On both sides of one boundary of each map, near the middle of its x axis, at speeds > 0."""
    found: list[Checked] = []
    for each in maps:
        found += _beside_boundary(vehicle, each)
    return tuple(found)


def _beside_boundary(vehicle: Vehicle, each: StabilityMap) -> list[Checked]:
    middle = (len(each.x) - 1) / 2.0
    span = _SHARE * float(each.y[-1] - each.y[0])
    for column in sorted(range(len(each.x)), key=lambda k: abs(k - middle)):
        pieces = each.pieces[column]
        for one, other in pairwise(pieces):
            if (one.reason is Reason.STABLE) == (other.reason is Reason.STABLE):
                continue
            below = max(one.high - span, (one.low + one.high) / 2.0)
            above = min(one.high + span, (other.low + other.high) / 2.0)
            points = [{each.x_name: float(each.x[column]), each.y_name: y} for y in (below, above)]
            if all(each.loop.at(point).speed_mps > 0.0 for point in points):
                return [_checked(vehicle, each.loop.at(p), p) for p in points]
    return []


def _checked(vehicle: Vehicle, loop: LateralLoop, values: dict[str, float]) -> Checked:
    abscissa = loop.poles()[0].real
    where = ", ".join(f"{axis(n).words} = {v:.4g} {axis(n).unit}" for n, v in values.items())
    return Checked(
        where, conditions(loop).reason(), abscissa, growth_rate(vehicle, loop, abs(abscissa))
    )


def growth_rate(vehicle: Vehicle, loop: LateralLoop, expected_per_s: float) -> float:
    """Growth rate (1/s) of a deviation of 1e-6 in the full loop, over the second half of a run.

    The size of a deviation is the norm of what is left in each second-long window, so that a swing
    through 0 is not taken for decay. The run lasts long enough for `expected_per_s`.
    """
    horizon = float(np.clip(8.0 / max(expected_per_s, 1e-3), 10.0, _LONGEST_S))
    start = {"offset": _SMALL, "heading_error": -_SMALL, "steering": _SMALL}
    run = simulated(vehicle, loop, start, horizon_s=horizon)
    kept = [run.names.index(n) for n in ("offset", "heading_error", "steering")]
    if loop.integral:
        kept.append(run.names.index("offset_integral"))
    size = np.linalg.norm(run.states[kept], axis=0)
    count = len(size) // 8
    early, late = size[-4 * count : -2 * count], size[-2 * count :]
    step_s = horizon / (len(size) - 1)
    ratio = float(np.sqrt(np.mean(late**2) / np.mean(early**2)))
    return float(np.log(ratio) / (2 * count * step_s))
