"""How wide the boxes of bounded errors are: what beacons and errors do to place and heading.

`python -m workbench.bench.bounded_widths` (extra `analysis`) prints a table. A bicycle drives
curves of either hand in a ring of beacons, without slip; every range errs within a bound and one of
each round is far off; speed and steering are reported within 0.02 m/s and 0.005 rad. It fails when
a box does not hold the truth.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from workbench.bench.text import table
from workbench.estimation.bounded_localisation import BoundedRange, BoundedTrack
from workbench.estimation.lanes import Array
from workbench.runtime.localiser.site import Antenna, Beacon
from workbench.runtime.onboard.dead_reckoning import (
    Driven,
    Pose,
    Quantity,
    Sampled,
    per_wheelbase,
)

RINGS: Final = ((6, 0.15), (16, 0.2), (32, 0.2), (32, 0.1), (32, 0.05), (32, 0.02))
"""Beacons, and the bound of their ranges' errors, m."""
SEEDS: Final = range(2)
UNTIL_MS, AFTER_MS, PERIOD_MS, REPORT_MS = 14_000, 9_000, 333, 33
_RADIUS_M: Final = 28.0
_ANTENNA: Final = Antenna(0.9, 0.0, 1.9, "of the bench")
_HEIGHT_M: Final = 3.0
_STRAY_M: Final = (0.5, 9.0)
_WHEELBASE_M: Final = 1.75
_SPEED_MPS, _STEERING_RAD = 0.02, 0.005


def main() -> bool:
    """Print the table; True: every box held the truth."""
    rows, held = [], True
    for count, error_m in RINGS:
        found = [each for seed in SEEDS for each in halves(count, error_m, seed)]
        held = held and all(holds for holds, *_ in found)
        wide = np.asarray([each[1:] for each in found])
        middle, most = np.median(wide, axis=0), wide.max(axis=0)
        rows.append([
            str(count), f"{error_m:g} m",
            *(f"{middle[k]:.3f}, {most[k]:.3f} {unit}" for k, unit in ((0, "m"), (1, "rad"))),
        ])  # fmt: skip
    headings = ["beacons", "error within", "place: median, most", "heading: median, most"]
    sys.stdout.write(table(headings, rows) + "\n")
    return held


def halves(count: int, error_m: float, seed: int) -> Iterator[tuple[bool, float, float]]:
    """Whether a box held the pose, and half its width: the larger of x and y, and heading."""
    rng = np.random.default_rng(seed)
    poses, driven = _driven(rng)
    beacons = [_beacon(k, count) for k in range(count)]
    x, y, _ = poses[0]
    start = Pose((x - 10.0, x + 10.0), (y - 10.0, y + 10.0), (-math.pi, math.pi))
    track = BoundedTrack(start, 0)
    for at_ms in range(PERIOD_MS, UNTIL_MS, PERIOD_MS):
        moved = track.moved_on(driven, until_us=1000 * at_ms)
        assert moved is not None, "reports keep to their bounds"
        found = moved.ranged(_ranges(rng, poses[at_ms], beacons, error_m), _ANTENNA, wrong=1)
        assert found is not None, "ranges keep to their bounds"
        track = found
        if at_ms > AFTER_MS:
            pose = track.pose
            sides = (pose.x, pose.y, pose.heading)
            half = [0.5 * (high - low) for low, high in sides]
            off = [true - 0.5 * sum(side) for true, side in zip(poses[at_ms], sides, strict=True)]
            off[2] = math.remainder(off[2], math.tau)
            holds = all(abs(o) <= h for o, h in zip(off, half, strict=True))
            yield holds, max(half[:2]), half[2]


def _beacon(k: int, count: int) -> Beacon:
    turn = math.tau * k / count + 0.1
    return Beacon(str(k), _RADIUS_M * math.cos(turn), _RADIUS_M * math.sin(turn), _HEIGHT_M)


def _driven(rng: np.random.Generator) -> tuple[Array, Driven]:
    """The pose at every millisecond, (n, 3), and what is reported on the way."""
    time = np.arange(UNTIL_MS + 1) / 1e3
    speed = np.clip(1.5 * time, 0.0, 2.0)
    steering = 0.25 * np.sin(0.5 * time + rng.uniform(0.0, math.tau))
    turn = speed * np.tan(steering) / _WHEELBASE_M
    heading = rng.uniform(-3.0, 3.0) + _summed(turn)
    x, y = _summed(speed * np.cos(heading)), _summed(speed * np.sin(heading))

    def said(values: Array, error: float) -> tuple[Sampled, ...]:
        about = values + rng.uniform(-error, error, len(values))
        return tuple(
            Sampled((float(about[k] - error), float(about[k] + error)), 1000 * k, 1000 * k)
            for k in range(0, len(values), REPORT_MS)
        )

    driven = Driven(
        Quantity(said(speed, _SPEED_MPS), (-6.0, 3.0), (-0.1, 8.0)),
        Quantity(said(steering, _STEERING_RAD), (-0.4, 0.4), (-0.6, 0.6)),
        per_wheelbase((_WHEELBASE_M - 0.01, _WHEELBASE_M + 0.01)),
    )
    return np.stack([x, y, heading], axis=1), driven


def _summed(rate: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(rate[:-1])]) / 1e3


def _ranges(
    rng: np.random.Generator, pose: Array, beacons: Sequence[Beacon], error_m: float
) -> list[BoundedRange]:
    """One of each beacon, within bounds that are error_m wide to either side; one far too long."""
    x, y, heading = (float(value) for value in pose)
    antenna = (
        x + _ANTENNA.forward_m * math.cos(heading), y + _ANTENNA.forward_m * math.sin(heading),
        _ANTENNA.height_m,
    )  # fmt: skip
    stray, found = int(rng.integers(len(beacons))), []
    for k, beacon in enumerate(beacons):
        said = math.dist(antenna, (beacon.x_m, beacon.y_m, beacon.height_m))
        said += float(rng.uniform(-error_m, error_m))
        if k == stray:
            said += float(rng.uniform(*_STRAY_M))
        found.append(BoundedRange(beacon, (max(said - error_m, 0.0), said + error_m)))
    return found


if __name__ == "__main__":
    sys.exit(not main())
