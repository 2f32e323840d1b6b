"""How far a vehicle's motion can be from what was commanded, from its drive-by-wire's maps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from workbench.errors import InputError
from workbench.runtime.onboard.curve import Curve
from workbench.runtime.onboard.drive_by_wire import COUNT, DriveByWire, Pedals, Steering

# Every figure below takes fewer than 2^8 roundings of positive numbers.
_ROUNDING = 1.0 + 2.0**-40


@final
@dataclass(frozen=True, slots=True)
class ActuationBound:
    """Where the difference between commanded and realised comes from; all magnitudes.

    maps: the map's band and half a count; dead_band: what presses no pedal, or does not turn the
    wheel; delay: slew limit times (turn + delay + build-up); reading: what the controller commands
    wrongly because it misreads the road wheels; withheld: what the slew may withhold from the law.
    """

    maps: float
    dead_band: float
    delay: float
    reading: float
    withheld: float

    @property
    def total(self) -> float:
        """max(maps, dead_band), of which only one acts at a time, plus the rest; rounded up."""
        rest = self.delay + self.reading + self.withheld
        return (max(self.maps, self.dead_band) + rest) * _ROUNDING


def acceleration_bound(dbw: DriveByWire) -> ActuationBound:
    """|realised - wanted| acceleration (m/s^2) while `actuate` calls a turn covered.

    With S the slew limit, b = turn + longest delay + longest build-up, and E the largest distance,
    over all ratios that a permitted command gives, between the band of the map, half a count to
    either side, and its middle (coasting: between the band of coasting and the command):
    |realised(t) - sent(t)| <= E + S b, |sent - wanted| <= withheld.

    Assumes that the realised acceleration lies at every instant in the hull of what the maps allow
    for the commands sent within the last b; that covers every mixture of delays and monotone build-
    up. Rigor NUMERICAL, rounded up. Source: triangle inequality; E is attained at a node of the
    piecewise linear bands, shifted by half a count.
    """
    p = dbw.pedals
    used = (
        (p.accelerator, p.coast_below_mps2, p.accel_max_mps2),
        (p.brake, p.coast_below_mps2, -p.accel_min_mps2),
    )
    return ActuationBound(
        maps=max(_map_error(curve, least, most) for curve, least, most in used),
        dead_band=_coasting_error(p),
        delay=p.slew_mps3 * (dbw.turn_s + p.longest_s),
        reading=0.0,
        withheld=p.withheld_mps2,
    )


def steering_bound(dbw: DriveByWire, *, reading_gain_per_s: float) -> ActuationBound:
    """|realised - wanted| road-wheel rate (rad/s) while `actuate` calls a turn covered.

    reading_gain_per_s: how much the law's rate changes with the road-wheel angle that it reads, at
    most. For a rate u whose target lies far enough ahead (`Steering.needed_lead_rad`), the wheel
    turns all the time at the rate that it is given: maps = rate_error |u| + half a count. Below the
    least such rate u_b the wheel may rest, or turn either way: dead_band = (2 + rate_error) u_b +
    half a count. Delay as in `acceleration_bound`.

    Assumes that a wheel outside of its dead band turns towards its target at the rate given, within
    rate_error seen at the road wheels, and the hull of `acceleration_bound`. Raises InputError for
    a lead that no rate makes long enough.
    """
    s, limit = dbw.steering, dbw.steering.rate_limit_radps
    steepest = max(s.road_wheel.slopes)
    count = 0.5 * COUNT * steepest
    return ActuationBound(
        maps=s.rate_error * limit + count,
        dead_band=(2.0 + s.rate_error) * _least_rate_radps(s, dbw.turn_s) + count,
        delay=s.slew_radps2 * (dbw.turn_s + s.longest_s),
        reading=reading_gain_per_s * _reading_error_rad(s),
        withheld=s.withheld_radps,
    )


def _map_error(curve: Curve, least: float, most: float) -> float:
    first, last = curve.command_for(least), curve.command_for(most)
    return max(
        max(highest - middle, middle - lowest)
        for ratio in _corners(curve, first, last)
        for lowest, highest in [curve.effect((ratio - 0.5 * COUNT, ratio + 0.5 * COUNT))]
        for middle in [curve.middle(ratio)]
    )


def _corners(curve: Curve, first: float, last: float) -> Iterator[float]:
    """Every ratio in [first, last] where the error as a function of the ratio may have a corner."""
    yield from (first, last)
    for node in curve.command:
        for ratio in (node - 0.5 * COUNT, node, node + 0.5 * COUNT):
            if first < ratio < last:
                yield ratio


def _coasting_error(pedals: Pedals) -> float:
    below, (low, high) = pedals.coast_below_mps2, pedals.coast_mps2
    return max(high + below, below - low)


def _least_rate_radps(steering: Steering, turn_s: float) -> float:
    """The rate from which on a target always lies far enough ahead."""
    at_rest = steering.needed_lead_rad(0.0, turn_s)
    per_rate = steering.needed_lead_rad(1.0, turn_s) - at_rest
    if not steering.lead_s > per_rate:
        raise InputError(
            f"[drive_by_wire.steering] lead_s: expected more than {per_rate!r} s, in which the "
            f"road wheels would reach their target before the next command, got "
            f"{steering.lead_s!r}; lengthen it"
        )
    floor = steering.wheel_rate_floor_radps * max(steering.road_wheel.slopes)
    return max(floor, at_rest / (steering.lead_s - per_rate) * (1.0 + 2.0**-40))


def _reading_error_rad(steering: Steering) -> float:
    """Largest distance of the true road-wheel angle from the middle of the map at a report."""
    curve, error = steering.road_wheel, steering.report_error_rad
    bands = zip(curve.lowest, curve.middles, curve.highest, strict=True)
    widest = max(max(high - middle, middle - low) for low, middle, high in bands)
    return math.nextafter(widest + error * max(curve.slopes), math.inf)
