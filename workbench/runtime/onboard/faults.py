"""Every fault that can be noticed on board: when it is there, what is done, what ends it."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, final


@final
class Reaction(enum.Enum):
    """What a fault does to the car, the mildest first.

    While disarmed, every one but ALERT and PLAN is a reason not to arm.
    """

    ALERT = "an event in the log; decisions go on"
    PLAN = "the plan in force is carried out: TRACK until its switch at most, then BRAKE"
    BRAKE = "accelerator 0, full brake, steering keeps its last path command; latched"
    LATCH = "BRAKE, latched in the state FAULT"
    YIELD = "ENABLE 0 once, then silence: the driver has the car"
    REFUSE = "no arming; found while armed it is a LATCH"


@final
class Release(enum.Enum):
    """What ends the reaction to a fault."""

    GONE = "its condition no longer holds"
    STANDSTILL = (
        "the condition has been gone for the release time, the car stands, and the next "
        "decision permits TRACK from standstill"
    )
    REARM = "the operator's REARM, which checks all that ARM checks"
    DISARM = "the operator's DISARM, then ARM"
    RESTART = "mended, and the program started anew"


@final
class Latency(enum.Enum):
    """How long after the condition has become true the answer is on the bus, at most."""

    TURN = "one turn, 33 ms"
    DECISION = "the end of the decision that is late"
    REQUEST = "at once, to every ARM and REARM"
    BESIDE = "beside the core: the loop writes it to the log within a second"


@final
@dataclass(frozen=True, slots=True)
class Rule:
    """row: of the fault list; condition: when it is there; the rest: see there."""

    row: str
    condition: str
    reaction: Reaction
    release: Release
    latency: Latency = Latency.TURN


def _alert(row: str, condition: str, latency: Latency = Latency.TURN) -> Rule:
    return Rule(row, condition, Reaction.ALERT, Release.GONE, latency)


def _brake(row: str, condition: str) -> Rule:
    return Rule(row, condition, Reaction.BRAKE, Release.STANDSTILL)


def _latch(row: str, condition: str, latency: Latency = Latency.TURN) -> Rule:
    return Rule(row, condition, Reaction.LATCH, Release.DISARM, latency)


def _yield(row: str, condition: str) -> Rule:
    return Rule(row, condition, Reaction.YIELD, Release.REARM)


def _refuse(row: str, condition: str) -> Rule:
    return Rule(row, condition, Reaction.REFUSE, Release.RESTART, Latency.REQUEST)


@final
class Fault(enum.Enum):
    """What can go wrong and be noticed here; the value is its `Rule`.

    Needed reports: speed, steering, accelerator, brake, gear and global status. Ages are of the
    receiver's monotonic clock.
    """

    STALE_REPORT = _brake(
        "stale vehicle speed/steer",
        "no accepted frame of a needed report for more than 100 ms (three periods)",
    )
    LOCALISATION_LOST = _brake(
        "localisation dropped",
        "no whole localisation set yet, or the last one is older than its budget of age; until "
        "then its intervals grow",
    )
    FROZEN = _brake(
        "frozen value",
        "speed, steering or pose stay the same bit by bit while what was commanded or driven "
        "must have changed them by more than their threshold",
    )
    NOT_AVAILABLE = _brake(
        "NaN/Inf/sentinel",
        "the last frame of a needed report says error, not available or invalid",
    )
    OUT_OF_RANGE = _brake(
        "out of range / rate",
        "three frames in a row of a needed report are refused: outside the protocol's or the "
        "vehicle's range, faster than its slew limit, of wrong length or form",
    )
    WRONG_SPEED = _latch(
        "wrong unit / wrong parameters",
        "the reported speed contradicts the localised speed, or the way between two "
        "localisations, by more than all errors allow",
    )
    WRONG_TURN = _latch(
        "wrong unit / wrong parameters",
        "the heading between two localisations contradicts the way times tan(steering) / "
        "wheelbase by more than all errors allow",
    )
    REPLAYED = _brake(
        "replay",
        "sets whose counter or stamp goes backwards: each adds 1, each whole set takes 1, at 5; or "
        "a needed report comes more than twice as often as it may",
    )
    DUPLICATE = _brake(
        "duplicate",
        "frames of a set that repeat the one before: each adds 1, each whole set takes 1, at 5; "
        "they are dropped and counted from the first on",
    )
    OUT_OF_ORDER = _alert(
        "out of order",
        "a set's frame came out of order or its counter repeats or goes backwards; the set is "
        "dropped and counted",
    )
    LATE = _brake(
        "late (delay d)",
        "the stamp of the last localisation or people set lies further back than the delay that "
        "is allowed, by the estimated offset of the sender's clock",
    )
    CLOCK_JUMP = _alert(
        "clock jump",
        "a sender's clock (the loop: the wall clock) jumps; no age uses either",
    )
    CLOCK_BACKWARDS = _latch(
        "clock jump", "the instant of a frame or of a turn lies before the one before it"
    )
    BUS_ERROR = _latch(
        "bus-off / error passive / RX overflow",
        "bus-off, error passive, overflow, a bus that closes, a frame that cannot be sent or read",
    )
    ERROR_FRAME = _brake(
        "bus-off / error passive / RX overflow", "an error frame within the last 100 ms"
    )
    BUS_SILENT = _latch(
        "bus-off / error passive / RX overflow", "no frame at all for more than 100 ms"
    )
    INTEGRITY = _brake(
        "counter / CRC error",
        "frames with wrong CRC, form or counter: each adds 1, each whole set takes 1, at 5",
    )
    OVER_CAPACITY = _brake(
        "pedestrian burst 0..100", "the newest people header says that there are more than 32"
    )
    PEOPLE_LOST = _brake(
        "track set incomplete",
        "no whole people set yet, or the last one is older than its budget of age; until then "
        "people's guards grow",
    )
    OVERRUN = Rule(
        "deadline overrun",
        "a decision ended later after its turn than the latency that the proof allows",
        Reaction.PLAN,
        Release.STANDSTILL,
        Latency.DECISION,
    )
    LATE_TURN = _latch(
        "hang (GIL, SIGSTOP)",
        "a turn comes later after the last one than the gap that the proof allows: whatever held "
        "the program up is over, and what the car did meanwhile is not known",
    )
    NOT_ENABLED = _yield(
        "wrong mode state",
        "the vehicle reports by-wire control disabled or timed out, or does not enable in time, "
        "while it is commanded",
    )
    NOT_FORWARD = _yield("wrong mode state", "the gear is not FORWARD while the car is commanded")
    DRIVER_OVERRIDE = _yield(
        "driver override",
        "the override bit is set, or the driver presses a pedal beyond the threshold",
    )
    NOT_FOLLOWING = _latch(
        "actuator not following",
        "the vehicle's commanded value differs from ours, or its output from that, by more than "
        "the tolerance for longer than the time allowed",
    )
    WEAK_BRAKE = _latch(
        "actuator not following",
        "under BRAKE the speed is above what the brake's bounds allow after that time",
    )
    SPOOFED = _latch(
        "spoofed command IDs",
        "a frame arrives with an identifier that only this program sends (in SHADOW: only the "
        "workbench's own; the others are the controller's that is watched)",
    )
    BUS_BUSY = _alert(
        "bus flood / babbling idiot", "more frames within the last second than the bus should carry"
    )
    BUS_FLOOD = _brake(
        "bus flood / babbling idiot",
        "as BUS_BUSY, and a needed report has not come for two periods (67 ms)",
    )
    WRONG_PROTOCOL = _refuse(
        "wrong protocol (v2/v3)",
        "a needed report of the bundle's protocol is missing, or a report of the other protocol "
        "is on the bus",
    )
    WRONG_VEHICLE = _refuse("wrong vehicle", "the vehicle reports another maker than expected")
    FLOAT_MODE = _latch(
        "subnormal / FP environment changed",
        "rounding is not to nearest or subnormals are flushed, probed every turn",
    )
    BUNDLE = _refuse(
        "corrupted bundle", "the bundle was not loaded with its signature verified before loading"
    )
    LOG_LOST = _alert(
        "disk full / slow disk", "the recorder dropped entries or stopped", Latency.BESIDE
    )
    LEAK = _alert("memory growth / fd leak", "memory or open files above limit", Latency.BESIDE)
    UPSTREAM_LOST = _brake(
        "gate: upstream controller",
        "in GATE, no usable command of the upstream controller for more than 100 ms",
    )
    UPSTREAM_DISABLED = _yield(
        "gate: upstream controller", "in GATE, the upstream controller sends ENABLE 0"
    )
    COARSE_READING = _brake(
        "assumption: estimation error",
        "offset, heading or speed are known less well than the error that the proof gives the "
        "controller",
    )
    NOT_COVERED = _brake(
        "assumption: actuation",
        "what the law wants cannot be sent, or not in time, or what is sent stays too far behind",
    )
    NOT_OBSERVED = _brake(
        "assumption: initial set",
        "what was received cannot be put into one observation, or not on the path",
    )
    INTENTS_LOST = _alert(
        "assumption: intent",
        "ways of people are sent, and the last that fitted the people are missing or older than "
        "the people's budget of age, or somebody seen has none or has left them; who has none is "
        "taken to go on as they do",
    )
    INTERNAL = _latch("exception", "anything raised where nothing should")

    @property
    def rule(self) -> Rule:
        """Its row, condition, reaction and release."""
        rule: Rule = self.value
        return rule

    @property
    def reaction(self) -> Reaction:
        """What it does to the car."""
        return self.rule.reaction


@final
@dataclass(frozen=True, slots=True)
class Found:
    """A fault that is there: in words, and since which instant (us) its condition holds."""

    fault: Fault
    detail: str
    since_us: int

    def __str__(self) -> str:
        return f"{self.fault.name}: {self.detail}"


NOT_ON_BOARD: Final = (
    ("crash / kill -9",
     "nothing: the frames stop, and after the vehicle's own time-out by-wire control is disabled; "
     "the car is not braked"),
    ("hang (GIL, SIGSTOP)",
     "nothing while it lasts, as after a crash; LATE_TURN answers it when it is over"),
    ("corrupted bundle",
     "the loader refuses hash, signature, symbols or golden vectors; the program ends before it "
     "opens the bus"),
    ("replay",
     "of PACMod 2 reports with plausible values at their usual rate: its frames have neither "
     "counter nor checksum; WRONG_SPEED, WRONG_TURN, FROZEN, NOT_FOLLOWING and WEAK_BRAKE catch "
     "those that contradict physics"),
)  # fmt: skip
"""Rows of the fault list, or parts of them, that no code on board can answer, and what happens."""
