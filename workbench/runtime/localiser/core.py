"""The localiser's core: frames in, one car's estimate, localisation sets out; no clock of its own.

It is driven by the loop that drives the monitor's core, and never commands a vehicle.
"""

from __future__ import annotations

import enum
import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, final

from workbench.runtime.localiser.car import Car, Status
from workbench.runtime.localiser.numbers import Clocks, Numbers
from workbench.runtime.localiser.range_stream import RangeSeen, RangeStream
from workbench.runtime.localiser.sets import initial_set, localised, possible_set
from workbench.runtime.localiser.steps import Steps
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.report_names import report_names
from workbench.runtime.onboard.states import Request, State
from workbench.runtime.onboard.times import SEND_US, TURN_US, seconds
from workbench.runtime.onboard.turns import TurnResult
from workbench.runtime.protocols import Refusal, decode, load_protocol, localisation_frames
from workbench.runtime.protocols.ranges import ranges_protocol

REPORT_AGE_US: Final = 200_000
"""Longest time between two reports of speed, or of steering: what the car did in a longer one is
not known."""
_SAMPLE_GAP_US: Final = 10_000
# So many messages may wait; a bus that carries more is flooded.
_MOST_WAITING: Final = 512
_SETS: Final = 256


class Silence(enum.Enum):
    """Why no set is sent."""

    UNPLACED = "the car has not been placed"
    LOST = "ranges contradict the estimate, or none was accepted for too long"
    UNREPORTED = "speed or steering is not reported"
    NOT_FINITE = "the estimate is not finite"
    UNSENDABLE = "the set does not fit into its frames"


@final
@dataclass(slots=True)
class Tally:
    """What has happened so far. reports: used; refused_reports: of speed and steering, not to be
    used; early: reports that came too soon after the one before; dropped: messages beyond what may
    wait; backwards: frames before the last one's
    instant; sets, unobserved: sent, with the heading and without; begun: how often the estimate was
    begun anew, by its reason; bus_errors."""

    reports: int = 0
    refused_reports: int = 0
    early: int = 0
    dropped: int = 0
    backwards: int = 0
    sets: int = 0
    unobserved: int = 0
    begun: dict[Silence, int] = field(default_factory=dict)
    bus_errors: int = 0


@final
@dataclass(frozen=True, slots=True, order=True)
class _Message:
    """What was measured at an instant; number: order of arrival; place: a beacon, or a report's."""

    at_us: int
    number: int
    place: int
    value: float


_SPEED, _STEERING = -1, -2


def behind_us(clocks: Clocks) -> tuple[int, int]:
    """Least and most from a set's stamp until its last frame is on the bus: messages wait until
    none that is older can come, and the loop sends within SEND_US and a gap."""
    settle_us = max(clocks.stamps(LONGEST_WAIT_US).delay_us[1], clocks.report_delay_us)
    return settle_us, settle_us + SEND_US + 1_000


@final
class LocaliserCore:
    """Everything between frames and frames; instants are of the receiver's monotonic clock, us.

    level: of the set that is sent, one of the numbers' levels; period_us: least time between two
    sets. Messages wait until nothing older can come that would still be used, then they are taken
    in the order of their instants. Nothing here raises, whatever frames hold.
    """

    def __init__(self, numbers: Numbers, steps: Steps, *, level: float, period_us: int) -> None:
        self._numbers, self._steps = numbers, steps
        self._level, self._deviations = level, numbers.deviations(level)
        self._period_us = period_us
        self._vehicle = load_protocol(numbers.vehicle.protocol)
        self._own = ranges_protocol()
        names = report_names(self._vehicle)
        self._places = {
            names.speed.message: (names.speed.signal, _SPEED),
            names.steering.output.message: (names.steering.output.signal, _STEERING),
        }
        bounds = numbers.clocks.stamps(LONGEST_WAIT_US)
        self._settle_us, _ = behind_us(numbers.clocks)
        self.ranges = RangeStream(bounds, beacons=len(numbers.site.beacons))
        self._waiting: list[_Message] = []
        self._arrived = 0
        self._came_us: dict[int, int] = {}
        self._reported_us: dict[int, int] = {}
        self._settled_us = -self._settle_us
        self._last_us: int | None = None
        self._sent_us: int | None = None
        self._number = -1
        self._why = Silence.UNREPORTED
        self.car: Car | None = None
        self.tally = Tally()
        self.said: Status | Silence = Silence.UNREPORTED

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame that came by at_us."""
        if self._last_us is not None and at_us < self._last_us:
            self.tally.backwards += 1
            return
        self._last_us = at_us
        if identifier in self._own.by_id:
            seen = self.ranges.take(decode(self._own, identifier, data), at_us)
            if isinstance(seen, RangeSeen):
                self._put(seen.at_us, seen.beacon, seen.range_m)
            return
        message = self._vehicle.by_id.get(identifier)
        if message is None or message.name not in self._places:
            return
        signal, place = self._places[message.name]
        frame = decode(self._vehicle, identifier, data)
        value = math.nan if isinstance(frame, Refusal) else self._value(place, frame.values[signal])
        if not math.isfinite(value):
            self.tally.refused_reports += 1
            return
        before_us = self._came_us.get(place)
        if before_us is not None and at_us - before_us < _SAMPLE_GAP_US:
            self.tally.early += 1
            return
        self._came_us[place] = at_us
        self.tally.reports += 1
        self._put(at_us - self._numbers.clocks.report_delay_us, place, value)

    def bus_error(self, kind: BusError, at_us: int) -> None:  # noqa: ARG002
        """The bus failed; what was lost shows as a gap."""
        self.tally.bus_errors += 1

    def request(self, request: Request, at_us: int) -> None:
        """Nobody asks a localiser anything; the loop says here that it is to end."""

    def turn(self, at_us: int, clock: Callable[[], int]) -> TurnResult:  # noqa: ARG002
        """Take what has settled, and make a set's frames when they are due."""
        self._settle(at_us - self._settle_us)
        events: tuple[str, ...] = ()
        said, frames = self._sending(at_us)
        if said is not self.said:
            events, self.said = (f"{said.name}: {said.value}",), said
        # The loop ends at once when it is asked to: this program holds no vehicle.
        return TurnResult(at_us, frames, State.DISARMED, None, None, None, (), events)

    def _value(self, place: int, reported: float) -> float:
        """A report in the filter's terms, NaN where it cannot be."""
        vehicle = self._numbers.vehicle
        if place == _SPEED:
            return reported / (1.0 + vehicle.speed_scale)
        return vehicle.road_wheel.middle(reported) - vehicle.steering_zero_rad

    def _put(self, at_us: int, place: int, value: float) -> None:
        if len(self._waiting) >= _MOST_WAITING:
            self.tally.dropped += 1
            return
        self._arrived += 1
        heapq.heappush(self._waiting, _Message(at_us, self._arrived, place, value))

    def _settle(self, until_us: int) -> None:
        """Take what was measured until then, in the order of its instants."""
        while self._waiting and self._waiting[0].at_us <= until_us:
            message = heapq.heappop(self._waiting)
            # None is older: a range that came later than it may is refused, and reports have one
            # delay. `max` keeps the order whatever instants the caller gives.
            self._settled_us = max(self._settled_us, message.at_us)
            self._check(self._settled_us)
            self._take(message, self._settled_us)
        self._settled_us = max(self._settled_us, until_us)
        self._check(until_us)
        if self.car is not None:
            self.car.moved_on(at_s=seconds(self._settled_us))

    def _check(self, at_us: int) -> None:
        """Give up an estimate that cannot be believed at that instant."""
        if self.car is None:
            return
        if at_us - min(self._reported_us.values()) > REPORT_AGE_US:
            self._give_up(Silence.UNREPORTED)
        elif self.car.status(now_s=seconds(at_us)) is Status.LOST:
            self._give_up(Silence.LOST)

    def _give_up(self, reason: Silence) -> None:
        self.car, self._why = None, reason
        self.tally.begun[reason] = self.tally.begun.get(reason, 0) + 1

    def _take(self, message: _Message, at_us: int) -> None:
        at_s, place = seconds(at_us), message.place
        if place >= 0:
            if self.car is not None:
                self.car.ranged(at_s=at_s, beacon=place, range_m=message.value)
            return
        if self.car is None:
            self.car = Car(self._numbers.site, self._steps, at_s=at_s)
            self._reported_us = dict.fromkeys((_SPEED, _STEERING), at_us)
        self._reported_us[place] = at_us
        self.car.reported(
            at_s=at_s, commands=None,
            speed_mps=message.value if place == _SPEED else None,
            steering_rad=message.value if place == _STEERING else None,
        )  # fmt: skip

    def _sending(self, at_us: int) -> tuple[Status | Silence, tuple[Frame, ...]]:
        """What is known, and the frames that say so if a set is due."""
        if self.car is None:
            return self._why, ()
        status = self.car.status(now_s=seconds(at_us))
        if status in _SILENT:
            return _SILENT[status], ()
        if self._sent_us is not None and at_us - self._sent_us < self._period_us - TURN_US // 2:
            return status, ()
        known = status is Status.VALID
        found = (initial_set if known else possible_set)(
            self.car, now_s=seconds(at_us), level=self._level, deviations=self._deviations
        )
        if found is None:
            self._give_up(Silence.NOT_FINITE)
            return self._why, ()
        number = (self._number + 1) % _SETS
        frames = localisation_frames(localised(found, number=number), heading_observed=known)
        if isinstance(frames, Refusal):
            return Silence.UNSENDABLE, ()
        self._number, self._sent_us = number, at_us
        self.tally.sets += known
        self.tally.unobserved += not known
        return status, tuple(Frame(identifier, data) for identifier, data in frames)


_SILENT: Final = {Status.UNPLACED: Silence.UNPLACED, Status.LOST: Silence.LOST}
