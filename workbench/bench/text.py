"""The scores as plain text tables, every column with its unit."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.bench.cold_start import ColdStart
from workbench.bench.scoreboard import Loop
from workbench.bench.tightness import HorizonScore, MethodScore
from workbench.bench.timing import KernelTime

# Position, steering and heading (or their path counterparts): what decides about clearance.
_SHOWN = (0, 1, 2, 4)


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns set flush left, two spaces apart."""
    lines = [headings, *rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headings))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def tightness_text(loop: Loop, scores: Sequence[MethodScore]) -> str:
    """All methods of one loop: Rigor, escapes, width ratios and segment excess per horizon."""
    signals = [loop.benchmark.system.ode.states[i] for i in _SHOWN]
    headings = [
        "method",
        "step s",
        "Rigor",
        "T s",
        "escapes",
        "touching",
        *(f"{signal.name} ratio" for signal in signals),
        "limits decided",
        "s for 3 s",
    ]
    names = [signal.name for signal in signals]
    rows = [_row(score, horizon, names) for score in scores for horizon in score.horizons]
    beyond = [_excess_row(score, horizon, names) for score in scores for horizon in score.horizons]
    units = [f"{signal.name} {signal.unit}" for signal in signals]
    checked = max(horizon.times_checked for score in scores for horizon in score.horizons)
    title = (
        f"{loop.benchmark.name}: {scores[0].horizons[0].trajectories} trajectories, {checked} "
        "times each; ratio: mean over the instants to T of tube width / sampled width, and in "
        "brackets of tube width / width proved by validated trajectories; touching: outside by "
        "less than the runs' own error, 1e-9"
    )
    excess = "excess of 0.05 s segments over the sampled hull to T, mean (worst)"
    return "\n".join(
        [title, table(headings, rows), excess, table(["method", "T s", *units], beyond)]
    )


def _excess_row(score: MethodScore, horizon: HorizonScore, names: Sequence[str]) -> list[str]:
    return [
        score.method,
        _end(score, horizon),
        *(f"{horizon.excess_mean[name]:.1e} ({horizon.excess_worst[name]:.1e})" for name in names),
    ]


def _end(score: MethodScore, horizon: HorizonScore) -> str:
    if horizon.covered:
        return f"{horizon.horizon_s:g}"
    return f"{horizon.horizon_s:g} (proved to {score.proved_until_s:.2f}, {score.status})"


def _row(score: MethodScore, horizon: HorizonScore, names: Sequence[str]) -> list[str]:
    return [
        score.method,
        f"{score.step_s:g}",
        score.rigor,
        _end(score, horizon),
        str(horizon.escapes),
        str(horizon.touching),
        *(
            f"{_ratio(horizon.width_ratio[name])} ({_ratio(horizon.proved_ratio[name])})"
            for name in names
        ),
        "-" if score.kinks_decided is None else f"{score.kinks_decided:.1%}",
        f"{score.elapsed_s:.2g}",
    ]


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def times_text(times: Sequence[KernelTime]) -> str:
    """Online tubes beside the compiled trajectory."""
    rows = [
        [
            item.loop,
            item.method,
            str(item.steps),
            f"{item.trajectory_us:.2f}",
            f"{item.tube_us:.1f}",
            f"{item.ratio:.1f}",
            *(_count(n) for n in (item.trajectory_instructions, item.tube_instructions)),
            _ratio(item.instruction_ratio),
        ]
        for item in times
    ]
    headings = [
        "loop",
        "method",
        "steps",
        "trajectory us",
        "tube us",
        "ratio",
        "trajectory instructions",
        "tube instructions",
        "ratio",
    ]
    first = times[0]
    title = f"one call in C in steps of 0.05 s, median of {first.rounds} interleaved rounds"
    if first.tube_instructions is None:
        title += "; instructions not counted, valgrind is missing"
    return f"{title}\n{table(headings, rows)}"


def _count(value: int | None) -> str:
    return "-" if value is None else str(value)


def cold_start_text(measured: ColdStart) -> str:
    """First decision of a fresh process."""
    return (
        f"cold start of the runtime, median of {measured.processes} fresh processes: "
        f"{measured.process_s:.3f} s in all (import {measured.import_s:.3f} s, load "
        f"{measured.load_s:.3f} s, first decision {measured.decide_s:.4f} s), "
        f"peak {measured.peak_mib:.1f} MiB, verdict {measured.verdict} ({measured.reason})"
    )
