"""How far off a simulated car's localiser was, how sure it was, and whether it was right so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols import worst_rounding
from workbench.simulation.ranged_place import Told

_MOST: Final = 0.95


@final
@dataclass(frozen=True, slots=True)
class Spread:
    """Of many numbers: what 95 % stay below, and the greatest."""

    most: float
    worst: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """At least one number."""
        ordered = sorted(values)
        return cls(ordered[math.ceil(_MOST * len(ordered)) - 1], ordered[-1])


@final
@dataclass(frozen=True, slots=True)
class ToldScores:
    """Of the sets of a drive, from the scenario's beginning on.

    sets: how many; holding: share of them that held the true x, y, heading and speed at their
    stamp; error_m: distance of their middle from the true place; radius_m: the larger of their
    radii of x and y; heading_error_rad, heading_radius_rad: likewise.
    """

    sets: int
    holding: float
    error_m: Spread
    radius_m: Spread
    heading_error_rad: Spread
    heading_radius_rad: Spread

    @classmethod
    def of(cls, told: Sequence[Told]) -> ToldScores | None:
        """None where there is no set."""
        told = [each for each in told if each.t_s >= 0.0]
        if not told:
            return None
        places = [(each.place, each.truth) for each in told]
        return cls(
            len(told), sum(map(holds, told)) / len(told),
            Spread.of([math.dist((p.x_m, p.y_m), (m.x_m, m.y_m)) for p, m in places]),
            Spread.of([max(p.x_radius_m, p.y_radius_m) for p, _ in places]),
            Spread.of([abs(_turned(p.heading_rad, m.heading)) for p, m in places]),
            Spread.of([p.heading_radius_rad for p, _ in places]),
        )  # fmt: skip

    @property
    def words(self) -> str:
        """In a sentence."""
        return (
            f"localiser among beacons: {self.sets} sets, {100 * self.holding:.4g} % of them held "
            f"the true state; place off by {self.error_m.most:.3f} m (95 %) and "
            f"{self.error_m.worst:.3f} m at most, radius {self.radius_m.most:.3f} m and "
            f"{self.radius_m.worst:.3f} m; heading off by {self.heading_error_rad.worst:.4f} rad "
            f"at most, radius {self.heading_radius_rad.worst:.4f} rad"
        )


def holds(told: Told) -> bool:
    """Whether a set, with what its frames round, holds the true state at its stamp."""
    place, truth = told.place, told.truth
    return all(
        abs(off) <= radius + math.fsum(worst_rounding()[name] for name in rounded)
        for off, radius, *rounded in (
            (place.x_m - truth.x_m, place.x_radius_m, _X, _X_RADIUS),
            (place.y_m - truth.y_m, place.y_radius_m, _Y, _Y_RADIUS),
            (_turned(place.heading_rad, truth.heading), place.heading_radius_rad, *_HEADING),
            (place.speed_mps - truth.speed_mps, place.speed_radius_mps, *_SPEED),
        )
    )


_X, _X_RADIUS = ("LOC_POSITION", "X"), ("LOC_RADII", "X_RADIUS")
_Y, _Y_RADIUS = ("LOC_POSITION", "Y"), ("LOC_RADII", "Y_RADIUS")
_HEADING: Final = (("LOC_MOTION", "HEADING"), ("LOC_MOTION", "HEADING_RADIUS"))
_SPEED: Final = (("LOC_MOTION", "SPEED"), ("LOC_STAMP", "SPEED_RADIUS"))


def _turned(one_rad: float, other_rad: float) -> float:
    return math.remainder(one_rad - other_rad, math.tau)
