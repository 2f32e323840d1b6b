"""The localiser of the vehicle on a simulated car's bus: RANGE frames and reports in, sets out."""

from __future__ import annotations

import dataclasses
import itertools
import random
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime.localiser.core import LocaliserCore, behind_us
from workbench.runtime.localiser.folder import Built
from workbench.runtime.onboard.loop import LONGEST_WAIT_US
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.protocols import LocalisationSet, Localised, NoSet, decode, load_protocol
from workbench.simulation.pacmod2_unit import CanFrame
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.range_beacons import RANGED_US, Beacons, RangeErrors
from workbench.simulation.run_up import BEGUN_US, RunUp
from workbench.simulation.scene import Scene

PERIOD_US: Final = 100_000
"""A set ten times a second, as `workbench-localiser` sends by default."""
_CLOCK_US: Final = 7_000_000
"""By so much the localiser's clock is ahead of the monitor's."""
_BEGINS_US: Final = 1_500
_APART_US: Final = 500
_KEPT_US: Final = 500_000
_OWN: Final = load_protocol("workbench")


@final
@dataclass(frozen=True, slots=True)
class Ranging:
    """The localiser as it was built for the vehicle and its site, what becomes of the ranges, and
    the time between two of one beacon.

    errors may be others than the site states: then the sets promise more than they hold.
    elsewhere: the localiser is a process of its own on the same bus.
    """

    built: Built
    errors: RangeErrors
    period_us: int = RANGED_US
    elsewhere: bool = False


def require_heard(ranging: Ranging, settings: OnboardSettings) -> None:
    """Raise InputError unless the monitor allows for the localiser's delay and protocol.

    Nothing on board notices a delay that every set has had from the start.
    """
    numbers, bounds = ranging.built.numbers, settings.sensors.stamps
    behind, allowed = behind_us(numbers.clocks), (
        bounds.delay_us[0], bounds.delay_us[1] - LONGEST_WAIT_US
    )  # fmt: skip
    if not (allowed[0] <= behind[0] and behind[1] <= allowed[1]):
        raise InputError(
            f"localiser: expected a bundle whose sensors file says [clocks] delay_us around "
            f"{list(behind)}, which its sets need, got {list(allowed)}; build the bundle with "
            "another --sensors"
        )
    have, want = numbers.vehicle.protocol, settings.drive_by_wire.protocol
    if have != want:
        raise InputError(
            f"localiser: expected one for {want}, which the bundle drives, got {have}; build it "
            "for the same vehicle"
        )


@final
@dataclass(frozen=True, slots=True)
class Told:
    """One set as the bus carries it, and the car at the instant that it is about (its stamp).

    t_s: the stamp on the scenario's clock; before it begins, below 0.
    """

    t_s: float
    place: Localised
    truth: Motion


@final
class RangedPlace:
    """Beacons, localiser and driver around one car; instants are of the bus, in us.

    core: None where it is elsewhere. told: all sets with a heading so far that the core sent. The
    same ranging, scene and seed give the same frames.
    """

    def __init__(self, ranging: Ranging, scene: Scene, *, seed: int) -> None:
        numbers, wire = ranging.built.numbers, scene.setting.vehicle.drive_by_wire
        assert wire is not None, "who drives has a drive-by-wire"
        chance = random.Random(f"ranges {seed}")
        self.core = None if ranging.elsewhere else LocaliserCore(
            numbers, ranging.built.steps, level=numbers.level, period_us=PERIOD_US
        )  # fmt: skip
        self.told: list[Told] = []
        self._scene = scene
        self._beacons = Beacons(numbers.site, ranging.errors, chance, period_us=ranging.period_us)
        self._driver = RunUp(scene.car, wire.value)
        self._turn_us = chance.randrange(TURN_US)
        self._sets = LocalisationSet()
        self._past: deque[tuple[int, Motion]] = deque()

    def drive(self, at_us: int, duration_us: int) -> None:
        """The run-up goes on for a time, by hand; it begins at 0 and is over at its `BEGUN_US`."""
        self._driver.press(at_us)
        self._scene.car.advance(duration_us)

    def hear(self, identifier: int, data: bytes, at_us: int) -> None:
        """A frame on the bus."""
        if self.core is not None:
            self.core.receive(identifier, data, at_us + _CLOCK_US)

    def due(self, at_us: int, *, silent: bool) -> Iterator[tuple[int, CanFrame]]:
        """What beacons and localiser send by now, and when it is on the bus; silent: no ranges."""
        motion = self._scene.car.motion
        self._past.append((at_us, motion))
        while self._past[0][0] < at_us - _KEPT_US:
            self._past.popleft()
        yield from self._beacons.due(motion, at_us, silent=silent)
        core = self.core
        if core is not None and at_us >= self._turn_us:
            self._turn_us += TURN_US
            result = core.turn(at_us + _CLOCK_US, lambda: at_us + _CLOCK_US)
            for k, frame in enumerate(result.frames):
                yield at_us + _BEGINS_US + k * _APART_US, (frame.identifier, frame.data)
                self._note(frame.identifier, frame.data)

    def _note(self, identifier: int, data: bytes) -> None:
        """Keep a set that is whole with this frame, beside the truth."""
        before = self._sets
        self._sets = before.taking(decode(_OWN, identifier, data))
        found = self._sets.outcome
        if isinstance(found, NoSet) or self._sets.frames.completed == before.frames.completed:
            return
        stamp_us = round(1e6 * found.stamp_s) - _CLOCK_US
        self.told.append(Told((stamp_us - BEGUN_US) / 1e6, found, self._then(stamp_us)))

    def _then(self, at_us: int) -> Motion:
        """The car at an instant, on the line between the two steps around it."""
        for (from_us, one), (until_us, two) in itertools.pairwise(self._past):
            if from_us <= at_us <= until_us:
                part = (at_us - from_us) / (until_us - from_us)
                a, b = dataclasses.astuple(one), dataclasses.astuple(two)
                return Motion(*(x + part * (y - x) for x, y in zip(a, b, strict=True)))
        raise AssertionError("a set is about the last half second")
