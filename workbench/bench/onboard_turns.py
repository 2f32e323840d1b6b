"""How long turns of the real core take, and whether they gather memory."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from workbench.bench.onboard_programs import Cores, told_by

Told = tuple[float, float, float]
"""Median, 99.9th percentile, largest."""


@final
@dataclass(frozen=True, slots=True)
class Turns:
    """Turns of one core, fed as fast as they come.

    decided_us: from handing in the last frame before a turn that decides until its frames were
    made; ended_us: until its decision had ended; others_us: turns without a decision; beyond_turn:
    turns that took longer than the period. states: share of the turns; verdicts: of the
    decisions; faults: turns in which they were there. marks: (decisions, resident MiB); laps: cores
    that were begun, one per 16 km of road.
    """

    cores: Cores
    decisions: int
    decided_us: Told
    ended_us: Told
    others_us: Told
    beyond_turn: int
    states: Mapping[str, float]
    verdicts: Mapping[str, float]
    faults: Mapping[str, int]
    marks: tuple[tuple[int, float], ...]
    laps: int
    seconds: float


def told(values_us: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Told:
    """Median, 99.9th percentile and largest."""
    return (
        float(np.median(values_us)), float(np.quantile(values_us, 0.999)), float(values_us.max()),
    )  # fmt: skip


def turns(
    bundle: Path,
    decisions: int,
    *,
    cores: Cores,
    turn_us: int,
    queries: Path | None = None,
    line: Callable[[str], None] = lambda _: None,
) -> Turns:
    """Feed the bundle until so many decisions; queries: where to put some of the kernel's."""
    with told_by("onboard_feed.py", [str(bundle), str(decisions)], cores=cores, line=line) as found:
        said, folder = found
        times = {name: np.fromfile(folder / name) for name in ("decided", "ended", "others")}
        if queries is not None:
            shutil.copyfile(folder / "queries", queries)
    return Turns(
        cores, decisions, told(times["decided"]), told(times["ended"]), told(times["others"]),
        int(sum((times[name] > turn_us).sum() for name in ("decided", "others"))),
        _shares(said["states"]), _shares(said["verdicts"]), said["faults"],
        tuple((int(count), float(mib)) for count, mib in said["marks"]), said["laps"],
        said["seconds"],
    )  # fmt: skip


def at_shares(marks: tuple[tuple[int, float], ...]) -> Mapping[str, float]:
    """Resident MiB at the start, and after 10, 50 and 100 %."""
    most = marks[-1][0]
    found = {"start": marks[0][1]}
    for share in (10, 50, 100):
        found[f"{share} %"] = next(mib for count, mib in marks if count >= most * share / 100)
    return found


def _shares(counts: Mapping[str, int]) -> dict[str, float]:
    total = max(sum(counts.values()), 1)
    return {name: count / total for name, count in counts.items()}
