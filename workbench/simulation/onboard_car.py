"""A car with PACMod 2 on a straight road, its sensors and a crowd, as frames on the bus."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, final

from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.path import PathTable
from workbench.runtime.protocols import (
    Localised,
    PeopleSeen,
    PersonKind,
    Refusal,
    SentPerson,
    Way,
    intent_frames,
    localisation_frames,
    people_frames,
)
from workbench.simulation.pacmod2_unit import Outputs, Pacmod2Unit, maker_frame

REPORT_US: Final = 33_333
LOCALISED_US: Final = 333_333
PEOPLE_US: Final = 200_000
VIN_US: Final = 1_000_000
_SENSOR_DELAY_US: Final = 25_000
_CLOCK_US: Final = 7_000_000
"""By so much the sensors' clock is ahead of ours."""
_STEP_US: Final = 5_000
_SPACING_M: Final = 0.5
# Radii that are sent; the measured values are those of the car.
_PLACE_M, _HEADING_RAD, _SPEED_MPS = 0.1, 0.02, 0.1
_BODY_M, _ERROR_M, _VELOCITY_MPS = 0.3, 0.2, 0.1
_KNOT_S, _KNOTS = 0.5, 12
_ASIDE_M: Final = 0.3
_BUILD_UP_S: Final = 0.08
_WHEEL_RADPS: Final = 6.0


class Sent(NamedTuple):
    """A frame on the bus and when."""

    at_us: int
    identifier: int
    data: bytes


def straight_road(from_m: float, to_m: float) -> PathTable:
    """Along x, a node every half metre; at least 200 of them."""
    count = max(200, math.ceil((to_m - from_m) / _SPACING_M) + 1)
    zeros = (0.0,) * count
    nodes = tuple(from_m + _SPACING_M * j for j in range(count))
    return PathTable(from_m, _SPACING_M, nodes, zeros, zeros, zeros[1:], zeros[1:])


@final
@dataclass(frozen=True, slots=True)
class Crowd:
    """People all along the road, each at a place of their own every `every_m` of it.

    aside_m: how far beside the path they stand, left and right by turns; every `crossing`-th walks
    to and fro across it, aside_m to either side, within cycle_s.
    """

    every_m: float = 5.5
    aside_m: float = 5.0
    crossing: int = 6
    cycle_s: float = 30.0

    def around(self, x_m: float, radius_m: float, at_us: int) -> list[SentPerson]:
        """Everybody within a disc about a point of the road."""
        first = math.ceil((x_m - radius_m) / self.every_m)
        last = math.floor((x_m + radius_m) / self.every_m)
        found = [self._person(k, at_us) for k in range(first, last + 1)]
        return [each for each in found if math.hypot(each.x_m - x_m, each.y_m) <= radius_m]

    def ways(self, people: Sequence[SentPerson], at_us: int) -> dict[int, list[Way]]:
        """What they may want, by track, from an instant on: to go on as they will, and, of those
        who cross, to stop where they are; _ASIDE_M holds what lies beside the line between two
        knots, and how far they go before they stand."""
        found = {}
        for person in people:
            k = round(person.x_m / self.every_m)
            knots = [self._person(k, at_us + round(_KNOT_S * 1e6) * j) for j in range(_KNOTS)]
            wanted = [knots] if k % self.crossing else [knots, knots[:1] * _KNOTS]
            found[person.track] = [
                tuple((at.x_m, at.y_m, _BODY_M + _ERROR_M + _ASIDE_M) for at in way)
                for way in wanted
            ]
        return found

    def _person(self, k: int, at_us: int) -> SentPerson:
        y_m, speed_mps = self.aside_m * (1 - 2 * (k % 2)), 0.0
        if k % self.crossing == 0:
            rate = math.tau / self.cycle_s
            phase = rate * at_us / 1e6 + k
            y_m, speed_mps = self.aside_m * math.sin(phase), self.aside_m * rate * math.cos(phase)
        return SentPerson(
            k % 65_536, PersonKind.ON_FOOT, self.every_m * k, y_m, _BODY_M + _ERROR_M, 0.0,
            speed_mps, _VELOCITY_MPS, 0.0,
        )  # fmt: skip


@final
@dataclass(slots=True)
class OnboardCar:
    """Its true state about the middle of the rear axle, what it was told, and what is due.

    The pedals do what the middle of the vehicle's maps says and come up within 80 ms, the wheel
    turns at the rate it is told, everything at once: what is measured with it are times and memory,
    not proofs. Reports come at 30 Hz, localisation at 3 Hz, people at 5 Hz. sends_ways: what people
    may want comes after them.
    """

    settings: OnboardSettings
    crowd: Crowd
    x_m: float = 0.0
    y_m: float = 0.0
    heading: float = 0.0
    watched_m: float = 20.0
    sends_ways: bool = False
    speed_mps: float = 0.0
    wheel_rad: float = 0.0
    accel: float = 0.0
    brake: float = 0.0
    now_us: int = 0
    _unit: Pacmod2Unit = field(default_factory=Pacmod2Unit)
    _due_us: dict[str, int] = field(
        default_factory=lambda: {"reports": 4_000, "place": 40_000, "people": 90_000, "vin": 7_000}
    )

    def hear(self, identifier: int, data: bytes) -> None:
        """A frame of whoever commands it."""
        self._unit.hear(identifier, data, self.now_us)

    def until(self, at_us: int) -> Iterator[Sent]:
        """Lets the car go on until an instant, and what was sent on the way there."""
        while self.now_us < at_us:
            step_us = min(_STEP_US, at_us - self.now_us)
            self.now_us += step_us
            self._step(step_us / 1e6)
            for name, due_us in self._due_us.items():
                if due_us <= self.now_us:
                    self._due_us[name] = due_us + _PERIODS_US[name]
                    yield from (Sent(self.now_us, *frame) for frame in self._frames(name))

    def _step(self, step_s: float) -> None:
        pedals, steering = self.settings.drive_by_wire.pedals, self.settings.drive_by_wire.steering
        told, most = self._unit.commands(self.now_us), step_s / _BUILD_UP_S
        self.accel += _clipped(told.get("ACCEL_CMD", 0.0) - self.accel, most)
        self.brake += _clipped(told.get("BRAKE_CMD", 0.0) - self.brake, most)
        short_rad = told.get("POSITION_VALUE", self.wheel_rad) - self.wheel_rad
        turns_radps = min(told.get("SPEED_LIMIT", 0.0), _WHEEL_RADPS)
        self.wheel_rad += _clipped(short_rad, turns_radps * step_s)
        least, release = pedals.accelerator.commands[0], pedals.brake.commands[0]
        push = pedals.accelerator.middle(self.accel) if self.accel >= least else 0.0
        push -= pedals.brake.middle(self.brake) if self.brake >= release else 0.0
        speed = max(self.speed_mps + push * step_s, 0.0)
        way = 0.5 * (speed + self.speed_mps) * step_s
        road_rad = steering.road_wheel.middle(self.wheel_rad)
        wheelbase_m = sum(self.settings.sensors.wheelbase_m) / 2.0
        turn = way * math.tan(road_rad) / wheelbase_m
        self.x_m += way * math.cos(self.heading + 0.5 * turn)
        self.y_m += way * math.sin(self.heading + 0.5 * turn)
        self.heading += turn
        self.speed_mps = speed

    def _frames(self, name: str) -> list[tuple[int, bytes]]:
        if name == "reports":
            outputs = Outputs(self.accel, self.brake, self.wheel_rad, self.speed_mps)
            return self._unit.reports(outputs, self.now_us)
        if name == "vin":
            return [maker_frame(self.settings.maker)]
        measured_us = self.now_us - _SENSOR_DELAY_US
        stamp_s = (measured_us + _CLOCK_US) / 1e6
        if name == "place":
            frames = localisation_frames(self._localised(stamp_s))
            assert not isinstance(frames, Refusal), frames
            return list(frames)
        number = self._due_us[name] // PEOPLE_US % 256
        people = self.crowd.around(self.x_m, self.watched_m + 1.0, measured_us)
        return self._people(PeopleSeen(number, stamp_s, self.watched_m, tuple(people)))

    def _people(self, seen: PeopleSeen) -> list[tuple[int, bytes]]:
        frames = people_frames(
            seen.people, number=seen.number, stamp_s=seen.stamp_s,
            watched_radius_m=seen.watched_radius_m,
        )  # fmt: skip
        assert not isinstance(frames, Refusal), frames
        if not self.sends_ways:
            return list(frames)
        ways = self.crowd.ways(seen.people, round(seen.stamp_s * 1e6) - _CLOCK_US)
        sent = intent_frames(seen, ways, knot_period_s=_KNOT_S)
        assert not isinstance(sent, Refusal), sent
        return [*frames, *sent.frames]

    def _localised(self, stamp_s: float) -> Localised:
        back_m = self.speed_mps * _SENSOR_DELAY_US / 1e6
        return Localised(
            number=self._due_us["place"] // LOCALISED_US % 256,
            stamp_s=stamp_s,
            x_m=self.x_m - back_m * math.cos(self.heading),
            y_m=self.y_m - back_m * math.sin(self.heading),
            heading_rad=math.remainder(self.heading, math.tau),
            speed_mps=self.speed_mps,
            x_radius_m=_PLACE_M,
            y_radius_m=_PLACE_M,
            heading_radius_rad=_HEADING_RAD,
            speed_radius_mps=_SPEED_MPS,
        )


_PERIODS_US: Final = {
    "reports": REPORT_US, "place": LOCALISED_US, "people": PEOPLE_US, "vin": VIN_US,
}  # fmt: skip


def _clipped(value: float, most: float) -> float:
    return min(max(value, -most), most)
