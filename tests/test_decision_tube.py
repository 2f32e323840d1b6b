"""No simulated state leaves the tube of TRACK, whatever the curvature does within its bins."""

from __future__ import annotations

import numpy as np
import pytest
from decision_answers import Array, TubeAnswer
from decision_fixture import (
    COMPLETE,
    LEFT_REGION,
    NO_ENCLOSURE,
    SAFE,
    STARTS,
    UNPROVED,
    Start,
    kernel,
    query,
)
from decision_paths import RANDOM_POINTS, arc, exact_runs, paths, segments, simulate

# Twenty times the largest excess seen, which is rounding of the simulation.
_ROUNDING = 1e-13
_PAIRS = [
    *(("S", start) for start in STARTS),
    *(("left", start) for start in ("initial set", "rate limit", "point")),
    *(("right", start) for start in ("initial set", "accelerating", "standing")),
    *(("straight", start) for start in ("initial set", "braking", "point")),
]


def _excess(answer: TubeAnswer, fine: Array) -> Array:
    """Largest distance outside the tube, per state."""
    lower, upper = answer.rows("lower", 7), answer.rows("upper", 7)
    seen = segments(fine, answer.steps)
    outside = np.maximum(lower[:, None, :, None] - seen, seen - upper[:, None, :, None])
    return np.asarray(outside.max(axis=(0, 1, 3)))


@pytest.mark.parametrize(("where", "start"), _PAIRS)
def test_runs_along_the_path_stay_in_every_segment(where: str, start: str) -> None:
    answer, fine = exact_runs(where, start)
    assert answer.status in (COMPLETE, LEFT_REGION)
    assert answer.verdict == (SAFE if answer.status == COMPLETE else UNPROVED)
    assert answer.steps >= 25
    assert _excess(answer, fine).max() < _ROUNDING


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("where", ["unsure", "S"])
def test_runs_with_any_curvature_of_the_bins_stay_in_every_segment(where: str, start: str) -> None:
    path, box = paths()[where], STARTS[start]
    chance = np.random.default_rng(11)
    answer = kernel()(query(path.table, box)).track
    assert answer.steps >= 25
    states = box.states(RANDOM_POINTS, chance)
    # Each run keeps to one bound, or changes at every step: to either, or to anything between.
    way = chance.integers(0, 4, states.shape[1])

    def curvature(station: Array) -> Array:
        low, high = path.bins(station)
        share = np.choose(
            way,
            [
                np.zeros_like(station),
                np.ones_like(station),
                chance.integers(0, 2, station.shape).astype(float),
                chance.uniform(size=station.shape),
            ],
        )
        return np.asarray(low + share * (high - low))

    fine = simulate(box, states, curvature, steps=answer.steps, held=True)
    assert _excess(answer, fine).max() < _ROUNDING


@pytest.mark.parametrize("curvature", [0.0, 1e-9, 0.1, -0.1])
def test_ordinary_states_never_end_without_an_enclosure(curvature: float) -> None:
    chance = np.random.default_rng(5)
    table = arc(curvature).table
    refused = []
    for _ in range(200):
        center = chance.uniform([-0.2, -1, -0.3, 0, -0.3, -1, -1], [0.2, 1, 0.3, 3, 0.3, 1, 1])
        radius = chance.integers(0, 2, 7) * np.array([0.2, 0.1, 0.02, 0.2, 0.05, 0.1, 0.1])
        answer = kernel()(query(table, Start(tuple(center), tuple(radius))))
        refused += [
            (tube.steps, center, radius) for tube in answer.tubes if tube.status == NO_ENCLOSURE
        ]
    assert not refused, f"{len(refused)} of 200, first {refused[0]}"


def test_a_tube_that_leaves_the_operating_region_is_unproved() -> None:
    table = paths()["straight"].table
    outward = Start((0.0, 1.3, 0.0, 2.5, 0.4, 0.0, 0.0), (0.05,) * 5 + (0.0, 0.0))
    answer = kernel()(query(table, outward)).track
    assert (answer.verdict, answer.status) == (UNPROVED, LEFT_REGION)
    assert 0 < answer.steps < 60
    outside = Start((0.0, 1.6, 0.0, 2.5, 0.0, 0.0, 0.0), (0.0,) * 7)
    answer = kernel()(query(table, outside)).track
    assert (answer.verdict, answer.status, answer.steps) == (UNPROVED, LEFT_REGION, 0)


@pytest.mark.parametrize("nodes", range(2, 60, 3))
def test_a_tube_that_runs_off_the_path_is_unproved(nodes: int) -> None:
    path = arc(0.05, nodes=nodes)
    start = STARTS["point"]
    answer = kernel()(query(path.table, start)).track
    # 2.8 m/s for 3 s along the path, which begins 4 m behind.
    runs_off = path.table.end_m < 8.4
    assert (answer.verdict != SAFE) == runs_off or 8.4 <= path.table.end_m < 8.9
    if runs_off:
        assert (answer.verdict, answer.status) == (UNPROVED, LEFT_REGION)
        last = answer.rows("upper", 7)[:, 0]
        assert (last <= path.table.end_m).all()
