"""`workbench reach --switch-at`: TRACK, then BRAKE from any time in an interval on."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import Subject, number
from workbench.cli.common import chosen_vehicle
from workbench.cli.output import Progress
from workbench.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from workbench.models.closed_loop import ClosedLoop
    from workbench.reach import ReachTube, TubeMethod
    from workbench.report.curves import SampledRuns
    from workbench.sets import Box

    Array = NDArray[np.float64]

_LAWS: Final = ("vehicle", "reference-zero")
_GROUPS: Final = 6
_RUN_STEP_S: Final = 0.02


def add_switch_options(parser: argparse.ArgumentParser) -> None:
    """Add `--switch-at` and `--brake`; `chosen_switch` reads them."""
    parser.add_argument(
        "--switch-at",
        nargs=2,
        type=number,
        metavar=("FROM", "TO"),
        help="switch from TRACK to BRAKE at any time between FROM and TO, in s",
    )
    parser.add_argument(
        "--brake",
        choices=_LAWS,
        help="the BRAKE law: the vehicle's own, down to a standstill that lasts (a benchmark loop "
        "gets the shipped vehicle's), or reference speed 0 through the PID (default: vehicle)",
    )


def chosen_switch(args: argparse.Namespace, subject: Subject) -> Switch | None:
    """What `--switch-at` asks for. Raises InputError on times out of order or past the horizon."""
    if args.switch_at is None:
        if args.brake is not None:
            raise InputError("--brake: expected --switch-at FROM TO beside it; add it")
        return None
    low, high = args.switch_at
    if not 0.0 <= low <= high <= args.horizon:
        raise InputError(
            f"--switch-at: expected 0 <= FROM <= TO <= --horizon, got {low:g} {high:g} and "
            f"{args.horizon:g} s; give both times in order, within the horizon"
        )
    from workbench.controllers import ReferenceZeroBrake, Track
    from workbench.models.closed_loop import ClosedLoop

    loop = subject.system
    if not (isinstance(loop, ClosedLoop) and isinstance(loop.mode, Track)):
        raise InputError(
            f"--switch-at: expected a loop in TRACK, got {subject.name}, which brakes already; "
            "choose another --system"
        )
    own = args.brake in (None, "vehicle")
    brake = chosen_vehicle(args).brake.mode() if own else ReferenceZeroBrake()
    return Switch(subject, loop, dataclasses.replace(loop, mode=brake), (low, high))


@final
@dataclass(frozen=True, slots=True)
class Switch:
    """A loop that tracks, the same loop braking, and when it switches."""

    subject: Subject
    track: ClosedLoop
    brake: ClosedLoop
    between_s: tuple[float, float]

    @property
    def words(self) -> str:
        """What happens, as part of a sentence."""
        low, high = self.between_s
        return f"switching from TRACK to BRAKE at any time from {low:g} to {high:g} s"

    def region(self, tube: ReachTube) -> Box | None:
        """The operating region; a braked car's raw speed may fall without limit."""
        from workbench.sets import Box

        region = self.subject.region
        if region is None or "speed" not in region.names or not len(tube.lower):
            return region
        low, high = region.interval("speed")
        low = min(low, float(tube.lower[:, tube.names.index("speed")].min()))
        intervals = {name: region.interval(name) for name in region.names}
        return Box.from_intervals(intervals | {"speed": (low, high)})

    def reading(self, tube: ReachTube) -> list[str]:
        """How to read a speed below 0, as a line; none where the tube has none."""
        from workbench.controllers import ReferenceZeroBrake

        falls = len(tube.lower) and float(tube.lower[:, tube.names.index("speed")].min()) < 0.0
        if isinstance(self.brake.mode, ReferenceZeroBrake) or not falls:
            return []
        return ["speed: the car stands where it is 0 or below; the brake law's own value falls on"]

    @property
    def _reset(self) -> dict[str, float]:
        names = self.brake.ode.names
        return {name: 0.0 for name in ("speed_integral", "brake_clock") if name in names}

    def tube(self, *, horizon_s: float, step_s: float, parts: Mapping[str, int]) -> ReachTube:
        """The hull of the tubes of all cells, with a progress bar."""
        from workbench.reach import ValidatedTube
        from workbench.reach.switching.tube import Switched

        def method(each_row: Callable[[], object]) -> Switched:
            steps = ValidatedTube(step_s=step_s, each_row=each_row)
            return Switched(self.brake, self.between_s, self._reset, steps)

        rows = method(lambda: None).rows_run(horizon_s)
        return tube_by(method, Run(self.subject, horizon_s, parts, rows))

    def runs(self, *, horizon_s: float, count: int, seed: int) -> SampledRuns:
        """Runs that switch at several times, the first and the last among them, each with constant
        disturbances."""
        import numpy as np

        from workbench.cli.analysis_results import curve_times
        from workbench.report.curves import SampledRuns
        from workbench.sensitivity.sampling import sample_initial_states

        times = curve_times(horizon_s)
        box = self.subject.initial_set.reordered(self.track.ode.names)
        groups = np.array_split(sample_initial_states(box, count=count, seed=seed), _GROUPS)
        rng = np.random.default_rng(seed)
        switches = np.linspace(*self.between_s, _GROUPS).tolist()
        found = [
            self._group(states, times.tolist(), switch_s=switch_s, rng=rng)
            for switch_s, states in zip(switches, groups, strict=True)
        ]
        return SampledRuns(times, np.concatenate(found))

    def _group(
        self, states: Array, times: list[float], *, switch_s: float, rng: np.random.Generator
    ) -> Array:
        """Runs (N, M, n) over the states of TRACK that all switch at one time."""
        import numpy as np

        from workbench.sensitivity.sampling import parameter_states

        names, count = self.track.ode.names, len(states)
        felt: dict[str, Array] = {}
        for ranged in (*self.track.ode.disturbances, *self.brake.ode.disturbances):
            felt.setdefault(ranged.name, parameter_states([ranged], count, rng)[:, 0])
        last = {name: states[:, i] for i, name in enumerate(names)}
        loop, now, rows = self.track, 0.0, []
        for time in sorted({*times, switch_s}):
            if time > now:
                last = _moved(loop, last, felt, time - now)
                now = time
            if time in times:
                rows.append(np.stack([last[name] for name in names], axis=1))
            if time == switch_s:
                loop = self.brake
                last |= {name: np.full(count, value) for name, value in self._reset.items()}
        return np.stack(rows, axis=1)


def _moved(
    loop: ClosedLoop, states: Mapping[str, Array], felt: Mapping[str, Array], time_s: float
) -> dict[str, Array]:
    import numpy as np

    from workbench.sensitivity.sampling import rollout

    ode = loop.ode
    moved = rollout(
        loop,
        np.stack([states[name] for name in ode.names], axis=1),
        horizon_s=time_s,
        step_s=time_s / math.ceil(time_s / _RUN_STEP_S),
        disturbances=np.stack([felt[d.name] for d in ode.disturbances], axis=1)
        if ode.disturbances
        else None,
    )[:, -1]
    return dict(zip(ode.names, moved.T, strict=True))


@final
@dataclass(frozen=True, slots=True)
class Run:
    """What a tube starts from, how far it goes, and how many rows each cell takes."""

    subject: Subject
    horizon_s: float
    parts: Mapping[str, int]
    rows: int


def tube_by(method_of: Callable[[Callable[[], object]], TubeMethod], run: Run) -> ReachTube:
    """The hull over the cells of the initial set, with a progress bar.

    method_of: the method that calls its argument when a row is done.
    """
    from workbench.reach.compute import hull

    subject, cells = run.subject, run.subject.initial_set.split(run.parts)
    label = "tube" if len(cells) == 1 else f"tube of {len(cells)} cells"
    with Progress(label, len(cells) * run.rows) as bar:
        method = method_of(bar.advance)
        tubes = [
            method.tube(subject.system, initial_set=cell, horizon_s=run.horizon_s) for cell in cells
        ]
    return hull(tuple(tubes))
