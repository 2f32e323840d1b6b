"""What was sent before t = 0 drifts too; what cannot be bounded at a sample is said as a value."""

from __future__ import annotations

import pytest

from workbench.controllers import PathFollowing, SpeedPid, SteeringPid, Track
from workbench.controllers.sampling import IntegralStep, Jitter, Sampling, SentCommand
from workbench.errors import InputError
from workbench.models import ClosedLoop, PlaneBicycle, System
from workbench.models.benchmarks import PLANE_STATES, b1, b2_path
from workbench.reach import ReachTube, TubeStatus, compute_tube
from workbench.reach.sampled_data.tube import SampledTube
from workbench.sets import Box

POINT = dict.fromkeys(PLANE_STATES, (0.0, 0.0)) | {"speed": (2.5, 2.5)}


def drifting(measured_s: float, acts_s: float, *, jitter_s: float = 0.005) -> Sampling:
    return Sampling(
        0.05, jitter_s, Jitter.DRIFT, (measured_s,) * 2, (acts_s,) * 2, IntegralStep.NOMINAL
    )


def tube_of(
    system: System,
    intervals: dict[str, tuple[float, float]],
    sampling: Sampling,
    *,
    horizon_s: float,
    sent_mps2: tuple[float, ...] = (0.0,),
) -> ReachTube:
    sent = tuple(SentCommand.exactly(0.0, a) for a in sent_mps2)
    box = Box.from_intervals(intervals)
    method = SampledTube(sampling, sent, degree=2)
    return compute_tube(system, initial_set=box, horizon_s=horizon_s, method=method)


@pytest.mark.parametrize(("measured_s", "acts_s"), [(0.05, 0.025), (0.0625, 0.0), (0.075, 0.0)])
def test_a_command_under_way_acts_one_drifting_period_before_the_first(
    measured_s: float, acts_s: float
) -> None:
    """The first sample comes at m, the one before 0.05 +- 0.005 s earlier, and acts a after it."""
    sampling = drifting(measured_s, acts_s)
    tube = tube_of(b1().system, POINT, sampling, horizon_s=0.05, sent_mps2=(-1.0, 2.0))
    assert tube.complete
    column = tube.names.index("speed")
    early, late = (measured_s + acts_s - 0.05 + s for s in (-0.005, 0.005))
    slow, fast = (2.5 - s + 2.0 * (0.05 - s) for s in (late, early))
    assert tube.lower_at[-1, column] <= slow + 1e-12
    assert tube.upper_at[-1, column] >= fast - 1e-12
    assert tube.half_width_at()[-1, column] < 2.0 * (fast - slow)


def test_commands_whose_instants_drift_over_each_other_are_refused() -> None:
    with pytest.raises(InputError, match="overlap"):
        drifting(0.05, 0.24)
    assert drifting(0.05, 0.24, jitter_s=0.001).commands_sent == 6


def test_an_overflow_at_a_sample_is_a_value() -> None:
    """Without an upper limit, the lower one has a kink whose formula reaches to 1e300 only."""
    steering, speed = SteeringPid(0.0, 0.0, 0.0, 0.0, None), SpeedPid(1.0, 0.1, -2.0, None)
    loop = ClosedLoop(PlaneBicycle(1.75, None), PathFollowing(steering, speed), Track(2.8))
    fast = POINT | {"speed": (-1e301, -1e301)}
    tube = tube_of(loop, fast, drifting(0.0, 0.0), horizon_s=0.01)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert "range of numbers, at the sample at t = 0 s" in tube.message
    assert tube.upper_at[0, tube.names.index("speed_integral")] == pytest.approx(0.0, abs=1e-280)


@pytest.mark.parametrize("measured_s", [(0.0, 0.0), (0.0, 0.02)])
def test_a_pole_in_a_reading_is_singular(measured_s: tuple[float, float]) -> None:
    bench = b2_path()
    intervals = {n: bench.initial_set.interval(n) for n in bench.initial_set.names}
    sampling = Sampling(0.05, 0.0, Jitter.CLOCK, measured_s, (0.0, 0.0), IntegralStep.NOMINAL)
    tube = tube_of(bench.system, intervals | {"offset": (9.0, 11.0)}, sampling, horizon_s=0.2)
    assert tube.status is TubeStatus.SINGULAR
    assert "at the sample at t = 0 s" in tube.message
