"""How often a person's guards contradict each other: the car would brake for a wrong limit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from workbench.estimation.guard_model import GuardFit, GuardModel
from workbench.estimation.guard_scores import held_out_fits
from workbench.estimation.guard_shipped import shipped_guards
from workbench.estimation.people_data import PersonTrack, by_recording, load_measured, load_tracks
from workbench.runtime import Guard
from workbench.runtime.policies.guards import Relation, relation_to

LATER_S = 1.0
"""A guard is compared with the person's next one, and with that of so much later."""

_SAME_TIME_S = 1e-9


@final
@dataclass(frozen=True, slots=True)
class ViolationCount:
    """Of one kind under one guard: people, compared pairs of guards, pairs that contradict each
    other (`relation_to` is OUTSIDE), and people with such a pair."""

    guard: str
    kind: str
    people: int
    compared: int
    refuted: int
    people_refuted: int


def violation_table(folder: Path) -> tuple[ViolationCount, ...]:
    """Counts with the shipped guards, then with those fitted to the other recordings of `folder`.

    Raises InputError for a folder that cannot be read or holds one recording only.
    """
    tracks, measured = load_tracks(folder), load_measured(folder)
    shipped = dict.fromkeys(by_recording(tracks), shipped_guards())
    return (
        *count_violations(tracks, measured, shipped, name="shipped"),
        *count_violations(tracks, measured, held_out_fits(tracks, measured), name="held out"),
    )


def count_violations(
    tracks: Sequence[PersonTrack],
    measured: Sequence[PersonTrack],
    fits: Mapping[str, GuardFit],
    *,
    name: str,
) -> Iterator[ViolationCount]:
    """One count for each kind. tracks: whose sample times the guards are of; measured: of the same
    people in the same order; fits: by recording; name: of the guard."""
    for kind in sorted({track.kind for track in tracks}):
        found = [
            person_violations(fits[track.recording].of(kind), track.t_s, seen)
            for track, seen in zip(tracks, measured, strict=True)
            if track.kind == kind and len(seen.t_s)
        ]
        refuted = [sum(pairs) for pairs in found]
        yield ViolationCount(
            name, kind, len(found), sum(map(len, found)), sum(refuted),
            sum(count > 0 for count in refuted),
        )  # fmt: skip


def person_violations(
    model: GuardModel, times_s: Sequence[float] | np.ndarray, seen: PersonTrack
) -> list[bool]:
    """For each pair of the person's guards, neighbours first, whether the two contradict."""
    every = np.asarray(times_s, np.float64)
    times = every[every >= seen.t_s[0] - _SAME_TIME_S]
    guards = model.guards(seen, times, body_radius_m=0.0)
    moved = [
        Guard(float(t) + guard.at_s, guard.position, guard.velocity, guard.limits)
        for t, guard in zip(times, guards, strict=True)
    ]
    later = np.searchsorted(times, times + LATER_S - _SAME_TIME_S)
    pairs = [(i, i + 1) for i in range(len(times) - 1)]
    pairs += [(i, int(j)) for i, j in enumerate(later) if j < len(times)]
    return [relation_to(moved[i], moved[j]) is Relation.OUTSIDE for i, j in pairs]


def violation_lines(counts: Sequence[ViolationCount]) -> Iterator[str]:
    """The counts as the lines of a Markdown table."""
    yield "| guard | kind | people | compared | contradictions | people with one |"
    yield "| --- " * 6 + "|"
    for c in counts:
        yield (
            f"| {c.guard} | {c.kind} | {c.people} | {c.compared} | {c.refuted} "
            f"| {c.people_refuted} |"
        )
