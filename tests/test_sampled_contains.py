"""The tube of a sampled loop holds every run of an event simulator that shares no code with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from sampled_runs import Plain, sampled_runs

from workbench.bench.containment import bounds_at
from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand
from workbench.models.benchmarks import Benchmark, b1, b2, b2_noise, b2_slow
from workbench.reach import ReachTube, compute_tube
from workbench.reach.sampled_data.tube import SampledTube
from workbench.sensitivity.sampling import sample_initial_states

CLOCK, DRIFT = Jitter.CLOCK, Jitter.DRIFT
NOMINAL, MEASURED = IntegralStep.NOMINAL, IntegralStep.MEASURED
LIMITS = Plain(0.2, 0.6, (-2.0, 1.0))
PLAIN = {
    "B1": Plain(),
    "B2": LIMITS,
    "B2-slow": Plain(0.1, 0.6, (-2.0, 1.0)),
    "B2-noise": Plain(0.2, 0.6, (-2.0, 1.0), (0.1, 0.02, 0.05), (0.01, 0.1)),
}
PLANT = 5


def tube_of(
    bench: Benchmark, sampling: Sampling, horizon_s: float
) -> tuple[ReachTube, tuple[SentCommand, ...]]:
    command = SentCommand((-0.15, -0.1), (0.2, 0.3))
    sent = (command,) * sampling.commands_sent
    method = SampledTube(sampling, sent, degree=2)
    tube = compute_tube(
        bench.system, initial_set=bench.initial_set, horizon_s=horizon_s, method=method
    )
    return tube, sent


def check(bench: Benchmark, sampling: Sampling, *, horizon_s: float, seed: int = 1) -> None:
    tube, sent = tube_of(bench, sampling, horizon_s)
    assert tube.complete, tube.message
    names = bench.system.ode.names
    states = sample_initial_states(bench.initial_set.reordered(names), count=1500, seed=seed)
    end = float(tube.times[-1])
    times = np.unique(np.concatenate([tube.times, np.linspace(0.0, end, 61)]))
    runs = sampled_runs(PLAIN[bench.name], sampling, sent, states=states, times=times, seed=seed)
    lower, upper = bounds_at(tube, times)
    # The integrals step at instants that the runs know and the tube calls the earliest.
    known = sampling.read[1] == 0 and sampling.jitter is CLOCK
    columns = slice(None) if known else slice(PLANT)
    # Where a run and the tube round the instant of a step to different sides of a time.
    near = np.abs(times[:, None] - np.arange(200) * sampling.period_s).min(axis=1) < 1e-9
    kept = np.ones((len(times), runs.shape[2]), dtype=bool)
    kept[near, PLANT:] = False
    outside = np.maximum(runs - upper, lower - runs) * kept
    worst = outside[:, :, columns].max()
    assert worst < 1e-9, np.argwhere(outside[:, :, columns] == worst)[0]


@pytest.mark.parametrize(
    ("bench", "sampling"),
    [
        (b1, Sampling(1 / 30, 0.0, CLOCK, (0.0, 0.0), (0.0, 0.0), NOMINAL)),
        (b2, Sampling(1 / 30, 0.0, CLOCK, (0.02, 0.02), (0.03, 0.03), NOMINAL)),
        (b2_noise, Sampling(1 / 30, 0.001, CLOCK, (0.04, 0.043), (0.0, 0.004), MEASURED)),
        (b2_noise, Sampling(1 / 30, 0.001, DRIFT, (0.04, 0.043), (0.0, 0.004), MEASURED)),
        (b2_slow, Sampling(0.05, 0.004, CLOCK, (0.0, 0.02), (0.11, 0.13), NOMINAL)),
        (b2, Sampling(0.05, 0.004, DRIFT, (0.01, 0.02), (0.1, 0.11), NOMINAL)),
        (b2, Sampling(0.05, 0.0, CLOCK, (0.1, 0.1), (0.05, 0.09), NOMINAL)),
    ],
)
def test_runs_stay_inside(bench, sampling: Sampling) -> None:
    check(bench(), sampling, horizon_s=0.6)


@st.composite
def samplings(draw: st.DrawFn) -> Sampling:
    """Periods of 20 to 80 ms, delays up to two periods, windows that keep commands in order."""
    period = draw(st.floats(0.02, 0.08))
    parts = [draw(st.sampled_from([0.0, 0.1, 0.25])) * period for _ in range(3)]
    delays = [draw(st.sampled_from([0.0, 0.3, 1.0, 1.4])) * period for _ in range(2)]
    return Sampling(
        period_s=period,
        jitter_s=parts[0] * 0.5,
        jitter=draw(st.sampled_from([CLOCK, DRIFT])),
        measurement_delay_s=(delays[0], delays[0] + parts[1]),
        actuation_delay_s=(delays[1], delays[1] + parts[2]),
        integral_step=draw(st.sampled_from([NOMINAL, MEASURED])),
    )


@settings(
    max_examples=6,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
@given(samplings(), st.sampled_from([b1, b2_noise]))
def test_runs_under_random_timing_stay_inside(sampling: Sampling, bench) -> None:
    check(bench(), sampling, horizon_s=0.35)


@pytest.mark.campaign
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(samplings(), st.sampled_from([b1, b2, b2_slow, b2_noise]), st.integers(0, 10**6))
def test_many_runs_under_random_timing_stay_inside(sampling: Sampling, bench, seed: int) -> None:
    check(bench(), sampling, horizon_s=1.0, seed=seed)
