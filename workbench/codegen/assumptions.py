"""The premises under which what a bundle says holds, each with what stands for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workbench.claims import Assumption
from workbench.models.vehicle_sections import Uncertainty
from workbench.reach.learned.tube import LearnedTube
from workbench.runtime.onboard.drive_by_wire import DriveByWire

if TYPE_CHECKING:
    from workbench.codegen.bundle import MonitorSpec

# How each kernel proves what is rounded in its tubes.
_ROUNDING = {
    "local": "proved: a budget over the operating region, see docs/online-kernel.md",
    "enclosed": "proved: outward throughout the tube, see docs/online-kernel.md; distances from "
    "people by a budget, see docs/separation.md",
}

_ALWAYS = (
    Assumption(
        "model", "the car moves as the kinematic bicycle under the bundle's control law",
        "none yet: no conformance fit; slip, lag and slope are not covered",
    ),
    Assumption(
        "time", "the initial set holds at the stamp; BRAKE is commanded within the switch interval",
        "age, check and sender are timed every cycle; TRACK's own delay is not in the tube",
    ),
    Assumption(
        "brake", "BRAKE acts after the vehicle file's delay and build-up, decelerates within its "
        "bounds, and the car does not roll back", "the vehicle file's provenance",
    ),
    Assumption(
        "compiled code", "the compiler kept the operations of the generated C",
        "flags without contraction or reassociation, golden vectors compared bit for bit",
    ),
    Assumption(
        "floating point", "round to nearest, subnormal numbers kept",
        "checked at loading and around every call",
    ),
    Assumption(
        "people", "everybody stays in their guard; for LookAhead, in their intent tubes",
        "guards: compared with every later observation; intent: the prediction's own model",
    ),
    Assumption(
        "sight", "whoever may be hidden within the watched disc is among the people, as assumed",
        "none: a stated limit; whoever fills the observation",
    ),
)  # fmt: skip


def _initial_set(spec: MonitorSpec) -> Assumption:
    share = next(each.share for each in spec.levels if each.name == spec.deciding_level)
    part = "the true state lies in the observation's intervals"
    if share < 1.0:
        part += f", each cut to its inner {share:.3g} about its centre (a speed of 0 stays in)"
    return Assumption(
        "initial set", f"{part}: the level {spec.deciding_level!r}, share {share:.3g}, decides",
        "whoever fills the observation",
    )  # fmt: skip


def assumptions(spec: MonitorSpec) -> tuple[Assumption, ...]:
    """The premises under which what a bundle of `spec` says holds, with their evidence."""
    rounding = Assumption(
        "rounding", "rounding, truncation and motion between instants are inside the tube",
        _ROUNDING[spec.method.kernel],
    )  # fmt: skip
    unsure = _uncertainty(spec.vehicle.unsure())
    wire = spec.vehicle.drive_by_wire
    measured = spec.vehicle.uncertainty.includes_drive_by_wire
    driven = (
        () if wire is None else (_measured_actuation() if measured else _actuation(wire.value),)
    )
    learned = () if spec.learned is None else (_learned(spec.learned),)
    return (_initial_set(spec), *_ALWAYS, unsure, *driven, rounding, *learned)


def _learned(method: LearnedTube) -> Assumption:
    return Assumption(
        "learned bound",
        "TRACK's tube: no trajectory leaves the learned bound about its region's simulation at any "
        "time; what the bundle says of errors, disturbances and rounding is of the other tubes",
        f"none but sampled runs: {method.learned.condition}",
    )


def _actuation(wire: DriveByWire) -> Assumption:
    return Assumption(
        "actuation", "at every instant the car does what the maps of the vehicle file allow for "
        f"the commands sent within the last {wire.turn_s + wire.pedals.longest_s:.3g} s (pedals), "
        f"{wire.turn_s + wire.steering.longest_s:.3g} s (steering); between two turns the law "
        "moves by no more than the slew allows",
        "none at run time but that withheld commands and clamped targets are told (covered); the "
        "vehicle file's provenance, and its outputs compared with its commands",
    )  # fmt: skip


def _measured_actuation() -> Assumption:
    return Assumption(
        "actuation", "the car moves as the law commands but for the disturbance of `estimation`, "
        "which was found with the drive-by-wire in between and not from its maps and delays",
        "none at run time but that withheld commands and clamped targets are told (covered); what "
        "the vehicle file's [uncertainty] says of the drives it was found in",
    )  # fmt: skip


def _uncertainty(unsure: Uncertainty) -> Assumption:
    bounds = [
        f"{what} within {bound:g} {unit}"
        for what, bound, unit in (
            ("the offset is read", unsure.lateral_m, "m"),
            ("the heading", unsure.heading_rad, "rad"),
            ("the speed", unsure.speed_mps, "m/s"),
            ("the acceleration is disturbed", unsure.acceleration_mps2, "m/s^2"),
            ("the steering's rate", unsure.steering_rate_radps, "rad/s"),
            ("the wheelbase is known", unsure.wheelbase_m, "m"),
        )
        if bound > 0.0
    ]
    felt = ", ".join(bounds) or "the controller reads the state without error"
    return Assumption(
        "estimation", f"{felt}; nothing else but the path's curvature disturbs the car",
        f"none at run time; the vehicle file's provenance: {unsure.provenance}",
    )  # fmt: skip
