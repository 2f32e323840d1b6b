"""Every row of the fault list as things that go wrong in DRIVE or GATE: what, and when it shows."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable
from dataclasses import dataclass

from onboard_campaign_injectors import (
    braking_badly,
    bus_says,
    driver,
    earlier_frame,
    fails_once,
    frozen_pose,
    growing,
    in_core,
    late_people,
    localised,
    moved,
    parameter,
    raising,
    rounding_upward,
    says,
    slower_pedals,
)
from onboard_campaign_truth import (
    aged,
    brakes_too_little,
    by_age,
    not_following,
    own,
    pushed,
    shown_by,
    silent_since,
    when_raised,
)
from onboard_campaign_world import ARMED_US, Truth
from onboard_world import Injector
from onboard_world_injectors import (
    LOCALISATION,
    PEOPLE,
    Changed,
    Delayed,
    Doubled,
    Frozen,
    Incomplete,
    Replayed,
    Stopped,
    Swapped,
    flipped,
    identifiers,
    raw_field,
    wrong_unit,
)
from onboard_world_inside import (
    crowd,
    emergency_stop,
    error_frame,
    silent_bus,
    stuck_wheel,
    wrong_echo,
    wrong_gear,
)
from onboard_world_intruders import Intruder, other_protocol, spoofed

from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.states import Mode
from workbench.runtime.protocols import Localised

F = Fault
Made = Callable[[int, random.Random], Injector | tuple[Injector, ...]]
DRIVEN_US, EARLY_US = 5_000_000, ARMED_US + 400_000
LAST = ("LOC_RADII",)


@dataclass(frozen=True)
class Row:
    """make: what goes wrong from an instant on; faults: what may answer it, the named one first;
    truth: when it was there; most_us: how long it may stay hidden; from_us: what is driven until
    then; on_bus: whether the answer can reach the bus; after_us: so long nothing goes wrong yet."""

    name: str
    faults: tuple[Fault, ...]
    make: Made
    truth: Truth = own
    most_us: int = 4_000_000
    from_us: int = DRIVEN_US
    mode: Mode = Mode.DRIVE
    on_bus: bool = True
    after_us: int = 60_000


def _stops(name: str) -> Row:
    return Row(
        f"{name} stops", (F.STALE_REPORT,), lambda at, dice: Stopped(at, stops=identifiers(name))
    )


def vague(seen: Localised) -> Localised:
    return dataclasses.replace(seen, x_radius_m=1.5, y_radius_m=1.5)


def flood(start_us: int) -> Intruder:
    """Short frames of identifier 0 that take three quarters of the bus."""
    return Intruder(start_us, frames=[(0, b"")], period_us=150)


def _raw(name: str, byte: int, raw: int, fault: Fault = F.OUT_OF_RANGE) -> Row:
    return Row(
        f"{name} raw 0x{raw:04X}", (fault, F.STALE_REPORT),
        lambda at, dice: Changed(
            at, of=identifiers(name), change=raw_field(byte, raw), needed=3
        ),
    )  # fmt: skip


NEEDED = (
    "VEHICLE_SPEED_RPT", "STEERING_RPT_1", "ACCEL_RPT", "BRAKE_RPT", "SHIFT_RPT", "GLOBAL_RPT",
)  # fmt: skip
ON_BUS = (
    *(_stops(name) for name in NEEDED),
    Row("localisation stops", (F.LOCALISATION_LOST,),
        lambda at, dice: Stopped(at, stops=LOCALISATION), aged("LOC_RADII")),
    Row("people stop", (F.PEOPLE_LOST,),
        lambda at, dice: Stopped(at, stops=PEOPLE), aged("PERSON_TRACK")),
    Row("speed said invalid", (F.NOT_AVAILABLE,),
        lambda at, dice: says(at, "VEHICLE_SPEED_RPT", lambda v: v.update(VEHICLE_SPEED_VALID=0))),
    _raw("VEHICLE_SPEED_RPT", 0, 0x7FFF),
    _raw("VEHICLE_SPEED_RPT", 0, 0x8000),
    _raw("STEERING_RPT_1", 4, 0x7FFF),
    _raw("ACCEL_RPT", 0, 0xFFFF),
    _raw("BRAKE_RPT", 4, 1001),
    _raw("SHIFT_RPT", 2, 0x0505),
    Row("speed 4 m/s more", (F.OUT_OF_RANGE, F.STALE_REPORT), lambda at, dice: says(
        at, "VEHICLE_SPEED_RPT", lambda v: v.update(VEHICLE_SPEED=v["VEHICLE_SPEED"] + 4.0),
        needed=3)),
    Row("reports too short", (F.OUT_OF_RANGE, F.STALE_REPORT), lambda at, dice: Changed(
        at, of=identifiers("BRAKE_RPT"), change=lambda data: data[:-1], needed=3)),
    Row("reports too long", (F.OUT_OF_RANGE, F.STALE_REPORT), lambda at, dice: Changed(
        at, of=identifiers("GLOBAL_RPT"), change=lambda data: data + b"\0", needed=3)),
    Row("old sets of people", (F.REPLAYED, F.INTEGRITY, F.PEOPLE_LOST),
        lambda at, dice: Replayed(at, of=PEOPLE, window_us=700_000),
        by_age("PERSON_TRACK", PEOPLE)),
    Row("old localisation", (F.REPLAYED, F.INTEGRITY, F.LOCALISATION_LOST),
        lambda at, dice: Replayed(at, of=LOCALISATION, window_us=900_000),
        by_age("LOC_RADII", LOCALISATION)),
    Row("speed twice as often", (F.REPLAYED,),
        lambda at, dice: Doubled(at, of=identifiers("VEHICLE_SPEED_RPT")),
        shown_by(*identifiers("VEHICLE_SPEED_RPT"))),
    Row("frames of people twice", (F.DUPLICATE,), lambda at, dice: Doubled(at, of=PEOPLE),
        shown_by(*PEOPLE)),
    Row("frames swapped", (F.INTEGRITY, F.LOCALISATION_LOST),
        lambda at, dice: Swapped(at, of=LOCALISATION), by_age("LOC_RADII", LOCALISATION)),
    Row("localisation late", (F.LATE,), lambda at, dice: Delayed(
        at, of=LOCALISATION, delay_us=400_000), shown_by(LOCALISATION[3])),
    Row("people late", (F.LATE,), lambda at, dice: late_people(at), shown_by(PEOPLE[3])),
    Row("people's bits flip", (F.INTEGRITY, F.PEOPLE_LOST), lambda at, dice: Changed(
        at, of=PEOPLE, change=flipped(*dice.sample(range(64), dice.randint(1, 3)))),
        by_age("PERSON_TRACK", PEOPLE)),
    Row("a frame of each set lost", (F.INTEGRITY, F.LOCALISATION_LOST), lambda at, dice: Incomplete(
        at, lost=dice.choice(LOCALISATION[1:3]), header=LOCALISATION[0]),
        by_age("LOC_RADII", LOCALISATION)),
    Row("33 to 255 people", (F.OVER_CAPACITY,),
        lambda at, dice: crowd(at, dice.choice((33, 100, 101, 255))), shown_by(PEOPLE[0])),
    Row("clock backwards", (F.CLOCK_BACKWARDS,), lambda at, dice: earlier_frame(at)),
    Row("controller's errors", (F.BUS_ERROR,), bus_says),
    Row("error frame", (F.ERROR_FRAME,), lambda at, dice: error_frame(at)),
    Row("a frame not sent", (F.BUS_ERROR,),
        lambda at, dice: fails_once(at, BusError.SEND, broken=False)),
    Row("a frame not read", (F.BUS_ERROR,),
        lambda at, dice: fails_once(at, BusError.RECEIVE, broken=False)),
    Row("bus has to be reopened", (F.BUS_ERROR,),
        lambda at, dice: fails_once(at, BusError.RECEIVE, broken=True)),
    Row("nothing heard", (F.BUS_SILENT, F.STALE_REPORT),
        lambda at, dice: silent_bus(at), silent_since),
    Row("command from outside", (F.SPOOFED,), lambda at, dice: spoofed(
        at, dice.choice(("GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD")), bytes(8))),
    Row("second monitor", (F.SPOOFED,),
        lambda at, dice: spoofed(at, dice.choice(("HEARTBEAT", "DECISION")), bytes(8))),
    Row("flood, gear starved", (F.BUS_FLOOD,), lambda at, dice: (
        flood(at - 50_000),
        Stopped(at, stops=identifiers("SHIFT_RPT"), budget_us=66_666))),
    Row("other protocol's reports", (F.WRONG_PROTOCOL,), lambda at, dice: other_protocol(at)),
)  # fmt: skip
IN_CAR = (
    Row("speed report frozen", (F.FROZEN, F.WRONG_SPEED, F.NOT_OBSERVED), lambda at, dice: Frozen(
        at, name="VEHICLE_SPEED_RPT", signal="VEHICLE_SPEED"), pushed, from_us=EARLY_US),
    Row("pose frozen", (F.FROZEN, F.WRONG_SPEED), lambda at, dice: frozen_pose(at),
        shown_by(LOCALISATION[3])),
    Row("speed in mph, at once", (F.OUT_OF_RANGE, F.WRONG_SPEED, F.STALE_REPORT, F.NOT_OBSERVED),
        lambda at, dice: wrong_unit(at), shown_by(LOCALISATION[3], 0x6F)),
    Row("speed in km/h, at once", (F.OUT_OF_RANGE, F.WRONG_SPEED, F.STALE_REPORT, F.NOT_OBSERVED),
        lambda at, dice: wrong_unit(at, factor=3.6), shown_by(LOCALISATION[3], 0x6F)),
    Row("speed drifts to mph", (F.WRONG_SPEED, F.NOT_OBSERVED), lambda at, dice: growing(
        at, "VEHICLE_SPEED_RPT", "VEHICLE_SPEED", per_frame=0.02), shown_by(LOCALISATION[3], 0x6F)),
    Row("heading 0.3 rad off", (F.WRONG_TURN, F.NOT_OBSERVED),
        lambda at, dice: moved(at, heading_rad=0.3), shown_by(LOCALISATION[3])),
    Row("steering ratio halved", (F.WRONG_TURN, F.NOT_OBSERVED), lambda at, dice: parameter(
        at, steering_ratio=10.0), shown_by(LOCALISATION[3]), most_us=10_000_000),
    Row("localised speed 2 m/s off", (F.NOT_OBSERVED,), lambda at, dice: moved(at, speed_mps=2.0),
        shown_by(LOCALISATION[3])),
    Row("localisation vague", (F.COARSE_READING,), lambda at, dice: localised(
        at, lambda world, seen: vague(seen)), shown_by(LOCALISATION[3])),
    Row("law cannot be sent", (F.NOT_COVERED,), lambda at, dice: in_core(at, slower_pedals),
        lambda world, made, found: found.at_us, from_us=EARLY_US),
    Row("by-wire switched off", (F.NOT_ENABLED,), lambda at, dice: emergency_stop(at)),
    Row("brake bus times out", (F.NOT_ENABLED,), lambda at, dice: says(
        at, "GLOBAL_RPT", lambda v: v.update(BRK_CAN_TIMEOUT=1))),
    Row("our commands missed", (F.NOT_ENABLED,), lambda at, dice: says(
        at, "GLOBAL_RPT", lambda v: v.update(USR_CAN_TIMEOUT=1))),
    Row("gear to neutral", (F.NOT_FORWARD,), lambda at, dice: wrong_gear(at)),
    Row("driver brakes", (F.DRIVER_OVERRIDE,),
        lambda at, dice: driver(at, ("GLOBAL_RPT",), brake=0.3)),
    Row("driver accelerates", (F.DRIVER_OVERRIDE,),
        lambda at, dice: driver(at, ("GLOBAL_RPT",), accel=0.3)),
    Row("driver steers", (F.DRIVER_OVERRIDE,),
        lambda at, dice: driver(at, ("GLOBAL_RPT",), turns_wheel=True)),
    Row("other command repeated", (F.NOT_FOLLOWING,), lambda at, dice: wrong_echo(at)),
    Row("brake holds by itself", (F.NOT_FOLLOWING,), lambda at, dice: says(
        at, "BRAKE_RPT", lambda v: v.update(OUTPUT_VALUE=0.5)), not_following),
    Row("steering motor stuck", (F.NOT_FOLLOWING, F.FROZEN), lambda at, dice: stuck_wheel(at),
        when_raised, from_us=EARLY_US, most_us=8_000_000),
    Row("weak brake", (F.WEAK_BRAKE,), lambda at, dice: braking_badly(
        at, share=dice.uniform(0.0, 0.25)), brakes_too_little),
    Row("other maker", (F.WRONG_VEHICLE,), lambda at, dice: says(
        at, "VIN_RPT", lambda v: v.update(MFG_CODE=0x111111))),
    Row("gear not stated", (F.STALE_REPORT, F.OUT_OF_RANGE), lambda at, dice: Changed(
        at, of=identifiers("SHIFT_RPT"), change=raw_field(0, 0x09, size=1), needed=3)),
    Row("rounding upward", (F.FLOAT_MODE,), lambda at, dice: rounding_upward(at)),
    Row("exception in receiving", (F.INTERNAL,), lambda at, dice: in_core(
        at, raising(lambda core: core._watch.intake, "receive")), when_raised),
    Row("exception in a turn", (F.INTERNAL,), lambda at, dice: in_core(
        at, raising(lambda core: core._watch, "look"))),
)  # fmt: skip
DRIVEN = (*ON_BUS, *IN_CAR)
