"""Where the beacons stand and what the estimate may assume of the vehicle: values, checked."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError

_FEWEST_BEACONS: Final = 3
# The beacons' extent across the line through them, over that along it.
_THINNEST: Final = 0.05


def _require_positive(section: object, *keys: str) -> None:
    for key in keys:
        value = getattr(section, key)
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{key}: expected a number > 0, got {value!r}")


@final
@dataclass(frozen=True, slots=True)
class Beacon:
    """A fixed transponder; height over the floor that the wheels stand on."""

    name: str
    x_m: float
    y_m: float
    height_m: float


@final
@dataclass(frozen=True, slots=True)
class Antenna:
    """The vehicle's transponder, from the middle of the rear axle."""

    forward_m: float
    left_m: float
    height_m: float
    provenance: str


@final
@dataclass(frozen=True, slots=True)
class Ranges:
    """Time-of-flight ranges: deviation in line of sight, and the share that comes round a corner.

    accepted: share of ranges in line of sight that the gate lets pass; stray_share of all ranges
    are longer by an excess that is exponential with mean stray_m.
    """

    deviation_m: float
    accepted: float
    stray_share: float
    stray_m: float
    provenance: str

    def __post_init__(self) -> None:
        _require_positive(self, "deviation_m", "stray_m")
        if not (0.5 <= self.accepted < 1.0 and 0.0 <= self.stray_share < 0.5):
            raise InputError(
                "accepted, stray_share: expected shares in [0.5, 1) and [0, 0.5), got "
                f"{self.accepted!r} and {self.stray_share!r}"
            )


@final
@dataclass(frozen=True, slots=True)
class Reports:
    """The vehicle's reports: deviations of one report, of the speed's scale and of the zero."""

    speed_mps: float
    steering_rad: float
    speed_scale: float
    steering_zero_rad: float
    standing_mps: float
    standing_s: float
    provenance: str

    def __post_init__(self) -> None:
        _require_positive(self, *(f.name for f in dataclasses.fields(self)[:-1]))


@final
@dataclass(frozen=True, slots=True)
class Motion:
    """Random walks beside the kinematic bicycle; units in the shipped file."""

    acceleration: float
    steering_rate: float
    heading_slip: float
    lateral_slip: float
    forward_slip: float
    standing_heading: float
    standing_mps: float
    standing_s: float
    scale_walk: float
    zero_walk_rad: float
    provenance: str

    def __post_init__(self) -> None:
        _require_positive(self, *(f.name for f in dataclasses.fields(self)[:-1]))


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """When a heading, or the whole estimate, is not to be used."""

    heading_rad: float
    still_m: float
    lost_after: float
    range_age_s: float
    provenance: str

    def __post_init__(self) -> None:
        _require_positive(self, "heading_rad", "lost_after", "range_age_s")
        if not 0.0 <= self.still_m < math.inf:
            raise InputError(f"still_m: expected a number >= 0, got {self.still_m!r}")


@final
@dataclass(frozen=True, slots=True)
class Site:
    """All that the estimate rests on, beside the vehicle's wheelbase.

    Raises InputError unless there are at least three beacons with distinct names that do not stand
    on one line: from ranges to a line nobody can tell its two sides apart.
    """

    beacons: tuple[Beacon, ...]
    antenna: Antenna
    ranges: Ranges
    reports: Reports
    motion: Motion
    limits: Limits

    def __post_init__(self) -> None:
        names = [beacon.name for beacon in self.beacons]
        if len(names) < _FEWEST_BEACONS or len(set(names)) != len(names):
            raise InputError(
                f"beacon: expected at least {_FEWEST_BEACONS} with distinct names, got {names}"
            )
        along, across = _extents(self.beacons)
        if not across > _THINNEST * along:
            raise InputError(
                "beacon: expected beacons around the place, got all within "
                f"{across:.3g} m of one line of {along:.3g} m; move one of them off the line"
            )


def _extents(beacons: tuple[Beacon, ...]) -> tuple[float, float]:
    """Roots of the eigenvalues of the scatter of the beacons' places."""
    n = len(beacons)
    x0, y0 = sum(b.x_m for b in beacons) / n, sum(b.y_m for b in beacons) / n
    xx = sum((b.x_m - x0) ** 2 for b in beacons)
    yy = sum((b.y_m - y0) ** 2 for b in beacons)
    xy = sum((b.x_m - x0) * (b.y_m - y0) for b in beacons)
    middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return math.sqrt(middle + half), math.sqrt(max(middle - half, 0.0))
