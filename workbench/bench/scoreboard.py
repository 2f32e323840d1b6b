"""The loops to measure, the methods side by side, and their scores."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from workbench.bench.online_kernels import compiled, kernel_functions
from workbench.bench.samples import SamplePlan, sampled_runs
from workbench.bench.tightness import SCORE_STEP_S, MethodScore, Samples
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark, all_benchmarks
from workbench.reach import Partitioned, ReachTube, TubeMethod, ValidatedTube, compute_tube
from workbench.reach.inner.extremes import SearchEffort
from workbench.reach.inner.hull import inner_hull
from workbench.reach.online.kernels import Form

HORIZONS_S = (3.0, 4.0, 5.0)
# Steps of 0.05 s are sampled at quarters, so that motion between instants is seen.
SAMPLE_STEP_S = SCORE_STEP_S / 4
ONLINE_KERNEL = "local"
# The initial set is split along the states that drive the others: y, speed and heading, or offset,
# speed and heading error; finely where limits are met.
_SPLIT_AXES = (1, 3, 4)
_SPLIT_FINELY = ("B2", "B2-slow")


@final
@dataclass(frozen=True, slots=True)
class Loop:
    """A benchmark loop and the partitions of its set."""

    benchmark: Benchmark
    parts_per_axis: tuple[int, ...]


def bench_loops(only: tuple[str, ...]) -> tuple[Loop, ...]:
    """The loops named in `only` (all when empty), in the order of their description."""
    known = {benchmark.name: benchmark for benchmark in all_benchmarks()}
    unknown = [name for name in only if name not in known]
    if unknown:
        raise InputError(f"no benchmark loop {unknown[0]!r}; expected one of {', '.join(known)}")
    return tuple(
        Loop(loop, (1, 2, 3) if name in _SPLIT_FINELY else (1, 2))
        for name, loop in known.items()
        if not only or name in only
    )


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """One tube method on the board."""

    name: str
    step_s: float
    compute: Callable[[float], ReachTube]


def entries(loop: Loop, horizon_s: float) -> tuple[Entry, ...]:
    """The methods for one loop, each from the whole horizon in s to a tube."""
    benchmark = loop.benchmark

    def by(method: TubeMethod) -> Callable[[float], ReachTube]:
        return lambda horizon_s: compute_tube(
            benchmark.system,
            initial_set=benchmark.initial_set,
            horizon_s=horizon_s,
            method=method,
        )

    def online(form: Form) -> Callable[[float], ReachTube]:
        functions = kernel_functions(benchmark, ONLINE_KERNEL, form)
        kernel = compiled(functions, horizon_s=horizon_s, step_s=SCORE_STEP_S)
        return lambda horizon_s: kernel.tube(
            benchmark.initial_set, horizon_s=horizon_s, step_s=SCORE_STEP_S
        )

    names = benchmark.system.ode.names
    validated = tuple(
        Entry(
            f"validated, {parts ** len(_SPLIT_AXES)} cells" if parts > 1 else "validated",
            SCORE_STEP_S,
            by(Partitioned(ValidatedTube(SCORE_STEP_S), {names[i]: parts for i in _SPLIT_AXES})),
        )
        for parts in loop.parts_per_axis
    )
    return (
        *validated, *(Entry(f"online-{form.value}", SCORE_STEP_S, online(form)) for form in Form)
    )  # fmt: skip


def score_loop(
    loop: Loop, plan: SamplePlan, *, advance: Callable[[int], None]
) -> tuple[MethodScore, ...]:
    """All tubes of one loop against the same samples and the same validated trajectories.

    One tube over `plan.horizon_s` serves every horizon in it: a longer run starts with the rows of
    a shorter one. `advance` counts finished units of work, `units_of_work` of them.
    """
    benchmark = loop.benchmark
    methods, timed, tubes = entries(loop, plan.horizon_s), [], []
    for method in methods:
        timed.append(_timed(method, min(HORIZONS_S[0], plan.horizon_s)))
        tubes.append(method.compute(plan.horizon_s))
        advance(_UNITS_PER_TUBE)
    inner = inner_hull(
        benchmark.system,
        initial_set=benchmark.initial_set,
        horizon_s=plan.horizon_s,
        step_s=SCORE_STEP_S,
        effort=SearchEffort(starts=64, rounds=3, every=4, seed=plan.seed),
    )
    advance(_UNITS_PER_TUBE)
    samples = Samples(plan.times, tubes, inner=inner)
    for runs in sampled_runs(benchmark, plan):
        samples.add(runs)
        advance(1)
    return tuple(
        _score(samples, which, method, timed[which]) for which, method in enumerate(methods)
    )


_UNITS_PER_TUBE = 5


def units_of_work(loop: Loop, plan: SamplePlan) -> int:
    """How often `score_loop` counts on."""
    return (len(loop.parts_per_axis) + len(Form) + 1) * _UNITS_PER_TUBE + plan.blocks


def _timed(method: Entry, horizon_s: float) -> tuple[float, float | None]:
    """Seconds that the tube takes, and its share of decided kinks."""
    start = time.perf_counter()
    tube = method.compute(horizon_s)
    elapsed_s = time.perf_counter() - start
    if tube.kinks is None or not tube.kinks.decided_share.size:
        return elapsed_s, None
    return elapsed_s, tube.kinks.share


def _score(
    samples: Samples, which: int, method: Entry, timed: tuple[float, float | None]
) -> MethodScore:
    tube: ReachTube = samples.tubes[which]
    end_s = float(samples.times[-1])
    return MethodScore(
        method=method.name,
        step_s=method.step_s,
        rigor=tube.rigor.name,
        status=tube.status.name,
        proved_until_s=float(tube.times[-1]),
        elapsed_s=timed[0],
        kinks_decided=timed[1],
        horizons=tuple(
            samples.score(which, horizon_s) for horizon_s in HORIZONS_S if horizon_s <= end_s
        ),
    )
