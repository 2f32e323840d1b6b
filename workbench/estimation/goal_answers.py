"""What is known afterwards of recorded questions: the goal people reached, and who was near."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.field_paths import VEHICLE_NUMBERS, Others
from workbench.estimation.goals import load_goals
from workbench.estimation.intent_labels import load_labels
from workbench.estimation.motion_filter import Estimate
from workbench.estimation.motion_queries import FRESH_S, Queries
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.tables import Table

Values = NDArray[np.float64]
NEIGHBOURS = 3
FAR_M = 1e4
"""Where nobody is, a disc this far away repels by nothing."""
_MOVED_M = 3.0
_ALIKE_MPS = 0.5


def goals_reached(folder: Path, tracks: Sequence[PersonTrack], queries: Queries) -> Values:
    """(n, 2), the goal that each question's person went to, NaN where it is not known.

    With `goals` and `goal_labels` in the folder, the centre of the labelled goal of usable tracks;
    otherwise the last place of everybody who moved at least 3 m.
    """
    if Table.exists(folder, "goals") and Table.exists(folder, "goal_labels"):
        name = "goals.csv.gz" if (folder / "goals.csv.gz").is_file() else "goals.csv"
        scenes = load_goals(folder / name)
        places = {
            (scene, goal.name): (goal.x_m, goal.y_m)
            for scene, goals in scenes.items()
            for goal in goals
        }
        of_person = {
            (label.recording, label.agent): places[label.scene, label.goal]
            for label in load_labels(folder)
            if label.usable
        }
    else:
        moved = [t for t in tracks if np.hypot(*(t.xy_m[-1] - t.xy_m[0])) >= _MOVED_M]
        of_person = {track.key: tuple(track.xy_m[-1]) for track in moved}
    none = (np.nan, np.nan)
    keys = [queries.measured[who].key for who in queries.who]
    return np.array([of_person.get(key, none) for key in keys], dtype=np.float64).reshape(-1, 2)


def neighbours(queries: Queries, known: Sequence[Estimate], *, radius_m: float) -> Others:
    """The three nearest people of each question who are no company, at its estimate's time.

    Company is who moves alike, within 0.5 m/s: people who walk or stand together do not repel each
    other, and taking them for obstacles makes every prediction worse. known: as `known_by_then`
    gives them. Of the others only what was measured by the question's time is used: the last
    place, at most 1.2 s old, carried on at the line through the last two.
    """
    discs = np.zeros((len(known), NEIGHBOURS, 5))
    discs[..., 0], discs[..., 4] = FAR_M, radius_m
    crowd: dict[str, list[PersonTrack]] = {}
    for track in queries.measured:
        crowd.setdefault(track.recording, []).append(track)
    for name, people in crowd.items():
        asked = np.flatnonzero(queries.recording == queries.recordings.index(name))
        for instant in np.unique(queries.at_s[asked]):
            rows = _moving(people, float(instant))
            for k in asked[queries.at_s[asked] == instant]:
                discs[k, :, :4] = _nearest(rows, queries.measured[queries.who[k]], known[k])
    return Others(discs, np.empty((len(known), 0, VEHICLE_NUMBERS)))


def _moving(people: Sequence[PersonTrack], at_s: float) -> dict[str, Values]:
    """Place and velocity, with the time they hold at, of everybody measured lately."""
    rows = {}
    for person in people:
        count = int(np.searchsorted(person.t_s, at_s + 1e-9, side="right"))
        if count and at_s - person.t_s[count - 1] <= FRESH_S:
            velocity = np.zeros(2)
            if count > 1:
                step = person.xy_m[count - 1] - person.xy_m[count - 2]
                velocity = step / (person.t_s[count - 1] - person.t_s[count - 2])
            row = (*person.xy_m[count - 1], *velocity, person.t_s[count - 1])
            rows[person.agent] = np.array(row)
    return rows


def _nearest(rows: dict[str, Values], person: PersonTrack, known: Estimate) -> Values:
    found = np.zeros((NEIGHBOURS, 4))
    found[:, 0] = FAR_M
    others = [row for agent, row in rows.items() if agent != person.agent]
    if others:
        table = np.array(others)
        table = table[np.hypot(*(table[:, 2:4] - known.velocity_mps).T) > _ALIKE_MPS]
        places = table[:, :2] + (known.t_s - table[:, 4:]) * table[:, 2:4]
        order = np.argsort(np.hypot(*(places - known.mean[0]).T), kind="stable")[:NEIGHBOURS]
        found[: len(order)] = np.hstack([places, table[:, 2:4]])[order]
    return found
