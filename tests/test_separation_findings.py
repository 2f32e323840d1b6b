"""Findings agree with brute force: PROVED keeps clear of people, REFUTED has a true witness."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_separation_holds import BODY, arc, gap, in_plane

from workbench.claims import Rigor, Verdict
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark, b1, b2_noise, b2_path
from workbench.reach import (
    PathGround,
    PlaneGround,
    ValidatedTube,
    check_separation,
    compute_tube,
)
from workbench.reach.findings.encounter import Encounter, distance_from_body, in_disc
from workbench.reach.findings.finding import Finding, FindingEffort, Outcome, explain_separation
from workbench.reach.findings.refutation import SeparationWitness
from workbench.reach.inner.extremes import SearchEffort
from workbench.runtime.observation import Person
from workbench.sensitivity.sampling import rollout, sample_initial_states

HORIZON_S = 1.0
REQUIRED_M = 0.2
SEARCH = SearchEffort(starts=16, rounds=2, every=5, seed=1)


def standing(x_m: float, y_m: float) -> Person:
    return Person("p", x_m, y_m, 0.0, 0.0, 0.3, 0.2, 0.1)


def finding(
    person: Person, *, cells: int = 24, loop: Benchmark | None = None, ground: object = None
) -> Finding:
    loop = loop or b1()
    return explain_separation(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=HORIZON_S,
        encounter=Encounter(ground or PlaneGround(), BODY, (person,), REQUIRED_M),  # type: ignore[arg-type]
        method=ValidatedTube(),
        effort=FindingEffort(cells, SEARCH),
    )


def sampled_gap(person: Person, loop: Benchmark, count: int = 300) -> float:
    """Smallest distance of body and disc over sampled runs."""
    starts = sample_initial_states(loop.initial_set, count=count, seed=3)
    runs = rollout(loop.system, starts, horizon_s=HORIZON_S, step_s=0.01)
    t = np.linspace(0.0, HORIZON_S, runs.shape[1])
    radius = person.radius_m + person.growth_mps * t + person.growth_mps2 * t**2 / 2
    return gap(
        runs[..., [0, 1, 4]], person.x_m + person.vx_mps * t, person.y_m + person.vy_mps * t, radius
    )


def replayed(witness: SeparationWitness, loop: Benchmark) -> np.ndarray:
    """The witness's state at its time, by many small Runge-Kutta steps."""
    state = np.array([list(witness.trajectory.initial_state.values())])
    assert loop.initial_set.contains(witness.trajectory.initial_state)
    for k in range(round(witness.time_s / 0.05)):
        signal = witness.trajectory.signal[k].tolist()
        state = rollout(
            loop.system, state, horizon_s=0.05, step_s=0.0005, disturbances=signal or None
        )[:, -1]
    return np.asarray(state[0])


def signed_distance(pose: np.ndarray, x: float, y: float) -> float:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    u = c * (x - pose[0]) + s * (y - pose[1])
    v = c * (y - pose[1]) - s * (x - pose[0])
    a, b = max(u - BODY.front_m, -BODY.rear_m - u), abs(v) - BODY.half_width_m
    return max(a, b) if max(a, b) <= 0 else math.hypot(max(a, 0.0), max(b, 0.0))


def assert_true(witness: SeparationWitness, person: Person, loop: Benchmark) -> None:
    state, t = replayed(witness, loop), witness.time_s
    for i, name in enumerate(loop.system.ode.names):
        assert witness.state_lower[name] - 1e-6 <= state[i] <= witness.state_upper[name] + 1e-6
    radius = person.radius_m + person.growth_mps * t + person.growth_mps2 * t * t / 2
    x, y = person.x_m + person.vx_mps * t, person.y_m + person.vy_mps * t
    assert math.hypot(witness.person_x_m - x, witness.person_y_m - y) <= radius
    true = signed_distance(state[[0, 1, 4]], witness.person_x_m, witness.person_y_m)
    assert true - 1e-6 <= witness.distance_m <= true + 1e-3
    assert 0.0 < witness.shortfall_m <= REQUIRED_M - witness.distance_m


def test_far_away_is_proved_with_one_tube_and_in_the_way_is_refuted_with_none() -> None:
    far, near = finding(standing(3.0, 4.0)), finding(standing(3.0, 1.0))
    assert (far.outcome, far.cells, far.open_cells, far.witness) == (Outcome.PROVED, 1, (), None)
    assert far.clearance_m >= REQUIRED_M
    assert (near.outcome, near.cells) == (Outcome.REFUTED, 0)
    assert far.rigor is near.rigor is Rigor.ENCLOSED
    assert near.witness is not None
    assert_true(near.witness, standing(3.0, 1.0), b1())


def test_splitting_proves_what_one_tube_cannot() -> None:
    loop, person = b1(), standing(3.0, 2.2)
    tube = compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=HORIZON_S)
    whole = check_separation(
        tube,
        ground=PlaneGround(),
        body=BODY,
        people=[person],
        clearance_required_m=REQUIRED_M,
    )
    assert whole.verdict is Verdict.UNPROVED
    assert whole.rigor is Rigor.ENCLOSED
    found = finding(person, cells=200)
    assert found.outcome is Outcome.PROVED
    assert found.cells > 1
    assert REQUIRED_M <= found.clearance_m <= sampled_gap(person, loop)


def test_too_little_effort_is_undecided_and_says_what_is_open() -> None:
    found = finding(standing(3.0, 2.2), cells=1)
    assert found.outcome is Outcome.UNDECIDED
    assert found.rigor is Rigor.SAMPLED
    assert found.witness is None
    assert len(found.open_cells) == 2
    loop = b1()
    for point in itertools.islice(loop.initial_set.vertices(), 4):
        assert any(cell.contains(point) for cell in found.open_cells)


@settings(max_examples=6, deadline=None)
@given(st.floats(-1.0, 6.0), st.floats(-3.0, 3.0))
def test_findings_agree_with_samples(x_m: float, y_m: float) -> None:
    person = standing(x_m, y_m)
    found = finding(person, cells=8)
    nearest = sampled_gap(person, b1(), count=100)
    if found.outcome is Outcome.PROVED:
        assert nearest >= REQUIRED_M
    elif found.outcome is Outcome.REFUTED:
        assert found.witness is not None
        assert_true(found.witness, person, b1())
    if nearest < REQUIRED_M - 0.05:
        assert found.outcome is Outcome.REFUTED


def test_a_disturbance_that_is_needed_is_found_and_named() -> None:
    loop, person = b2_noise(), standing(2.0, 1.9)
    found = finding(person, loop=loop, cells=1)
    assert found.outcome is Outcome.REFUTED
    assert found.witness is not None
    assert len(found.witness.trajectory.disturbances) == len(loop.system.ode.disturbances)
    assert_true(found.witness, person, loop)


def test_along_a_path_the_witness_is_in_the_plane() -> None:
    loop, ground = b2_path(), PathGround(arc(20.0))
    person = Person("p", 3.0, 1.5, 0.0, 0.0, 0.3, 0.2, 0.1)
    found = finding(person, loop=loop, ground=ground)
    assert found.outcome is Outcome.REFUTED
    assert found.rigor is Rigor.NUMERICAL
    witness = found.witness
    assert witness is not None
    state = replayed(witness, loop)
    true = signed_distance(in_plane(state), witness.person_x_m, witness.person_y_m)
    assert true <= witness.distance_m <= true + 1e-3
    assert true < REQUIRED_M
    states = np.array([[0.3, 0.2, 0.1], [7.77, -0.4, -0.2]])
    poses = ground.poses(states)
    exact = in_plane(np.insert(states, [2, 2], 0.0, axis=1))
    assert poses == pytest.approx(exact, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.floats(-4, 6), st.floats(-4, 4), st.floats(-0.3, 0.3), st.integers(0, 2**32 - 1))
def test_the_proved_distance_holds_for_every_pose(
    x: float, y: float, heading: float, seed: int
) -> None:
    encounter = Encounter(PlaneGround(), BODY, (), REQUIRED_M)
    low = {"x": 0.5, "y": -0.1, "heading": heading}
    high = {"x": 0.6, "y": 0.1, "heading": heading + 0.05}
    bound = distance_from_body(encounter, (low, high), (x, y))
    lower, upper = np.array(list(low.values())), np.array(list(high.values()))
    share = np.random.default_rng(seed).random((50, 3))
    share[:8] = list(itertools.product((0.0, 1.0), repeat=3))
    true = [signed_distance(pose, x, y) for pose in lower + share * (upper - lower)]
    assert max(true) <= bound <= max(true) + 0.6
    assert distance_from_body(encounter, (low, low), (x, y)) <= true[0] + 1e-4


def test_the_rim_of_a_disc_is_inside_and_the_next_float_is_not() -> None:
    person = Person("p", 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0)
    assert in_disc(person, (2.5, 0.0), 2.0)
    assert not in_disc(person, (math.nextafter(2.5, 3.0), 0.0), 2.0)


def test_misuse_is_answered_and_nobody_is_no_danger() -> None:
    with pytest.raises(InputError, match="clearance_required_m >= 0"):
        Encounter(PlaneGround(), BODY, (), -1.0)
    with pytest.raises(InputError, match="expected cells >= 1"):
        FindingEffort(0, SEARCH)
    with pytest.raises(InputError, match="give the ground that fits"):
        finding(standing(0.0, 0.0), ground=PathGround(arc(5.0)))
    loop = b1()
    found = explain_separation(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=0.2,
        encounter=Encounter(PlaneGround(), BODY, (), REQUIRED_M),
        method=ValidatedTube(),
        effort=FindingEffort(1, SEARCH),
    )
    assert (found.outcome, found.clearance_m) == (Outcome.PROVED, math.inf)
