"""Random closed loops with initial sets and horizons, the same ones for the same seed."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.controllers import (
    Mode,
    PathFollowing,
    ReferenceZeroBrake,
    SpeedPid,
    SteeringPid,
    Track,
    VehicleBrake,
)
from workbench.models import (
    ClosedLoop,
    Disturbance,
    EstimationError,
    PathBicycle,
    PlaneBicycle,
    Ranged,
)
from workbench.models.bicycle import Plant
from workbench.sets import Box

# Half widths of the largest initial sets: along, offset, steering, speed, heading, two integrals.
_LARGEST_RADII = (0.2, 0.2, 0.02, 0.2, 0.05, 0.02, 0.02)


@final
@dataclass(frozen=True, slots=True)
class RandomLoop:
    """A loop, the set it starts from, how long it is followed; `name` says what it is made of."""

    name: str
    system: ClosedLoop
    initial_set: Box
    horizon_s: float


def random_loops(count: int, *, seed: int) -> Iterator[RandomLoop]:
    """`count` loops; number k depends on `seed` and k alone.

    Plane and path coordinates; TRACK and both BRAKE laws; with and without limits; look-ahead 0;
    gains of wrong sign, which are unstable; estimation error, disturbance and parameter ranges,
    present and absent; initial sets of all sizes up to the benchmarks', some axes without width;
    horizons of 1 to 5 s, most of them no multiple of a usual step.
    """
    return (_loop(index, np.random.default_rng([seed, index])) for index in range(count))


def _loop(index: int, rng: np.random.Generator) -> RandomLoop:
    limited = _chance(rng, 0.6)
    plant = _plant(rng, limited)
    mode = _mode(rng)
    noisy, pushed, ranged = (_chance(rng, share) for share in (0.3, 0.3, 0.35))
    system = ClosedLoop(
        plant,
        PathFollowing(_steering(rng, limited), _speed(rng, limited)),
        mode,
        _estimation_error(rng) if noisy else EstimationError(),
        _disturbance(rng) if pushed else Disturbance(),
    )
    if ranged:
        system = _with_ranges(system, rng)
    words = [
        system.ode.name.replace("Bicycle", "").replace("ReferenceZeroBrake", "BRAKE (paper)"),
        *(word for word, present in (("limits", limited), ("N", noisy), ("W", pushed),
                                     ("ranges", ranged)) if present),
    ]  # fmt: skip
    horizon_s = round(rng.uniform(1.0, 5.0), 3)
    if _chance(rng, 0.25):
        horizon_s = round(2.0 * horizon_s) / 2.0
    return RandomLoop(f"{index}: {', '.join(words)}", system, _initial_set(system, rng), horizon_s)


def _chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)


def _plant(rng: np.random.Generator, limited: bool) -> Plant:
    wheelbase_m = rng.uniform(1.2, 3.0)
    limit = rng.uniform(0.15, 0.6) if limited else None
    if _chance(rng, 0.65):
        return PlaneBicycle(wheelbase_m, limit)
    middle, spread = rng.uniform(-0.08, 0.08), rng.choice([0.0, 0.002, 0.01])
    curvature = Ranged("curvature", "1/m", middle, middle - spread, middle + spread)
    return PathBicycle(wheelbase_m, limit, curvature)


def _mode(rng: np.random.Generator) -> Mode:
    kind = rng.random()
    if kind < 0.55:
        return Track(rng.uniform(1.5, 4.0))
    if kind < 0.75:
        return ReferenceZeroBrake()
    weakest = rng.uniform(0.8, 2.5)
    build_up_s = rng.choice([0.0, rng.uniform(0.1, 0.4)])
    return VehicleBrake(
        weakest,
        weakest * rng.choice([1.0, rng.uniform(1.0, 1.3)]),
        rng.uniform(0.0, 0.3) if build_up_s else 0.0,
        build_up_s,
        rng.uniform(0.1, 0.4),
    )


def _steering(rng: np.random.Generator, limited: bool) -> SteeringPid:
    proportional, derivative = rng.uniform(0.2, 1.0), rng.uniform(0.3, 1.5)
    if _chance(rng, 0.12):
        proportional = -rng.uniform(0.05, 0.3)
    if _chance(rng, 0.08):
        derivative = -rng.uniform(0.05, 0.4)
    return SteeringPid(
        proportional,
        rng.choice([0.0, rng.uniform(0.0, 0.1)]),
        derivative,
        0.0 if _chance(rng, 0.2) else rng.uniform(0.5, 3.0),
        rng.uniform(0.08, 0.4) if limited else None,
    )


def _speed(rng: np.random.Generator, limited: bool) -> SpeedPid:
    proportional = -rng.uniform(0.05, 0.3) if _chance(rng, 0.06) else rng.uniform(0.4, 1.5)
    return SpeedPid(
        proportional,
        rng.choice([0.0, rng.uniform(0.0, 0.3)]),
        -rng.uniform(0.3, 2.5) if limited else None,
        rng.uniform(0.2, 1.5) if limited else None,
    )


def _estimation_error(rng: np.random.Generator) -> EstimationError:
    return EstimationError(rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.02), rng.uniform(0.0, 0.05))


def _disturbance(rng: np.random.Generator) -> Disturbance:
    return Disturbance(rng.uniform(0.0, 0.15), rng.uniform(0.0, 0.015))


def _with_ranges(system: ClosedLoop, rng: np.random.Generator) -> ClosedLoop:
    """One to three parameters known to 0.2 to 3 % only."""
    known = [p for p in system.ode.parameters if p.nominal != 0.0]
    ranges = {}
    for index in rng.permutation(len(known))[: rng.integers(1, 4)]:
        value, share = known[index].nominal, 10.0 ** rng.uniform(-2.7, -1.5)
        ranges[known[index].name] = (value - share * abs(value), value + share * abs(value))
    return dataclasses.replace(system, parameter_ranges=ranges)


def _initial_set(system: ClosedLoop, rng: np.random.Generator) -> Box:
    size = 10.0 ** rng.uniform(-1.3, 0.0)
    spread = (0.0, 0.5, 0.05, 0.0, 0.15, 0.0, 0.0)
    center = [rng.uniform(-reach, reach) for reach in spread]
    center[3] = rng.uniform(1.5, 4.0)
    radii = [size * rng.uniform(0.2, 1.0) * largest for largest in _LARGEST_RADII]
    if not _chance(rng, 0.3):
        radii[5:] = 0.0, 0.0
    known = rng.random(len(radii)) < 0.1
    names = system.ode.names
    # A brake clock, where there is one, starts at exactly 0.
    extra = [0.0] * (len(names) - len(center))
    widths = [0.0 if exact else radius for radius, exact in zip(radii, known, strict=True)]
    return Box.around(
        dict(zip(names, [*center, *extra], strict=True)),
        radius=dict(zip(names, [*widths, *extra], strict=True)),
    )
