"""How fast sweeps of gains are, beside python-control and scipy alone, and what they take.

Run with Python (extra `study`): `python -m workbench.bench.gain_sweep_figures` prints the tables;
`--into docs/gain-sweeps.md` puts them between the document's marks. `--points` is the size of the
study that is swept whole by one and by two local workers, `--compared` how many points both routes
score. It fails where the routes differ in a figure that both have.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.bench.gain_sweep_baseline import LACKS, Score, baseline
from workbench.bench.into_document import markdown, put_between
from workbench.simulation.gain_sweep.kernels import Kernels
from workbench.simulation.gain_sweep.plan import Plan
from workbench.simulation.gain_sweep.points import points
from workbench.simulation.gain_sweep.scores import score
from workbench.simulation.gain_sweep.store import SweepStore

MARKS: Final = ("<!-- speed of sweeps: begin -->", "<!-- speed of sweeps: end -->")
_STUDY: Final = """
[study]
name = "steering gains of the simulated GEM e2, by its size"
claim = "Nothing: this is about time and memory."

[gains]
kp = [0.004, 0.02]
kd = [0.04, 0.16]
look-ahead = [4.0, 10.0]

[search]
method = "sobol"
points = {points}
seed = 1

[cases]
speeds_mps = [2.0]
curvatures_per_m = [[0.0, 0.0]]
initial_sets = [{{ name = "radii of the file", offset_m = 0.3, radius_factor = 1.0 }}]

[decide]
trade = ["area_3s_m2", "settling_s"]
choose = "area_3s_m2"
"""
# Of a value, or absolute: integrators with other steps, a grid of times.
_AGREE: Final = {"settling_s": 0.051, "speed_settling_s": 0.051, "saturated": 0.01}
_USUAL: Final = 1e-3


@final
@dataclass(frozen=True, slots=True)
class Whole:
    """A study swept by a command: wall time (s), and peak memory (MiB) of its largest process."""

    jobs: int
    seconds: float
    mebibytes: float


def compared(kernels: Kernels, plan: Plan) -> tuple[float, float, list[str]]:
    """CPU seconds per point by the kernels and by the other route, and where they differ, in
    words."""
    case, count = plan.cases[0], plan.count
    wanted = points(plan, kernels.vehicle, range(1, count + 1))
    other = baseline(kernels.vehicle)
    score(kernels, wanted[0], case)
    other(wanted[0], case)
    begun = time.process_time()
    ours = [score(kernels, gains, case) for gains in wanted]
    middle = time.process_time()
    theirs = [other(gains, case) for gains in wanted]
    ended = time.process_time()
    wrong = [
        f"point {k + 1}: {said}"
        for k, (mine, found) in enumerate(zip(ours, theirs, strict=True))
        for said in differences({n: float(mine[n]) for n in found}, found)
    ]
    return (middle - begun) / count, (ended - middle) / count, wrong


def differences(mine: Score, other: Score) -> list[str]:
    """Figures by which two scores differ more than rounding and steps of time allow, in words."""
    found = []
    for name, value in other.items():
        known, most = mine[name], _AGREE.get(name, _USUAL * max(1.0, abs(value)))
        both_lack = math.isnan(known) and math.isnan(value)
        if not (known == value or both_lack or abs(known - value) <= most):
            found.append(f"{name} {known:.6g} and {value:.6g}")
    return found


def study(folder: Path, count: int) -> Path:
    """Its file."""
    file = folder / "study.toml"
    file.write_text(_STUDY.format(points=count), encoding="utf-8")
    return file


def swept(folder: Path, count: int, jobs: int) -> Whole:
    """Begin to end by the command, kernels compiled and workers started on the way."""
    command = [
        sys.executable, "-m", "workbench.cli.main", "gains", "sweep", str(study(folder, count)),
        "--out", str(folder / f"sweep-{jobs}"), "--jobs", str(jobs),
    ]  # fmt: skip
    begun = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as child:
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {child.returncode}")
    return Whole(jobs, time.perf_counter() - begun, used.ru_maxrss / 1024.0)


def tables(compare: int, count: int) -> tuple[str, list[str]]:
    """All of it as Markdown, and what differs."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        store = SweepStore(folder / "compared")
        plan = store.begin(study(folder, compare))
        begun = time.perf_counter()
        store.build()
        built = time.perf_counter() - begun
        ours, theirs, wrong = compared(store.kernels(), plan)
        whole = [swept(folder, count, jobs) for jobs in (1, 2)]
    speed = markdown(
        ["route", "points", "points per CPU second", "figures it lacks"],
        [
            ["compiled kernels, full score", str(compare), f"{1.0 / ours:.3g}", "none"],
            ["python-control and scipy's RK45", str(compare), f"{1.0 / theirs:.3g}",
             "; ".join(LACKS)],
        ],
    )  # fmt: skip
    study_rows = [
        [str(each.jobs), str(count), f"{each.seconds:.0f} s", f"{count / each.seconds:.3g}",
         f"{whole[0].seconds / each.seconds:.2f}", f"{each.mebibytes:.0f} MiB"]
        for each in whole
    ]  # fmt: skip
    headings = ["local workers", "points", "wall time", "points per second", "times as fast",
                "most memory of a process"]  # fmt: skip
    said = (
        f"One case per point. Compiling both kernels took {built:.0f} s, which is part of the wall "
        f"times below, as is the start of the workers; {os.cpu_count()} cores were there."
    )
    return "\n\n".join([speed, said, markdown(headings, study_rows)]), wrong


def main(arguments: Sequence[str] | None = None) -> int:
    """Print or put the tables; 1 where the routes differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000, help="(default: 10000)")
    parser.add_argument("--compared", type=int, default=100, help="(default: 100)")
    parser.add_argument("--into", type=Path, metavar="FILE", help="a document with the marks")
    args = parser.parse_args(arguments)
    text, wrong = tables(args.compared, args.points)
    if args.into and not wrong:
        put_between(args.into, MARKS, text)
    sys.stdout.write("\n".join([text, *wrong]) + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
