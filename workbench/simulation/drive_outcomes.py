"""What came of a drive through a scenario, whoever drove it, and whether that was expected."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.policies import Ground
from workbench.simulation.scenarios.scenario import Expected, Scenario
from workbench.simulation.scene import Contact, Nearness

WALKING_MPS: Final = 1.5
_STANDS_MPS: Final = 0.05
_JERK_S: Final = 0.2
_ABOUT: Final[Mapping[Expected, frozenset[Ground]]] = {
    Expected.BRAKES: frozenset({Ground.PEOPLE}),
    Expected.BRAKES_BLIND: frozenset({Ground.READING, Ground.TIME}),
    Expected.BRAKES_UNPROVED: frozenset({Ground.MOTION, Ground.REGION}),
}


@final
@dataclass(frozen=True, slots=True)
class Step:
    """One turn: time (s), station (m), speed, acceleration along the body, whether TRACK was what
    was sent, and what stood against it (`Objections`)."""

    t_s: float
    station_m: float
    speed_mps: float
    acceleration_mps2: float
    tracks: bool
    grounds: tuple[Ground, ...]


@final
@dataclass(frozen=True, slots=True)
class DriveOutcome:
    """One drive.

    set_off_s: first TRACK, None without one; brakes: times (s) at which BRAKE came after TRACK
    while the car moved and had not passed; grounds: why, for each of them; passed_s: when it had
    gone passed_m, None if never;
    nearest_m: smallest distance of the moving car to anybody; contact: the first touch while it
    moved; stood_s: time at standstill after it set off and before it passed; way_m; fastest_mps;
    hardest_mps2: strongest deceleration; jerk_mps3: largest change of acceleration over 0.2 s.
    """

    set_off_s: float | None
    brakes: tuple[float, ...]
    grounds: tuple[tuple[Ground, ...], ...]
    passed_s: float | None
    nearest_m: float
    contact: Contact | None
    stood_s: float
    way_m: float
    fastest_mps: float
    hardest_mps2: float
    jerk_mps3: float

    @classmethod
    def of(cls, steps: Sequence[Step], nearness: Nearness, scenario: Scenario) -> DriveOutcome:
        """At least one step."""
        set_off_s = next((step.t_s for step in steps if step.tracks), None)
        passed_s = next((step.t_s for step in steps if step.station_m >= scenario.passed_m), None)
        until_s = math.inf if passed_s is None else passed_s
        since_s = math.inf if set_off_s is None else set_off_s
        brakes = tuple(
            after
            for before, after in itertools.pairwise(steps)
            if before.tracks and not after.tracks and after.t_s < until_s
            and after.speed_mps > _STANDS_MPS
        )  # fmt: skip
        turn_s = steps[1].t_s - steps[0].t_s if len(steps) > 1 else 0.0
        stood = sum(
            step.speed_mps <= _STANDS_MPS for step in steps if since_s <= step.t_s < until_s
        )
        return cls(
            set_off_s, tuple(step.t_s for step in brakes), tuple(step.grounds for step in brakes),
            passed_s, nearness.moving_m, nearness.contact, stood * turn_s,
            steps[-1].station_m - steps[0].station_m,
            max(step.speed_mps for step in steps),
            max(0.0, *(-step.acceleration_mps2 for step in steps)),
            _jerk_mps3(steps, turn_s),
        )  # fmt: skip

    def is_as(self, expected: Expected) -> bool:
        """Whether it is what was expected; see `Expected`."""
        if expected is Expected.COLLIDES:
            return self.contact is not None
        if self.contact is not None:
            return False
        if expected is Expected.ANY:
            return True
        if expected is Expected.STAYS:
            return self.set_off_s is None or self.fastest_mps <= WALKING_MPS
        if self.set_off_s is None:
            return False
        if expected in _ABOUT:
            return any(_ABOUT[expected] & set(each) for each in self.grounds)
        return not self.brakes and self.passed_s is not None

    @property
    def story(self) -> str:
        """In a few words."""
        if self.contact is not None:
            c = self.contact
            return f"touched {c.person} at {c.t_s:.1f} s with {c.speed_mps:.1f} m/s"
        if self.set_off_s is None:
            return "did not set off"
        why = dict.fromkeys(each.value for grounds in self.grounds for each in grounds)
        braked = "did not brake"
        if self.brakes:
            braked = f"braked {len(self.brakes)} times ({', '.join(why) or 'nobody says why'})"
        passed = "never passed" if self.passed_s is None else f"passed at {self.passed_s:.1f} s"
        near = "" if self.nearest_m == math.inf else f", nearest {self.nearest_m:.2f} m"
        return f"{braked}, {passed}{near}"


def _jerk_mps3(steps: Sequence[Step], turn_s: float) -> float:
    apart = max(1, round(_JERK_S / turn_s)) if turn_s > 0.0 else 1
    pairs = zip(steps, steps[apart:], strict=False)
    return max(
        (abs(b.acceleration_mps2 - a.acceleration_mps2) / _JERK_S for a, b in pairs), default=0.0
    )
