"""A beta for a vehicle's TRACK along any path, fixed before the drive, as in the paper."""

from __future__ import annotations

import dataclasses
from typing import Final

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import Vehicle
from workbench.reach.learned.shared_middles import Range, about_shared_middles
from workbench.sensitivity.discrepancy import Discrepancy, LearningMethod, learn_discrepancy
from workbench.sets import Box

SHARE: Final = 0.5
"""Of the operating region's width, about its middle: where sets are drawn."""


def learn_vehicle_beta(
    vehicle: Vehicle, *, horizon_s: float, method: LearningMethod
) -> Discrepancy:
    """Learn how far TRACK's runs spread from sets of the vehicle file's size, wherever they are.

    Each pair starts in one box with the radii of [initial_set], about a middle that is uniform on
    the middle half of [operation.region] (speeds from 0 on, if that is more), follows a speed
    uniform on 0 to the region's fastest, on a road of a curvature uniform on +- [operation]'s. The
    curvature is constant along a run; errors and disturbances of the file do not act: the paper's
    model has none. Rigor SAMPLED; the bound's region is where such pairs start.
    InputError as `method` raises it, and for an initial set without width.
    """
    most, region = vehicle.operation.curvature_per_m, vehicle.operation.region
    ode = vehicle.closed_loop(vehicle.track(), PathFrame(-most, most)).ode
    middles = {"station": (0.0, 0.0)} | {
        name: _inner(region.interval(name), standing=name == "speed") for name in region.names
    }
    radius = dict(zip(vehicle.initial_set.names, vehicle.initial_set.radius, strict=True))
    ranges = {
        "curvature": (-most, most),
        "reference_speed": (0.0, region.interval("speed")[1]),
    }
    system = about_shared_middles(ode, Box.from_intervals(middles), ranges=ranges)
    found = learn_discrepancy(
        system,
        initial_set=Box(ode.names, *_about_zero([radius[name] for name in ode.names])),
        horizon_s=horizon_s,
        method=method,
    )
    sides = {
        name: (low - radius[name], high + radius[name]) for name, (low, high) in middles.items()
    }
    del sides["station"]
    condition = (
        "both start in one box of the vehicle file's initial radii about a shared middle within "
        f"{SHARE:g} of the operating region, on a road of constant curvature, without errors and "
        f"disturbances; {found.condition}"
    )
    return dataclasses.replace(found, region=Box.from_intervals(sides), condition=condition)


def _about_zero(radius: list[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if not any(radius):
        raise InputError("expected an [initial_set] with some width, got a point; widen an axis")
    return tuple(-each for each in radius), tuple(radius)


def _inner(side: Range, *, standing: bool) -> Range:
    middle, half = 0.5 * (side[0] + side[1]), 0.5 * SHARE * (side[1] - side[0])
    low, high = middle - half, middle + half
    return (min(low, 0.0), high) if standing else (low, high)
