"""TRACK, then BRAKE to standstill, as one equation whose braking part is exogenous."""

from __future__ import annotations

import dataclasses

import casadi as ca

from workbench.errors import InputError
from workbench.models.signals import Ranged
from workbench.models.system import Ode

TRACKING, BRAKING, INTEGRATING = "tracking", "braking", "speed_integrating"
BRAKE_SPEED, STEERING_SHARE = "brake_speed", "steering_share"
INTEGRAL_SHARE, FREE_STEERING = "offset_integral_share", "free_steering_rate"
SPEED_ERROR = "speed_estimate_error"
ACCELERATION_DISTURBANCE = "acceleration_disturbance"
STEERING_DISTURBANCE = "steering_rate_disturbance"
REFERENCE_CHANGE = "reference_speed_change"
MAY_DISTURB = frozenset({
    "curvature", "wheelbase", "position_error_lateral", "heading_estimate_error", SPEED_ERROR,
    ACCELERATION_DISTURBANCE, STEERING_DISTURBANCE, REFERENCE_CHANGE,
})  # fmt: skip
"""What may disturb a loop: only the acceleration's disturbance changes the speed besides the
commands, only the speed's estimate changes what BRAKE leaves of the steering; the change of the
reference acts on the command to accelerate alone, which BRAKE does not follow."""


def stopping_loop(track: Ode, *, speeds_mps: tuple[float, float]) -> Ode:
    """The loop `track` (of `Track`) that a parameter turns into that of `VehicleBrake`.

    Parameters `tracking` a and `braking` b, one of them 1 and the other 0: with a = 1 it is `track`
    itself; with b = 1 the car moves with the disturbance `brake_speed` within speeds_mps, any
    function of time, while the state `speed` rests: nothing that BRAKE does to the speed depends on
    the other states, so it is bounded in closed form by whoever chooses the disturbance's range.
    (Two parameters, because 1 - b has the magnitude 1 + |b|.) Parameter `speed_integrating` g
    scales the speed integral's rate. Disturbances `steering_share` and `offset_integral_share` in
    [0, 1] scale the rates of the steering and of its integral: 1 in TRACK, clip(v / stop_speed - 1,
    0, 1) in BRAKE. `free_steering_rate`, within the rate limits or 0, is added to the steering's
    rate: with `steering_share` = 0 it stands for whatever the steering may do within its limits.
    Every solution of the loop with `VehicleBrake`, under any of its decelerations, solves this one
    for a = 0, b = 1, g = 0, brake_speed = max(0, speed), in all states but speed and clock. A
    disturbance of the steering's rate is not scaled. New parameters and disturbances come after
    those of `track`. Raises InputError for a loop without the states, commands and limits of a
    `Track` with a path, or one that anything disturbs which is not in `MAY_DISTURB`: the bounds on
    speed and share would have to know it.
    """
    _check(track)
    tracking, braking, integrating = map(ca.SX.sym, (TRACKING, BRAKING, INTEGRATING))
    exogenous, share = ca.SX.sym(BRAKE_SPEED), ca.SX.sym(STEERING_SHARE)
    integral_share, free = ca.SX.sym(INTEGRAL_SHARE), ca.SX.sym(FREE_STEERING)
    own = track.x[track.names.index("speed")]
    scales = {
        "speed": tracking, "speed_integral": integrating, "steering": share,
        "offset_integral": integral_share,
    }  # fmt: skip
    turning = ca.vertcat(*(
        symbol
        for disturbance, symbol in zip(track.disturbances, ca.vertsplit(track.w), strict=True)
        if disturbance.name == STEERING_DISTURBANCE
    ))  # fmt: skip
    commanded = ca.substitute(track.field, turning, ca.SX.zeros(turning.shape))
    added = {"steering": free + ca.sum1(turning)}
    scaled = [
        scales.get(name, ca.SX(1)) * rate + added.get(name, ca.SX(0))
        for name, rate in zip(track.names, ca.vertsplit(commanded), strict=True)
    ]
    moving = tracking * own + braking * exogenous
    field = ca.cse(ca.substitute(ca.vertcat(*scaled), own, moving))
    nominal = {parameter.name: parameter.nominal for parameter in track.parameters}
    rates = min(nominal["steering_rate_min"], 0.0), max(nominal["steering_rate_max"], 0.0)
    switches = [Ranged(name, "1", 1.0, 0.0, 1.0) for name in (TRACKING, BRAKING, INTEGRATING)]
    inputs = [
        Ranged(BRAKE_SPEED, "m/s", 0.0, *speeds_mps), Ranged(STEERING_SHARE, "1", 1.0, 0.0, 1.0),
        Ranged(INTEGRAL_SHARE, "1", 1.0, 0.0, 1.0), Ranged(FREE_STEERING, "rad/s", 0.0, *rates),
    ]  # fmt: skip
    return dataclasses.replace(
        track,
        name=f"{track.name}, then BRAKE",
        parameters=(*track.parameters, *switches),
        disturbances=(*track.disturbances, *inputs),
        p=ca.vertcat(track.p, tracking, braking, integrating),
        w=ca.vertcat(track.w, exogenous, share, integral_share, free),
        field=field,
        outputs=(),
    )


_STATES = {"speed", "speed_integral", "steering", "offset_integral"}
_PARAMETERS = {
    "reference_speed", "acceleration_min", "acceleration_max", "steering_rate_min",
    "steering_rate_max",
}  # fmt: skip


def _check(track: Ode) -> None:
    known = {*track.names, *(parameter.name for parameter in track.parameters)}
    missing = (_STATES | _PARAMETERS) - known
    if missing:
        raise InputError(f"expected a loop of plant and PIDs, {track.name} lacks {sorted(missing)}")
    more = sorted({disturbance.name for disturbance in track.disturbances} - MAY_DISTURB)
    if more:
        raise InputError(
            f"expected a loop that only {', '.join(sorted(MAY_DISTURB))} disturb, {track.name} has "
            f"{more}; the bounds on the speed while braking do not know them"
        )
