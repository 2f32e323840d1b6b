"""The paper's Table I: time for three nested reach sets of one drive, on one core."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from workbench.bench.decision_cost import timed_calls
from workbench.bench.decision_kernel import DecisionKernel
from workbench.bench.decision_scenes import Scene
from workbench.codegen.bundle import MonitorSpec
from workbench.codegen.decision_source import SUBSTEPS
from workbench.codegen.native_calls import exported_size, load_function
from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.vehicle import Vehicle
from workbench.reach import ValidatedTube
from workbench.reach.tube import Array
from workbench.runtime.manifest import LIBRARY_FILE, MANIFEST_FILE, SOURCE_FILE, manifest_from_json
from workbench.sets import Box
from workbench.simulation.measures import percentile

_DOUBLES = ctypes.POINTER(ctypes.c_double)
PLAIN: Final = "TRACK tubes, compiled kernel, the paper's model"
UNSURE: Final = "TRACK tubes, compiled kernel, with N and W"
LEARNED: Final = "TRACK tubes, compiled, the paper's method: learned beta (SAMPLED)"
_MODES: Final = (1.0, 0.0, 1.0)
"""tracking, braking, integrating: TRACK, see `models.stopping`."""
_SHARES: Final = (0.0, 1.0, 1.0, 0.0)
"""Of the last disturbances, which BRAKE alone has, in TRACK: its speed, two shares of 1, no free
rate."""
PUBLISHED_S: Final = (0.096, 0.103, 0.129, 0.136, 0.163)
"""The paper's times at T = 3, 3.5, 4, 4.5 and 5 s, on its vehicle's computer."""
_CURVATURE_ROOM: Final = 1e-9


@final
@dataclass(frozen=True, slots=True)
class TimedStart:
    """One decision: nested sets (the largest first), what the kernel is asked for each of them, the
    speed that is followed, and the path's curvature where the car is."""

    sets: tuple[Box, ...]
    queries: tuple[Mapping[str, Sequence[float]], ...]
    reference_speed_mps: float
    curvature_per_m: float


@final
@dataclass(frozen=True, slots=True)
class TimeRow:
    """Three nested sets, one after the other, for each T: median and 99 % quantile, s.

    what: computed how; calls: times that this was done for each T; incomplete: by T, how many of
    them had a tube that ended before T; these are left out, so that times at two T may be of other
    starts.
    """

    what: str
    horizons_s: tuple[float, ...]
    median_s: tuple[float, ...]
    p99_s: tuple[float, ...]
    calls: int
    incomplete: tuple[int, ...]

    @property
    def growth(self) -> float:
        """Median at the longest T over that at the shortest."""
        return self.median_s[-1] / self.median_s[0]


@final
@dataclass(frozen=True, slots=True)
class TimedKernels:
    """What is timed. files: of a bundle of `spec`; learned: of one whose TRACK is by a learned beta
    and all else of the same spec, None where there is none."""

    spec: MonitorSpec
    files: Mapping[str, bytes]
    learned: Mapping[str, bytes] | None


@final
@dataclass(frozen=True, slots=True)
class PaperTimes:
    """All rows, and the processor they were taken on."""

    rows: tuple[TimeRow, ...]
    processor: str


def paper_times(
    kernels: TimedKernels,
    starts: Sequence[TimedStart],
    *,
    horizons_s: Sequence[float],
    certain: Mapping[str, Sequence[float]],
    validated: int,
    advance: Callable[[], None] = lambda: None,
) -> PaperTimes:
    """Time TRACK's tubes alone, whole decisions, and the desk's `ValidatedTube` for so many starts
    (0: not at all).

    certain: a query's fields of disturbances without N and W, as the
    paper's model has none; `advance` after each T of each row. InputError without a start.
    """
    if not starts:
        raise InputError("expected at least one start to time tubes from, got none; drive longer")
    spec, files, horizons = kernels.spec, kernels.files, tuple(horizons_s)
    with one_core():
        rows = [
            _tubes_alone(_Library(files, spec, certain, PLAIN), starts, horizons, advance),
            _tubes_alone(_Library(files, spec, {}, UNSURE), starts, horizons, advance),
            _decisions(files, spec, starts, horizons, advance),
        ]
        if kernels.learned is not None:
            library = _Library(kernels.learned, spec, certain, LEARNED, entry="wb_learned_tube")
            rows.append(_tubes_alone(library, starts, horizons, advance))
        if validated:
            rows.append(_validated(spec.vehicle, starts[:validated], horizons, advance))
    return PaperTimes(tuple(rows), processor_name())


class _Library:
    """A tube alone by the bundle's own library, on a road that goes on bending as where the car is.

    disturbances: fields of a query that replace the bundle's own.
    """

    def __init__(
        self, files: Mapping[str, bytes], spec: MonitorSpec,
        disturbances: Mapping[str, Sequence[float]], what: str, *, entry: str = "wb_tube",
    ) -> None:  # fmt: skip
        self.what, self._spec = what, spec
        manifest = manifest_from_json(files[MANIFEST_FILE].decode())
        library, n = files[LIBRARY_FILE], len(manifest.states)
        self._entry = load_function(library, entry)
        # The capacity in steps is that of a decision's rows, each cut into substeps.
        self._result = np.zeros(2 + 2 * n * (2 * SUBSTEPS * spec.steps + 1))
        self._work = np.zeros(exported_size(library, "wb_work_size"))
        own = {field.name: field.default for field in manifest.query}
        self._w = [
            list(disturbances.get(name, own[name] or ()))
            for name in ("disturbance_lower", "disturbance_upper")
        ]
        self._names = [parameter.name for parameter in manifest.parameters]
        self._nominal = [parameter.nominal for parameter in manifest.parameters]
        self._curvature = _curvature_at(spec)

    def query(self, start: TimedStart, box: Box, horizon_s: float) -> Array:
        """The input vector of `wb_tube`, and of `wb_learned_tube`; see `codegen/c/online.c`."""
        values = list(self._nominal)
        values[self._names.index("reference_speed")] = start.reference_speed_mps
        ends: list[float] = []
        for side, bounds in zip((-1.0, 1.0), self._w, strict=True):
            numbers = [*bounds[: -len(_SHARES)], *_SHARES]
            numbers[self._curvature] = start.curvature_per_m + side * _CURVATURE_ROOM
            ends += numbers
        sets = (*box.center, *box.radius)
        return np.array([*sets, *values, *_MODES, *ends, horizon_s, self._spec.step_s])

    def timed(self, start: TimedStart, horizon_s: float) -> float | None:
        """Seconds for all sets one after the other; None where a proof ends early."""
        spent_ns = 0
        for box in start.sets:
            asked = self.query(start, box, horizon_s)
            buffers = [each.ctypes.data_as(_DOUBLES) for each in (asked, self._result, self._work)]
            begun_ns = time.perf_counter_ns()
            self._entry(*buffers)
            spent_ns += time.perf_counter_ns() - begun_ns
            if self._result[0] != 0.0:
                return None
        return spent_ns / 1e9


def _tubes_alone(
    library: _Library, starts: Sequence[TimedStart], horizons_s: tuple[float, ...],
    advance: Callable[[], None],
) -> TimeRow:  # fmt: skip
    """No set is spared, whatever another one settles."""
    return _row(library.what, starts, horizons_s, library.timed, advance)


def _curvature_at(spec: MonitorSpec) -> int:
    ode = spec.vehicle.uncertain_loop(spec.vehicle.track(), PathFrame(-1.0, 1.0)).ode
    return [d.name for d in ode.disturbances].index("curvature")


def _row(
    what: str, starts: Sequence[TimedStart], horizons_s: tuple[float, ...],
    timed: Callable[[TimedStart, float], float | None], advance: Callable[[], None],
) -> TimeRow:  # fmt: skip
    medians, tails, incomplete = [], [], []
    for horizon_s in horizons_s:
        timed(starts[0], horizon_s)  # once for the caches, not counted
        found = [timed(start, horizon_s) for start in starts]
        complete = [seconds for seconds in found if seconds is not None]
        incomplete.append(len(found) - len(complete))
        medians.append(statistics.median(complete) if complete else float("nan"))
        tails.append(percentile(complete, 0.99) if complete else float("nan"))
        advance()
    return TimeRow(what, horizons_s, tuple(medians), tuple(tails), len(starts), tuple(incomplete))


def _decisions(
    files: Mapping[str, bytes], spec: MonitorSpec, starts: Sequence[TimedStart],
    horizons_s: tuple[float, ...], advance: Callable[[], None],
) -> TimeRow:  # fmt: skip
    """`wb_decide` once for each set, as if it were the only one: TRACK, TRACK then BRAKE, BRAKE."""
    manifest = manifest_from_json(files[MANIFEST_FILE].decode())
    kernel = DecisionKernel(
        spec.sizes, files[SOURCE_FILE].decode(), files[LIBRARY_FILE], manifest.query,
        manifest.result,
    )  # fmt: skip
    medians, tails, incomplete = [], [], []
    for horizon_s in horizons_s:
        scenes = [
            Scene("nested set", {**query, "horizon_s": (horizon_s,)})
            for start in starts
            for query in start.queries
        ]
        found = timed_calls(kernel, scenes)
        each_s = found.first_us.reshape(len(starts), -1).sum(axis=1) / 1e6
        complete = (found.verdicts == 0.0).all(axis=1).reshape(len(starts), -1).all(axis=1)
        incomplete.append(int((~complete).sum()))
        kept = each_s[complete].tolist()
        medians.append(statistics.median(kept) if kept else float("nan"))
        tails.append(percentile(kept, 0.99) if kept else float("nan"))
        advance()
    return TimeRow(
        "whole decisions, compiled kernel, with N and W", horizons_s, tuple(medians), tuple(tails),
        len(starts), tuple(incomplete),
    )  # fmt: skip


def _validated(
    vehicle: Vehicle, starts: Sequence[TimedStart], horizons_s: tuple[float, ...],
    advance: Callable[[], None],
) -> TimeRow:  # fmt: skip
    """The desk's reference on the same loop; what depends on the loop alone is made before. At
    the shortest T only: farther ahead, where tubes become wide, it takes minutes."""
    method = ValidatedTube(degree=1)
    loops = {}
    for start in starts:
        bend = start.curvature_per_m
        frame = PathFrame(bend - _CURVATURE_ROOM, bend + _CURVATURE_ROOM)
        loops[bend] = vehicle.uncertain_loop(vehicle.track(), frame)

    def timed(start: TimedStart, horizon_s: float) -> float | None:
        loop = loops[start.curvature_per_m]
        method.tube(loop, initial_set=start.sets[-1], horizon_s=method.step_s)
        begun_s = time.perf_counter()
        tubes = [method.tube(loop, initial_set=box, horizon_s=horizon_s) for box in start.sets]
        spent_s = time.perf_counter() - begun_s
        return spent_s if all(tube.complete for tube in tubes) else None

    found = _row("TRACK tubes, ValidatedTube, with N and W", starts, horizons_s[:1], timed, advance)
    unknown = (math.nan,) * (len(horizons_s) - 1)
    return dataclasses.replace(
        found, horizons_s=horizons_s, median_s=found.median_s + unknown,
        p99_s=found.p99_s + unknown, incomplete=found.incomplete + (0,) * len(unknown),
    )  # fmt: skip


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """This process, and those that it starts, on one core, where the system lets us say so."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def processor_name() -> str:
    """What the system calls the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()
