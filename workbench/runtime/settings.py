"""What a monitor is set up with, and whether it makes sense."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.errors import InputError
from workbench.runtime.contents import Manifest, VehicleBody
from workbench.runtime.policies import FailSafe, Relation, Timing

_LATEST_S = 1e9


def fixed_values(
    body: VehicleBody, clearance_required_m: float, timing: Timing
) -> dict[str, Sequence[float]]:
    """What every query of a monitor holds alike."""
    return {
        "front_m": (body.front_m,),
        "rear_m": (body.rear_m,),
        "half_width_m": (body.half_width_m,),
        "clearance_required_m": (clearance_required_m,),
        "switch_s": timing.switch_s,
        "brake_s": (0.0, timing.latency_s + timing.send_gap_s),
    }


def fail_safe_of(manifest: Manifest, level: int, timing: Timing) -> FailSafe:
    """The policy that fits a bundle; guards must overlap from cycle to cycle, no more."""
    return FailSafe(
        level=level,
        timing=timing,
        brake=manifest.brake,
        required=Relation.OVERLAPS,
        unseen_speed_mps=manifest.guard_speed_max_mps,
    )


def started(now_s: float) -> float:
    """The clock's first instant; raises InputError for one that cannot be counted from."""
    if not -_LATEST_S < now_s < _LATEST_S:
        raise InputError(
            f"clock: expected a finite time in s below {_LATEST_S:g}, got {now_s!r}; give a "
            "monotonic clock that counts from a late zero, such as time.monotonic"
        )
    return now_s


def check_settings(clearance_required_m: float, start_station_m: float | None) -> None:
    """Raise InputError for a monitor's settings that make no sense."""
    if not 0.0 <= clearance_required_m < math.inf:
        raise InputError(
            f"expected a finite clearance_required_m >= 0, got {clearance_required_m!r}"
        )
    if start_station_m is not None and not math.isfinite(start_station_m):
        raise InputError(f"expected a finite start_station_m or None, got {start_station_m!r}")
