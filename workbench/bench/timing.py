"""Time and instructions of a compiled tube beside the compiled trajectory alone."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import final

import numpy as np

from workbench.bench.scoreboard import compiled_tube
from workbench.bench.tightness import SCORE_STEP_S
from workbench.codegen.compiler import find_compiler
from workbench.codegen.tube_kernel import CompiledTrajectory
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark

_STEPS = 60
_ROUNDS = 200


@final
@dataclass(frozen=True, slots=True)
class KernelTime:
    """Cost of one call over 60 steps of 0.05 s, in C, without any interpreter.

    tube_us, trajectory_us: medians of interleaved runs, microseconds; ratio: median of the rounds'
    quotients; tube_instructions, trajectory_instructions: by callgrind, None without valgrind.
    """

    loop: str
    steps: int
    rounds: int
    tube_us: float
    trajectory_us: float
    ratio: float
    tube_instructions: int | None
    trajectory_instructions: int | None

    @property
    def instruction_ratio(self) -> float | None:
        """Instructions of the tube per instruction of the trajectory."""
        if self.tube_instructions is None or self.trajectory_instructions is None:
            return None
        return self.tube_instructions / self.trajectory_instructions


def kernel_time(benchmark: Benchmark) -> KernelTime:
    """Measure one loop. Raises InputError without a C compiler or when the tube stops early."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        _prepare(benchmark, folder)
        lines = _run(["./harness", *_ARGUMENTS, str(_ROUNDS)], folder).stdout.split("\n")
        rounds = np.array([[float(v) for v in line.split()] for line in lines if line])
        counts = {entry: _instructions(entry, folder) for entry in ("wb_tube", "wb_trajectory")}
    medians = np.median(rounds, axis=0) / 1e3
    return KernelTime(
        loop=benchmark.name,
        steps=_STEPS,
        rounds=_ROUNDS,
        tube_us=float(medians[0]),
        trajectory_us=float(medians[1]),
        ratio=float(np.median(rounds[:, 0] / rounds[:, 1])),
        tube_instructions=counts["wb_tube"],
        trajectory_instructions=counts["wb_trajectory"],
    )


_ARGUMENTS = ("./tube.so", "./trajectory.so", "input")


def _prepare(benchmark: Benchmark, folder: Path) -> None:
    horizon_s = _STEPS * SCORE_STEP_S
    tube = compiled_tube(benchmark, horizon_s)
    ode = tube.ode
    n = len(ode.states)
    query = tube.query(benchmark.initial_set, horizon_s, SCORE_STEP_S)
    inputs = [
        query,
        np.array(benchmark.initial_set.reordered(ode.names).center),
        np.array(ode.parameter_values()),
        np.array([w.nominal for w in ode.disturbances]),
    ]
    result = 2 + 2 * (2 * _STEPS + 1) * n
    sizes = [len(query), result, n, len(inputs[2]), len(inputs[3]), (_STEPS + 1) * n]
    content = np.concatenate([np.array(sizes, dtype=float), *inputs, [SCORE_STEP_S]])
    (folder / "input").write_bytes(content.tobytes())
    (folder / "tube.so").write_bytes(tube.shared_object)
    trajectory = CompiledTrajectory(benchmark.system, steps=_STEPS)
    (folder / "trajectory.so").write_bytes(trajectory.shared_object)
    source = (files("workbench.bench") / "c" / "harness.c").read_text()
    (folder / "harness.c").write_text(source)
    _run([find_compiler(), "-std=c99", "-O2", "-o", "harness", "harness.c", "-ldl"], folder)


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.strip() or f"exit status {done.returncode}"
        raise InputError(f"expected {command[0]} to measure the kernels, it failed: {reason}")
    return done


def _instructions(entry: str, folder: Path) -> int | None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    options = ["--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={entry}"]
    command = [valgrind, *options, "--callgrind-out-file=/dev/null", "./harness", *_ARGUMENTS, "0"]
    found = re.search(r"Collected : (\d+)", _run(command, folder).stderr)
    return int(found.group(1)) if found else None
