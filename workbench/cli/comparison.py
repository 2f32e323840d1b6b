"""Every method that bounds the spread of trajectories, run on one loop and measured alike."""

from __future__ import annotations

import enum
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar, final

import numpy as np

from workbench.claims import Rigor
from workbench.cli.analysis_options import Subject
from workbench.cli.analysis_results import Array, centre_run, distances_from, radii, runs_at
from workbench.cli.methods import LOCAL, REGION, TUBES
from workbench.cli.output import Progress
from workbench.errors import InputError
from workbench.reach import ReachTube
from workbench.reach.local import Reference
from workbench.sensitivity.blockwise import BlockwiseGrowth
from workbench.sensitivity.discrepancy import Discrepancy, Growth, derive_discrepancy
from workbench.sensitivity.inputs import Inputs
from workbench.sensitivity.kinks import smooth_form
from workbench.sensitivity.sampling import parameter_states, sample_initial_states
from workbench.sensitivity.weighted_norm import ExponentialGrowth
from workbench.sets import Box


class Family(enum.Enum):
    """What a bound is derived over; the value says it in words."""

    REGION = "over the region"
    TRAJECTORY = "along the trajectory"
    TUBE = "tube of the initial set"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """Instants (M,), the largest sampled distance (M, n) from the middle run, that run (M, n)."""

    times_s: Array
    distances: Array
    middle: Array

    @property
    def units(self) -> Array:
        """Largest sampled distance of each state (n,); 1 where it does not move."""
        largest = self.distances.max(axis=0)
        return np.where(largest > 0.0, largest, 1.0)

    def ratios(self, half_widths: Array) -> Array:
        """Half widths over sampled distances (M, n); NaN where none was sampled."""
        moved = self.distances > 0.0
        return np.where(moved, half_widths / np.where(moved, self.distances, 1.0), np.nan)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What one method gave.

    half_widths: about the middle run (M, n), inf where nothing is proved; ratios: over the sampled
    distances; until_s: end of the proof; condition: of its metric at the end, in units of the
    sampled spread, None where it has none; refusal: why there is no bound at all; bound, tube: the
    result itself.
    """

    name: str
    family: Family
    rigor: Rigor | None
    half_widths: Array
    ratios: Array
    until_s: float
    cost_s: float
    statement: str = ""
    condition: float | None = None
    refusal: str = ""
    bound: Discrepancy | None = None
    tube: ReachTube | None = None

    @property
    def mean_ratios(self) -> Array:
        """Mean over time per state (n,); NaN for a state that does not move."""
        moving = ~np.isnan(self.ratios).all(axis=0)
        kept = np.where(moving, self.ratios, 1.0)
        return np.where(moving, np.nanmean(kept, axis=0), np.nan)

    @property
    def score(self) -> float:
        """Geometric mean of the mean ratios; inf where one of them is."""
        return _geometric(self.mean_ratios)

    @property
    def over_time(self) -> Array:
        """Geometric mean over the states of the ratios at each instant (M,)."""
        return np.array([_geometric(row) for row in self.ratios])


def _geometric(ratios: Array) -> float:
    known = ratios[~np.isnan(ratios)]
    return float(np.exp(np.log(known).mean())) if len(known) else float("nan")


def sampled(subject: Subject, times_s: Array, *, count: int, seed: int) -> Sampled:
    """Runs from the initial set, each with constant inputs, of every other one at their ends."""
    ode, rng = subject.system.ode, np.random.default_rng(seed)
    ordered = subject.initial_set.reordered(ode.names)
    states = sample_initial_states(ordered, count=count, seed=seed)
    inputs = []
    for ranges in (ode.parameters, ode.disturbances):
        values = parameter_states(ranges, len(states), rng)
        low, high = np.array([r.lower for r in ranges]), np.array([r.upper for r in ranges])
        values[::2] = np.where(values < 0.5 * (low + high), low, high)[::2]
        inputs.append(values)
    runs = runs_at(subject.system, states, times_s, inputs=(inputs[0], inputs[1]))
    middle = centre_run(subject, times_s)
    with np.errstate(invalid="ignore"):  # runs of an unstable loop may leave the finite numbers
        return Sampled(times_s, np.abs(runs - middle).max(axis=0), middle)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What the methods are run on: step and effort, region, and a tube that is there already."""

    subject: Subject
    samples: Sampled
    region: Box
    cells: int
    step_s: float
    tube: ReachTube
    tube_cost_s: float

    @property
    def horizon_s(self) -> float:
        """End of the comparison."""
        return float(self.samples.times_s[-1])


# The method whose tube a `Setting` brings.
READY = "sensitivity-quadratic"


def compared(setting: Setting, chosen: Sequence[str]) -> list[Compared]:
    """The chosen methods, one family after the other, with a progress bar."""
    names = [name for name in (*REGION, *LOCAL, *TUBES) if name in chosen]
    found, reference, before_s = [], None, 0.0
    with Progress("methods", max(1, len(names))) as progress:
        for name in names:
            if name in REGION:
                found.append(_over_region(setting, name))
            elif name in TUBES:
                found.append(_tube(setting, name))
            else:
                if reference is None:
                    started_s = time.perf_counter()
                    reference = _reference(setting)
                    before_s = time.perf_counter() - started_s
                found.append(_along(setting, name, reference, before_s))
            progress.advance()
    return found


def _over_region(setting: Setting, name: str) -> Compared:
    ode = setting.subject.system.ode
    ranged = any(q.lower < q.upper for q in (*ode.parameters, *ode.disturbances))
    inputs = Inputs.AGAINST_NOMINAL if ranged else Inputs.SHARED
    kinked = smooth_form(ode).kappa.numel() > 0
    method = REGION[name](setting.cells, inputs, kinked)
    bound, refusal, cost_s = _timed(
        lambda: derive_discrepancy(
            setting.subject.system,
            region=setting.region,
            horizon_s=setting.horizon_s,
            method=method,
        ),
    )
    if bound is None:
        return _refused(setting, name, Family.REGION, refusal, cost_s)
    widths = radii(bound, setting.subject, setting.samples.times_s)
    return Compared(
        name, Family.REGION, bound.rigor, widths, setting.samples.ratios(widths),
        bound.horizon_s, cost_s, f"{bound.norm}. It holds when {bound.condition}",
        condition=_condition(bound.growth, setting.samples.units), bound=bound,
    )  # fmt: skip


def _reference(setting: Setting) -> Reference:
    return Reference.of(
        setting.subject.system,
        initial_set=setting.subject.initial_set,
        horizon_s=setting.horizon_s,
        step_s=setting.step_s,
    )


def _along(setting: Setting, name: str, reference: Reference, before_s: float) -> Compared:
    method = LOCAL[name](setting.step_s)
    run, refusal, cost_s = _timed(lambda: method.along(reference))
    cost_s += before_s
    if run is None:
        return _refused(setting, name, Family.TRAJECTORY, refusal, cost_s)
    number = float(run.condition[-1])
    figures = cost_s, None if np.isnan(number) else number
    return _of_tube(setting, name, Family.TRAJECTORY, run.tube, figures)


def _tube(setting: Setting, name: str) -> Compared:
    if name == READY:
        return _of_tube(setting, name, Family.TUBE, setting.tube, (setting.tube_cost_s, None))
    started_s = time.perf_counter()
    tube = TUBES[name](setting.step_s).tube(
        setting.subject.system,
        initial_set=setting.subject.initial_set,
        horizon_s=setting.horizon_s,
    )
    cost_s = time.perf_counter() - started_s
    return _of_tube(setting, name, Family.TUBE, tube, (cost_s, None))


def _of_tube(
    setting: Setting,
    name: str,
    family: Family,
    tube: ReachTube,
    figures: tuple[float, float | None],
) -> Compared:
    samples = setting.samples
    widths = distances_from(samples.middle, tube, samples.times_s)
    widths = np.where(np.isnan(widths), np.inf, widths)
    end = f"Every trajectory from the initial set stays in the tube up to {tube.times[-1]:g} s"
    return Compared(
        name, family, tube.rigor, widths, samples.ratios(widths), float(tube.times[-1]),
        figures[0], f"{end} ({tube.message})" if tube.message else end,
        condition=figures[1], tube=tube,
    )  # fmt: skip


def _refused(setting: Setting, name: str, family: Family, refusal: str, cost_s: float) -> Compared:
    nothing = np.full(setting.samples.distances.shape, np.inf)
    ratios = setting.samples.ratios(nothing)
    return Compared(name, family, None, nothing, ratios, 0.0, cost_s, refusal=refusal)


Result = TypeVar("Result")


def _timed(work: Callable[[], Result]) -> tuple[Result | None, str, float]:
    """The result or the refusal, and the time it took."""
    started_s, result, refusal = time.perf_counter(), None, ""
    try:
        result = work()
    except InputError as error:
        refusal = str(error)
    return result, refusal, time.perf_counter() - started_s


def _condition(growth: Growth, units: Array) -> float | None:
    """Largest condition number of the metrics (W^2 for a weighted norm) in these units."""
    if isinstance(growth, ExponentialGrowth):
        scaled = np.array(growth.weights) * units
        return float((scaled.max() / scaled.min()) ** 2)
    if isinstance(growth, BlockwiseGrowth):
        pairs = zip(growth.blocks, growth.metrics, strict=True)
        parts = [np.array(P) * np.outer(units[list(b)], units[list(b)]) for b, P in pairs]
        return max(float(np.linalg.cond(part)) for part in parts)
    return None
