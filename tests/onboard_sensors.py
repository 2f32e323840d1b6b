"""Sensors in virtual time, within stated bounds and as unlucky as they may be."""

from __future__ import annotations

import bisect
import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from onboard_truth import GRID_US, Car, CarState, Walker, unlucky

from workbench.runtime.arc import Interval
from workbench.runtime.onboard.sensor_bounds import PersonBounds, SensorBounds
from workbench.runtime.onboard.stamps import StampBounds
from workbench.runtime.person_guard import MotionLimits
from workbench.runtime.protocols import (
    Localised,
    PersonKind,
    Refusal,
    SentPerson,
    encode,
    load_protocol,
    localisation_frames,
    people_frames,
)

OWN = load_protocol("workbench")
PACMOD2 = load_protocol("pacmod2")
STEERING_RATIO = 20.0
Frame = tuple[int, int, bytes]
"""Arrival (us), identifier, bytes."""
Radii = tuple[float, float, float, float]


def road_wheel(angle_rad: float) -> Interval:
    """2 % around a twentieth of the steering wheel's angle."""
    ends = (0.98 * angle_rad / STEERING_RATIO, 1.02 * angle_rad / STEERING_RATIO)
    return min(ends), max(ends)


BOUNDS = SensorBounds(
    stamps=StampBounds(delay_us=(1_000, 20_000), drift_ppm=200, window_us=5_000_000),
    report_delay_us=(0, 15_000),
    speed_gain=(0.99, 1.01),
    speed_error_mps=0.03,
    speed_range_mps=(-1.0, 8.0),
    acceleration_mps2=(-3.0, 2.0),
    steering_wheel_error_rad=0.02,
    steering_wheel_limit_rad=13.0,
    road_wheel=road_wheel,
    steering_limit_rad=0.6,
    steering_rate_radps=0.4,
    wheelbase_m=(1.70, 1.80),
    on_foot=PersonBounds(MotionLimits(2.5, 1.5), 0.1),
    on_wheels=PersonBounds(MotionLimits(7.0, 3.0), 0.2),
    unseen_speed_mps=7.0,
    localisation_age_us=1_200_000,
    people_age_us=1_200_000,
    report_age_us=100_000,
)
"""Of everything that is drawn here."""


@dataclass(frozen=True)
class SenderClock:
    """A clock that is ahead_us behind ours at our zero and runs slower by drift_ppm."""

    behind_us: int
    drift_ppm: float

    def reads_s(self, at_us: float) -> float:
        """What it shows at an instant of ours."""
        return (at_us - self.behind_us - self.drift_ppm * 1e-6 * at_us) / 1e6


@dataclass
class Sender:
    """Counts its sets and delays their frames, which stay in order."""

    dice: random.Random
    clock: SenderClock
    delay_us: tuple[int, int]
    number: int = field(default=0)
    late_us: int = 0

    def delayed(self, at_us: int, frames: Sequence[tuple[int, bytes]]) -> Iterator[Frame]:
        """The frames of a set that is stamped now, with their arrivals."""
        least, most = self.delay_us
        arrival = at_us + self.late_us
        arrival += self.dice.choice((least, most, self.dice.randint(least, most)))
        for identifier, data in frames:
            yield arrival, identifier, data
            arrival += self.dice.randint(230, 300)

    def counted(self) -> int:
        """The next set's number."""
        self.number = (self.number + 1) % 256
        return self.number


def localisation(
    sender: Sender, car: CarState, at_us: int, *, radii: Radii, errors: Radii
) -> Iterator[Frame]:
    """The frames of a localisation of the car as it is now; both: x, y, heading, speed."""
    heading = math.remainder(car.heading_rad + errors[2], math.tau)
    frames = localisation_frames(
        Localised(
            number=sender.counted(),
            stamp_s=sender.clock.reads_s(at_us),
            x_m=car.x_m + errors[0],
            y_m=car.y_m + errors[1],
            heading_rad=heading,
            speed_mps=car.speed_mps + errors[3],
            x_radius_m=radii[0],
            y_radius_m=radii[1],
            heading_radius_rad=radii[2],
            speed_radius_mps=radii[3],
        )
    )
    assert not isinstance(frames, Refusal), frames
    return sender.delayed(at_us, frames)


def people(
    sender: Sender, seen: Sequence[SentPerson], at_us: int, *, watched_radius_m: float
) -> Iterator[Frame]:
    """The frames of a set of people that is stamped now."""
    frames = people_frames(
        seen,
        number=sender.counted(),
        stamp_s=sender.clock.reads_s(at_us),
        watched_radius_m=watched_radius_m,
    )
    assert not isinstance(frames, Refusal), frames
    return sender.delayed(at_us, frames)


def pacmod2_reports(
    *, speed_mps: float, wheel_rad: float, commanded_rad: float = 0.0
) -> list[tuple[int, bytes]]:
    """VEHICLE_SPEED_RPT and STEERING_RPT_1 with these values."""
    speed = encode(
        PACMOD2, "VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": speed_mps, "VEHICLE_SPEED_VALID": 1}
    )
    steering = encode(
        PACMOD2,
        "STEERING_RPT_1",
        {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": commanded_rad, "OUTPUT_VALUE": wheel_rad},
    )
    assert isinstance(speed, bytes)
    assert isinstance(steering, bytes)
    return [(0x6F, speed), (0x6E, steering)]


class Scenario:
    """A car, people and sensors by one seed; `frames` come in the order of their arrival."""

    def __init__(self, seed: int, *, standing: bool = False, people: int = 4) -> None:
        dice = self.dice = random.Random(seed)
        bounds = self.bounds = BOUNDS
        self.car = Car(dice, bounds, standing=standing)
        self.gain = dice.choice(bounds.speed_gain)
        self.turn = dice.choice((0.98, 1.02, dice.uniform(0.98, 1.02)))
        self.radii = tuple(dice.uniform(*ends) for ends in _RADII)
        self.local = self._sender()
        self.crowd = self._sender()
        self.watched_radius_m = dice.randint(40, 80) / 2
        self.walkers = [self._walker(track) for track in range(people)]
        self.period_us = dice.choice((100_000, 335_000))
        self.drops = dice.choice((0.0, 0.0, 0.02, 0.1))

    def _sender(self) -> Sender:
        dice, stamps = self.dice, self.bounds.stamps
        drift = dice.choice((-1.0, 1.0, 0.0)) * stamps.drift_ppm
        clock = SenderClock(dice.randint(-400_000_000, -1_000_000), drift)
        return Sender(dice, clock, stamps.delay_us)

    def _walker(self, track: int) -> Walker:
        dice, car = self.dice, self.car.at(0)
        kind = dice.choice((PersonKind.ON_FOOT, PersonKind.ON_WHEELS))
        bounds = self.bounds.on_foot if kind is PersonKind.ON_FOOT else self.bounds.on_wheels
        away, angle = self.watched_radius_m * dice.uniform(0.2, 1.2), dice.uniform(0.0, math.tau)
        x, y = car.x_m + away * math.cos(angle), car.y_m + away * math.sin(angle)
        speed = dice.choice((0.0, 1.0, dice.random())) * bounds.limits.speed_mps
        # Towards the car, more or less.
        aim = angle + math.pi + dice.uniform(-0.5, 0.5)
        place = (x, y, speed * math.cos(aim), speed * math.sin(aim))
        return Walker(dice, track, kind, bounds.limits, [place])

    def frames(self, until_us: int) -> list[Frame]:
        """Everything that arrives, dropped frames left out."""
        found: list[Frame] = []
        local_us, crowd_us = (self.dice.randrange(0, 100_000, GRID_US) for _ in range(2))
        for at_us in range(0, until_us, GRID_US):
            if at_us % 35_000 == 0:
                found += self._reports(at_us)
            if at_us == local_us:
                local_us += self.period_us
                found += self._localisation(at_us)
            if at_us == crowd_us:
                crowd_us += self.dice.choice((100_000, 200_000))
                found += self._people(at_us)
        kept = [frame for frame in found if self.dice.random() >= self.drops]
        return sorted(kept, key=lambda frame: frame[0])

    def _reports(self, at_us: int) -> Iterator[Frame]:
        car, dice, bounds = self.car.at(at_us), self.dice, self.bounds
        speed = (car.speed_mps + unlucky(dice, bounds.speed_error_mps - 0.006)) / self.gain
        wheel = car.steering_rad * STEERING_RATIO / self.turn + unlucky(dice, 0.0194)
        for identifier, data in pacmod2_reports(speed_mps=speed, wheel_rad=wheel):
            delay = bounds.report_delay_us
            yield at_us + dice.choice((*delay, dice.randint(*delay))), identifier, data

    def _localisation(self, at_us: int) -> Iterator[Frame]:
        a, b, c, d = self.radii
        errors = (unlucky(self.dice, a), unlucky(self.dice, b), unlucky(self.dice, c))
        return localisation(
            self.local,
            self.car.at(at_us),
            at_us,
            radii=(a, b, c, d),
            errors=(*errors, unlucky(self.dice, d)),
        )

    def _people(self, at_us: int) -> Iterator[Frame]:
        car = self.car.at(at_us)
        seen = []
        for walker in self.walkers:
            x, y, _, _ = walker.at(at_us)
            if math.hypot(x - car.x_m, y - car.y_m) <= self.watched_radius_m:
                seen.append(self._sent(walker, at_us))
        return people(self.crowd, seen, at_us, watched_radius_m=self.watched_radius_m)

    def _sent(self, walker: Walker, at_us: int) -> SentPerson:
        dice = self.dice
        age_us = min(dice.randrange(0, 300_000, GRID_US), at_us)
        x, y, vx, vy = walker.at(at_us - age_us)
        position, velocity = dice.uniform(0.05, 0.5), dice.uniform(0.0, 0.5)
        off, spun = unlucky(dice, position), unlucky(dice, velocity)
        aim, turned = dice.uniform(0.0, math.tau), dice.uniform(0.0, math.tau)
        return SentPerson(
            track=walker.track,
            kind=walker.kind,
            x_m=x + off * math.cos(aim),
            y_m=y + off * math.sin(aim),
            position_radius_m=position,
            x_speed_mps=vx + spun * math.cos(turned),
            y_speed_mps=vy + spun * math.sin(turned),
            velocity_radius_mps=velocity,
            age_s=age_us / 1e6,
        )


_RADII = ((0.02, 0.3), (0.02, 0.3), (0.005, 0.08), (0.02, 0.2))


def played(
    frames: Sequence[Frame], receive: Callable[[int, bytes, int], None], *, steps_us: Sequence[int]
) -> Iterator[int]:
    """Hands the frames over and stops at each of the instants, after what has arrived by then."""
    arrivals = [frame[0] for frame in frames]
    done = 0
    for now_us in steps_us:
        until = bisect.bisect_right(arrivals, now_us)
        for arrival, identifier, data in frames[done:until]:
            receive(identifier, data, arrival)
        done = until
        yield now_us
