"""Time and instructions of the compiled online tubes beside the compiled trajectory alone."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import final

import numpy as np

from workbench.bench.online_kernels import Setting, cells_of, steps_in
from workbench.bench.tightness import SCORE_STEP_S
from workbench.codegen.compiler import find_compiler
from workbench.codegen.online_tube import OnlineTube
from workbench.codegen.trajectory import CompiledTrajectory
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark

_ROUNDS = 200
_CALLS_PER_CELL = 5
_FILES = ("./tube.so", "./trajectory.so", "input")


@final
@dataclass(frozen=True, slots=True)
class OnlineCost:
    """Cost of the tubes of all cells over [0, horizon_s], in C, one core, without any interpreter.

    tube_us, trajectory_us: medians of interleaved rounds, microseconds; the trajectory is that of
    the set's centre in steps of 0.05 s, whatever the tube's step; ratio: median of the rounds'
    quotients; tube_instructions, trajectory_instructions, instruction_ratio: by callgrind, None
    without valgrind.
    """

    setting: Setting
    horizon_s: float
    rounds: int
    tube_us: float
    trajectory_us: float
    ratio: float
    tube_instructions: int | None
    trajectory_instructions: int | None
    instruction_ratio: float | None


@final
@dataclass(frozen=True, slots=True)
class CostCase:
    """A compiled tube, what it is run with, and for how long."""

    kernel: OnlineTube
    setting: Setting
    horizon_s: float


def online_costs(
    benchmark: Benchmark,
    cases: Sequence[CostCase],
    *,
    rounds: int = _ROUNDS,
    advance: Callable[[], None] = lambda: None,
) -> tuple[OnlineCost, ...]:
    """Measure every case on one loop; `advance` is called after each.

    The cases' tubes must be complete: an early end would be no cost of a tube. Raises InputError
    where one is not, and without a C compiler.
    """
    found = []
    yardsticks: dict[float, int | None] = {}
    with harness_folder() as folder:
        for case in cases:
            prepare(benchmark, case, folder)
            lines = run(["./harness", *_FILES, str(rounds)], folder).stdout.split("\n")
            times = np.array([[float(v) for v in line.split()] for line in lines if line])
            if case.horizon_s not in yardsticks:
                yardsticks[case.horizon_s] = _instructions("wb_trajectory", folder)
            counted, yardstick = _instructions("wb_tube", folder), yardsticks[case.horizon_s]
            medians = np.median(times, axis=0) / 1e3
            found.append(OnlineCost(
                case.setting, case.horizon_s, rounds, float(medians[0]), float(medians[1]),
                float(np.median(times[:, 0] / times[:, 1])), counted, yardstick,
                counted / yardstick if counted is not None and yardstick else None,
            ))  # fmt: skip
            advance()
    return tuple(found)


@contextlib.contextmanager
def harness_folder() -> Iterator[Path]:
    """A temporary folder with the compiled harness in it."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        source = (files("workbench.bench") / "c" / "online_harness.c").read_text()
        (folder / "harness.c").write_text(source)
        run([find_compiler(), "-std=c99", "-O2", "-o", "harness", "harness.c", "-ldl"], folder)
        yield folder


def prepare(benchmark: Benchmark, case: CostCase, folder: Path) -> None:
    """Write what the harness reads."""
    ode, kernel = benchmark.system.ode, case.kernel
    n, steps = len(ode.states), steps_in(case.horizon_s, SCORE_STEP_S)
    cells = cells_of(benchmark, case.setting.parts)
    queries = [kernel.query(cell, case.horizon_s, case.setting.step_s) for cell in cells]
    inputs = [
        *queries,
        np.array(benchmark.initial_set.reordered(ode.names).center),
        np.array(ode.parameter_values()),
        np.array([w.nominal for w in ode.disturbances]),
    ]
    result = 2 + 2 * (2 * kernel.sizes.steps + 1) * n
    calls = max(1, _CALLS_PER_CELL // len(cells))
    sizes = [len(cells), calls, len(queries[0]), result, n, len(inputs[-2]), len(inputs[-1]),
             (steps + 1) * n]  # fmt: skip
    content = np.concatenate([np.array(sizes, dtype=float), *inputs, [SCORE_STEP_S]])
    (folder / "input").write_bytes(content.tobytes())
    (folder / "tube.so").write_bytes(kernel.shared_object)
    trajectory = CompiledTrajectory(benchmark.system, steps=steps)
    (folder / "trajectory.so").write_bytes(trajectory.shared_object)


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command there; InputError with its reason where it fails."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.strip() or f"exit status {done.returncode}"
        raise InputError(f"expected {command[0]} to measure the kernels, it failed: {reason}")
    return done


def touched_stack(folder: Path) -> int:
    """Bytes of a painted stack that one run over the queries in `folder` touches."""
    return int(run(["./harness", *_FILES, "stack"], folder).stdout)


def _instructions(entry: str, folder: Path) -> int | None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    options = ["--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={entry}"]
    command = [valgrind, *options, "--callgrind-out-file=/dev/null", "./harness", *_FILES, "0"]
    found = re.search(r"Collected : (\d+)", run(command, folder).stderr)
    return int(found.group(1)) if found else None
