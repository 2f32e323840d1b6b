"""The shipped drive-by-wire, and plants that do what its maps allow, as badly as they may."""

from __future__ import annotations

import functools
import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from workbench.models.vehicle import Vehicle, gem_e2_drive_path, load_vehicle
from workbench.runtime.onboard.actuation import Sent, Wanted, actuate, resting
from workbench.runtime.onboard.commands import Commander, Frame
from workbench.runtime.onboard.drive_by_wire import DriveByWire
from workbench.runtime.onboard.times import SEND_US, seconds
from workbench.runtime.protocols import Decoded, decode, load_protocol

PACMOD2 = load_protocol("pacmod2")
STEP_S = 0.002


@functools.cache
def drive_vehicle() -> Vehicle:
    return load_vehicle(gem_e2_drive_path())


def granted_text(reference_mps: float = 1.2) -> str:
    """The shipped driving file with the shipped sensors' [reading] in its proof.

    A controller that knows its speed within 0.48 m/s needs a higher [brake] stop_speed_mps.
    """
    text = gem_e2_drive_path().read_text(encoding="utf-8")
    for old, new in (
        ("reference_speed_mps = 2.8", f"reference_speed_mps = {reference_mps}"),
        ("stop_speed_mps = 0.2", "stop_speed_mps = 0.5"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text + (
        "\n[uncertainty]\nlateral_m = 0.2\nheading_rad = 0.05\nspeed_mps = 0.48\n"
        'provenance = "the sensors file"\n'
    )


def shipped() -> DriveByWire:
    section = drive_vehicle().drive_by_wire
    assert section is not None
    return section.value


def values(frames: tuple[Frame, ...]) -> dict[str, float]:
    """Every signal of a frame set by name, as the vehicle reads it."""
    said: dict[str, float] = {}
    for frame in frames:
        decoded = decode(PACMOD2, frame.identifier, frame.data)
        assert isinstance(decoded, Decoded), decoded
        said.update(decoded.values)
    return said


def started() -> Sent:
    sent = resting(shipped(), 0.0)
    assert sent is not None
    return sent


def sent_after(wanted: Wanted, *, turns: int, read_back_rad: float = 0.0) -> Sent:
    """What is sent once the slew has let `wanted` through."""
    before = started()
    for _ in range(turns):
        before = actuate(
            shipped(), wanted, read_back_rad=read_back_rad, before=before, elapsed_s=0.033
        ).sent
    return before


@dataclass
class Plant:
    """A vehicle at a corner of what the file allows; sides in [-1, 1], shares in [0, 1].

    pedal_side: where in the bands of the pedals; rate_side: how wrong the wheel's rate is;
    report_side: how wrong its report; late: which share of delay and build-up it takes. `fault`
    changes what it hears.
    """

    dbw: DriveByWire
    pedal_side: float
    rate_side: float
    report_side: float
    late: float
    fault: Callable[[dict[str, float]], dict[str, float]] = lambda said: said
    wheel_rad: float = 0.0
    rate_radps: float = 0.0
    acceleration_mps2: float = 0.0
    _heard: deque[tuple[float, dict[str, float]]] = field(default_factory=deque)
    _reports: deque[tuple[float, float]] = field(default_factory=deque)

    def hear(self, at_s: float, said: dict[str, float]) -> None:
        self._heard.append((at_s, self.fault(said)))

    def report_rad(self, at_s: float) -> float:
        """The steering wheel as it was, report_age ago, with the report's error."""
        steering = self.dbw.steering
        while len(self._reports) > 1 and self._reports[1][0] <= at_s - steering.report_age_s:
            self._reports.popleft()
        true_rad = self._reports[0][1] if self._reports else self.wheel_rad
        return true_rad + self.report_side * (steering.report_error_rad - 0.0005)

    def _acting(self, at_s: float, longest_s: float) -> dict[str, float]:
        acts = [said for sent_s, said in self._heard if sent_s <= at_s - self.late * longest_s]
        return acts[-1] if acts else self._heard[0][1]

    def step(self, at_s: float) -> None:
        """One step on; the acceleration and the road wheels' rate during it."""
        pedals, steering = self.dbw.pedals, self.dbw.steering
        said = self._acting(at_s, pedals.longest_s)
        self.acceleration_mps2 = self._pedals(said)
        said = self._acting(at_s, steering.longest_s)
        gap = said["POSITION_VALUE"] - self.wheel_rad
        curve = steering.road_wheel
        road_rad = curve.middle(self.wheel_rad)
        if abs(gap) > steering.dead_band_rad:
            # Part of the rate's error goes to the slope of the map, from piece to piece.
            rate = said["SPEED_LIMIT"] * (1.0 + 0.2 * self.rate_side * steering.rate_error)
            self.wheel_rad += math.copysign(min(rate * STEP_S, abs(gap)), gap)
        self.rate_radps = (curve.middle(self.wheel_rad) - road_rad) / STEP_S
        self._reports.append((at_s + STEP_S, self.wheel_rad))
        while len(self._heard) > 1 and self._heard[1][0] < at_s - 0.5:
            self._heard.popleft()

    def _pedals(self, said: dict[str, float]) -> float:
        pedals, side = self.dbw.pedals, 0.5 * (1.0 + self.pedal_side)
        assert said["ACCEL_CMD"] == 0.0 or said["BRAKE_CMD"] == 0.0
        if said["ACCEL_CMD"] > 0.0:
            low, high = pedals.accelerator.at(said["ACCEL_CMD"])
            return low + side * (high - low)
        if said["BRAKE_CMD"] > 0.0:
            low, high = pedals.brake.at(said["BRAKE_CMD"])
            return -(low + side * (high - low))
        low, high = pedals.coast_mps2
        return low + side * (high - low)


@dataclass(frozen=True)
class Worst:
    """Largest differences between wanted and realised over covered turns, and their share; fault:
    why the drive ended early, or ''."""

    acceleration_mps2: float
    steering_rate_radps: float
    covered: float
    fault: str


def drive(plant: Plant, *, seed: int, turns: int = 90) -> Worst:
    """Drive a plant by a random law that moves about as fast as the slew lets it."""
    rng, dbw = random.Random(seed), plant.dbw
    commander, at_s = Commander(dbw), 0.0
    plant.hear(-1.0, values(commander.enable(plant.report_rad(0.0))))
    wanted, worst = Wanted(0.0, 0.0), [0.0, 0.0]
    (elapsed_s, made_s), counted = _pace(rng, dbw), 0
    for turn in range(turns):
        wanted = _next(rng, dbw, wanted, elapsed_s)
        frames = commander.track(
            wanted.acceleration_mps2, wanted.steering_rate_radps,
            read_back_rad=plant.report_rad(at_s), elapsed_s=elapsed_s, made_s=made_s,
        )  # fmt: skip
        assert frames
        assert commander.last is not None
        if commander.last.fault:
            return Worst(worst[0], worst[1], counted / turns, commander.last.fault)
        counts = commander.last.covered and turn > 8
        counted += counts
        # The frames are under way for as long as they may be.
        heard_s, heard = at_s + made_s + rng.choice((0.0, seconds(SEND_US))), False
        elapsed_s, made_s = _pace(rng, dbw)
        end_s = at_s + elapsed_s
        while at_s + STEP_S <= end_s:
            if at_s >= heard_s and not heard:
                plant.hear(at_s, values(frames))
                heard = True
            plant.step(at_s)
            if counts:
                found = (
                    abs(plant.acceleration_mps2 - wanted.acceleration_mps2),
                    abs(plant.rate_radps - wanted.steering_rate_radps),
                )
                worst = [max(pair) for pair in zip(worst, found, strict=True)]
            at_s += STEP_S
    return Worst(worst[0], worst[1], counted / turns, "")


def _pace(rng: random.Random, dbw: DriveByWire) -> tuple[float, float]:
    """How long a turn is, and how long after its begin the next one makes its frames."""
    most_s = dbw.turn_s - seconds(SEND_US)
    elapsed_s = rng.choice((0.8 * most_s, rng.uniform(0.5 * most_s, most_s)))
    return elapsed_s, rng.choice((0.0, rng.uniform(0.0, most_s - elapsed_s), most_s - elapsed_s))


def _next(rng: random.Random, dbw: DriveByWire, wanted: Wanted, elapsed_s: float) -> Wanted:
    pedals, steering = dbw.pedals, dbw.steering
    push = rng.choice((-1.0, 1.0, 0.0, rng.uniform(-1.0, 1.0)))
    turn = rng.choice((-1.0, 1.0, 0.0, rng.uniform(-1.0, 1.0)))
    acceleration = wanted.acceleration_mps2 + push * pedals.slew_mps3 * elapsed_s
    rate = wanted.steering_rate_radps + turn * steering.slew_radps2 * elapsed_s
    limit = steering.rate_limit_radps
    return Wanted(
        min(max(acceleration, pedals.accel_min_mps2), pedals.accel_max_mps2),
        min(max(rate, -limit), limit),
    )
