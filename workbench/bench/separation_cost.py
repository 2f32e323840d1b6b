"""Instructions and time of the compiled separation, per segment and tube, and by people."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import final

import numpy as np

from workbench.bench.text import table
from workbench.codegen.compiler import find_compiler
from workbench.codegen.separation_source import CompiledSeparation
from workbench.errors import InputError
from workbench.reach.tube import Array
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    MOST_PEOPLE,
    MOST_PIECES,
    MOST_TUBES,
    DiscPiece,
    PersonTube,
    RadiusBetween,
    TrackedPerson,
    TubeKind,
    timed_discs,
)

SEGMENTS = 60
_STEP_S = 0.05
_ROUNDS = 50


@final
@dataclass(frozen=True, slots=True)
class SeparationCost:
    """One call over 60 segments of 0.05 s. tubes: of everybody; instructions: by callgrind, None
    without valgrind; median_us: of 50 rounds of 10 calls, in C."""

    case: str
    people: int
    tubes: int
    instructions: int | None
    median_us: float

    @property
    def per_segment_and_tube(self) -> float | None:
        """Instructions per segment and tube, everything included."""
        if self.instructions is None or self.tubes == 0:
            return None
        return self.instructions / (SEGMENTS * self.tubes)


def separation_costs() -> tuple[SeparationCost, ...]:
    """Measure the cases: far, near, worst, and a street of 0 to 32 people with 3 tubes each.

    leaving: one tube of one piece that the car drives away from, so that only its box is looked at;
    near: one that is looked at in every segment; worst: every tube has all its pieces in every
    segment, each a bound of its own, and none is ever skipped: every loop runs to its end. Raises
    InputError without a C compiler.
    """
    cases: list[tuple[str, list[TrackedPerson], float]] = [
        ("leaving", [_one(0, -10000.0, 1)], 0.0),
        ("near", [_one(0, 0.0, 1)], 0.0),
        ("worst", [_one(i, 0.0, MOST_TUBES, MOST_PIECES) for i in range(MOST_PEOPLE)], 100.0),
        *(("street", street(count), 0.05) for count in (0, 1, 2, 4, 8, 16, 32)),
    ]
    kernel = CompiledSeparation(SEGMENTS)
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        _build(kernel, folder)
        return tuple(_measure(kernel, case, folder) for case in cases)


def separation_cost_text(costs: Sequence[SeparationCost]) -> str:
    """The costs as a table."""
    rows = [
        [
            cost.case, str(cost.people), str(cost.tubes),
            "-" if cost.instructions is None else str(cost.instructions),
            "-" if cost.per_segment_and_tube is None else f"{cost.per_segment_and_tube:.0f}",
            f"{cost.median_us:.1f}",
        ]
        for cost in costs
    ]  # fmt: skip
    headings = ["case", "people", "tubes", "instructions", "per segment and tube", "us"]
    return f"separation over {SEGMENTS} segments, one call in C\n{table(headings, rows)}"


def street(count: int) -> list[TrackedPerson]:
    """`count` people along 25 m of a street, each with two intents of 10 pieces and a guard."""
    rng = np.random.default_rng(11)
    people = []
    for i in range(count):
        x, y = rng.uniform(-5.0, 20.0), rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 7.0)
        vx = rng.choice([-1.0, 1.0]) * 1.4
        times = [-0.2 + 0.4 * k for k in range(11)]
        xs, towards = [x + vx * t for t in times], -math.copysign(1.0, y)
        radii = [0.3 + 0.1 * k for k in range(11)]
        intents = [
            timed_discs(
                times, xs, [y + towards * across * t for t in times], radii,
                between=RadiusBetween.LARGER,
            )
            for across in (0.0, 0.7)
        ]  # fmt: skip
        seen = Guard(0.0, Disc(x, y, 0.3), Disc(vx, 0.0, 0.2), MotionLimits(2.5, 1.5))
        guard = guard_disc(seen, from_s=-0.2, until_s=3.8)
        people.append(TrackedPerson(f"person {i}", (*intents, guard)))
    return people


def _one(index: int, x_m: float, tubes: int, bounds: int = 1) -> TrackedPerson:
    """Tubes of bounds of a single piece each: what costs most per piece."""
    piece = DiscPiece(-101.0, x_m, 0.0, -3.0, 1.5, 0.3, 3.0, 0.0)
    tube = PersonTube(TubeKind.INTENT, ((piece,),) * bounds, 1000.0)
    return TrackedPerson(f"person {index}", (tube,) * tubes)


def _query(kernel: CompiledSeparation, people: list[TrackedPerson], skew_s: float) -> Array:
    times = _STEP_S * np.arange(SEGMENTS + 1.0)
    way = 2.8 * times[:-1]
    size = np.full(SEGMENTS, 1.5)
    rectangles = np.stack([way, 0.0 * way, 0.02 * np.sin(way), size, size - 0.5], axis=1)
    return kernel.query(
        people, times_s=times, rectangles=rectangles, kinds=frozenset(TubeKind),
        skew_s=(-skew_s, skew_s),
    )  # fmt: skip


def _build(kernel: CompiledSeparation, folder: Path) -> None:
    (folder / "kernel.c").write_text(kernel.source)
    source = (files("workbench.bench") / "c" / "separation_harness.c").read_text()
    (folder / "harness.c").write_text(source)
    options = ["-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno"]
    _run([find_compiler(), *options, "-o", "harness", "harness.c", "kernel.c", "-lm"], folder)


def _measure(
    kernel: CompiledSeparation, case: tuple[str, list[TrackedPerson], float], folder: Path
) -> SeparationCost:
    name, people, skew_s = case
    query = _query(kernel, people, skew_s)
    if kernel.call(query)[0]:
        raise InputError(f"expected the kernel to take the case {name!r}, it refused")
    (folder / "input").write_bytes(np.concatenate([[float(len(query))], query]).tobytes())
    lines = _run(["./harness", "input", str(_ROUNDS)], folder).stdout.split()
    return SeparationCost(
        name, len(people), sum(len(person.tubes) for person in people), _instructions(folder),
        float(np.median([float(line) for line in lines])) / 1e3,
    )  # fmt: skip


def _instructions(folder: Path) -> int | None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    options = ["--tool=callgrind", "--collect-atstart=no", "--toggle-collect=wb_separate"]
    command = [valgrind, *options, "--callgrind-out-file=/dev/null", "./harness", "input", "0"]
    found = re.search(r"Collected : (\d+)", _run(command, folder).stderr)
    return int(found.group(1)) if found else None


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.strip() or f"exit status {done.returncode}"
        raise InputError(f"expected {command[0]} to measure the separation, it failed: {reason}")
    return done
