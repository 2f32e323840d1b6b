"""What one update of the intent filter takes: time in four ways, and instructions of the C code."""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.bench.online_cost import run
from workbench.bench.text import table
from workbench.codegen.compiler import compile_shared, find_compiler
from workbench.estimation.intent_cloud import (
    Cloud,
    Draws,
    FilterSettings,
    Measured,
    NumpyUpdate,
    Update,
    Values,
)
from workbench.estimation.intent_filter import Belief, Intents, advance, begin
from workbench.estimation.intent_kernel import CompiledUpdate, kernel_arguments, kernel_source
from workbench.estimation.intent_plain import PlainUpdate
from workbench.estimation.intent_scenarios import CROSSING

CROWDS: Final = (1, 20)
KERNEL: Final = "the C function alone"
PLAIN: Final = "plain Python"
_GOALS: Final = CROSSING[:2]
_STEP_S: Final = 0.2
_ROUNDS: Final = 2000
_WARM: Final = 20


@final
@dataclass(frozen=True, slots=True)
class UpdateCost:
    """One way to update everybody of a crowd once.

    people; particles: per person; rounds; median_us, late_us: time of a round, its 99 % quantile;
    instructions: of a round, by callgrind, None where not counted.
    """

    way: str
    people: int
    particles: int
    rounds: int
    median_us: float
    late_us: float
    instructions: int | None


def update_costs(
    *, rounds: int = _ROUNDS, advance_by: Callable[[], None] = lambda: None
) -> tuple[UpdateCost, ...]:
    """All ways, one after the other on this core, for one person and for 20.

    An update is what one measurement at 5 Hz asks for with 200 particles for each of two goals and
    for the unknown one: motion, weights, resampling, mixing, and, but for the C function alone,
    drawing the random numbers and the calls from Python. rounds: of the quick ways; plain Python
    gets a hundredth. Raises InputError without a C compiler.
    """
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        folder = Path(name)
        (folder / "kernel.so").write_bytes(compile_shared(kernel_source()).shared_object)
        ways: dict[str, tuple[Update, int]] = {
            "C from Python": (CompiledUpdate(folder / "kernel.so"), rounds),
            "NumPy": (NumpyUpdate(), rounds),
            PLAIN: (PlainUpdate(), max(rounds // 100, 3)),
        }
        found = []
        for people in CROWDS:
            found.append(_alone(folder, people, rounds))
            advance_by()
            for way, (update, many) in ways.items():
                found.append(_from_python(way, update, people, max(many // people, 3)))
                advance_by()
    return tuple(found)


def units_of_work() -> int:
    """How often `update_costs` calls `advance_by`."""
    return 4 * len(CROWDS)


def update_text(costs: Sequence[UpdateCost]) -> str:
    """The costs as a table, each beside plain Python."""
    plain = {cost.people: cost.median_us for cost in costs if cost.way == PLAIN}
    rows = [
        [cost.way, str(cost.people), str(cost.particles), f"{cost.median_us:.1f}",
         f"{cost.late_us:.1f}", f"{plain[cost.people] / cost.median_us:.0f}",
         "-" if cost.instructions is None else f"{cost.instructions}"]
        for cost in costs
    ]  # fmt: skip
    headings = [
        "one update", "people", "particles each", "median us", "99 % us", "times plain Python",
        "instructions",
    ]  # fmt: skip
    return table(headings, rows)


def _beliefs(people: int, settings: FilterSettings) -> list[Belief]:
    return [
        begin(Intents.of_person(_GOALS, "bench", str(k), seed=1), 0.0, np.zeros(2), settings)
        for k in range(people)
    ]


def _places() -> Iterator[tuple[float, Values]]:
    """Times and places of somebody who walks to and fro."""
    step = 0
    while True:
        step += 1
        yield step * _STEP_S, np.array([0.0, 0.26 * (step % 40)])


def _from_python(way: str, update: Update, people: int, rounds: int) -> UpdateCost:
    settings = FilterSettings.chosen()
    beliefs, places, times = _beliefs(people, settings), _places(), []
    for t_s, place in (next(places) for _ in range(rounds)):
        begun = time.process_time()
        beliefs = [advance(each, t_s, place, settings, update) for each in beliefs]
        times.append(1e6 * (time.process_time() - begun))
    return _cost(way, people, np.array(times), None)


def _alone(folder: Path, people: int, rounds: int) -> UpdateCost:
    """The C function on states that it has after some updates, called from C."""
    _write_input(folder, people)
    source = (files("workbench.bench") / "c" / "intent_harness.c").read_text()
    (folder / "harness.c").write_text(source)
    run([find_compiler(), "-std=c99", "-O2", "-o", "harness", "harness.c", "-ldl"], folder)
    told = run(["./harness", "./kernel.so", "input", str(rounds)], folder).stdout
    return _cost(KERNEL, people, np.array(told.split(), float) / 1e3, _instructions(folder))


def _cost(way: str, people: int, times_us: Values, instructions: int | None) -> UpdateCost:
    particles = FilterSettings.chosen().particles * (len(_GOALS) + 1)
    return UpdateCost(
        way, people, particles, len(times_us), float(np.median(times_us)),
        float(np.quantile(times_us, 0.99)), instructions,
    )  # fmt: skip


def _write_input(folder: Path, people: int) -> None:
    """Write what the harness reads: everybody's arguments of the update after _WARM."""
    settings, kept = FilterSettings.chosen(), _Kept()
    beliefs, places = _beliefs(people, settings), _places()
    for t_s, place in (next(places) for _ in range(_WARM)):
        kept.arguments.clear()
        beliefs = [advance(each, t_s, place, settings, kept) for each in beliefs]
    lengths = [array.size for array in kept.arguments[0][2]]
    parts: list[Sequence[float] | Values] = [[people, *lengths]]
    for counts, numbers, arrays in kept.arguments:
        parts += [counts, numbers, *(array.ravel() for array in arrays)]
    (folder / "input").write_bytes(np.concatenate([np.asarray(p, float) for p in parts]).tobytes())


@final
class _Kept:
    """The update in NumPy that keeps what the C function would be called with."""

    def __init__(self) -> None:
        self.arguments: list[tuple[tuple[int, ...], tuple[float, ...], list[Values]]] = []

    def __call__(
        self, cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
    ) -> tuple[Cloud, Values]:
        """See `Update`."""
        self.arguments.append(kernel_arguments(cloud, draws, measured, settings))
        return NumpyUpdate()(cloud, draws, measured, settings)


def _instructions(folder: Path) -> int | None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    options = ["--tool=callgrind", "--collect-atstart=no", "--toggle-collect=intent_update"]
    command = [valgrind, *options, "--callgrind-out-file=/dev/null"]
    told = run([*command, "./harness", "./kernel.so", "input", "1"], folder)
    found = re.search(r"Collected : (\d+)", told.stderr)
    return int(found.group(1)) if found else None
