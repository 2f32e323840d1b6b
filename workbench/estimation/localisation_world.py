"""A generated world for the localisation: cars that drive, and what their sensors say.

It shares no formula with the filter: motion by Euler-Maruyama in small steps, a driver who sees the
truth, ranges from the geometry. Only the site's numbers are common.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.estimation.lanes import Array
from workbench.estimation.localisation import Flags
from workbench.estimation.localisation_site import Site

REPORT_HZ: Final = 30
RANGE_HZ: Final = 3
_STEPS: Final = 8
"""Steps of the motion between two reports."""


@final
@dataclass(frozen=True, slots=True)
class Leg:
    """A part of a drive: until when, at which speed, at which road-wheel angle (0 speed: stop)."""

    until_s: float
    speed_mps: float
    steering_rad: float


@final
@dataclass(frozen=True, slots=True)
class Faults:
    """What ranges suffer: share dropped, share too long (mean excess, exponential), and, for what
    the filter does not know of, a constant error of every beacon and a factor on all noise."""

    dropped: float
    stray: float
    stray_mean_m: float
    bias_m: float = 0.0
    noise_factor: float = 1.0


@final
@dataclass(frozen=True, slots=True)
class Drive:
    """n cars at K instants of report: truth (K, n, 7) in the order of `STATES`, reports (K, n),
    commands in force from then on (K, n, 2); ranges (K, n, beacons), NaN where there is none."""

    times_s: Array
    truth: Array
    speed_mps: Array
    steering_rad: Array
    commands: Array
    ranges_m: Array


def figure_eight() -> tuple[Leg, ...]:
    """Stand, drive to the left, stop for 10 s, drive to the right, and straight on."""
    return (
        Leg(5.0, 0.0, 0.0), Leg(10.0, 2.0, 0.0), Leg(19.0, 2.5, 0.22), Leg(31.0, 0.0, 0.1),
        Leg(40.0, 2.5, -0.22), Leg(43.0, 2.0, 0.0),
    )  # fmt: skip


def generated_drive(
    site: Site, legs: tuple[Leg, ...], faults: Faults, *, cars: int, wheelbase_m: float, seed: int
) -> Drive:
    """Drive n cars, each with own noise, scale, zero and first heading, from the hall's south-west.

    The driver commands acceleration within [-2, 1] m/s^2 and a steering rate within 0.2 rad/s.
    """
    rng = np.random.default_rng(seed)
    count = round(legs[-1].until_s * REPORT_HZ) + 1
    state = _first(site, faults, cars, rng)
    rows: list[tuple[Array, ...]] = []
    for k in range(count):
        time = k / REPORT_HZ
        leg = next((leg for leg in legs if time < leg.until_s), legs[-1])
        commands = _commands(leg, state)
        rows.append((
            state.copy(), *_reports(site, faults, state, rng), commands,
            _ranges(site, faults, state, rng, due=k % (REPORT_HZ // RANGE_HZ) == 0),
        ))  # fmt: skip
        for _ in range(_STEPS):
            state = _moved(site, faults, state, commands, rng, wheelbase_m=wheelbase_m)
    columns = [np.stack(column) for column in zip(*rows, strict=True)]
    return Drive(np.arange(count) / REPORT_HZ, *columns)


def _first(site: Site, faults: Faults, cars: int, rng: np.random.Generator) -> Array:
    state = np.zeros((cars, 7))
    state[:, 0] = 13.0 + rng.normal(0.0, 0.5, cars)
    state[:, 1] = 6.0 + rng.normal(0.0, 0.5, cars)
    state[:, 2] = rng.uniform(-0.3, 0.3, cars)
    state[:, 5] = faults.noise_factor * rng.normal(0.0, site.reports.speed_scale, cars)
    state[:, 6] = faults.noise_factor * rng.normal(0.0, site.reports.steering_zero_rad, cars)
    return state


def _stands(commands: Array, speed: Array) -> Flags:
    """A car whose driver brakes or rests, and that has come to a stop, stays there."""
    return (commands[:, 0] <= 0.0) & (speed <= 0.025)


def _commands(leg: Leg, state: Array) -> Array:
    speed, steering = state[:, 3], state[:, 4]
    pulled = np.clip(2.0 * (leg.speed_mps - speed), -2.0, 1.0)
    braked = np.where(speed > 0.025, -1.0, 0.0)
    acceleration = pulled if leg.speed_mps > 0.0 else braked
    return np.stack([acceleration, np.clip(leg.steering_rad - steering, -0.2, 0.2)], axis=1)


def _moved(
    site: Site, faults: Faults, state: Array, commands: Array, rng: np.random.Generator, *,
    wheelbase_m: float,
) -> Array:  # fmt: skip
    motion, step = site.motion, 1.0 / (REPORT_HZ * _STEPS)
    noise = faults.noise_factor * rng.normal(0.0, np.sqrt(step), (7, len(state)))
    x, y, heading, speed, steering, scale, zero = state.T
    stands = _stands(commands, speed)
    rocking = speed * (1.0 - step / motion.standing_s) + (
        motion.standing_mps * np.sqrt(2.0 / motion.standing_s) * noise[3]
    )
    driven = np.maximum(speed + commands[:, 0] * step + motion.acceleration * noise[3], 0.0)
    root = np.where(stands, 0.0, np.sqrt(np.abs(speed)))
    along = speed * step + motion.forward_slip * root * noise[0]
    across = motion.lateral_slip * root * noise[1]
    turned = np.where(
        stands, motion.standing_heading * noise[2],
        speed * np.tan(steering) / wheelbase_m * step + motion.heading_slip * root * noise[2],
    )  # fmt: skip
    middle = heading + 0.5 * turned
    return np.stack([
        x + along * np.cos(middle) - across * np.sin(middle),
        y + along * np.sin(middle) + across * np.cos(middle),
        heading + turned,
        np.where(stands, rocking, driven),
        steering + commands[:, 1] * step + motion.steering_rate * noise[4],
        scale + motion.scale_walk * noise[5],
        zero + motion.zero_walk_rad * noise[6],
    ], axis=1)  # fmt: skip


def _reports(
    site: Site, faults: Faults, state: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    factor, n = faults.noise_factor, len(state)
    speed = state[:, 3] * (1.0 + state[:, 5]) + factor * rng.normal(0, site.reports.speed_mps, n)
    return speed, state[:, 4] + state[:, 6] + factor * rng.normal(0, site.reports.steering_rad, n)


def _ranges(
    site: Site, faults: Faults, state: Array, rng: np.random.Generator, *, due: bool
) -> Array:
    shape, antenna = (len(state), len(site.beacons)), site.antenna
    if not due:
        return np.full(shape, np.nan)
    cosine, sine = np.cos(state[:, 2]), np.sin(state[:, 2])
    x = state[:, 0] + cosine * antenna.forward_m - sine * antenna.left_m
    y = state[:, 1] + sine * antenna.forward_m + cosine * antenna.left_m
    true = np.stack([
        np.sqrt((x - b.x_m) ** 2 + (y - b.y_m) ** 2 + (antenna.height_m - b.height_m) ** 2)
        for b in site.beacons
    ], axis=1)  # fmt: skip
    found = true + faults.noise_factor * rng.normal(0.0, site.ranges.deviation_m, shape)
    found += np.where(rng.random(shape) < faults.stray, 1.0, 0.0) * rng.exponential(
        max(faults.stray_mean_m, 1e-9), shape
    )
    # Alternating signs, so that no displacement of the car explains them away.
    found += faults.bias_m * np.array([(-1.0) ** k for k in range(shape[1])])
    return np.where(rng.random(shape) < faults.dropped, np.nan, found)
