"""The bench counts every escape, measures widths as stated, and its command reports both."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from workbench.bench import (
    ColdStart,
    KernelTime,
    SamplePlan,
    bench_loops,
    bounds_at,
    cold_start,
    escaping,
    kernel_times,
    sampled_runs,
)
from workbench.bench.scoreboard import Loop
from workbench.bench.tightness import MethodScore, Samples
from workbench.claims import Rigor
from workbench.cli.main import main
from workbench.errors import InputError
from workbench.models.benchmarks import PLANE_STATES, b1_small, b2_noise
from workbench.reach import ReachTube, TubeStatus, compute_tube
from workbench.reach.inner.extremes import SearchEffort
from workbench.reach.inner.hull import inner_hull

PLAN = SamplePlan(count=2000, horizon_s=0.5, step_s=0.0125, seed=1)


def tube_of(
    half_width: float,
    segment_more: float,
    *,
    steps: int = 2,
    names: tuple[str, ...] = ("x",),
) -> ReachTube:
    """[-half_width, half_width] at instants 0.05 k s, `segment_more` wider between them."""
    at = np.full((steps + 1, len(names)), half_width)
    between = np.full((steps, len(names)), half_width + segment_more)
    times = 0.05 * np.arange(steps + 1)
    return ReachTube(times, -between, between, -at, at, names, TubeStatus.COMPLETE, Rigor.NUMERICAL)


def test_bounds_are_those_of_instants_and_segments() -> None:
    lower, upper = bounds_at(tube_of(1.0, 0.5), np.array([0.0, 0.02, 0.05, 0.07, 0.1, 0.11]))
    assert upper.ravel().tolist() == [1.0, 1.5, 1.0, 1.5, 1.0, np.inf]
    assert np.array_equal(lower, -upper)


@pytest.mark.parametrize(
    ("value", "when", "outside"),
    [
        (1.2, 0.02, False),
        (1.2, 0.05, True),
        (-1.6, 0.02, True),
        (np.nan, 0.07, True),
        (9.0, 0.2, False),
    ],
)
def test_an_escape_at_one_time_is_found(value: float, when: float, outside: bool) -> None:
    times = np.array([0.0, when])
    runs = np.array([[[0.0], [value]]])
    assert escaping(tube_of(1.0, 0.5), times, runs, allowance=1e-9).any() == outside


def test_scores_are_the_stated_means() -> None:
    times = np.linspace(0.0, 0.1, 9)
    samples = Samples(times, (tube_of(1.0, 0.5), tube_of(0.3, 0.0)))
    samples.add(np.array([0.5 * np.ones(9), -0.5 * np.ones(9)])[:, :, None])
    samples.add(np.array([0.25 * np.ones(9)])[:, :, None])
    wide, narrow = samples.score(0, 0.1), samples.score(1, 0.1)
    assert wide.width_ratio == {"x": pytest.approx(2.0)}
    assert wide.excess_mean == wide.excess_worst == {"x": pytest.approx(1.0)}
    assert (wide.escapes, wide.trajectories, wide.times_checked) == (0, 3, 8)
    assert wide.final_radius == {"x": 1.0}
    assert wide.final_sampled_radius == {"x": 0.5}
    assert narrow.escapes == 2
    assert wide.proved_ratio == {"x": None}
    assert narrow.excess_mean == {"x": pytest.approx(-0.2)}
    longer = samples.score(0, 3.0)
    assert not longer.covered
    assert longer.width_ratio == wide.width_ratio


def test_runs_that_leave_by_less_than_their_error_only_touch() -> None:
    times = np.linspace(0.0, 0.1, 9)
    samples = Samples(times, (tube_of(1.0, 0.0),))
    ends = [0.5, 1.0 + 5e-10, 1.0 + 5e-9, np.nan]
    samples.add(np.array([end * np.ones(9) for end in ends])[:, :, None])
    score = samples.score(0, 0.1)
    assert (score.escapes, score.touching) == (2, 1)


def test_proved_ratios_are_never_below_sampled_ones_of_reachable_sets() -> None:
    loop = b1_small()
    tube = compute_tube(loop.system, initial_set=loop.initial_set, horizon_s=0.5)
    inner = inner_hull(
        loop.system,
        initial_set=loop.initial_set,
        horizon_s=0.5,
        step_s=0.05,
        effort=SearchEffort(starts=32, rounds=2, every=2, seed=1),
    )
    samples = Samples(PLAN.times, (tube,), inner=inner)
    for runs in sampled_runs(loop, PLAN):
        samples.add(runs)
    score = samples.score(0, 0.5)
    assert score.escapes == 0
    for name in tube.names:
        proved, sampled = score.proved_ratio[name], score.width_ratio[name]
        assert proved is not None
        assert sampled is not None
        assert 1.0 <= proved == pytest.approx(sampled, rel=1e-4)


def test_samples_hold_vertices_and_extremes_and_follow_the_seed() -> None:
    loop = b1_small()
    runs = np.concatenate(list(sampled_runs(loop, PLAN)))
    assert runs.shape == (2000, 41, 7)
    starts = {tuple(row) for row in runs[:, 0]}
    assert set(loop.initial_set.vertices()) <= starts
    again = np.concatenate(list(sampled_runs(loop, PLAN)))
    assert np.array_equal(runs, again)
    uniform = runs[-500:]
    assert np.all(runs.max(axis=0) >= uniform.max(axis=0))


def test_sampled_disturbances_switch_but_runs_stay_continuous() -> None:
    noisy, quiet = (
        np.concatenate(list(sampled_runs(loop, PLAN))) for loop in (b2_noise(), b1_small())
    )
    jumps = [np.abs(np.diff(runs[:, :, 3], axis=1)).max() for runs in (noisy, quiet)]
    assert max(jumps) < 0.05
    slopes = np.diff(noisy[:, :, 3], axis=1) / PLAN.step_s
    assert np.abs(np.diff(slopes, axis=1)).max() > 0.1


def test_wrong_use_is_answered() -> None:
    with pytest.raises(InputError, match="no benchmark loop 'B9'; expected one of B1, B1-small"):
        bench_loops(("B9",))
    with pytest.raises(InputError, match="at least 1000 trajectories"):
        SamplePlan(count=10, horizon_s=3.0, step_s=0.0125, seed=1)
    assert main(["bench", "--only", "B9"]) == 2


def test_kernel_times_are_counted() -> None:
    measured, quadratic = kernel_times(b1_small())
    assert (measured.method, quadratic.method) == ("online-linear", "online-quadratic")
    assert 0.5 < measured.trajectory_us < measured.tube_us < quadratic.tube_us < 1e5
    assert measured.ratio > 1.0
    if shutil.which("valgrind") is None:
        assert measured.instruction_ratio is None
        pytest.skip("needs the optional tool valgrind")
    assert measured.tube_instructions is not None
    assert measured.trajectory_instructions is not None
    assert measured.trajectory_instructions > 60 * 4 * 40
    assert measured.instruction_ratio == pytest.approx(
        measured.tube_instructions / measured.trajectory_instructions
    )


def test_a_folder_without_a_bundle_has_no_cold_start(tmp_path) -> None:
    with pytest.raises(InputError, match="expected a bundle that decides") as caught:
        cold_start(tmp_path)
    assert "workbench.errors" not in str(caught.value)


def test_the_command_reports_everything(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("workbench.cli.bench._TRAJECTORIES_QUICK", 3000)
    monkeypatch.setattr("workbench.bench.scoreboard.HORIZONS_S", (0.4, 0.5))
    monkeypatch.setattr("workbench.cli.bench_online.measure", lambda *_, **__: [])
    monkeypatch.setattr("workbench.cli.bench_decision.measure", lambda *_, **__: None)
    assert main(["bench", "--quick", "--only", "B1-small", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["escapes"] == 0
    assert found["trajectories"] == 3000
    scores = {method["method"]: method for method in found["tightness"]["B1-small"]}
    assert list(scores) == ["validated", "validated, 8 cells", "online-linear", "online-quadratic"]
    for method in scores.values():
        assert method["rigor"] == "ENCLOSED"
        first = method["horizons"][0]
        assert first["horizon_s"] == 0.4
        assert first["trajectories"] == 3000
        for state in ("x", "y", "steering", "heading"):
            assert 1.0 <= first["width_ratio"][state] <= 1.1
            assert 1.0 <= first["proved_ratio"][state] <= 1.1
            assert 0.0 <= first["excess_mean"][state] <= first["excess_worst"][state]
    finer = scores["validated, 8 cells"]["horizons"][1]["width_ratio"]
    assert finer["y"] < scores["validated"]["horizons"][1]["width_ratio"]["y"]
    assert found["times"][0]["ratio"] > 1.0
    assert found["cold_start"]["process_s"] < 5.0
    assert found["cold_start"]["verdict"] == "SAFE"


def test_a_board_alone_leaves_the_others_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    time = KernelTime("B1", "online-linear", 60, 200, 60.0, 5.0, 12.0, None, None, None)
    monkeypatch.setattr("workbench.bench.kernel_times", lambda _: (time,))
    assert main(["bench", "--board", "time", "--only", "B1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["tightness"], found["cold_start"], found["escapes"]) == ({}, None, None)
    assert found["online"] == []
    assert found["times"][0]["tube_us"] == 60.0


def test_an_escape_makes_the_command_fail(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def one_escape(_loop: Loop, _plan: SamplePlan, *, advance: object) -> tuple[MethodScore, ...]:
        tube = tube_of(1.0, 0.0, steps=60, names=PLANE_STATES)
        samples = Samples(np.linspace(0.0, 3.0, 241), (tube,))
        runs = np.zeros((1, 241, 7))
        runs[0, 100] = 2.0
        samples.add(runs)
        score = samples.score(0, 3.0)
        return (MethodScore("any", 0.05, "NUMERICAL", "COMPLETE", 3.0, 0.0, 0.5, (score,)),)

    time = KernelTime("B1", "online-linear", 60, 200, 60.0, 5.0, 12.0, None, None, None)
    start = ColdStart(1, 0.1, 0.05, 0.01, 0.001, 20.0, "SAFE", "")
    monkeypatch.setattr("workbench.bench.score_loop", one_escape)
    monkeypatch.setattr("workbench.bench.kernel_times", lambda _: (time,))
    monkeypatch.setattr("workbench.cli.bench._cold_start", lambda _: start)
    monkeypatch.setattr("workbench.cli.bench_online.measure", lambda *_, **__: [])
    monkeypatch.setattr("workbench.cli.bench_decision.measure", lambda *_, **__: None)
    assert main(["bench", "--quick", "--only", "B1", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["escapes"] == 1
    assert main(["bench", "--quick", "--only", "B1"]) == 1
    text = capsys.readouterr().out
    assert "escapes: 1 in all" in text
    assert "50.0%" in text
    assert "valgrind is missing" in text
