"""What the control law reads: one point for the sets that are known, and one that does not jump."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, final

from workbench.runtime.arc import Interval
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.onboard_settings import ReadingErrors
from workbench.runtime.onboard.pid import Reading
from workbench.runtime.projection import PathPose

# Fast against a wheel that is out of true, slow against the slew of the steering.
_PULL_M: Final = 2.0


@final
@dataclass(frozen=True, slots=True)
class LawReading:
    """The law's reading, moved on from turn to turn; `seen` returns the next value.

    A new localisation moves the middle of what is known by up to its own error, and the law would
    answer with a steering rate that no slew lets through. But any point is a reading as good as the
    proof needs it, if no state that is possible is farther from it than the error that the proof
    grants. So offset and heading error go on as the bicycle does, e' = v sin psi, psi' = v (tan
    steering / L - kappa cos psi / (1 - kappa e)), are pulled to the middle by v dt / 2 m of the
    way, and are held to [upper - granted, lower + granted] (the middle, where that is empty). The
    first one is as near to the path as it may be. Where `free`, as in a car that stands, there may
    be jumps: the reading is put into what is known, one localisation after the other. Speed and
    steering are the middles.

    reading: None before the first.
    """

    wheelbase_m: float
    granted: ReadingErrors
    reading: Reading | None = None

    def seen(
        self,
        observation: Observation,
        pose: PathPose,
        curvature_per_m: float,
        *,
        elapsed_s: float,
        free: bool,
    ) -> LawReading:
        """With what is known now, elapsed_s later."""
        offset, heading = 0.0, 0.0
        if self.reading is not None:
            offset, heading = self._moved(self.reading, pose, elapsed_s)
        now = Reading(
            _held(offset, pose.offset, pose.offset if free else None, self.granted.offset_m),
            _held(
                heading,
                pose.heading_error,
                pose.heading_error if free else None,
                self.granted.heading_rad,
            ),
            middle(observation.steering),
            middle(observation.speed),
            curvature_per_m,
        )
        return replace(self, reading=now)

    def _moved(self, before: Reading, pose: PathPose, elapsed_s: float) -> tuple[float, float]:
        v, curvature = before.speed_mps, before.curvature_per_m
        gap = 1.0 - curvature * before.offset_m
        if not gap > 0.0:
            return middle(pose.offset), middle(pose.heading_error)
        sine, cosine = math.sin(before.heading_error_rad), math.cos(before.heading_error_rad)
        turning = math.tan(before.steering_rad) / self.wheelbase_m - curvature * cosine / gap
        offset = before.offset_m + elapsed_s * v * sine
        heading = before.heading_error_rad + elapsed_s * v * turning
        share = min(abs(v) * elapsed_s / _PULL_M, 1.0)
        return (
            offset + share * (middle(pose.offset) - offset),
            heading + share * (middle(pose.heading_error) - heading),
        )


def middle(ends: Interval) -> float:
    """Of an interval."""
    return 0.5 * (ends[0] + ends[1])


def _held(value: float, ends: Interval, within: Interval | None, granted: float) -> float:
    low, high = ends[1] - granted, ends[0] + granted
    if within is not None:
        low, high = max(low, within[0]), min(high, within[1])
    return min(max(value, low), high) if low <= high else middle(ends)
