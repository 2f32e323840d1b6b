"""The loops to measure, the methods side by side, and their scores."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from workbench.bench.samples import SamplePlan, sampled_runs
from workbench.bench.tightness import SCORE_STEP_S, MethodScore, Samples
from workbench.codegen.c_source import KernelSizes
from workbench.codegen.tube_kernel import CompiledTube
from workbench.errors import InputError
from workbench.models.benchmarks import Benchmark, all_benchmarks
from workbench.reach import ReachTube, SensitivityTube, compute_tube
from workbench.sets import Box

HORIZONS_S = (3.0, 4.0, 5.0)
# Steps of 0.05 s are sampled at quarters, so that motion between instants is seen.
SAMPLE_STEP_S = SCORE_STEP_S / 4
# Limited loops switch between regimes within a step; a short one keeps the undecided share small.
_DESK_STEP_S = 0.025
_DESK_STEP_LIMITED_S = 0.01
_MERGE_STEPS = 1
# The compiled tube refuses to leave its region; here the region shall not decide.
_REGION = 100.0


@final
@dataclass(frozen=True, slots=True)
class Loop:
    """A benchmark loop and the step of the desk method on it, in s."""

    benchmark: Benchmark
    desk_step_s: float


def bench_loops(only: tuple[str, ...]) -> tuple[Loop, ...]:
    """The loops named in `only` (all when empty), in the order of their description."""
    known = {benchmark.name: benchmark for benchmark in all_benchmarks()}
    unknown = [name for name in only if name not in known]
    if unknown:
        raise InputError(f"no benchmark loop {unknown[0]!r}; expected one of {', '.join(known)}")
    return tuple(
        Loop(loop, _DESK_STEP_S if name.startswith("B1") else _DESK_STEP_LIMITED_S)
        for name, loop in known.items()
        if not only or name in only
    )


def wide_region(benchmark: Benchmark) -> Box:
    """An operating region far larger than any tube of the benchmark."""
    names = benchmark.system.ode.names
    return Box(names, (-_REGION,) * len(names), (_REGION,) * len(names))


def compiled_tube(benchmark: Benchmark, horizon_s: float) -> CompiledTube:
    """The compiled kernel of one loop, for steps of 0.05 s up to `horizon_s`."""
    sizes = KernelSizes(round(horizon_s / SCORE_STEP_S), SCORE_STEP_S, _MERGE_STEPS)
    return CompiledTube(benchmark.system, region=wide_region(benchmark), sizes=sizes)


def score_loop(
    loop: Loop, plan: SamplePlan, *, advance: Callable[[int], None]
) -> tuple[MethodScore, ...]:
    """Both tubes of one loop against the same samples; `advance` counts finished units of work.

    One tube over `plan.horizon_s` serves every horizon in it: a longer run starts with the rows of
    a shorter one. `units_of_work(plan)` says how many units there are.
    """
    benchmark = loop.benchmark
    start = time.perf_counter()
    desk = compute_tube(
        benchmark.system,
        initial_set=benchmark.initial_set,
        horizon_s=plan.horizon_s,
        method=SensitivityTube(step_s=loop.desk_step_s),
    )
    desk_s = time.perf_counter() - start
    advance(_UNITS_PER_TUBE)
    kernel = compiled_tube(benchmark, plan.horizon_s)
    start = time.perf_counter()
    compiled = kernel.tube(benchmark.initial_set, horizon_s=plan.horizon_s, step_s=SCORE_STEP_S)
    compiled_s = time.perf_counter() - start
    advance(_UNITS_PER_TUBE)
    samples = Samples(plan.times, (desk, compiled))
    for runs in sampled_runs(benchmark, plan):
        samples.add(runs)
        advance(1)
    return (
        _score(samples, 0, ("desk", loop.desk_step_s, desk_s)),
        _score(samples, 1, ("compiled", SCORE_STEP_S, compiled_s)),
    )


_UNITS_PER_TUBE = 5


def units_of_work(plan: SamplePlan) -> int:
    """How often `score_loop` counts on."""
    return 2 * _UNITS_PER_TUBE + plan.blocks


def _score(samples: Samples, which: int, method: tuple[str, float, float]) -> MethodScore:
    tube: ReachTube = samples.tubes[which]
    name, step_s, elapsed_s = method
    end_s = float(samples.times[-1])
    return MethodScore(
        method=name,
        step_s=step_s,
        rigor=tube.rigor.name,
        status=tube.status.name,
        proved_until_s=float(tube.times[-1]),
        elapsed_s=elapsed_s,
        horizons=tuple(
            samples.score(which, horizon_s) for horizon_s in HORIZONS_S if horizon_s <= end_s
        ),
    )
