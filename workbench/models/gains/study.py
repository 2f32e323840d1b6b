"""One vehicle's gains from all sides: the study behind the page of `workbench gains`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.controllers.sampling import IntegralStep, Jitter, Sampling
from workbench.errors import InputError
from workbench.models.gains.held import HeldLoop, Timing, schur_stable
from workbench.models.gains.jitter import JitterStudy, Judged, jitter_study
from workbench.models.gains.lateral import AXES, LateralLoop
from workbench.models.gains.over_speed import OverSpeed, over_speed
from workbench.models.gains.responses import Responses, responses
from workbench.models.gains.routh import Piece, Reason, conditions, stability_pieces, stable_between
from workbench.models.gains.spectral import (
    CriticalDelay,
    SampledMap,
    critical_delay,
    sampled_map,
    steady_sampling,
)
from workbench.models.gains.stability_map import StabilityMap, stability_map
from workbench.models.gains.three_routes import Checked, checked_points
from workbench.models.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAPS: Final = (
    ("speed", "kp"), ("speed", "kd"), ("speed", "ki"),
    ("speed", "look-ahead"), ("look-ahead", "kp"), ("kd", "kp"),
)  # fmt: skip
_SEED: Final = 1


@final
@dataclass(frozen=True, slots=True)
class Effort:
    """How much a study draws and tries: points per map axis, speeds, schedules per pattern length.

    None of them changes what is proved, only how much is looked at.
    """

    points: int = 61
    speeds: int = 25
    patterns: int = 200

    def __post_init__(self) -> None:
        for each in dataclasses.fields(self):
            if not getattr(self, each.name) > 1:
                raise InputError(
                    f"Effort.{each.name}: expected more than 1, got {getattr(self, each.name)!r}"
                )


@final
@dataclass(frozen=True, slots=True, eq=False)
class GainStudy:
    """What a vehicle's gains do; every part has `rows()` for a data frame and `plot()`.

    speed_range_mps: the speeds studied; stable_speeds_mps: stretches of that range on which every
    frozen speed is stable, proved; always_stable: the whole range is one of them; along: by axis,
    exact pieces over its range, the other values being as in `loop`. without_ahead:
    the map of (kd, kp) with look-ahead 0. timing_stable: exact, at the middle of the timing.
    """

    vehicle: str
    loop: LateralLoop
    reason: Reason
    speed_range_mps: tuple[float, float]
    stable_speeds_mps: tuple[tuple[float, float], ...]
    always_stable: bool
    along: tuple[tuple[str, tuple[Piece, ...]], ...]
    over_speed: OverSpeed
    responses: Responses
    maps: tuple[StabilityMap, ...]
    without_ahead: StabilityMap
    checked: tuple[Checked, ...]
    sampling: Sampling
    timing_stable: bool
    critical: CriticalDelay
    sampled: tuple[SampledMap, ...]
    jitter: JitterStudy
    linear_offset_m: float

    def rows(self) -> list[dict[str, str | float | bool]]:
        """Poles and margins over speed, the first thing to look at."""
        return self.over_speed.rows()

    def plot(self) -> Figure:
        """Two maps, phase margins, step responses, samples and jitter in one figure."""
        from workbench.models.gains.pictures import figure, paint_study

        return figure(lambda canvas: paint_study(canvas, self), width_in=11.0, height_in=6.0)

    @property
    def judged(self) -> Judged:
        """Proof and search for the timing as it was given."""
        return next(e for e in self.jitter.judged if e.sampling == self.sampling)

    @property
    def disagreements(self) -> int:
        """Grid points, over all maps, at which exact conditions and eigenvalues differ."""
        return sum(each.disagreeing for each in (*self.maps, self.without_ahead))


def default_ranges(loop: LateralLoop) -> dict[str, tuple[float, float]]:
    """Ranges of maps about the present values, beyond 0 to where signs change."""
    found = {"speed": (-1.0, 2.5 * abs(loop.speed_mps) or 5.0)}
    for name, least in (("look-ahead", 3.0), ("kp", 0.05), ("ki", 0.02), ("kd", 0.3)):
        high = max(3.0 * abs(loop.value(name)), least)
        found[name] = (0.0 if name == "look-ahead" else -0.15 * high, high)
    return found


def default_sampling() -> Sampling:
    """30 samples per second, 5 ms of jitter on a clock, commands act 50 ms later."""
    return Sampling(1.0 / 30.0, 0.005, Jitter.CLOCK, (0.0, 0.0), (0.05, 0.05), IntegralStep.NOMINAL)


def study_gains(
    vehicle: Vehicle,
    *,
    gains: Mapping[str, float] | None = None,
    speed_range_mps: tuple[float, float] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    sampling: Sampling | None = None,
    effort: Effort | None = None,
) -> GainStudy:
    """The whole study of a vehicle's steering gains on a straight path.

    gains: values to study instead of the file's, by the names of `AXES` (speed: instead of the
    reference speed); speed_range_mps: 0 < low < high, by default from 0.3 m/s to the fastest of the
    operating region; ranges: of the maps' axes, beside `default_ranges`; sampling: timing on the
    vehicle, by default `default_sampling`. Rigor: exact conditions, maps along lines, and the
    contraction proof are ENCLOSED statements about the linearised loop; all else is NUMERICAL, the
    search SAMPLED. Raises InputError on values that cannot be.
    """
    loop, effort = LateralLoop.of(vehicle).at(gains or {}), effort or Effort()
    if loop.speed_mps <= 0.0:
        raise InputError(f"speed: expected a speed > 0 in m/s, got {loop.speed_mps:g}")
    if loop.look_ahead_m < 0.0:
        raise InputError(f"look-ahead: expected a distance >= 0 in m, got {loop.look_ahead_m:g}")
    speeds = speed_range_mps or (0.3, max(vehicle.operation.region.interval("speed")[1], 1.0))
    around = _ranges(loop, ranges or {})
    timing = sampling or default_sampling()
    HeldLoop.of(loop, Timing.of(timing))  # what cannot be held is refused before any work
    period, delay = timing.period_s, _middle_delay(timing)
    over = over_speed(loop, *speeds, points=effort.speeds)
    pieces = stability_pieces(loop, "speed", *speeds)
    maps = tuple(stability_map(loop, x, y, ranges=around, points=effort.points) for x, y in MAPS)
    return GainStudy(
        vehicle=vehicle.name,
        loop=loop,
        reason=conditions(loop).reason(),
        speed_range_mps=speeds,
        stable_speeds_mps=tuple((p.low, p.high) for p in pieces if p.reason is Reason.STABLE),
        always_stable=stable_between(loop, "speed", *speeds),
        along=tuple((name, stability_pieces(loop, name, *around[name])) for name in AXES),
        over_speed=over,
        responses=responses(
            vehicle, loop, _shown_speeds(loop, speeds), horizon_s=_horizon(loop, speeds)
        ),
        maps=maps,
        without_ahead=stability_map(
            loop.at({"look-ahead": 0.0}), "kd", "kp", ranges=around, points=effort.points
        ),
        checked=checked_points(vehicle, maps),
        sampling=timing,
        timing_stable=_stable_at_middle(loop, period, delay),
        critical=critical_delay(loop, period, _longest_delay(over)),
        sampled=_sampled_maps(loop, period, delay, around, over, effort),
        jitter=jitter_study(loop, timing, _jitters(timing), patterns=effort.patterns, seed=_SEED),
        linear_offset_m=_linear_offset(vehicle, loop),
    )


def _ranges(
    loop: LateralLoop, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    unknown = sorted(set(given) - set(AXES))
    if unknown:
        raise InputError(f"expected ranges of {', '.join(AXES)}, got one of {unknown[0]!r}")
    return default_ranges(loop) | dict(given)


def _shown_speeds(loop: LateralLoop, speeds: tuple[float, float]) -> tuple[float, ...]:
    return tuple(sorted({max(speeds[0], 0.35 * loop.speed_mps), loop.speed_mps, speeds[1]}))


def _horizon(loop: LateralLoop, speeds: tuple[float, float]) -> float:
    """Long enough for the slowest of the speeds shown to settle, where it is stable."""
    slowest = max(loop.at({"speed": v}).poles()[0].real for v in _shown_speeds(loop, speeds))
    return min(max(1.3 * math.log(20.0) / -slowest, 10.0), 120.0) if slowest < 0.0 else 10.0


def _middle_delay(sampling: Sampling) -> float:
    return float(sum((*sampling.measurement_delay_s, *sampling.actuation_delay_s)) / 2.0)


def _stable_at_middle(loop: LateralLoop, period_s: float, delay_s: float) -> bool:
    timing = Timing.of(steady_sampling(period_s, delay_s))
    return schur_stable(HeldLoop.of(loop, timing).steady(timing))


def _longest_delay(over: OverSpeed) -> float:
    """Half as much again as the largest delay margin in the range."""
    margins = [p.delay_s for p in over.points if p.stable and math.isfinite(p.delay_s)]
    return 1.5 * max(margins, default=1.0)


def _sampled_maps(
    loop: LateralLoop,
    period_s: float,
    delay_s: float,
    ranges: Mapping[str, tuple[float, float]],
    over: OverSpeed,
    effort: Effort,
) -> tuple[SampledMap, ...]:
    """Speed and delay at the real rate; kd and kp there; periods and delays at the speed."""
    timing, points = (period_s, delay_s), max(2, (2 * effort.points) // 3)
    here = [p.delay_s for p in over.points if p.stable and p.speed_mps >= loop.speed_mps]
    longest = 1.5 * max(here, default=_longest_delay(over))
    most = min(max(longest, 3.0 * period_s), 24.0 * period_s)
    speeds = (float(over.speeds_mps[0]), float(over.speeds_mps[-1]))
    slow = max(longest, 4.0 * period_s)
    return (
        sampled_map(loop, timing, ("speed", speeds), ("delay", (0.0, most)), points=points),
        sampled_map(loop, timing, ("kd", ranges["kd"]), ("kp", ranges["kp"]), points=points),
        sampled_map(
            loop, timing, ("period", (slow / 10.0, 2.0 * slow)), ("delay", (0.0, slow)),
            points=points,
        ),
    )  # fmt: skip


def _jitters(sampling: Sampling) -> tuple[float, ...]:
    """None, half, as given, and twice, as far as the timing allows."""
    found = []
    for jitter_s in sorted(
        {0.0, sampling.jitter_s / 2.0, sampling.jitter_s, 2.0 * sampling.jitter_s}
    ):
        try:
            Timing.of(dataclasses.replace(sampling, jitter_s=jitter_s))
        except InputError:
            if jitter_s == sampling.jitter_s:
                raise
            continue
        found.append(jitter_s)
    return tuple(found)


def _linear_offset(vehicle: Vehicle, loop: LateralLoop) -> float:
    """The offset (m), at rest otherwise, from which the steering rate asked for is the limit."""
    limit = vehicle.limits.steering_rate_radps
    return limit / abs(loop.proportional) if loop.proportional else math.inf
