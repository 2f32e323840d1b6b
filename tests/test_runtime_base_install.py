"""The runtime decides without any analysis package, and starts within 80 MB."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from runtime_fixture import write_bundle

BLOCKED = (
    "casadi", "numpy", "scipy", "cvxpy", "control", "filterpy", "matplotlib", "clarabel", "pandas",
)  # fmt: skip

_START = """
import sys, time
started = time.perf_counter()
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked!r}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Block())
from workbench.runtime import Monitor, Observation, PathTable, Timing, Watched, load_bundle
n = 2000
path = PathTable(-1.0, 0.5, tuple(0.5 * j - 1.0 for j in range(n)), (0.0,) * n, (0.0,) * n,
                 (0.0,) * (n - 1), (0.0,) * (n - 1))
timing = Timing(period_s=0.1, latency_s=9.0, send_gap_s=0.04)
monitor = Monitor(load_bundle({folder!r}), path, release_steps=1, clearance_required_m=0.5,
                  timing=timing)
def seen():
    return Observation(
        (-0.1, 0.1), (-0.1, 0.1), (0, 0), (0, 0), (1.9, 2.1), (0, 0), (0, 0), 2.8, people=(),
        stamp_s=time.monotonic(), watched=Watched(0.0, 0.0, 50.0),
    )
first = monitor.step(seen())
cold_s = time.perf_counter() - started
# Not ru_maxrss: it survives exec, so it would count the process that started this one.
with open("/proc/self/status") as status:
    peak_mb = next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024
times = []
for _ in range(200):
    times.append(monitor.step(seen()).elapsed_s)
import json
print(json.dumps({{
    "action": first.action.name, "cold_s": cold_s,
    "peak_mb": peak_mb,
    "median_us": sorted(times)[100] * 1e6, "modules": sorted(sys.modules),
}}))
"""


def _run(folder: Path) -> dict[str, object]:
    code = _START.format(blocked=set(BLOCKED), folder=str(folder))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    measured: dict[str, object] = json.loads(done.stdout)
    return measured


def test_a_decision_needs_only_the_base_install(tmp_path: Path) -> None:
    measured = _run(write_bundle(tmp_path))
    assert measured["action"] == "TRACK"
    loaded = {str(name).partition(".")[0] for name in measured["modules"]}  # type: ignore[attr-defined]
    assert not loaded & {*BLOCKED, "asyncio", "tempfile"}


def test_the_runtime_starts_in_bounded_memory(tmp_path: Path) -> None:
    folder = write_bundle(tmp_path)
    # The time it takes is a figure of `workbench bench`; a busy machine must not fail a test.
    assert float(str(_run(folder)["peak_mb"])) < 80.0
