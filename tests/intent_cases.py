"""Generated squares with labelled people, for the tests of intents."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.estimation.goals import Goal

SQUARE = (
    Goal("west", -10.0, 0.0, 1.0), Goal("east", 10.0, 0.0, 1.0), Goal("north", 0.0, 10.0, 1.0),
)  # fmt: skip
SHARES = (0.5, 0.3, 0.2)


def write(path: Path, rows: Sequence[Sequence[object]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def square(folder: Path, *, people: int = 12, recordings: int = 2, clicked: bool = True) -> Path:
    """A folder in the layout of recordings: people walk from one goal to another, waving a bit."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(5)
    peds: list[list[object]] = [["recording", "agent", "kind", "t", "x", "y"]]
    clicks: list[list[object]] = [["recording", "agent", "t", "x", "y"]]
    labels: list[list[object]] = [
        ["recording", "agent", "scene", "origin", "goal", "start_ok", "end_ok", "usable"]
    ]
    for r in range(recordings):
        for k in range(people):
            goal = int(rng.choice(3, p=SHARES))
            origin = int(rng.choice([each for each in range(3) if each != goal]))
            ends = [np.array([SQUARE[each].x_m, SQUARE[each].y_m]) for each in (origin, goal)]
            ends = [end + 0.7 * rng.standard_normal(2) for end in ends]
            begin, last = 2.0 * k, float(np.hypot(*(ends[1] - ends[0]))) / 1.3
            key: list[object] = [f"square_{r}", f"p{k}"]
            bulge = rng.standard_normal() * np.array([-1.0, 1.0]) * (ends[1] - ends[0])[::-1] / 20
            for i in range(round(last / 0.2) + 1):
                part = min(0.2 * i / last, 1.0)
                at = ends[0] + part * (ends[1] - ends[0]) + 4 * part * (1 - part) * bulge
                row: list[object] = [round(begin + 0.2 * i, 3), *np.round(at, 4)]
                peds.append([*key, "ped", *row])
                if i % 6 == 0:
                    clicks.append([*key, *row])
            labels.append([*key, "square", SQUARE[origin].name, SQUARE[goal].name, 1, 1, 1])
    write(folder / "peds.csv", peds)
    if clicked:
        write(folder / "control_points.csv", clicks)
    write(folder / "goal_labels.csv", labels)
    write(folder / "goals.csv", [
        ["scene", "goal", "x", "y", "rms_spread"],
        *(["square", goal.name, goal.x_m, goal.y_m, goal.spread_m] for goal in SQUARE),
    ])  # fmt: skip
    return folder
