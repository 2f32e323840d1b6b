"""Pair i is the same whoever draws it: in any block, by any number of processes, after a kill."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.models.benchmarks import all_benchmarks
from workbench.models.signals import Ranged, Signal
from workbench.models.system import Ode, system_from_casadi
from workbench.sensitivity.learning.drawing import Drawing, Workforce
from workbench.sensitivity.learning.draws import uniforms, unit, words
from workbench.sensitivity.learning.function_simulator import FunctionSimulator
from workbench.sensitivity.learning.model_simulator import ModelSimulator
from workbench.sensitivity.learning.pairs import PairRuns
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sensitivity.learning.store import PairStore
from workbench.sensitivity.sampling import rollout
from workbench.sets import Box

SLOW = """\
import math, os, time
def drift(state, times, seed):
    time.sleep(0.002)
    mark = os.environ.get("WORKBENCH_TEST_MARK")
    if mark:
        with open(mark, "a") as file:
            file.write("x")
    noise = seed / 2**64
    return [[x * math.exp((noise - 1.0) * t) for x in state] for t in times]
"""


def _pendulum() -> Ode:
    x = ca.SX.sym("x", 2)
    return system_from_casadi(x, ca.vertcat(x[1], -ca.sin(x[0]) - 0.3 * x[1]), ("angle", "rate"))


_SET = Box.around({"angle": 0.4, "rate": 0.0}, radius={"angle": 0.2, "rate": 0.1})


def _pairs(seed: int = 3) -> SimulatedPairs:
    return SimulatedPairs(ModelSimulator.of(_pendulum(), horizon_s=1.0, step_s=0.1), _SET, seed)


def _slow(folder: Path) -> SimulatedPairs:
    file = folder / "slow.py"
    file.write_text(SLOW)
    box = Box.around({"a": 1.0, "b": 0.5}, radius={"a": 0.1, "b": 0.2})
    return SimulatedPairs(FunctionSimulator(file, "drift", box.names, np.array([0.0, 0.5])), box, 7)


def same(one: PairRuns, other: PairRuns) -> bool:
    return one.first.tobytes() == other.first.tobytes() and (
        one.second.tobytes() == other.second.tobytes()
    )


def test_a_pair_has_the_same_bits_in_every_block() -> None:
    pairs = _pairs()
    whole = pairs.block(0, 200)
    parts = [pairs.block(start, count) for start, count in ((0, 1), (1, 62), (63, 130), (193, 7))]
    joined = PairRuns(
        np.concatenate([part.first for part in parts]),
        np.concatenate([part.second for part in parts]),
    )
    assert same(whole, joined)
    assert not same(whole, _pairs(4).block(0, 200))


def test_the_runs_are_those_of_the_model_from_independent_uniform_states() -> None:
    runs = _pairs().block(0, 4000)
    again = rollout(_pendulum(), runs.first[:, 0], horizon_s=1.0, step_s=0.1)
    assert np.allclose(again, runs.first, rtol=0.0, atol=1e-14)
    share = (np.stack([runs.first, runs.second])[:, :, 0] - np.array(_SET.lower)) / (
        2.0 * np.array(_SET.radius)
    )
    assert share.min() >= 0.0
    assert share.max() <= 1.0
    flat = share.transpose(1, 0, 2).reshape(4000, 4)
    assert np.allclose(flat.mean(axis=0), 0.5, atol=0.025)
    assert np.allclose(np.cov(flat.T), np.eye(4) / 12.0, atol=0.01)


def test_random_words_are_spread_and_numbered() -> None:
    table = words(5, 0, (1000, 6))
    assert np.array_equal(table[123:456], words(5, 123, (333, 6)))
    assert len(np.unique(table)) == table.size
    values = uniforms(table[:, 0], 5)
    assert np.array_equal(values[7:8], uniforms(table[7:8, 0], 5))
    assert abs(values.mean() - 0.5) < 0.02
    assert np.abs(np.corrcoef(values.T) - np.eye(5)).max() < 0.15
    assert unit(np.array([2**64 - 1], dtype=np.uint64))[0] < 1.0


def test_parameters_are_uniform_on_their_ranges_and_shared_by_the_pair() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    ode = Ode(
        "ramp", (Signal("x", "m"),), (Ranged("slope", "m/s", 2.0, 1.0, 3.0),), (), x, p,
        ca.SX(0, 1), ca.SX(p),
    )  # fmt: skip
    pairs = SimulatedPairs(
        ModelSimulator.of(ode, horizon_s=1.0, step_s=0.5),
        Box.around({"x": 0.0}, radius={"x": 1.0}),
        1,
    )
    runs = pairs.block(0, 500)
    slopes = runs.first[:, -1] - runs.first[:, 0]
    assert np.allclose(slopes, runs.second[:, -1] - runs.second[:, 0])
    assert (slopes.min(), slopes.max()) == (
        pytest.approx(1.0, abs=0.02),
        pytest.approx(3.0, abs=0.02),
    )
    assert "parameters uniform on their ranges" in pairs.distribution


def test_the_compiled_integrator_gives_the_model_s_runs() -> None:
    pytest.importorskip("casadi")
    compiled = pytest.importorskip("workbench.codegen.compiled_simulator")
    bench = all_benchmarks()[0]
    grid = {"horizon_s": 1.0, "step_s": 0.05}
    try:
        simulator = compiled.CompiledSimulator.of(bench.system, **grid)
    except InputError as error:
        pytest.skip(str(error))
    slow = SimulatedPairs(ModelSimulator.of(bench.system, **grid), bench.initial_set, 2).block(
        0, 50
    )
    fast = SimulatedPairs(simulator, bench.initial_set, 2).block(0, 50)
    assert np.abs(slow.first - fast.first).max() < 1e-13
    assert np.abs(slow.second - fast.second).max() < 1e-13


@pytest.mark.parametrize(("jobs", "model"), [(1, False), (2, False), (2, True)])
def test_processes_draw_what_one_draws(jobs: int, model: bool, tmp_path: Path) -> None:
    pairs = _pairs() if model else _slow(tmp_path)
    alone = pairs.block(0, 25)
    counted: list[int] = []
    with Drawing(pairs, 25, Workforce(jobs, 4, isolated=True), drawn=counted.append) as drawing:
        assert same(drawing.block(0, 25), alone)
        assert same(drawing.block(3, 9), pairs.block(3, 9))
    assert sum(counted) == 25
    assert drawing.most == 25


def test_asking_beyond_the_total_is_refused() -> None:
    with Drawing(_pairs(), 10, Workforce(1, 4)) as drawing, pytest.raises(InputError, match="10"):
        drawing.block(5, 6)


def test_a_folder_is_read_and_not_drawn_again(tmp_path: Path) -> None:
    pairs, folder = _pairs(), tmp_path / "pairs"
    with Drawing(pairs, 30, Workforce(1, 8), store=PairStore.opened(folder, {"seed": 3})) as first:
        drawn = first.block(0, 30)
    before = {path.name: path.stat().st_mtime_ns for path in (folder / "pairs").iterdir()}
    assert sorted(before) == [f"0000000{k}.npy" for k in range(4)]
    # A recipe that says the same: other runs would be seen.
    with Drawing(
        _pairs(4), 30, Workforce(1, 8), store=PairStore.opened(folder, {"seed": 3})
    ) as second:
        assert same(second.block(0, 30), drawn)
    assert before == {path.name: path.stat().st_mtime_ns for path in (folder / "pairs").iterdir()}
    # More pairs than before complete the last block.
    with Drawing(pairs, 40, Workforce(1, 8), store=PairStore.opened(folder, {"seed": 3})) as third:
        assert same(third.block(0, 40), pairs.block(0, 40))


def test_a_folder_of_other_pairs_or_files_is_refused(tmp_path: Path) -> None:
    PairStore.opened(tmp_path / "a", {"seed": 3})
    with pytest.raises(InputError, match="same seed, 4, got those of 3"):
        PairStore.opened(tmp_path / "a", {"seed": 4})
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "mine.txt").write_text("")
    with pytest.raises(InputError, match="got other files"):
        PairStore.opened(tmp_path / "b", {"seed": 4})
    (tmp_path / "a" / "manifest.json").write_text("{")
    with pytest.raises(InputError, match="expected JSON"):
        PairStore.opened(tmp_path / "a", {"seed": 3})


def test_what_the_dead_left_half_written_is_cleared_away(tmp_path: Path) -> None:
    folder = tmp_path / "a"
    PairStore.opened(folder, {"seed": 3})
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, alive = (folder / "pairs" / f".00000001.npy.{p}.part" for p in (ended.pid, os.getpid()))
    dead.write_text("half")
    alive.write_text("half")
    PairStore.opened(folder, {"seed": 3})
    assert alive.exists()
    assert not dead.exists()


def test_a_spoilt_block_is_named(tmp_path: Path) -> None:
    store = PairStore.opened(tmp_path / "a", {"seed": 3})
    with Drawing(_pairs(), 8, Workforce(1, 8), store=store) as drawing:
        drawing.block(0, 8)
    block = tmp_path / "a" / "pairs" / "00000000.npy"
    other = io.BytesIO()
    np.save(other, np.zeros(8))
    for spoilt in (block.read_bytes()[:100], b"", other.getvalue()):
        block.write_bytes(spoilt)
        with (
            Drawing(_pairs(), 8, Workforce(1, 8), store=store) as drawing,
            pytest.raises(InputError, match=r"00000000\.npy: expected a block .*delete this file"),
        ):
            drawing.block(0, 8)


def test_a_killed_command_goes_on_and_ends_in_the_same_file(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    words = [
        sys.executable, "-m", "workbench.cli.main", "learn", "--from", "slow.py:drift",
        "--start", "a", "0.9", "1.1", "--start", "b", "0.3", "0.7", "--horizon", "0.5", "--step",
        "0.25", "--pairs", "600",
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}

    def started(*more: str, mark: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*words, *more], cwd=tmp_path, env={**environment, "WORKBENCH_TEST_MARK": mark},
            text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def calls(mark: str) -> int:
        file = tmp_path / mark
        return len(file.read_text()) if file.exists() else 0

    whole = started("--save", "whole.json", "--jobs", "1", mark="whole")
    cut = started("--save", "cut.json", "--resume", "pairs", "--jobs", "2", mark="cut")
    blocks = tmp_path / "pairs" / "pairs"
    ends = time.monotonic() + 60.0
    while not (blocks.is_dir() and len(list(blocks.glob("0*.npy"))) >= 3):
        assert cut.poll() is None, cut.communicate()
        assert time.monotonic() < ends
        time.sleep(0.01)
    cut.send_signal(signal.SIGKILL)
    cut.communicate()
    assert not (tmp_path / "cut.json").exists()
    resumed = started("--save", "cut.json", "--resume", "pairs", "--jobs", "1", mark="resumed")
    for ran in (whole, resumed):
        _, err = ran.communicate(timeout=120)
        assert ran.returncode == 0, err
    assert calls("resumed") < calls("whole") == 1219
    assert (tmp_path / "cut.json").read_bytes() == (tmp_path / "whole.json").read_bytes()
    assert json.loads((tmp_path / "cut.json").read_text())["statements"][0]["pairs"] == 600
    assert not list(tmp_path.rglob("*.part")), "an interrupted write leaves nothing once resumed"
