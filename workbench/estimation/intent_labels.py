"""Which goal recorded people had, which scene a recording shows, and how often goals are taken."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.goals import Goal
from workbench.estimation.tables import Table

LABEL_COLUMNS = ("recording", "agent", "scene", "goal", "usable")
_NO_GOAL = "-1"


@final
@dataclass(frozen=True, slots=True)
class Label:
    """The goal that a recorded person reached; usable: the track is whole and reached a goal."""

    recording: str
    agent: str
    scene: str
    goal: str
    usable: bool


def load_labels(folder: Path) -> tuple[Label, ...]:
    """Rows of `goal_labels.csv[.gz]`; none where the folder has no such table."""
    if not Table.exists(folder, "goal_labels"):
        return ()
    table = Table.read(folder, "goal_labels", LABEL_COLUMNS)
    labels = []
    for row in table.rows:
        if row.text("usable") not in ("0", "1"):
            raise InputError(f"{row.place('usable')}: expected 0 or 1, got {row.text('usable')!r}")
        usable = row.text("usable") == "1"
        if usable and row.text("goal") == _NO_GOAL:
            raise InputError(
                f"{row.place('goal')}: expected the goal of a usable track, got {_NO_GOAL}; "
                "name the goal, or set usable to 0"
            )
        labels.append(
            Label(row.text("recording"), row.text("agent"), row.text("scene"), row.text("goal"),
                  usable)
        )  # fmt: skip
    return tuple(labels)


def scenes_of(
    folder: Path, recordings: Iterable[str], scenes: Sequence[str], *, given: str | None = None
) -> dict[str, str]:
    """The scene of each recording, in this order of preference.

    `given`; the column `scene` of `recordings.csv`; that of `goal_labels.csv`; the longest scene
    name with which the recording's name begins; the only scene that there is.
    Raises InputError for a recording of which none of these says the scene.
    """
    if given is not None and given not in scenes:
        raise InputError(f"no scene {given!r} among the goals; they are of {', '.join(scenes)}")
    known = {label.recording: label.scene for label in load_labels(folder)}
    if Table.exists(folder, "recordings"):
        table = Table.read(folder, "recordings", ("recording",))
        if "scene" in table.columns:
            known |= {row.text("recording"): row.text("scene") for row in table.rows}
    found = {}
    for name in recordings:
        begins = sorted((each for each in scenes if name.startswith(each)), key=len)
        only = list(scenes) if len(scenes) == 1 else []
        told = [known[name]] if known.get(name) in scenes else []
        candidates = [given] if given is not None else told or begins or only
        if not candidates:
            raise InputError(
                f"recording {name!r}: nothing says which scene it shows; the goals are of "
                f"{', '.join(scenes)}; add a column scene to recordings.csv, or name it (--scene)"
            )
        found[name] = candidates[-1]
    return found


@final
@dataclass(frozen=True, slots=True)
class Prior:
    """How likely each goal is before a person is seen, and where that comes from.

    probability: (goals,), above zero, sums to 1; source: in words.
    """

    probability: NDArray[np.float64]
    source: str

    @classmethod
    def equal(cls, goals: Sequence[Goal]) -> Prior:
        """The same for each goal, as the paper has it."""
        return cls(np.full(len(goals), 1.0 / len(goals)), "equal")

    @classmethod
    def counted(cls, counts: NDArray[np.float64], source: str) -> Prior:
        """Proportional to the count of each goal plus one."""
        return cls((counts + 1.0) / (counts + 1.0).sum(), source)


def learned_prior(
    goals: Sequence[Goal], labels: Sequence[Label], *, scene: str, without: frozenset[str]
) -> Prior:
    """How often each goal was taken in recordings of this scene other than `without`.

    Counted in the labels, and in the counts that came with the goals unless these are the sum of
    the labels: then they hold what is left out here. Equal where nothing is left to count. It
    knows nothing of where a person comes from.
    """
    names = [goal.name for goal in goals]
    here = [label for label in labels if label.usable and label.scene == scene]
    everything = _counts(names, here)
    others = _counts(names, [label for label in here if label.recording not in without])
    ends = np.array([goal.ends or 0.0 for goal in goals])
    apart = ends.any() and not np.array_equal(ends, everything)
    sources = [text for text, used in (
        ("labels of other recordings", others.any()), ("counts in the table of goals", apart),
    ) if used]  # fmt: skip
    counts = others + (ends if apart else 0.0)
    return Prior.counted(counts, " and ".join(sources)) if sources else Prior.equal(goals)


def _counts(names: Sequence[str], labels: Iterable[Label]) -> NDArray[np.float64]:
    counts = np.zeros(len(names))
    for label in labels:
        counts[goal_index(names, label)] += 1.0
    return counts


def goal_index(names: Sequence[str], label: Label) -> int:
    """Which of the scene's goals the label names. Raises InputError where it is none of them."""
    if label.goal not in names:
        raise InputError(
            f"goal_labels: {label.recording!r}, {label.agent!r} has goal {label.goal!r}, scene "
            f"{label.scene!r} has {', '.join(names)}; use the goals that the labels were made with"
        )
    return names.index(label.goal)
