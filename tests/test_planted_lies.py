"""The independent envelope of B1 is right and tight, and the study's lies are found in small."""

from __future__ import annotations

import numpy as np
import pytest

from studies import planted_lies
from workbench.bench import tight_envelope as independent
from workbench.models.benchmarks import b1
from workbench.sensitivity import ExaminationVerdict
from workbench.sensitivity.sampling import rollout, sample_initial_states

TIMES = np.linspace(0.0, 1.0, 11)


@pytest.fixture(scope="module")
def envelope() -> independent.TightEnvelope:
    return independent.tight_envelope(TIMES, starts=1, seed=3)


def test_its_equations_and_set_are_those_of_the_benchmark() -> None:
    model = b1()
    ode, box = model.system.ode, model.initial_set
    points = np.random.default_rng(0).normal(size=(7, 20))
    nominal = np.array(ode.parameter_values())
    theirs = [np.array(ode.function()(point, nominal, [])).ravel() for point in points.T]
    np.testing.assert_allclose(independent.field(points).T, theirs, rtol=1e-12, atol=1e-12)
    assert ode.names == independent.NAMES
    np.testing.assert_allclose(independent.CENTRE, box.center, atol=1e-15)
    np.testing.assert_allclose(independent.RADIUS, box.radius, atol=1e-15)


def test_no_sample_is_further_out_and_each_end_is_reached(
    envelope: independent.TightEnvelope,
) -> None:
    model = b1()
    states = sample_initial_states(model.initial_set, count=3000, seed=5)
    runs = rollout(model.system, states, horizon_s=1.0, step_s=0.025)[:, ::4]
    middle = rollout(model.system, np.array([independent.CENTRE]), horizon_s=1.0, step_s=0.025)[
        :, ::4
    ]
    assert np.all(np.abs(runs - middle).max(axis=0) <= envelope.distance * (1 + 1e-6) + 1e-9)
    for k in (0, 4, 10):
        ends = rollout(model.system, envelope.state[k], horizon_s=1.0, step_s=0.025)[:, ::4]
        reached = np.abs(ends[np.arange(7), k, np.arange(7)] - middle[0, k])
        np.testing.assert_allclose(reached, envelope.distance[k], atol=1e-7)


def test_small_lies_are_found_and_stand_for_another_integrator(
    envelope: independent.TightEnvelope,
) -> None:
    lies = planted_lies.planted(envelope, (0.0, 1.0), (0.01,))
    planted_lies.check_lies(lies)
    assert len(lies) == 5 + 7


def test_a_check_that_fails_says_where(envelope: independent.TightEnvelope) -> None:
    missed = planted_lies.Lie("y", 0.5, 0.01, None, 1.0)
    with pytest.raises(AssertionError, match=r"not found: y at 0\.5 s, shrunk by 1%"):
        planted_lies.check_lies([missed])


def test_the_tight_bound_itself_is_consistent(envelope: independent.TightEnvelope) -> None:
    rows = (1.0 + planted_lies.SLACK) * envelope.distance
    found = planted_lies.examine(rows, 0.1)
    assert found.verdict is ExaminationVerdict.CONSISTENT
    assert np.nanmax(found.tightness) < 1.001
