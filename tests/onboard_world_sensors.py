"""Who sends localisation and people: clocks that are off and drift, delays, errors within radii."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from onboard_world_plant import Car

from workbench.runtime.protocols import (
    Localised,
    PersonKind,
    Refusal,
    SentPerson,
    localisation_frames,
    people_frames,
)

LOCALISED_US = 333_333
PEOPLE_US = 200_000


@dataclass
class SenderClock:
    """A sensor's own monotonic clock: offset_us at virtual 0, and fast by drift."""

    offset_us: int = 7_000_000
    drift: float = 20e-6

    def stamp_s(self, at_us: int) -> float:
        return (at_us * (1.0 + self.drift) + self.offset_us) / 1e6


@dataclass
class Localiser:
    """Poses at 3 Hz, measured now and sent delay_us later; drops: chance that one is never sent.

    Errors are drawn within the radii that are sent. begin_us: when the first is measured.
    """

    chance: random.Random
    clock: SenderClock = field(default_factory=SenderClock)
    begin_us: int = 40_000
    delay_us: int = 25_000
    drops: float = 0.0
    position_radius_m: float = 0.1
    heading_radius_rad: float = 0.02
    speed_radius_mps: float = 0.1
    number: int = 0

    def measured(self, car: Car, at_us: int) -> Localised | None:
        """What is known of the car now, or None where it is dropped."""
        if self.chance.random() < self.drops:
            return None
        self.number = (self.number + 1) % 256
        x, y, heading, speed = (self.chance.uniform(-0.9, 0.9) for _ in range(4))
        return Localised(
            number=self.number,
            stamp_s=self.clock.stamp_s(at_us),
            x_m=car.x_m + x * self.position_radius_m,
            y_m=car.y_m + y * self.position_radius_m,
            heading_rad=_wrapped(car.heading + heading * self.heading_radius_rad),
            speed_mps=car.speed_mps + speed * self.speed_radius_mps,
            x_radius_m=self.position_radius_m,
            y_radius_m=self.position_radius_m,
            heading_radius_rad=self.heading_radius_rad,
            speed_radius_mps=self.speed_radius_mps,
        )


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


@dataclass
class Walker:
    """Somebody who walks straight on."""

    track: int
    x_m: float
    y_m: float
    x_speed_mps: float = 0.0
    y_speed_mps: float = 0.0

    def at(self, at_us: int) -> tuple[float, float]:
        return (
            self.x_m + self.x_speed_mps * at_us / 1e6,
            self.y_m + self.y_speed_mps * at_us / 1e6,
        )


@dataclass
class Tracker:
    """Everybody at 5 Hz, measured now and sent delay_us later."""

    chance: random.Random
    walkers: list[Walker] = field(default_factory=list)
    clock: SenderClock = field(default_factory=lambda: SenderClock(8_500_000, -15e-6))
    begin_us: int = 90_000
    delay_us: int = 40_000
    watched_m: float = 60.0
    position_radius_m: float = 0.2
    velocity_radius_mps: float = 0.1
    number: int = 0

    def measured(self, at_us: int) -> list[tuple[int, bytes]]:
        """The frames of everybody there is now."""
        self.number = (self.number + 1) % 256
        frames = people_frames(
            [self._seen(walker, at_us) for walker in self.walkers],
            number=self.number,
            stamp_s=self.clock.stamp_s(at_us),
            watched_radius_m=self.watched_m,
        )
        assert not isinstance(frames, Refusal), frames
        return list(frames)

    def _seen(self, walker: Walker, at_us: int) -> SentPerson:
        (x, y), radius = walker.at(at_us), self.position_radius_m
        turn, far = self.chance.uniform(0.0, math.tau), self.chance.uniform(0.0, 0.9) * radius
        return SentPerson(
            track=walker.track,
            kind=PersonKind.ON_FOOT,
            x_m=x + far * math.cos(turn),
            y_m=y + far * math.sin(turn),
            # The body of the person, 0.3 m, and the error.
            position_radius_m=0.3 + radius,
            x_speed_mps=walker.x_speed_mps,
            y_speed_mps=walker.y_speed_mps,
            velocity_radius_mps=self.velocity_radius_mps,
            age_s=0.0,
        )


def framed_localisation(localised: Localised) -> list[tuple[int, bytes]]:
    frames = localisation_frames(localised)
    assert not isinstance(frames, Refusal), frames
    return list(frames)
