"""What one decision looked like from above: the values that a scene player draws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from workbench.claims import Verdict
from workbench.errors import InputError

Rectangle = tuple[float, float, float, float, float]
Disc = tuple[float, float, float]
Point = tuple[float, float]

# Beyond this nothing belongs to a scene; failed proofs may carry such numbers.
_FAR_M = 1e6


def drawable(shape: Sequence[float]) -> bool:
    """Whether a rectangle or disc is finite and near enough to be part of a picture."""
    return all(math.isfinite(value) and abs(value) < _FAR_M for value in shape)


def _require_drawable(what: str, values: Sequence[float]) -> None:
    if not drawable(values):
        raise InputError(
            f"expected finite numbers within {_FAR_M:g} m for {what}, got {tuple(values)!r}; "
            "leave out what cannot be placed in the plane"
        )


@final
@dataclass(frozen=True, slots=True)
class PersonFrame:
    """A person at one decision, the discs predicted for them, and those of their guard.

    name: label; x_m, y_m: position, m; radius_m: radius of the disc now, m;
    predicted, guarded: discs (x, y, radius) in m, in time order: from now to the horizon, and as
    far as the car needs to stop. wanted: goals by name and their probabilities, () where nobody
    estimated them.
    """

    name: str
    x_m: float
    y_m: float
    radius_m: float
    predicted: tuple[Disc, ...] = ()
    guarded: tuple[Disc, ...] = ()
    wanted: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        _require_drawable(f"person {self.name!r}", (self.x_m, self.y_m, self.radius_m))


@final
@dataclass(frozen=True, slots=True)
class PolicyAnswer:
    """What one policy said, deciding or not: action is "TRACK" or "BRAKE", reason: words."""

    policy: str
    verdict: Verdict
    action: str
    reason: str


@final
@dataclass(frozen=True, slots=True)
class LevelVerdicts:
    """Of one tube ("track", "stop", "brake"): a verdict per nested set, the largest first."""

    tube: str
    verdicts: tuple[Verdict, ...]


@final
@dataclass(frozen=True, slots=True)
class Frame:
    """Everything one decision saw and concluded, in the plane.

    t_s: time of the decision, s. x_m, y_m: reference point (rear axle), m; heading: rad.
    front_m, rear_m: car body ahead of and behind the reference point, m; half_width_m: m.
    speed_mps: m/s. verdict: what the monitor concluded; action: "TRACK" or "BRAKE"; reason: words.
    clearance_m: smallest proved clearance, m; None where nobody is there or nothing is proved.
    occupancy: rectangles (centre x, centre y, heading, half length, half width), one per segment of
    the tube in time order; people: those in view; path: points (x, y) of the followed path, m.
    stop_occupancy: as occupancy, of TRACK and then BRAKE to standstill. sent: what the sender sends
    at t_s, "" where nothing was. policies, levels: what each policy and each nested set said;
    violations: hypotheses that failed, and limits that people broke, in words; alert: the warning
    to a person, None without one.
    decided: False for a turn of the loop that made no decision; what is said of decisions, the
    verdict (INVALID) first, is then empty.
    Raises InputError where a number cannot be placed in the plane; occupancy and predictions may
    hold such numbers, as failed proofs do, and are then left out of pictures.
    """

    t_s: float
    x_m: float
    y_m: float
    heading: float
    front_m: float
    rear_m: float
    half_width_m: float
    speed_mps: float
    verdict: Verdict
    action: str
    reason: str
    clearance_m: float | None
    occupancy: tuple[Rectangle, ...] = ()
    people: tuple[PersonFrame, ...] = ()
    path: tuple[Point, ...] = ()
    stop_occupancy: tuple[Rectangle, ...] = ()
    sent: str = ""
    policies: tuple[PolicyAnswer, ...] = ()
    levels: tuple[LevelVerdicts, ...] = ()
    violations: tuple[str, ...] = ()
    alert: str | None = None
    decided: bool = True

    def __post_init__(self) -> None:
        # A recording's clock may count from anywhere, so its instants may be large.
        if not math.isfinite(self.t_s):
            raise InputError(f"expected finite numbers for the time of a frame, got {self.t_s!r}")
        pose = (self.x_m, self.y_m, self.heading, self.speed_mps)
        _require_drawable("pose and speed of a frame", pose)
        _require_drawable("the car's body", (self.front_m, self.rear_m, self.half_width_m))
        if self.clearance_m is not None and not drawable((self.clearance_m,)):
            raise InputError(
                f"expected a finite clearance or None at {self.t_s} s, got {self.clearance_m!r}; "
                "say None where there is none"
            )
        for point in self.path:
            _require_drawable("a point of the path", point)
