"""A core turn by turn: a car that does at once what it is told, its reports, sensors, and changes
to any of them."""

from __future__ import annotations

import copy
import copyreg
import functools
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from onboard_core_cases import DRIVE_BY_WIRE, MAKER, PATH, SENSORS, SETTINGS, bundle, core

from workbench.runtime.onboard.commands import Commander
from workbench.runtime.onboard.core import Core, Mode, Request, State, TurnResult
from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.protocols import (
    PROTOCOLS,
    Decoded,
    Localised,
    PersonKind,
    Refusal,
    SentPerson,
    decode,
    encode,
    load_protocol,
    localisation_frames,
    people_frames,
)

PACMOD2, OWN = load_protocol("pacmod2"), load_protocol("workbench")
LOCALISED_EVERY, PEOPLE_EVERY = 9, 6
BEFORE_US = 5_000
"""Reports come so long before the turn."""
OFFSET_US = 7_000_000
"""Of both senders' clocks."""


def identifier(name: str) -> int:
    return {**PACMOD2.by_name, **OWN.by_name}[name].frame_id


def framed(name: str, values: Mapping[str, float]) -> tuple[int, bytes]:
    protocol = PACMOD2 if name in PACMOD2.by_name else OWN
    data = encode(protocol, name, values)
    assert isinstance(data, bytes), data
    return identifier(name), data


def _view(content: bytes, kind: str) -> memoryview:
    return memoryview(content).cast(kind)  # type: ignore[call-overload,no-any-return]


# A monitor's plan holds rows of the kernel's result; a bench is copied with it.
copyreg.pickle(memoryview, lambda view: (_view, (view.tobytes(), view.format)))


@dataclass
class Bench:
    """Turns of a core, one every TURN_US; `changes` alters the reports' signals, `silent` names
    messages that do not come, `raw` replaces the bytes of some. brakes_badly: the car keeps its
    speed whatever the brake does; gain: of the speed report; pose_x_m: where the car is said to be
    instead; delay_us, jump_us: of the senders' stamps; held_up_us: by how much turns have moved.
    log: every call of the core."""

    core: Core = field(default_factory=core)
    turns: int = 0
    speed_mps: float = 0.0
    x_m: float = 0.0
    enabled: bool = False
    timed_out: bool = True
    told: dict[str, float] = field(
        default_factory=lambda: {"ACCEL": 0.0, "BRAKE": 0.0, "WHEEL": 0.0}
    )
    changes: dict[tuple[str, str], float] = field(default_factory=dict)
    silent: set[str] = field(default_factory=set)
    raw: dict[str, bytes] = field(default_factory=dict)
    people: list[SentPerson] = field(default_factory=list)
    brakes_badly: bool = False
    pose_x_m: float | None = None
    last_x_m: float = 0.0
    heading_rad: float = 0.0
    number: int = 0
    gain: float = 1.0
    delay_us: int = 20_000
    jump_us: int = 0
    held_up_us: int = 0
    takes_us: int = 2_000
    log: list[tuple[Any, ...]] = field(default_factory=list)
    dice: random.Random = field(default_factory=lambda: random.Random(4))

    @property
    def at_us(self) -> int:
        return self.turns * TURN_US + self.held_up_us

    def reports(self) -> dict[str, dict[str, float]]:
        told = self.told if self.enabled else {"ACCEL": 0.0, "BRAKE": 0.0, "WHEEL": 0.0}
        values: dict[str, dict[str, float]] = {
            "GLOBAL_RPT": {
                "PACMOD_STATUS": self.enabled, "OVERRIDE_STATUS": 0, "VEH_CAN_TIMEOUT": 0,
                "STR_CAN_TIMEOUT": 0, "BRK_CAN_TIMEOUT": 0, "USR_CAN_TIMEOUT": self.timed_out,
                "USR_CAN_READ_ERRORS": 0,
            },
            "ACCEL_RPT": _system(0.0, told["ACCEL"]),
            "BRAKE_RPT": _system(0.0, told["BRAKE"]) | {"BRAKE_ON_OFF": told["BRAKE"] > 0.0},
            "STEERING_RPT_1": _system(0.0, told["WHEEL"]),
            "SHIFT_RPT": {"MANUAL_INPUT": 3, "COMMANDED_VALUE": 3, "OUTPUT_VALUE": 3},
            "VEHICLE_SPEED_RPT": {
                "VEHICLE_SPEED": self.gain * self.speed_mps, "VEHICLE_SPEED_VALID": 1,
            },
        }  # fmt: skip
        if self.turns % 30 == 3:
            values["VIN_RPT"] = {"MFG_CODE": MAKER, "MODEL_YEAR_CODE": 72}
        for (message, signal), value in self.changes.items():
            if message in values:
                values[message][signal] = value
        return values

    def receive(self, name_or_id: str | int, data: bytes, at_us: int) -> None:
        number = identifier(name_or_id) if isinstance(name_or_id, str) else name_or_id
        self.log.append(("receive", number, data, at_us))
        self.core.receive(number, data, at_us)

    def request(self, request: Request) -> None:
        self.log.append(("request", request, self.at_us - 1_000))
        self.core.request(request, self.at_us - 1_000)

    def sensors(self, at_us: int) -> None:
        """The sets that are due."""
        stamp_s = (at_us - self.delay_us + OFFSET_US + self.jump_us) / 1e6
        if self.turns % LOCALISED_EVERY == 0:
            self.number = (self.number + 1) % 256
            x_m = self.x_m if self.pose_x_m is None else self.pose_x_m
            self._set(localisation_frames(self.localised(stamp_s, x_m)), at_us)
        if self.turns % PEOPLE_EVERY == 0:
            frames = people_frames(
                self.people, number=self.turns // PEOPLE_EVERY % 256, stamp_s=stamp_s,
                watched_radius_m=60.0,
            )  # fmt: skip
            self._set(frames, at_us)

    def localised(self, stamp_s: float, x_m: float) -> Localised:
        x = round(x_m + self.dice.uniform(-0.05, 0.05) * (self.pose_x_m is None), 3)
        self.last_x_m = x
        return Localised(
            number=self.number, stamp_s=stamp_s, x_m=x, y_m=0.0, heading_rad=self.heading_rad,
            speed_mps=self.speed_mps, x_radius_m=0.15, y_radius_m=0.1, heading_radius_rad=0.02,
            speed_radius_mps=0.2,
        )  # fmt: skip

    def _set(self, frames: tuple[tuple[int, bytes], ...] | Refusal, at_us: int) -> None:
        assert not isinstance(frames, Refusal), frames
        names = {message.frame_id: name for name, message in OWN.by_name.items()}
        for number, data in frames:
            if names[number] not in self.silent:
                self.receive(number, self.raw.get(names[number], data), at_us)

    def step(self, between: Callable[[Bench, int], object] | None = None) -> TurnResult:
        """The reports and sets of a turn, what else happens (`between`), and the turn."""
        at_us = self.at_us - BEFORE_US
        if at_us > 0:
            for name, values in self.reports().items():
                if name not in self.silent:
                    self.receive(name, self.raw.get(name, framed(name, values)[1]), at_us)
            self.sensors(at_us)
        if between is not None:
            between(self, at_us + 1_000)
        ended_us = self.at_us + self.takes_us
        self.log.append(("turn", self.at_us, ended_us))
        result = self.core.turn(self.at_us, lambda: ended_us)
        self.obey(result)
        self.turns += 1
        return result

    def obey(self, result: TurnResult) -> None:
        heard = {}
        for frame in result.frames:
            said = decode(PACMOD2, frame.identifier, frame.data)
            if isinstance(said, Decoded):
                heard[said.message] = said.values
        self.timed_out = "GLOBAL_CMD" not in heard
        flags = heard.get("GLOBAL_CMD", {"PACMOD_ENABLE": 0})
        self.enabled = bool(flags["PACMOD_ENABLE"])
        if "ACCEL_CMD" in heard:
            self.told = {
                "ACCEL": heard["ACCEL_CMD"]["ACCEL_CMD"], "BRAKE": heard["BRAKE_CMD"]["BRAKE_CMD"],
                "WHEEL": heard["STEERING_CMD"]["POSITION_VALUE"],
            }  # fmt: skip
        self._move()

    def _move(self) -> None:
        dt, told, before = TURN_US / 1e6, self.told, self.speed_mps
        push = hold = 0.0
        if self.enabled and told["ACCEL"] > 0.3:
            push = DRIVE_BY_WIRE.pedals.accelerator.middle(told["ACCEL"])
        if self.enabled and told["BRAKE"] > 0.05 and not self.brakes_badly:
            hold = DRIVE_BY_WIRE.pedals.brake.middle(told["BRAKE"])
        self.speed_mps = max(before + (push - hold) * dt, 0.0)
        self.x_m += 0.5 * (before + self.speed_mps) * dt

    def run(self, turns: int) -> TurnResult:
        for _ in range(turns - 1):
            self.step()
        return self.step()

    def until(self, state: State, *, most: int = 90) -> TurnResult:
        """Turns until a state is reached; fails where it is not."""
        for _ in range(most):
            result = self.step()
            if result.state is state:
                return result
        raise AssertionError(f"{state} was not reached: {result.state}, {result.events}")

    def copied(self) -> Bench:
        """One that goes on alone from here; what never changes is shared."""
        shared = (bundle(0), PATH, SETTINGS, PACMOD2, OWN, DRIVE_BY_WIRE, SENSORS)
        protocols = (load_protocol(name) for name in PROTOCOLS)
        return copy.deepcopy(self, {id(each): each for each in (*shared, *protocols)})

    def drive(self, *, speed_mps: float = 1.5) -> Bench:
        """Armed and tracking, at least so fast."""
        self.run(12)
        self.request(Request.ARM)
        self.until(State.TRACKING)
        for _ in range(120):
            self.step()
            if self.speed_mps >= speed_mps:
                return self
        raise AssertionError("the car did not move")


def _system(manual: float, told: float) -> dict[str, float]:
    return {"MANUAL_INPUT": manual, "COMMANDED_VALUE": told, "OUTPUT_VALUE": told}


def said(result: TurnResult) -> dict[str, Mapping[str, float]]:
    """What the vehicle and everybody else is told: values by message; the last of its kind."""
    found: dict[str, Mapping[str, float]] = {}
    for frame in result.frames:
        protocol = PACMOD2 if frame.identifier in PACMOD2.by_id else OWN
        decoded = decode(protocol, frame.identifier, frame.data)
        assert isinstance(decoded, Decoded), decoded
        found[decoded.message] = decoded.values
    return found


def commands(result: TurnResult) -> set[str]:
    """The vehicle's messages among the frames."""
    return said(result).keys() & PACMOD2.by_name.keys()


def brakes(result: TurnResult) -> bool:
    """Whether the frames are those of BRAKE: all four, no accelerator, the whole brake profile."""
    heard = said(result)
    if commands(result) != {"GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD"}:
        return False
    profile = heard["BRAKE_CMD"]["BRAKE_CMD"] == DRIVE_BY_WIRE.pedals.brake_profile
    enabled = heard["GLOBAL_CMD"] == {
        "PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0,
    }  # fmt: skip
    return heard["ACCEL_CMD"]["ACCEL_CMD"] == 0.0 and profile and enabled


def faults(result: TurnResult) -> set[Fault]:
    return {found.fault for found in result.faults}


def person(track: int, x_m: float, y_m: float) -> SentPerson:
    """Somebody who stands."""
    return SentPerson(track, PersonKind.ON_FOOT, x_m, y_m, 0.4, 0.0, 0.0, 0.1, 0.0)


def commander(b: Bench) -> Commander:
    """Who makes the core's command frames."""
    driver = b.core._helm._driver
    assert driver is not None
    return driver[0]


def bench(mode: Mode = Mode.DRIVE, **changed: Any) -> Bench:
    return Bench(core(mode, **changed))


def refusal(b: Bench, request: Request = Request.ARM) -> str:
    """The one sentence that answers a request; fails where nothing is refused."""
    b.request(request)
    result = b.step()
    refusals = [event for event in result.events if event.startswith("not armed: ")]
    assert len(refusals) == 1, result.events
    assert commands(result) == set()
    return refusals[0]


def answer(b: Bench, request: Request) -> str:
    b.request(request)
    return " ".join(b.step().events)


@functools.cache
def _driven() -> Bench:
    return bench().drive()


def driven() -> Bench:
    """A car that tracks at 1.5 m/s in DRIVE; each caller has its own."""
    return _driven().copied()
