"""Separation is conservative: no sampled run comes closer to a person than the proved clearance."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest

from workbench.claims import Rigor, Verdict
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark, b1, b2_path
from workbench.reach import (
    PathGround,
    PlaneGround,
    ReachTube,
    TubeStatus,
    ValidatedTube,
    check_separation,
    compute_tube,
)
from workbench.runtime.contents import VehicleBody
from workbench.runtime.observation import Person
from workbench.runtime.path import PathTable
from workbench.sensitivity.sampling import rollout, sample_initial_states

BODY = VehicleBody("car", 1.75, 2.26, 0.47, 0.8825)
RADIUS_M = 10.0  # of B2-path's arc
STEP_S = 0.05


LOOPS: dict[str, Benchmark] = {"plane": b1(), "path": b2_path()}


@functools.cache
def tube_of(name: str, horizon_s: float) -> ReachTube:
    loop = LOOPS[name]
    method = ValidatedTube(step_s=STEP_S)
    return compute_tube(
        loop.system, initial_set=loop.initial_set, horizon_s=horizon_s, method=method
    )


def arc(length_m: float) -> PathTable:
    s = np.arange(-2.0, length_m, 0.5)
    k = 1 / RADIUS_M
    bins = (k,) * (len(s) - 1)
    return PathTable(
        -2.0,
        0.5,
        tuple(float(v) for v in np.sin(k * s) / k),
        tuple(float(v) for v in (1 - np.cos(k * s)) / k),
        tuple(float(v) for v in k * s),
        bins,
        bins,
    )


def in_plane(states: np.ndarray) -> np.ndarray:
    """x, y, heading of path states on the arc."""
    s, e, psi = states[..., 0], states[..., 1], states[..., 4]
    turn = s / RADIUS_M
    x = RADIUS_M * np.sin(turn) - e * np.sin(turn)
    y = RADIUS_M * (1 - np.cos(turn)) + e * np.cos(turn)
    return np.stack([x, y, psi + turn], axis=-1)


def gap(poses: np.ndarray, x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> float:
    """Smallest distance between the body at `poses` (N, K+1, 3) and a disc per instant."""
    c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    dx, dy = x - poses[..., 0], y - poses[..., 1]
    along, across = c * dx + s * dy, c * dy - s * dx
    u = np.maximum(np.maximum(along - BODY.front_m, -BODY.rear_m - along), 0)
    v = np.maximum(np.abs(across) - BODY.half_width_m, 0)
    return float((np.hypot(u, v) - radius).min())


PEOPLE = [
    Person("ahead", 14.0, 0.5, 0.0, 0.0, 0.3, 0.2, 0.5),
    Person("crossing", 7.0, 6.0, 0.0, -1.2, 0.3, 0.2, 0.5),
    Person("alongside", 0.0, -4.0, 1.4, 0.0, 0.3, 0.2, 0.5),
]


@pytest.mark.parametrize("person", PEOPLE, ids=lambda person: person.name)
@pytest.mark.parametrize("name", ["plane", "path"])
def test_no_run_is_closer_than_the_proved_clearance(name: str, person: Person) -> None:
    plane = name == "plane"
    loop, tube = LOOPS[name], tube_of(name, 2.0)
    result = check_separation(
        tube,
        ground=PlaneGround() if plane else PathGround(arc(20.0)),
        body=BODY,
        people=[person],
        clearance_required_m=0.2,
    )
    starts = sample_initial_states(loop.initial_set, count=500, seed=3)
    runs = rollout(loop.system, starts, horizon_s=2.0, step_s=STEP_S / 5)
    poses = runs[..., [0, 1, 4]] if plane else in_plane(runs)
    t = np.linspace(0.0, 2.0, runs.shape[1])
    # The person may be anywhere in the disc, so its rim nearest to the car counts.
    radius = person.radius_m + person.growth_mps * t + person.growth_mps2 * t**2 / 2
    true = gap(poses, person.x_m + person.vx_mps * t, person.y_m + person.vy_mps * t, radius)
    assert result.clearance_m <= max(true, 0.0) + 1e-7
    assert result.person == person.name
    assert result.rigor is (Rigor.ENCLOSED if plane else Rigor.NUMERICAL)
    assert (result.verdict is Verdict.SAFE) == (result.clearance_m >= 0.2)
    if result.verdict is Verdict.SAFE:
        assert true >= 0.2


def test_far_away_is_safe_and_in_the_way_is_not() -> None:
    tube = tube_of("plane", 1.0)

    def verdict(y_m: float) -> Verdict:
        person = Person("p", 3.0, y_m, 0.0, 0.0, 0.3, 0.0, 0.0)
        return check_separation(
            tube, ground=PlaneGround(), body=BODY, people=[person], clearance_required_m=0.2
        ).verdict

    assert [verdict(y) for y in (6.0, 0.0, -6.0)] == [
        Verdict.SAFE,
        Verdict.UNPROVED,
        Verdict.SAFE,
    ]


def test_an_incomplete_tube_is_invalid_even_with_nobody() -> None:
    tube = dataclasses.replace(tube_of("plane", 0.5), status=TubeStatus.ENCLOSURE_FAILED)
    result = check_separation(
        tube, ground=PlaneGround(), body=BODY, people=[], clearance_required_m=0.2
    )
    assert result.verdict is Verdict.INVALID
    assert math.isinf(result.clearance_m)


def test_ground_that_cannot_be_covered_is_unproved() -> None:
    tube = tube_of("plane", 0.5)
    heading = tube.names.index("heading")
    lower, upper = tube.lower.copy(), tube.upper.copy()
    lower[:, heading], upper[:, heading] = -2.0, 2.0
    wide = dataclasses.replace(tube, lower=lower, upper=upper)
    result = check_separation(
        wide, ground=PlaneGround(), body=BODY, people=[], clearance_required_m=0.2
    )
    assert result.verdict is Verdict.UNPROVED


def test_a_path_that_ends_too_early_is_refused() -> None:
    tube = tube_of("path", 2.0)
    with pytest.raises(InputError, match="extend the path"):
        check_separation(
            tube, ground=PathGround(arc(2.0)), body=BODY, people=[], clearance_required_m=0.2
        )
