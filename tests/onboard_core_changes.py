"""What goes wrong at a core's bench, and the fault that must be found: (fault, change) by name."""

from __future__ import annotations

from collections.abc import Callable

from onboard_core_bench import OWN, PACMOD2, Bench, framed, identifier, person

from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.intake import BusError
from workbench.runtime.protocols import load_protocol, people_frames

LOCALISATION = ("LOC_STAMP", "LOC_POSITION", "LOC_MOTION", "LOC_RADII")
Change = Callable[[Bench, int], object]


def _silent(*names: str) -> Change:
    return lambda b, at_us: b.silent.update(names)


def _says(message: str, signal: str, value: float) -> Change:
    def change(b: Bench, at_us: int) -> None:
        b.changes[message, signal] = value

    return change


def _heard(number: int, data: bytes, times: int = 1) -> Change:
    def change(b: Bench, at_us: int) -> None:
        for _ in range(times):
            b.receive(number, data, at_us)

    return change


def _old_sets(b: Bench, at_us: int) -> None:
    """Whole sets of people from long ago, one after the other."""
    frames = people_frames([], number=b.turns % 2, stamp_s=1.0, watched_radius_m=60.0)
    assert isinstance(frames, tuple)
    b.receive(*frames[0], at_us)


RADII = {"SET": 0, "X_RADIUS": 0.0, "Y_RADIUS": 0.0, "HEADING_OBSERVED": 1}


def _repeated(b: Bench, at_us: int) -> None:
    frames = people_frames(
        [], number=b.turns // 6 % 256, stamp_s=at_us / 1e6, watched_radius_m=60.0
    )
    assert isinstance(frames, tuple)
    b.receive(*frames[0], at_us)
    b.receive(*frames[0], at_us)


def _corrupt(b: Bench, at_us: int) -> None:
    number, data = framed("LOC_RADII", RADII)
    b.receive(number, data[:-1] + bytes([data[-1] ^ 1]), at_us)


def _impossible(b: Bench, at_us: int) -> None:
    b.raw["VEHICLE_SPEED_RPT"] = framed(
        "VEHICLE_SPEED_RPT", {"VEHICLE_SPEED": 4.0, "VEHICLE_SPEED_VALID": 1}
    )[1]


def _wrong_length(b: Bench, at_us: int) -> None:
    b.raw["STEERING_RPT_1"] = bytes(7)


def _frozen_pose(b: Bench, at_us: int) -> None:
    b.pose_x_m = b.last_x_m


def _turned(b: Bench, at_us: int) -> None:
    b.heading_rad = 0.3


def _faster(b: Bench, at_us: int) -> None:
    b.gain = min(b.gain + 0.03, 2.237)


def _often(b: Bench, at_us: int) -> None:
    b.receive(*framed("SHIFT_RPT", b.reports()["SHIFT_RPT"]), at_us)


def _late(b: Bench, at_us: int) -> None:
    b.delay_us = 400_000


def jump(b: Bench, at_us: int) -> None:
    b.jump_us = 5_000_000


def _earlier(b: Bench, at_us: int) -> None:
    b.receive(*framed("SHIFT_RPT", b.reports()["SHIFT_RPT"]), at_us - 2_000)


def _held_up(b: Bench, at_us: int) -> None:
    b.held_up_us += 60_000 if b.held_up_us == 0 else 0


def _crowd(b: Bench, at_us: int) -> None:
    b.people = [person(k, 30.0, 5.0 + k) for k in range(33)]


def _weak(b: Bench, at_us: int) -> None:
    b.brakes_badly = True
    b.people = [person(7, b.x_m + 5.0, 0.0)]


def _bus_error(kind: BusError) -> Change:
    return lambda b, at_us: b.core.bus_error(kind, at_us)


def _flooded(b: Bench, at_us: int) -> None:
    for _ in range(300):
        b.receive(0, bytes(8), at_us)
    b.silent.add("SHIFT_RPT")


_OTHER = load_protocol("pacmod3").by_name["GLOBAL_RPT"].frame_id
CASES: dict[str, tuple[Fault, Change]] = {
    "speed stops": (Fault.STALE_REPORT, _silent("VEHICLE_SPEED_RPT")),
    "gear stops": (Fault.STALE_REPORT, _silent("SHIFT_RPT")),
    "localisation stops": (Fault.LOCALISATION_LOST, _silent(*LOCALISATION)),
    "people stop": (Fault.PEOPLE_LOST, _silent("PEOPLE")),
    "pose freezes": (Fault.FROZEN, _frozen_pose),
    "speed said invalid": (
        Fault.NOT_AVAILABLE, _says("VEHICLE_SPEED_RPT", "VEHICLE_SPEED_VALID", 0),
    ),
    "speed jumps": (Fault.OUT_OF_RANGE, _impossible),
    "frame too short": (Fault.OUT_OF_RANGE, _wrong_length),
    "speed in other units": (Fault.WRONG_SPEED, _faster),
    "heading elsewhere": (Fault.WRONG_TURN, _turned),
    "old sets": (Fault.REPLAYED, _old_sets),
    "report too often": (Fault.REPLAYED, _often),
    "frames twice": (Fault.DUPLICATE, _repeated),
    "sets late": (Fault.LATE, _late),
    "backwards": (Fault.CLOCK_BACKWARDS, _earlier),
    "off": (Fault.BUS_ERROR, _bus_error(BusError.BUS_OFF)),
    "cannot send": (Fault.BUS_ERROR, _bus_error(BusError.SEND)),
    "commands late": (Fault.NOT_COVERED, _bus_error(BusError.LATE)),
    "error frame": (Fault.ERROR_FRAME, _bus_error(BusError.ERROR_FRAME)),
    "nothing": (Fault.BUS_SILENT, _silent(*PACMOD2.by_name, *OWN.by_name)),
    "wrong CRC": (Fault.INTEGRITY, _corrupt),
    "33 people": (Fault.OVER_CAPACITY, _crowd),
    "hang": (Fault.LATE_TURN, _held_up),
    "disabled": (Fault.NOT_ENABLED, _says("GLOBAL_RPT", "PACMOD_STATUS", 0)),
    "our commands missed": (Fault.NOT_ENABLED, _says("GLOBAL_RPT", "USR_CAN_TIMEOUT", 1)),
    "brake bus down": (Fault.NOT_ENABLED, _says("GLOBAL_RPT", "BRK_CAN_TIMEOUT", 1)),
    "neutral": (Fault.NOT_FORWARD, _says("SHIFT_RPT", "OUTPUT_VALUE", 2)),
    "override": (Fault.DRIVER_OVERRIDE, _says("GLOBAL_RPT", "OVERRIDE_STATUS", 1)),
    "brake pedal": (Fault.DRIVER_OVERRIDE, _says("BRAKE_RPT", "MANUAL_INPUT", 0.2)),
    "other command": (Fault.NOT_FOLLOWING, _says("ACCEL_RPT", "COMMANDED_VALUE", 0.9)),
    "output stays": (Fault.NOT_FOLLOWING, _says("BRAKE_RPT", "OUTPUT_VALUE", 0.5)),
    "weak brake": (Fault.WEAK_BRAKE, _weak),
    "command from outside": (
        Fault.SPOOFED, _heard(*framed("BRAKE_CMD", {"BRAKE_CMD": 0.0})),
    ),
    "second monitor": (Fault.SPOOFED, _heard(identifier("HEARTBEAT"), bytes(8))),
    "flood": (Fault.BUS_FLOOD, _flooded),
    "other protocol": (Fault.WRONG_PROTOCOL, _heard(_OTHER, bytes(8))),
    "other maker": (Fault.WRONG_VEHICLE, _says("VIN_RPT", "MFG_CODE", 0x111111)),
}  # fmt: skip
