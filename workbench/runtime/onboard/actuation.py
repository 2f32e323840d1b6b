"""From acceleration and steering rate to pedals and steering wheel; what fails gives BRAKE."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.drive_by_wire import DriveByWire, Pedals, Steering
from workbench.runtime.onboard.times import SEND_US, seconds

__all__ = [
    "Actuated", "Curve", "DriveByWire", "Outputs", "Pedals", "Sent", "Steering", "Wanted",
    "actuate", "brake_outputs", "guarded", "held", "resting",
]  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Wanted:
    """Acceleration (m/s^2) and road-wheel rate (rad/s, positive to the left) of the control law."""

    acceleration_mps2: float
    steering_rate_radps: float


@final
@dataclass(frozen=True, slots=True)
class Outputs:
    """What goes to the vehicle: pedal ratios, steering-wheel angle (rad) and its rate (rad/s)."""

    accelerator: float
    brake: float
    wheel_rad: float
    wheel_rate_radps: float


@final
@dataclass(frozen=True, slots=True)
class Sent:
    """What was sent last: the command after its slew, the outputs, and the angle to hold (rad).

    hold_rad: the steering wheel's angle at which the last valid path command stood; a brake without
    a path keeps it. `resting` makes the first one.
    """

    command: Wanted
    outputs: Outputs
    hold_rad: float


@final
@dataclass(frozen=True, slots=True)
class Actuated:
    """One turn's outcome.

    withheld: how far the command sent stays behind the one wanted, as magnitudes; covered: whether
    the tube's disturbance holds for this turn: withheld within its share, no more than turn_s from
    the last turn's begin until this one's frames are out (at most SEND_US after they were made),
    and the wheel's target far enough ahead in spite of the angle's limit. fault: why
    BRAKE is sent, or ''.
    """

    sent: Sent
    withheld: Wanted
    covered: bool
    fault: str


def resting(dbw: DriveByWire, read_back_rad: float) -> Sent | None:
    """Both pedals free, the steering wheel where it is; None where that is not known.

    What `enable` sends, and what the first `actuate` starts from.
    """
    if not abs(read_back_rad) <= dbw.steering.wheel_limit_rad:
        return None
    outputs = Outputs(0.0, 0.0, read_back_rad, dbw.steering.wheel_rate_floor_radps)
    return Sent(Wanted(0.0, 0.0), outputs, read_back_rad)


def actuate(
    dbw: DriveByWire,
    wanted: Wanted,
    *,
    read_back_rad: float,
    before: Sent,
    elapsed_s: float,
    made_s: float = 0.0,
) -> Actuated:
    """What TRACK sends for `wanted`, elapsed_s after the last turn, made_s after this one began.

    Command: wanted, changed since `before` by at most slew times elapsed_s (at most turn_s).
    Pedals: the ratio whose middle is the command; neither within the dead band. Steering: the
    target is the read-back's road-wheel angle plus rate times lead_s, within the limits, and the
    wheel's rate is that of the road wheels over the map's slope there. Not finite or out of range,
    also of the read-back: the brake profile at the angle held, with the fault named.
    """
    fault = _fault(dbw, wanted, read_back_rad, elapsed_s)
    if fault:
        return braked(dbw, before, fault)
    turn_s = min(elapsed_s, dbw.turn_s)
    command = Wanted(
        _slewed(before.command.acceleration_mps2, wanted.acceleration_mps2,
                dbw.pedals.slew_mps3 * turn_s),
        _slewed(before.command.steering_rate_radps, wanted.steering_rate_radps,
                dbw.steering.slew_radps2 * turn_s),
    )  # fmt: skip
    accelerator, brake = _pedals(dbw.pedals, command.acceleration_mps2)
    raw = _outputs(dbw, command, read_back_rad, (accelerator, brake))
    sent = _sent(dbw, command, raw, read_back_rad, before)
    in_time = elapsed_s + made_s + seconds(SEND_US) <= dbw.turn_s
    return _outcome(dbw, wanted, sent, covered=in_time and _leads(dbw, command, read_back_rad))


def brake_outputs(
    dbw: DriveByWire,
    steering_rate_radps: float,
    *,
    read_back_rad: float,
    before: Sent,
    elapsed_s: float,
    made_s: float = 0.0,
) -> Actuated:
    """What BRAKE sends while the path is known: the brake profile, steering as `actuate` steers."""
    fault = _fault(dbw, Wanted(0.0, steering_rate_radps), read_back_rad, elapsed_s)
    if fault:
        return braked(dbw, before, fault)
    change = dbw.steering.slew_radps2 * min(elapsed_s, dbw.turn_s)
    rate = _slewed(before.command.steering_rate_radps, steering_rate_radps, change)
    command = Wanted(0.0, rate)
    raw = _outputs(dbw, command, read_back_rad, (0.0, dbw.pedals.brake_profile))
    sent = _sent(dbw, command, raw, read_back_rad, before)
    in_time = elapsed_s + made_s + seconds(SEND_US) <= dbw.turn_s
    wanted = Wanted(0.0, steering_rate_radps)
    return _outcome(dbw, wanted, sent, covered=in_time and _leads(dbw, command, read_back_rad))


def braked(dbw: DriveByWire, before: Sent, fault: str) -> Actuated:
    """What BRAKE sends without a path: the brake profile, the steering wheel at the angle held."""
    rate = max(abs(before.outputs.wheel_rate_radps), dbw.steering.wheel_rate_floor_radps)
    raw = Outputs(0.0, dbw.pedals.brake_profile, before.hold_rad, rate)
    outputs = guarded(dbw, raw, before.outputs)
    return Actuated(
        Sent(Wanted(0.0, 0.0), outputs, before.hold_rad), Wanted(0.0, 0.0), not fault, fault
    )


def held(dbw: DriveByWire, before: Sent) -> Actuated:
    """`braked` because it is decided, with nothing wrong."""
    return braked(dbw, before, "")


def guarded(dbw: DriveByWire, raw: Outputs, last: Outputs) -> Outputs:
    """The last stage: whatever comes, what leaves is within the limits, and never both pedals.

    It knows the limits and what left before (`last`), nothing of the stages before. Ratios in
    [0, limit], the wheel in +- wheel_limit_rad, its rate in [floor, limit]. Where a number is not
    finite, or both pedals are pressed, the brake profile leaves, with the wheel where `last` wanted
    it if this one's is not finite.
    """
    s, p = dbw.steering, dbw.pedals
    wheel = raw.wheel_rad if math.isfinite(raw.wheel_rad) else last.wheel_rad
    rate = raw.wheel_rate_radps if math.isfinite(raw.wheel_rate_radps) else 0.0
    wheel = min(max(wheel, -s.wheel_limit_rad), s.wheel_limit_rad)
    rate = min(max(rate, s.wheel_rate_floor_radps), s.wheel_rate_limit_radps)
    numbers = (raw.accelerator, raw.brake, raw.wheel_rad, raw.wheel_rate_radps)
    if not all(map(math.isfinite, numbers)) or (raw.accelerator > 0.0 and raw.brake > 0.0):
        return Outputs(0.0, p.brake_profile, wheel, rate)
    return Outputs(
        min(max(raw.accelerator, 0.0), p.accelerator_limit),
        min(max(raw.brake, 0.0), p.brake_limit),
        wheel,
        rate,
    )


def _fault(dbw: DriveByWire, wanted: Wanted, read_back_rad: float, elapsed_s: float) -> str:
    p, s = dbw.pedals, dbw.steering
    if not p.accel_min_mps2 <= wanted.acceleration_mps2 <= p.accel_max_mps2:
        return f"acceleration {wanted.acceleration_mps2!r} m/s^2 out of range"
    if not abs(wanted.steering_rate_radps) <= s.rate_limit_radps:
        return f"steering rate {wanted.steering_rate_radps!r} rad/s out of range"
    if not abs(read_back_rad) <= s.wheel_limit_rad:
        return f"steering wheel reported at {read_back_rad!r} rad, out of range"
    if not 0.0 <= elapsed_s < math.inf:
        return f"{elapsed_s!r} s since the last turn"
    return ""


def _slewed(before: float, wanted: float, change: float) -> float:
    return min(max(wanted, before - change), before + change)


def _pedals(pedals: Pedals, acceleration_mps2: float) -> tuple[float, float]:
    if abs(acceleration_mps2) < pedals.coast_below_mps2:
        return 0.0, 0.0
    if acceleration_mps2 > 0.0:
        return pedals.accelerator.command_for(acceleration_mps2), 0.0
    return 0.0, pedals.brake.command_for(-acceleration_mps2)


def _outputs(
    dbw: DriveByWire, command: Wanted, read_back_rad: float, pedals: tuple[float, float]
) -> Outputs:
    """As the maps have it; what leaves is `guarded`."""
    s, rate = dbw.steering, command.steering_rate_radps
    road_rad = s.road_wheel.middle(read_back_rad)
    target_rad = _within(road_rad + rate * s.lead_s, s.angle_limit_rad)
    return Outputs(
        *pedals,
        s.road_wheel.command_for(target_rad),
        abs(rate) / s.road_wheel.slope(read_back_rad),
    )


def _sent(
    dbw: DriveByWire, command: Wanted, raw: Outputs, read_back_rad: float, before: Sent
) -> Sent:
    curve, limit_rad = dbw.steering.road_wheel, dbw.steering.angle_limit_rad
    turned_rad = curve.middle(read_back_rad) + command.steering_rate_radps * dbw.turn_s
    hold_rad = curve.command_for(_within(turned_rad, limit_rad))
    return Sent(command, guarded(dbw, raw, before.outputs), hold_rad)


def _within(angle_rad: float, limit_rad: float) -> float:
    return min(max(angle_rad, -limit_rad), limit_rad)


def _leads(dbw: DriveByWire, command: Wanted, read_back_rad: float) -> bool:
    """Whether the limit of the angle leaves the target as far ahead as the bound needs it."""
    s, rate = dbw.steering, command.steering_rate_radps
    road_rad = s.road_wheel.middle(read_back_rad)
    wanted_rad = road_rad + rate * s.lead_s
    target_rad = _within(wanted_rad, s.angle_limit_rad)
    ahead_rad = abs(target_rad - road_rad)
    return target_rad == wanted_rad or ahead_rad >= s.needed_lead_rad(rate, dbw.turn_s)


def _outcome(dbw: DriveByWire, wanted: Wanted, sent: Sent, *, covered: bool) -> Actuated:
    withheld = Wanted(
        abs(wanted.acceleration_mps2 - sent.command.acceleration_mps2),
        abs(wanted.steering_rate_radps - sent.command.steering_rate_radps),
    )
    covered = (
        covered
        and withheld.acceleration_mps2 <= dbw.pedals.withheld_mps2
        and withheld.steering_rate_radps <= dbw.steering.withheld_radps
    )
    return Actuated(sent, withheld, covered, "")
