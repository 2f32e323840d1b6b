"""The full loop of a car whose wheelbase, speed and delay its controller does not know."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import casadi as ca

from workbench.models.bicycle import PathFrame, Pose
from workbench.models.gains.ranged_loop import Ranges
from workbench.models.signals import Ranged
from workbench.models.system import Ode

if TYPE_CHECKING:
    from workbench.models.vehicle import Vehicle

IN_FLIGHT: Final = "steering_in_flight"


@final
@dataclass(frozen=True, slots=True)
class _TrueCar:
    """The loop's own symbols, except for the wheelbase, which is the car's."""

    known: Mapping[str, ca.SX]
    wheelbase: ca.SX

    def parameter(self, name: str, unit: str, value: float) -> ca.SX:  # noqa: ARG002
        return self.wheelbase if name == "wheelbase" else self.known[name]

    def disturbance(
        self,
        name: str,
        unit: str,  # noqa: ARG002
        nominal: float,  # noqa: ARG002
        *,
        lower: float,  # noqa: ARG002
        upper: float,  # noqa: ARG002
    ) -> ca.SX:
        return self.known[name]

    def state(self, name: str, unit: str) -> ca.SX:  # noqa: ARG002
        return self.known[name]


def in_flight_bound_rad(vehicle: Vehicle, ranges: Ranges) -> float:
    """How far the steering may be from what was commanded: the longest delay at the rate limit."""
    product = ranges.delay_s[1] * vehicle.limits.steering_rate_radps
    return math.nextafter(product, math.inf) if product else 0.0


def ranged_plant(vehicle: Vehicle, ranges: Ranges) -> Ode:
    """TRACK on a straight path, of every car of the ranges under the vehicle's own controller.

    Wheelbase and speed scale are unknown constants, parameters `true_wheelbase` and `speed_scale`
    that only the car's motion sees. The state `speed` is the measured one; the car moves at
    speed_scale times it. The state `steering` is the commanded one, d' = u. With a delay t the
    car's steering is d(t - delay), which differs from d by what is in flight: at most delay times
    the limit of the steering rate. It enters as the disturbance `steering_in_flight`, which car and
    controller both see. Nothing is in flight at the start. Sound for every car, and for more
    motions than the delay allows.
    """
    ode = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0)).ode
    known = {each.name(): each for each in ca.vertsplit(ca.vertcat(ode.x, ode.p, ode.w))}
    wheelbase, scale = ca.SX.sym("true_wheelbase"), ca.SX.sym("speed_scale")
    plant = PathFrame(0.0, 0.0).bicycle(vehicle.geometry.wheelbase_m, vehicle.limits.steering_rad)
    pose = Pose(known["offset"], known["heading_error"], known["steering"], scale * known["speed"])
    rates = plant.rates(_TrueCar(known, wheelbase), pose)
    moved = {"station": rates.along, "offset": rates.offset, "heading_error": rates.heading}
    field = ca.vertcat(*(moved.get(name, ode.field[k]) for k, name in enumerate(ode.names)))
    outputs = ca.vertcat(*(expression for _, expression in ode.outputs))
    disturbances, w = ode.disturbances, ode.w
    bound = in_flight_bound_rad(vehicle, ranges)
    if bound:
        flight = ca.SX.sym(IN_FLIGHT)
        field, outputs = ca.substitute(
            [field, outputs], [known["steering"]], [known["steering"] + flight]
        )
        disturbances = (*disturbances, Ranged.symmetric(IN_FLIGHT, "rad", bound))
        w = ca.vertcat(w, flight)
    middle = ranges.middle
    return Ode(
        name="true car under its controller",
        states=ode.states,
        parameters=(
            *ode.parameters,
            Ranged("true_wheelbase", "m", middle.wheelbase_m, *ranges.wheelbase_m),
            Ranged("speed_scale", "1", middle.speed_scale, *ranges.speed_scale),
        ),
        disturbances=disturbances,
        x=ode.x,
        p=ca.vertcat(ode.p, wheelbase, scale),
        w=w,
        field=field,
        outputs=tuple((name, outputs[k]) for k, (name, _) in enumerate(ode.outputs)),
    )
