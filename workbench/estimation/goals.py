"""Where people of a place go: goals from a table, or learned as clusters of the ends of tracks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.tables import Table

GOAL_COLUMNS = ("scene", "goal", "x", "y")
DEFAULT_SPREAD_M = 1.5


@final
@dataclass(frozen=True, slots=True)
class Goal:
    """A region where people leave or stay.

    name: as the table writes it; x_m, y_m: its centre; spread_m: root mean square distance of
    people's last positions from the centre; ends: how many recorded tracks ended there when the
    table was made, None where the table does not say.
    """

    name: str
    x_m: float
    y_m: float
    spread_m: float
    ends: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x_m) and math.isfinite(self.y_m) and self.spread_m > 0.0):
            raise InputError(
                f"goal {self.name!r}: expected finite metres and a spread above zero, got "
                f"x {self.x_m}, y {self.y_m}, spread {self.spread_m}"
            )


def centres_m(goals: Sequence[Goal]) -> NDArray[np.float64]:
    """The centres, (goals, 2), m."""
    return np.array([(goal.x_m, goal.y_m) for goal in goals], dtype=np.float64).reshape(-1, 2)


def spreads_m(goals: Sequence[Goal]) -> NDArray[np.float64]:
    """The spreads, (goals,), m."""
    return np.array([goal.spread_m for goal in goals], dtype=np.float64)


def load_goals(path: Path) -> dict[str, tuple[Goal, ...]]:
    """The goals of each scene from a CSV file, plain or gzip, in the order of its rows.

    Columns: scene, goal, x, y; optional rms_spread (m, else 1.5) and n_develop (how many tracks
    ended there in recordings that are kept apart from the ones to be judged).
    Raises InputError when the file, a column or a number cannot be used, or a goal stands twice.
    """
    table = Table.read(*_split(Path(path)), GOAL_COLUMNS)
    scenes: dict[str, list[Goal]] = {}
    for row in table.rows:
        name, scene = row.text("goal"), row.text("scene")
        spread = row.number("rms_spread") if "rms_spread" in table.columns else DEFAULT_SPREAD_M
        ends = row.number("n_develop") if "n_develop" in table.columns else None
        if spread <= 0.0:
            raise InputError(f"{row.place('rms_spread')}: expected metres above zero, got {spread}")
        if ends is not None and ends < 0.0:
            raise InputError(f"{row.place('n_develop')}: expected a count, got {ends:g}")
        if any(goal.name == name for goal in scenes.get(scene, ())):
            raise InputError(
                f"{row.place('goal')}: goal {name!r} of scene {scene!r} stands twice; "
                "give each goal one row"
            )
        goal = Goal(name, row.number("x"), row.number("y"), spread, ends)
        scenes.setdefault(scene, []).append(goal)
    if not scenes:
        raise InputError(f"{table.path}: expected at least one goal, the table has no rows")
    return {scene: tuple(goals) for scene, goals in scenes.items()}


def _split(path: Path) -> tuple[Path, str]:
    name = path.name
    for ending in (".csv.gz", ".csv"):
        if name.endswith(ending) and path.is_file():
            return path.parent, name.removesuffix(ending)
    found = "nothing" if not path.exists() else "a folder" if path.is_dir() else "another file"
    raise InputError(
        f"expected a table of goals (.csv or .csv.gz with the columns {', '.join(GOAL_COLUMNS)}) "
        f"at {path}, found {found}"
    )


def goals_csv(scenes: Mapping[str, Sequence[Goal]]) -> str:
    """The table that `load_goals` reads."""
    lines = ["scene,goal,x,y,rms_spread,n_develop"]
    lines += [
        f"{scene},{goal.name},{goal.x_m:.3f},{goal.y_m:.3f},{goal.spread_m:.2f},{goal.ends or 0:g}"
        for scene, goals in scenes.items()
        for goal in goals
    ]
    return "\n".join(lines) + "\n"


@final
@dataclass(frozen=True, slots=True)
class MeanShift:
    """How the ends of tracks are clustered, and which clusters are kept.

    bandwidth_m: standard deviation of the Gaussian kernel; merge_m: modes nearer than this are one;
    reach_m: a point belongs to the nearest mode within this distance; least_share: modes with a
    smaller share of the points are dropped; moved_m: tracks that end nearer to where they began
    say nothing about goals; margin_s: tracks within this of the recording's begin or end may be
    cut, and their point there is left out.
    """

    bandwidth_m: float
    merge_m: float
    reach_m: float
    least_share: float
    moved_m: float
    margin_s: float

    @classmethod
    def people(cls) -> MeanShift:
        """For entrances and exits of squares and pavements, some metres wide."""
        return cls(1.2, 1.8, 3.6, 0.02, 3.0, 1.0)

    def __post_init__(self) -> None:
        if not (self.bandwidth_m > 0.0 and self.merge_m > 0.0 and self.reach_m > 0.0):
            raise InputError("mean shift: expected bandwidth, merge and reach above zero metres")


def learn_goals(tracks: Iterable[PersonTrack], method: MeanShift) -> tuple[Goal, ...]:
    """Goals as the modes of the density of the places where people come from and leave to.

    Every point climbs x <- sum_i k(x - x_i) x_i / sum_i k(x - x_i), k Gaussian, to a mode. Names
    are 0, 1, ... from the most used down. The tracks are of one place, of any recordings.
    Raises InputError when no track has moved far enough. D. Comaniciu, P. Meer, Mean shift, 2002.
    """
    first, last = _ends(list(tracks), method)
    points = np.array(first + last).reshape(-1, 2)
    if not len(points):
        raise InputError(
            f"expected tracks that move at least {method.moved_m:g} m and are not cut, got none; "
            "goals cannot be learned from these recordings"
        )
    modes = _merged(_climbed(points, method.bandwidth_m), method.merge_m)
    found = cKDTree(modes).query(points)
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    near = distance <= method.reach_m
    ending = np.arange(len(points)) >= len(first)
    goals = []
    for index, mode in enumerate(modes):
        own = near & (nearest == index)
        if own.sum() >= max(method.least_share * len(points), 1.0):
            spread = max(math.sqrt(float(np.mean(distance[own] ** 2))), 0.3)
            goals.append((float((own & ending).sum()), int(own.sum()), mode, spread))
    goals.sort(key=lambda goal: (-goal[1], *goal[2]))
    return tuple(
        Goal(str(name), float(mode[0]), float(mode[1]), spread, ends)
        for name, (ends, _, mode, spread) in enumerate(goals)
    )


def _ends(
    tracks: Sequence[PersonTrack], method: MeanShift
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    span: dict[str, tuple[float, float]] = {}
    for track in tracks:
        if len(track.t_s):
            low, high = span.get(track.recording, (math.inf, -math.inf))
            span[track.recording] = (min(low, track.t_s[0]), max(high, track.t_s[-1]))
    first, last = [], []
    for track in tracks:
        if len(track.t_s) < 2:
            continue
        if np.hypot(*(track.xy_m[-1] - track.xy_m[0])) < method.moved_m:
            continue
        low, high = span[track.recording]
        if track.t_s[0] > low + method.margin_s:
            first.append(track.xy_m[0])
        if track.t_s[-1] < high - method.margin_s:
            last.append(track.xy_m[-1])
    return first, last


def _climbed(points: NDArray[np.float64], bandwidth_m: float) -> NDArray[np.float64]:
    """Where each point's climb ends, (n, 2); a millimetre per step counts as arrived."""
    places = points.copy()
    for _ in range(300):
        square = ((places[:, None] - points[None]) ** 2).sum(axis=-1)
        pull = np.exp(-0.5 * square / bandwidth_m**2)
        moved = pull @ points / pull.sum(axis=1, keepdims=True)
        step = float(np.abs(moved - places).max())
        places = moved
        if step < 1e-3:
            break
    return places


def _merged(places: NDArray[np.float64], merge_m: float) -> NDArray[np.float64]:
    """Modes, the most climbed first; a place nearer than merge_m to a mode joins it."""
    crowd = np.asarray(cKDTree(places).query_ball_point(places, 0.1 * merge_m, return_length=True))
    modes: list[NDArray[np.float64]] = []
    for index in np.lexsort((places[:, 1], places[:, 0], -crowd)):
        if all(np.hypot(*(places[index] - mode)) >= merge_m for mode in modes):
            modes.append(places[index])
    return np.array(modes)
