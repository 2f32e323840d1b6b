"""How long one update of the particles takes here, in NumPy, in compiled C and in plain Python."""

from __future__ import annotations

import contextlib
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.intent_cloud import Update

_STEP_S: Final = 0.2
_UPDATES: Final = {"C": 2000, "NumPy": 500, "plain Python": 20}
_CROWD: Final = 20


def measured_times() -> list[tuple[str, int, int, float, float]]:
    """Rows of way, people, particles per person, median and 99 % quantile (us of CPU time).

    One update is all that a new measurement asks for: random numbers, motion, weights, resampling,
    at 5 Hz, 200 particles for each of three goals and for the unknown one.
    """
    from workbench.estimation.intent_cloud import NumpyUpdate
    from workbench.estimation.intent_plain import PlainUpdate

    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        ways: dict[str, Update] = {
            "C": _compiled(Path(folder)), "NumPy": NumpyUpdate(), "plain Python": PlainUpdate()
        }  # fmt: skip
        return [_timed(name, way, people) for name, way in ways.items() for people in (1, _CROWD)]


def _compiled(folder: Path) -> Update:
    from workbench.codegen.compiler import compile_shared
    from workbench.estimation.intent_kernel import CompiledUpdate, kernel_source

    library = folder / "intent.so"
    library.write_bytes(compile_shared(kernel_source()).shared_object)
    return CompiledUpdate(library)


@contextlib.contextmanager
def quick_update() -> Iterator[Update]:
    """The compiled update, or the one in NumPy on a machine without a compiler."""
    from workbench.codegen.compiler import find_compiler
    from workbench.estimation.intent_cloud import NumpyUpdate

    try:
        find_compiler()
    except InputError:
        yield NumpyUpdate()
        return
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        yield _compiled(Path(folder))


def _timed(name: str, way: Update, people: int) -> tuple[str, int, int, float, float]:
    import numpy as np

    from workbench.estimation.intent_cloud import FilterSettings
    from workbench.estimation.intent_filter import Intents, advance, begin
    from workbench.estimation.intent_scenarios import CROSSING

    settings = FilterSettings.chosen()
    beliefs = [
        begin(Intents.of_person(CROSSING, "times", str(k), seed=1), 0.0, np.zeros(2), settings)
        for k in range(people)
    ]
    times_us = []
    for step in range(1, max(_UPDATES[name] // people, 5) + 1):
        t_s, place = step * _STEP_S, np.array([0.0, 0.26 * (step % 40)])
        begun = time.process_time()
        beliefs = [advance(each, t_s, place, settings, way) for each in beliefs]
        times_us.append(1e6 * (time.process_time() - begun))
    particles = settings.particles * (len(CROSSING) + 1)
    late = sorted(times_us)[int(0.99 * (len(times_us) - 1))]
    return name, people, particles, statistics.median(times_us), late
