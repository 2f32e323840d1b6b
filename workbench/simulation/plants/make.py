"""Plants by name."""

from __future__ import annotations

import functools
from typing import Final

from workbench.errors import InputError
from workbench.models.vehicle import Vehicle
from workbench.simulation.plants.bicycle import BicycleChassis
from workbench.simulation.plants.chassis import Chassis, Start
from workbench.simulation.plants.single_track import (
    SingleTrack,
    SingleTrackChassis,
    gem_e2_single_track_path,
    load_single_track,
)

PLANTS: Final = ("bicycle", "single-track", "multi-body")


def chassis(
    kind: str, vehicle: Vehicle, *, x_m: float, y_m: float, heading: float, speed_mps: float = 0.0
) -> Chassis:
    """A car of this kind with the vehicle's wheelbase and steering limit, its wheels straight.

    kind: one of `PLANTS`; x_m, y_m: middle of the rear axle. Raises InputError for another kind,
    for `single-track` without a C compiler, for `multi-body` also without the extra `commonroad`.
    """
    return chassis_at(kind, vehicle, Start(x_m, y_m, heading, speed_mps))


def chassis_at(kind: str, vehicle: Vehicle, start: Start) -> Chassis:
    """The same from any start, also with its wheels turned."""
    wheelbase_m, limit_rad = vehicle.geometry.wheelbase_m, vehicle.limits.steering_rad
    if kind == "bicycle":
        return BicycleChassis(wheelbase_m, limit_rad, start=start)
    if kind == "single-track":
        return SingleTrackChassis(_single_track(), wheelbase_m, limit_rad, start=start)
    if kind == "multi-body":
        # Its package is an extra's.
        from workbench.simulation.plants.multi_body import MultiBodyChassis

        return MultiBodyChassis(wheelbase_m, limit_rad, start=start)
    raise InputError(f"expected a plant, one of {', '.join(PLANTS)}, got {kind!r}")


@functools.cache
def _single_track() -> SingleTrack:
    return load_single_track(gem_e2_single_track_path())
