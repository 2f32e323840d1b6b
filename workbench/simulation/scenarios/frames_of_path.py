"""Places beside a car's path: by station and distance to the left of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.models.spline_path import SplinePath
from workbench.simulation.frames import Point
from workbench.simulation.walkers.scripted import Leg

_CHORD_M = 2.0
_FAR_M = 1000.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class PathFrame:
    """(station, left) in m to the plane; straight on before the path's begin and behind its end.

    Raises InputError for places more than 1 km beside the path, before or behind it.
    """

    path: SplinePath

    def place(self, at: Point) -> Point:
        """Position (x, y) in m."""
        self._require_near(at)
        within = min(max(at[0], 0.0), self.path.length_m)
        (x, y), heading = self.path.position(within), float(self.path.heading(within))
        cos, sin = math.cos(heading), math.sin(heading)
        beyond = at[0] - within
        return float(x) + beyond * cos - at[1] * sin, float(y) + beyond * sin + at[1] * cos

    def vector(self, at: Point, along: Point) -> Point:
        """A vector from its parts along the path and to its left, at a place (station, left)."""
        heading = float(self.path.heading(min(max(at[0], 0.0), self.path.length_m)))
        cos, sin = math.cos(heading), math.sin(heading)
        return along[0] * cos - along[1] * sin, along[0] * sin + along[1] * cos

    def _require_near(self, at: Point) -> None:
        beyond_m = at[0] - min(max(at[0], 0.0), self.path.length_m)
        if max(abs(beyond_m), abs(at[1])) > _FAR_M:
            raise InputError(
                f"expected a place [station, left] within {_FAR_M:g} m of the path, whose stations "
                f"are 0 to {self.path.length_m:.1f} m, got [{at[0]:g}, {at[1]:g}]"
            )

    def legs(self, begin: Point, legs: tuple[Leg, ...]) -> tuple[Leg, ...]:
        """Legs in the plane. One that begins where the one before ended follows the path in chords
        of at most 2 m; one that a cue can begin anywhere is straight, as is one across the path."""
        self._require_near(begin)
        found, here = [], begin
        for k, leg in enumerate(legs):
            self._require_near(leg.to)
            follows = k == 0 or leg.cue is None
            pieces = max(1, math.ceil(abs(leg.to[0] - here[0]) / _CHORD_M)) if follows else 1
            for piece in range(1, pieces + 1):
                share = piece / pieces
                to = tuple(a + share * (b - a) for a, b in zip(here, leg.to, strict=True))
                first = piece == 1
                found.append(
                    Leg(
                        self.place((to[0], to[1])), leg.speed_mps, leg.cue if first else None,
                        leg.delay_s if first else 0.0,
                    )
                )  # fmt: skip
            here = leg.to
        return tuple(found)


@final
@dataclass(frozen=True, slots=True)
class PlaneFrame:
    """Places as they are."""

    def place(self, at: Point) -> Point:
        """The same."""
        return at

    def vector(self, at: Point, along: Point) -> Point:  # noqa: ARG002
        """The same."""
        return along

    def legs(self, begin: Point, legs: tuple[Leg, ...]) -> tuple[Leg, ...]:  # noqa: ARG002
        """The same."""
        return legs


Frame = PathFrame | PlaneFrame
