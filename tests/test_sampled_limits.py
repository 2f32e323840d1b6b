"""A sampled tube meets closed forms, and the continuous tube as the period goes to zero."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.controllers import VehicleBrake
from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand
from workbench.errors import InputError
from workbench.models import ClosedLoop
from workbench.models.benchmarks import b1, b1_small, b2
from workbench.reach import Partitioned, ReachTube, TubeStatus, ValidatedTube, compute_tube
from workbench.reach.sampled_data.drift import Anchor
from workbench.reach.sampled_data.tube import SampledTube
from workbench.reach.switching.exact_times import nearest_ticks
from workbench.reach.validated.sets import PolynomialSet
from workbench.sets import Box

STILL = SentCommand.exactly(0.0, 0.0)


def steady(
    period_s: float, *, delay_s: float = 0.0, measured_s: float = 0.0, jitter_s: float = 0.0
) -> Sampling:
    return Sampling(
        period_s, jitter_s, Jitter.CLOCK, (measured_s,) * 2, (delay_s,) * 2, IntegralStep.NOMINAL
    )


def sampled(sampling: Sampling, horizon_s: float, sent: SentCommand = STILL) -> ReachTube:
    method = SampledTube(sampling, (sent,) * sampling.commands_sent, degree=2)
    bench = b1()
    return compute_tube(
        bench.system, initial_set=bench.initial_set, horizon_s=horizon_s, method=method
    )


def speeds(initial: float, *, period_s: float, lag: int, count: int) -> np.ndarray:
    """v_{k+1} = v_k + T a_{k - lag}, a_k = 2.8 - v_k + 0.1 I_k, I_{k+1} = I_k + T (2.8 - v_k)."""
    v, integral, commands, found = initial, 0.0, [0.0] * lag, [initial]
    for _ in range(count):
        commands.append(2.8 - v + 0.1 * integral)
        integral += period_s * (2.8 - v)
        v += period_s * commands.pop(0)
        found.append(v)
    return np.array(found)


@pytest.mark.parametrize(("lag", "split"), [(0, 0.0), (1, 0.0), (3, 0.0), (3, 0.07), (2, 0.1)])
def test_speed_at_the_samples_is_the_linear_recursion(lag: int, split: float) -> None:
    """Delays of whole periods, wherever they arise; measurement delays move the start of time."""
    total = lag * 0.05
    tube = sampled(steady(0.05, delay_s=total - split * (lag > 0), measured_s=split), 1.0)
    ends = np.stack([speeds(v, period_s=0.05, lag=lag, count=20) for v in (2.3, 2.7)])
    column = tube.names.index("speed")
    low, high = ends.min(axis=0), ends.max(axis=0)
    assert np.allclose(tube.times, 0.05 * np.arange(21), rtol=0, atol=1e-12)
    assert np.all(tube.lower_at[:, column] <= low + 1e-13)
    assert np.all(tube.upper_at[:, column] >= high - 1e-13)
    assert np.allclose(tube.lower_at[:, column], low, rtol=0, atol=1e-9)
    assert np.allclose(tube.upper_at[:, column], high, rtol=0, atol=1e-9)


def test_commands_under_way_act_before_any_other() -> None:
    sampling = steady(0.05, delay_s=0.12)
    sent = (
        SentCommand.exactly(0.1, 0.0),
        SentCommand.exactly(-0.2, 1.0),
        SentCommand((0.3, 0.4), (0.0, 0.0)),
    )
    bench = b1()
    tube = compute_tube(
        bench.system,
        initial_set=bench.initial_set,
        horizon_s=0.12,
        method=SampledTube(sampling, sent, degree=2),
    )
    # They act from 0, from 0.12 - 0.10 and from 0.12 - 0.05 on.
    turned = 0.02 * 0.1 - 0.05 * 0.2 + 0.05 * np.array([0.3, 0.4])
    column = tube.names.index("steering")
    assert tube.lower_at[-1, column] == pytest.approx(turned[0] - 0.02, abs=1e-9)
    assert tube.upper_at[-1, column] == pytest.approx(turned[1] + 0.02, abs=1e-9)
    assert tube.upper_at[-1, tube.names.index("speed")] == pytest.approx(2.7 + 0.05, abs=1e-9)


def exact_start() -> Box:
    """B1's initial set without any width: at 2.5 m/s."""
    names = b1().initial_set.names
    return Box.around(dict(zip(names, b1().initial_set.center, strict=True)), radius={})


def speed_range(sampling: Sampling, horizon_s: float, sent_mps2: float) -> tuple[float, float]:
    sent = (SentCommand.exactly(0.0, sent_mps2),) * sampling.commands_sent
    tube = compute_tube(
        b1().system,
        initial_set=exact_start(),
        horizon_s=horizon_s,
        method=SampledTube(sampling, sent, degree=2),
    )
    column = tube.names.index("speed")
    return float(tube.lower_at[-1, column]), float(tube.upper_at[-1, column])


def test_an_unknown_instant_of_the_measurement() -> None:
    """The state moved on for s in [0, 0.04] s at 1 m/s^2; the command acts from 0.04 s on."""
    sampling = Sampling(0.05, 0.0, Jitter.CLOCK, (0.0, 0.04), (0.0, 0.0), IntegralStep.NOMINAL)
    found = speed_range(sampling, 0.09, 1.0)
    exact = [2.54 + 0.05 * (2.8 - 2.5 - s) for s in (0.04, 0.0)]
    assert found[0] <= exact[0] + 1e-15
    assert found[1] >= exact[1] - 1e-15
    assert found == pytest.approx(exact, abs=1e-9)


def test_an_unknown_instant_of_the_action() -> None:
    """The old command, 2 m/s^2, is in force for s in [0.01, 0.04] s, the new one afterwards."""
    sampling = Sampling(0.05, 0.0, Jitter.CLOCK, (0.0, 0.0), (0.01, 0.04), IntegralStep.NOMINAL)
    found = speed_range(sampling, 0.05, 2.0)
    exact = [2.5 + 2.0 * s + 0.3 * (0.05 - s) for s in (0.01, 0.04)]
    assert found[0] <= exact[0] + 1e-15
    assert found[1] >= exact[1] - 1e-15
    assert found == pytest.approx(exact, abs=1e-9)


def test_jitter_on_a_clock_moves_measurement_and_action() -> None:
    """Both within 0.01 s, the action never before the measurement (here taken apart)."""
    sampling = Sampling(0.05, 0.005, Jitter.CLOCK, (0.0, 0.0), (0.0, 0.0), IntegralStep.NOMINAL)
    found = speed_range(sampling, 0.05, 2.0)
    commands = [0.3 - 2.0 * s for s in (0.0, 0.01)]
    exact = [2.5 + 2.0 * s + a * (0.05 - s) for s, a in ((0.0, commands[1]), (0.01, commands[0]))]
    assert found == pytest.approx(exact, abs=2e-4)
    together = [2.5 + 2.0 * s + (0.3 - 2.0 * s) * (0.05 - s) for s in (0.0, 0.01)]
    assert found[0] <= together[0]
    assert found[1] >= together[1]


def test_samples_that_drift_are_read_in_absolute_time() -> None:
    """Until a command acts, the speed is that of the old command whatever the samples do."""
    sampling = Sampling(0.05, 0.002, Jitter.DRIFT, (0.0, 0.0), (0.1, 0.1), IntegralStep.NOMINAL)
    found = speed_range(sampling, 0.09, 2.0)
    assert found == pytest.approx((2.68, 2.68), abs=1e-9)


def test_samples_that_drift_may_have_come_or_not() -> None:
    """At 1.1 periods the second sample, due at 1 +- 0.2, has stepped the integral or has not."""
    sampling = Sampling(0.05, 0.01, Jitter.DRIFT, (0.0, 0.0), (0.0, 0.0), IntegralStep.NOMINAL)
    tube = compute_tube(
        b1().system,
        initial_set=exact_start(),
        horizon_s=0.055,
        method=SampledTube(sampling, (STILL,), degree=2),
    )
    column = tube.names.index("offset_integral")
    assert tube.lower_at[-1, column] <= 0.05 * 0.3
    assert tube.upper_at[-1, column] >= 0.05 * 0.3 + 0.05 * 0.29


@pytest.mark.parametrize("deep", [False, True])
def test_an_anchor_reads_a_set_at_another_time(deep: bool) -> None:
    """x = xi, c = s + xi / 2, |xi| <= 1, rates in [0, 2]: x + (s - c) f covers [-1, 1]."""
    wide = np.array([[1.0, 0.0]]) * deep
    box = PolynomialSet.of_boxes(-wide, wide, degree=2)
    coef = box.coef.copy()
    coef[0, 1, 0] = 0.75
    if deep:
        coef[0, 1, 1] = 0.5
    moves = np.zeros((1, 2, 0)) if deep else np.array([[[1.0], [0.5]]])
    source = PolynomialSet(box.algebra, coef, moves)
    anchor = Anchor.of(source, [0], nearest_ticks(0.75), (np.array([0.0]), np.array([2.0])))
    low, high = anchor.at((np.array([0.0]), np.array([2.0])))
    assert low[0] <= -1.0
    assert high[0] >= 1.0
    assert (low[0], high[0]) == pytest.approx((-1.0, 1.0), abs=1e-9)
    # With the rate known, 1 at all times, x - (c - s) alone is left.
    low, high = anchor.at((np.array([1.0]), np.array([1.0])))
    assert (low[0], high[0]) == pytest.approx((-0.5, 0.5), abs=1e-9)
    assert low[0] <= -0.5
    assert high[0] >= 0.5


def test_the_period_to_zero_gives_the_continuous_tube() -> None:
    bench = b1_small()
    arguments = {"initial_set": bench.initial_set, "horizon_s": 0.4}
    continuous = compute_tube(bench.system, method=ValidatedTube(0.05), **arguments)
    gaps = []
    for period_s in (0.02, 0.01, 0.005):
        method = SampledTube(steady(period_s), (STILL,), degree=2)
        tube = compute_tube(bench.system, method=method, **arguments)
        # Integrals are shown after their step: half a step apart on average, a whole one at most.
        away = np.abs(np.stack([tube.lower_at[-1], tube.upper_at[-1]]) - end_of(continuous))
        gaps.append(away.max())
    assert gaps[2] < 0.55 * gaps[1] < 0.3 * gaps[0]
    assert gaps[2] < 3e-3


def end_of(tube: ReachTube) -> np.ndarray:
    return np.stack([tube.lower_at[-1], tube.upper_at[-1]])


def test_what_is_less_certain_is_not_narrower() -> None:
    certain = sampled(steady(0.05, delay_s=0.04), 0.5)
    for sampling in (
        Sampling(0.05, 0.0, Jitter.CLOCK, (0.0, 0.0), (0.03, 0.05), IntegralStep.NOMINAL),
        Sampling(0.05, 0.002, Jitter.DRIFT, (0.0, 0.0), (0.04, 0.04), IntegralStep.MEASURED),
    ):
        loose = sampled(sampling, 0.5)
        assert np.all(loose.half_width_at() >= certain.half_width_at() - 1e-12)


def test_saturation_is_stated() -> None:
    limited = b2()
    method = SampledTube(steady(0.05), (STILL,), degree=2)
    arguments = {"horizon_s": 0.3, "method": method}
    wide = compute_tube(limited.system, initial_set=limited.initial_set, **arguments)
    assert wide.kinks is not None
    assert not wide.kinks.unsaturated
    free = compute_tube(b1().system, initial_set=b1().initial_set, **arguments)
    assert free.kinks is not None
    assert free.kinks.unsaturated


def test_cells_cover_and_are_narrower() -> None:
    bench = b1()
    method = SampledTube(steady(0.05, delay_s=0.05), (STILL,) * 1, degree=2)
    arguments = {"initial_set": bench.initial_set, "horizon_s": 0.6}
    whole = compute_tube(bench.system, method=method, **arguments)
    cells = compute_tube(bench.system, method=Partitioned(method, {"heading": 2}), **arguments)
    assert np.all(cells.half_width_at() <= whole.half_width_at() + 1e-12)


def test_a_loop_that_blows_up_ends_as_a_value() -> None:
    bench = b1_small()
    method = SampledTube(steady(0.5), (STILL,), degree=1)
    turned = bench.initial_set.reordered(bench.system.ode.names)
    intervals = {n: turned.interval(n) for n in turned.names} | {"heading": (1.2, 1.3)}
    tube = compute_tube(
        bench.system, initial_set=Box.from_intervals(intervals), horizon_s=9.0, method=method
    )
    assert tube.status is not TubeStatus.COMPLETE
    assert tube.message
    assert len(tube.lower_at) == len(tube.times) == len(tube.lower) + 1


def test_misuse_is_refused() -> None:
    bench, sampling = b1(), steady(0.05, delay_s=0.12)
    with pytest.raises(InputError, match="expected 3 commands"):
        SampledTube(sampling, (STILL,), degree=2)
    with pytest.raises(InputError, match="out of order"):
        Sampling(0.05, 0.0, Jitter.CLOCK, (0.0, 0.0), (0.0, 0.05), IntegralStep.NOMINAL)
    with pytest.raises(InputError, match="jitter_s"):
        steady(0.05, jitter_s=0.03)
    with pytest.raises(InputError, match="period_s"):
        steady(0.0)
    with pytest.raises(InputError, match="low <= high"):
        steady(0.05, delay_s=-0.1)
    loop = bench.system
    assert isinstance(loop, ClosedLoop)
    braking = ClosedLoop(loop.plant, loop.controller, VehicleBrake(2.0, 3.0, 0.1, 0.1, 0.2))
    for system in (braking, loop.ode):
        with pytest.raises(InputError, match="ClosedLoop"):
            compute_tube(
                system,
                initial_set=bench.initial_set,
                horizon_s=1.0,
                method=SampledTube(sampling, (STILL,) * 3, degree=2),
            )
