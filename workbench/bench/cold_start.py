"""How long the runtime takes from a fresh process to its first decision, and how much memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import final

import workbench
from workbench.errors import InputError

_PROCESSES = 5

# Runs in a fresh interpreter; a car that stands on a straight path, one person far ahead.
_PROGRAM = """
import json, sys, time
start = time.perf_counter()
from workbench.runtime import (
    Disc, Guard, Monitor, MotionLimits, Observation, ObservedPerson, PathTable, Person, Timing,
    Watched, load_bundle,
)
imported = time.perf_counter()
bundle = load_bundle(sys.argv[1])
loaded = time.perf_counter()
nodes = 200
line = tuple(0.5 * k for k in range(nodes))
zeros, bins = (0.0,) * nodes, (0.0,) * (nodes - 1)
path = PathTable(0.0, 0.5, line, zeros, zeros, bins, bins)
monitor = Monitor(
    bundle, path, release_steps=1, clearance_required_m=0.0, clock=lambda: 0.01,
    timing=Timing(period_s=0.1, latency_s=0.05, send_gap_s=0.05),
)
region = bundle.manifest.region
limits = MotionLimits(bundle.manifest.guard_speed_max_mps, bundle.manifest.guard_accel_max_mps2)
person = Person("ahead", 80.0, 0.0, 0.0, 0.0, 0.5, 0.1, 0.0)
guard = Guard(0.0, Disc(80.0, 0.0, 0.5), Disc(0.0, 0.0, 0.1), limits)
decision = monitor.step(Observation(
    x=(10.0, 10.1), y=(0.0, 0.05), heading=(-0.01, 0.01), steering=(-0.01, 0.01),
    speed=(0.0, 0.0), speed_integral=(0.0, 0.0), offset_integral=(0.0, 0.0),
    reference_speed_mps=min(2.0, region.interval("speed")[1]), stamp_s=0.0,
    people=(ObservedPerson("ahead", (person.intent,), guard),),
    watched=Watched(10.0, 0.0, 100.0),
))
decided = time.perf_counter()
# The process's own high-water mark: getrusage also counts the memory of whoever started it.
with open("/proc/self/status") as status:
    peak_kb = next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))
print(json.dumps({
    "import_s": imported - start, "load_s": loaded - imported, "decide_s": decided - loaded,
    "peak_mib": peak_kb / 1024,
    "verdict": decision.verdict.name, "reason": decision.reason,
}))
"""


@final
@dataclass(frozen=True, slots=True)
class ColdStart:
    """Median of fresh processes.

    process_s: from starting the interpreter to its end; import_s, load_s, decide_s: importing the
    runtime, loading and checking the bundle, path table and first decision, in s; peak_mib: largest
    resident memory, MiB; verdict: of that decision (an empty road, so SAFE when all is well).
    """

    processes: int
    process_s: float
    import_s: float
    load_s: float
    decide_s: float
    peak_mib: float
    verdict: str
    reason: str


def cold_start(bundle: Path) -> ColdStart:
    """Time the first decision of `bundle` (a folder) in fresh processes. InputError if it fails."""
    runs = sorted((_one(bundle) for _ in range(_PROCESSES)), key=lambda run: run.process_s)
    return runs[_PROCESSES // 2]


def _one(bundle: Path) -> ColdStart:
    root = str(Path(workbench.__file__).resolve().parents[1])
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, str(bundle)],
        env={**os.environ, "PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=False,
    )
    process_s = time.perf_counter() - start
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        # A traceback ends with the error's class, which says nothing to who gave the folder.
        reason = last.removeprefix(f"{InputError.__module__}.{InputError.__name__}: ")
        raise InputError(f"expected a bundle that decides, {bundle} does not: {reason}")
    return ColdStart(processes=_PROCESSES, process_s=process_s, **json.loads(done.stdout))
