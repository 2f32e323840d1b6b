"""A localiser's core under the monitor's loop, on a bus in virtual time, in a generated hall."""

from __future__ import annotations

import dataclasses
import functools
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from localisation_cases import USUAL, WHEELBASE_M, hall
from onboard_world_bus import Delivered, Frame, Port, Timeline, VirtualBus, VirtualClock
from onboard_world_plant import PACMOD2, framed

from workbench.codegen.localiser import LocaliserSpec, localiser_files
from workbench.estimation.localisation_sets import EllipsoidHull
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_world import Drive, Faults, Leg, generated_drive
from workbench.models.vehicle import gem_e2_drive_path, load_vehicle
from workbench.runtime.localiser.core import LocaliserCore
from workbench.runtime.localiser.folder import LIBRARY_FILE
from workbench.runtime.localiser.native_steps import native_steps
from workbench.runtime.localiser.numbers import NUMBERS_FILE, Clocks, Vehicle, numbers_from_json
from workbench.runtime.localiser.steps import Steps
from workbench.runtime.onboard.loop import Counts, Loop
from workbench.runtime.protocols import (
    Decoded,
    LocalisationSet,
    Localised,
    NoSet,
    decode,
    load_protocol,
    worst_rounding,
)
from workbench.runtime.protocols.ranges import SentRange, range_frame

OWN = load_protocol("workbench")
ROAD_WHEEL = load_vehicle(gem_e2_drive_path()).drive_by_wire.value.steering.road_wheel  # type: ignore[union-attr]
CLOCKS = Clocks(report_delay_us=0, range_delay_us=(500, 20_000), drift_ppm=100)
LEGS = (
    Leg(5.0, 0.0, 0.0), Leg(10.0, 2.0, 0.0), Leg(16.0, 2.5, 0.22), Leg(24.0, 0.0, 0.1),
    Leg(30.0, 2.5, -0.22),
)  # fmt: skip
# So near its end that the sender's stamp wraps during every drive.
_FIRST_STAMP = 2**24 - 120_000
_DRIFT = 1.0 + 50e-6
Bend = Callable[[int, SentRange], Sequence[tuple[int, SentRange]]]


def unheard() -> Site:
    """The hall for a program that does not hear the driver's commands."""
    motion = dataclasses.replace(hall().motion, acceleration=1.0, steering_rate=0.2)
    return dataclasses.replace(hall(), motion=motion)


@functools.cache
def spec() -> LocaliserSpec:
    vehicle = Vehicle(
        name="test car", protocol="pacmod2", wheelbase_m=WHEELBASE_M, road_wheel=ROAD_WHEEL,
        speed_scale=0.0, steering_zero_rad=0.0,
    )  # fmt: skip
    return LocaliserSpec(unheard(), vehicle, CLOCKS, EllipsoidHull(), 0.99)


@functools.cache
def files() -> dict[str, bytes]:
    return localiser_files(spec())


@functools.cache
def steps() -> Steps:
    return native_steps(files()[LIBRARY_FILE])


def core(level: float = 0.99, period_us: int = 100_000) -> LocaliserCore:
    numbers = numbers_from_json(files()[NUMBERS_FILE])
    return LocaliserCore(numbers, steps(), level=level, period_us=period_us)


@functools.cache
def drives(cars: int, seed: int, legs: tuple[Leg, ...] = LEGS, faults: Faults = USUAL) -> Drive:
    return generated_drive(hall(), legs, faults, cars=cars, wheelbase_m=WHEELBASE_M, seed=seed)


class Notes:
    """What the loop says of each turn."""

    def __init__(self) -> None:
        self.turns: list[Any] = []

    def before(self) -> tuple[()]:
        return ()

    def turned(self, result: Any, counts: Counts) -> None:
        self.turns.append(result)


class Road:
    """One car of a drive, its reports and ranges on a bus, and a localiser that hears them.

    bend: what becomes of a range before it is sent: (later by us, frame) of each that is; silent:
    a span (s) without the reports in mute. heard: every whole set with the instant of its last bit.
    """

    def __init__(
        self, core: LocaliserCore, drive: Drive, car: int, *, bend: Bend | None = None,
        silent: tuple[float, float] = (math.inf, math.inf),
        mute: Sequence[str] = ("VEHICLE_SPEED_RPT", "STEERING_RPT_1"),
    ) -> None:  # fmt: skip
        self.core, self.drive, self.car = core, drive, car
        self.chance = random.Random(1000 + car)
        self.timeline = Timeline()
        self.bus = VirtualBus(self.timeline)
        self.port = Port(self.timeline, self.bus, "localiser")
        self.notes = Notes()
        self.loop = Loop(
            core, self.port, open_bus=self.port.reopened, sends=True,
            clock=VirtualClock(self.timeline), surroundings=self.notes,
        )  # fmt: skip
        self.bend, self.silent, self.mute = bend, silent, mute
        self.number = 0
        self.sets = LocalisationSet()
        self.heard: list[tuple[int, Localised]] = []
        self.unobserved: list[int] = []
        self.bus.hears.append(self._hear)
        for k, time in enumerate(drive.times_s):
            self.timeline.at(round(time * 1e6), functools.partial(self._report, k))

    def run(self, until_s: float) -> Road:
        while self.timeline.now_us < until_s * 1e6:
            assert self.loop.once() is None
        return self

    def put(self, sender: str, identifier: int, data: bytes) -> None:
        self.bus.send(Frame(sender, identifier, data))

    def _report(self, k: int) -> None:
        drive, car, time = self.drive, self.car, self.drive.times_s[k]
        wheel = ROAD_WHEEL.command_for(float(drive.steering_rad[k, car]))
        said = {
            "VEHICLE_SPEED_RPT": {"VEHICLE_SPEED": float(drive.speed_mps[k, car]),
                                  "VEHICLE_SPEED_VALID": 1},
            "STEERING_RPT_1": {"MANUAL_INPUT": 0.0, "COMMANDED_VALUE": 0.0, "OUTPUT_VALUE": wheel},
        }  # fmt: skip
        muted = self.mute if self.silent[0] <= time < self.silent[1] else ()
        for name, values in said.items():
            if name not in muted:
                self.put("pacmod", PACMOD2.by_name[name].frame_id, framed(name, values))
        for beacon, value in enumerate(drive.ranges_m[k, car].tolist()):
            if k % 10 == 0 and (math.isfinite(value) or beacon == 0):
                stamp = (_FIRST_STAMP + round(time * _DRIFT * 1e4)) % 2**24
                sent = SentRange(
                    self.number % 256, beacon, value if math.isfinite(value) else None, stamp
                )
                self.number += 1
                now_us = self.timeline.now_us
                bent = [(0, sent)] if self.bend is None else self.bend(now_us, sent)
                for later_us, each in bent:
                    # In the order of their counters, as one sender's frames come.
                    delay_us = 1000 + 900 * beacon + later_us
                    self.timeline.at(now_us + delay_us, functools.partial(self._range, each))

    def _range(self, sent: SentRange) -> None:
        frame = range_frame(sent)
        assert isinstance(frame, tuple), frame
        self.put("beacons", *frame)

    def _hear(self, delivered: Delivered) -> None:
        if delivered.frame.sender != "localiser":
            return
        frame = decode(OWN, delivered.frame.identifier, delivered.frame.data)
        if not isinstance(frame, Decoded):
            assert frame.signal == "HEADING_OBSERVED", frame
            self.unobserved.append(delivered.at_us)
        before, self.sets = self.sets, self.sets.taking(frame)
        outcome = self.sets.outcome
        if not isinstance(outcome, NoSet) and self.sets.frames.completed > before.frames.completed:
            self.heard.append((delivered.at_us, outcome))


def truth_at(drive: Drive, car: int, at_s: float) -> list[float]:
    """x, y, heading, speed between two reports."""
    k = min(int(at_s * 30), len(drive.times_s) - 2)
    part = at_s * 30 - k
    a, b = drive.truth[k, car, :4], drive.truth[k + 1, car, :4]
    return [float(each) for each in a + part * (b - a)]


def holds(found: Localised, truth: Sequence[float]) -> bool:
    """Whether a set as the bus carries it holds a state."""
    said = (
        (found.x_m, found.x_radius_m, "LOC_POSITION", "X"),
        (found.y_m, found.y_radius_m, "LOC_POSITION", "Y"),
        (found.heading_rad, found.heading_radius_rad, "LOC_MOTION", "HEADING"),
        (found.speed_mps, found.speed_radius_mps, "LOC_MOTION", "SPEED"),
    )  # fmt: skip
    inside = []
    for k, (value, radius, message, signal) in enumerate(said):
        off = value - truth[k]
        if k == 2:
            off = math.remainder(off, math.tau)
        inside.append(abs(off) <= radius + 2 * worst_rounding()[(message, signal)])
    return bool(np.all(inside))
