"""Scores of every tube method on the benchmark loops: tightness, escapes, time and memory."""

from workbench.bench.cold_start import ColdStart, cold_start
from workbench.bench.containment import bounds_at, escaping
from workbench.bench.samples import SamplePlan, sampled_runs
from workbench.bench.scoreboard import Loop, bench_loops, score_loop
from workbench.bench.tightness import HorizonScore, MethodScore
from workbench.bench.timing import KernelTime, kernel_times

__all__ = [
    "ColdStart",
    "HorizonScore",
    "KernelTime",
    "Loop",
    "MethodScore",
    "SamplePlan",
    "bench_loops",
    "bounds_at",
    "cold_start",
    "escaping",
    "kernel_times",
    "sampled_runs",
    "score_loop",
]
