"""A question about people: the body, the ground, the discs, and distances between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from workbench.errors import InputError
from workbench.reach.findings.penetration import distance_function
from workbench.reach.separation import Ground
from workbench.reach.tube import Array
from workbench.runtime.contents import VehicleBody
from workbench.runtime.observation import Person

# Share of a disc's radius that keeps a chosen position inside it in spite of rounding.
_INSIDE = 1.0 - 1e-9


@final
@dataclass(frozen=True, slots=True)
class Encounter:
    """A question about people, as `check_separation` takes it.

    ground: where states are; body: what the vehicle covers there; people: whom it has to keep clear
    of, at time 0; clearance_required_m: how far. Raises InputError on a clearance that is negative
    or not finite.
    """

    ground: Ground
    body: VehicleBody
    people: tuple[Person, ...]
    clearance_required_m: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.clearance_required_m) and self.clearance_required_m >= 0):
            raise InputError(
                f"expected a finite clearance_required_m >= 0, got {self.clearance_required_m!r}"
            )

    def distances(self, states: Array, times_s: Array) -> Array:
        """Signed distance (..., people) of the body from each disc, in m; floats, for searching.

        states (..., 3) as the ground names them, times_s broadcast against (...).
        """
        poses = self.ground.poses(states)
        columns = [gap(poses, self.body, person, times_s)[0] for person in self.people]
        return np.stack(columns, axis=-1)


def gap(
    poses: Array, body: VehicleBody, person: Person, times_s: Array | float
) -> tuple[Array, Array, Array]:
    """Signed distance of body and disc (m), and a position (x, y) in the disc that is as near.

    Floats, for searching; poses (..., 3) as `Ground.poses` gives them.
    """
    t = np.asarray(times_s)
    px, py = person.x_m + person.vx_mps * t, person.y_m + person.vy_mps * t
    radius = person.radius_m + t * (person.growth_mps + 0.5 * t * person.growth_mps2)
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    dx, dy = px - poses[..., 0], py - poses[..., 1]
    u, v = c * dx + s * dy, c * dy - s * dx
    a = np.maximum(u - body.front_m, -body.rear_m - u)
    b = np.abs(v) - body.half_width_m
    distance = np.where(
        (a <= 0) & (b <= 0), np.maximum(a, b), np.hypot(np.maximum(a, 0), np.maximum(b, 0))
    )
    # Towards the body's middle line, by the radius at most.
    middle = 0.5 * (body.front_m - body.rear_m)
    reach = max(0.5 * (body.front_m + body.rear_m) - body.half_width_m, 0.0)
    au, av = np.clip(u, middle - reach, middle + reach) - u, -v
    length = np.hypot(au, av)
    share = np.minimum(_INSIDE * radius / np.where(length > 0.0, length, 1.0), 1.0)
    au, av = share * au, share * av
    return distance - radius, px + c * au - s * av, py + s * au + c * av


def distance_from_body(
    encounter: Encounter,
    states: tuple[dict[str, float], dict[str, float]],
    point: tuple[float, float],
) -> float:
    """Proved upper bound of the signed distance of `point` (m) from the body, for every state
    between states[0] and states[1]; inf where none was found."""
    places = encounter.ground.places(*states)
    body = encounter.body
    distance, ok = distance_function()(
        places.lower, places.upper, places.node, places.curvature,
        [body.front_m, body.rear_m, body.half_width_m], list(point),
    )  # fmt: skip
    return float(distance) if float(ok) == 1.0 else math.inf


def in_disc(person: Person, point: tuple[float, float], time_s: float) -> bool:
    """Whether `point` lies in the person's disc at `time_s`, decided without rounding."""
    x, y, vx, vy, radius, growth, growth2 = (Fraction(number) for number in person.numbers)
    t = Fraction(time_s)
    reach = radius + growth * t + growth2 * t * t / 2
    dx, dy = Fraction(point[0]) - (x + vx * t), Fraction(point[1]) - (y + vy * t)
    return reach >= 0 and dx * dx + dy * dy <= reach * reach
