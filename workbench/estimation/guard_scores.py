"""How often fitted guards hold on recordings they were not fitted to, and how large they are."""

from __future__ import annotations

import fnmatch
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from scipy.stats import beta

from workbench.errors import InputError
from workbench.estimation.guard_fit import FRESH_S, GuardRows, fit_guard, fit_rows
from workbench.estimation.guard_model import (
    GuardFit,
    GuardModel,
    guard_areas,
    is_inside,
)
from workbench.estimation.guard_motion import Floats, MotionRows, motion_rows
from workbench.estimation.people_data import (
    PersonTrack,
    by_recording,
    load_measured,
    load_tracks,
)

INSIDE = 0.999
AHEAD_S = (1.0, 2.0)
WINDOWS_S = (0.0, 0.5, 0.8, 1.2, 2.0)
"""Histories for the velocity of the disc to compare with; 0 is the two newest measurements."""


@final
@dataclass(frozen=True, slots=True)
class GuardScore:
    """One kind at one time ahead, all recordings together.

    rows, people: how many were judged; inside: share of the rows inside; row_interval: its 95 %
    interval as if rows were independent, which neighbouring ones are not; whole: share of the
    people who were never outside, people_interval: its 95 % interval; area_m2: mean area;
    disc_m2: area of the smallest disc around the constant-velocity position with as many of these
    very rows inside, disc_window_s: the history for its velocity, best of WINDOWS_S.
    """

    kind: str
    horizon_s: float
    seen: str
    rows: int
    people: int
    inside: float
    row_interval: tuple[float, float]
    whole: float
    people_interval: tuple[float, float]
    area_m2: float
    disc_m2: float
    disc_window_s: float


def guard_table(folder: Path, *, fit: GuardFit | None = None) -> tuple[GuardScore, ...]:
    """Scores on every recording of `folder` of the guard fitted to all the others of it.

    fit: judge this one instead, as `fit_folder` or `shipped_guards` give it. Three groups of rows,
    by `seen`: "fresh" (two measurements or more, the newest at most FRESH_S old), "all" (two or
    more, of any age), "once" (a single one, fresh: no velocity, the speed disc alone).
    Raises InputError for a folder that cannot be read or, without `fit`, holds one recording only.
    """
    tracks, measured = load_tracks(folder), load_measured(folder)
    fits = (
        held_out_fits(tracks, measured) if fit is None else dict.fromkeys(by_recording(tracks), fit)
    )
    return tuple(_scores(tracks, measured, fits))


def fit_folder(folder: Path) -> GuardFit:
    """The guards fitted to all recordings of a folder: 99.9 % of the positions inside."""
    return fit_guard(load_tracks(folder), load_measured(folder), inside=INSIDE)


def guard_table_elsewhere(folder: Path, patterns: Sequence[str]) -> tuple[GuardScore, ...]:
    """Scores on the recordings that no pattern names, of the guard fitted to those that one does.

    patterns: names, or with `*` and `?` as in file names. Raises InputError where they name none or
    leave none.
    """
    tracks, measured = load_tracks(folder), load_measured(folder)
    names = list(by_recording(tracks))
    idle = [each for each in patterns if not fnmatch.filter(names, each)]
    fitted = {name for each in patterns for name in fnmatch.filter(names, each)}
    if idle or fitted.issuperset(names):
        raise InputError(
            f"expected names of recordings to fit to that leave others to judge, got "
            f"{', '.join(idle or patterns)}; the folder has {', '.join(names[:20])}"
        )
    there = [track.recording in fitted for track in tracks]
    fit = fit_guard(_where(tracks, there), _where(measured, there), inside=INSIDE)
    left = [not each for each in there]
    fits = dict.fromkeys(names, fit)
    return tuple(_scores(_where(tracks, left), _where(measured, left), fits))


def _where(tracks: Sequence[PersonTrack], which: Sequence[bool]) -> list[PersonTrack]:
    return list(itertools.compress(tracks, which))


def held_out_fits(
    tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack]
) -> dict[str, GuardFit]:
    """For each recording a fit to all other recordings."""
    names = list(by_recording(tracks))
    if len(names) < 2:
        raise InputError(
            f"expected two recordings or more to hold one out, got {len(names)}; "
            "fit to another folder instead (fit_folder)"
        )
    rows = GuardRows.of(tracks, measured)
    return {name: fit_rows(rows.without(name), inside=INSIDE) for name in names}


def _scores(
    tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack], fits: dict[str, GuardFit]
) -> Iterator[GuardScore]:
    for kind in sorted({track.kind for track in tracks}):
        own = [i for i, track in enumerate(tracks) if track.kind == kind]
        chosen, seen = [tracks[i] for i in own], [measured[i] for i in own]
        ordered = list(dict.fromkeys(track.recording for track in chosen))
        models = [fits[name].of(kind) for name in ordered]
        for horizon in AHEAD_S:
            rows = motion_rows(chosen, seen, horizon, windows_s=WINDOWS_S)
            yield from _of_groups(kind, rows, models)


def _of_groups(kind: str, rows: MotionRows, models: Sequence[GuardModel]) -> Iterator[GuardScore]:
    fresh = rows.motion.age_s <= FRESH_S
    groups = {"fresh": rows.motion.known & fresh, "all": rows.motion.known,
              "once": ~rows.motion.known & fresh}  # fmt: skip
    for seen, which in groups.items():
        part = rows.take(which)
        if len(part.person):
            yield _score(kind, seen, part, models)


def _score(kind: str, seen: str, rows: MotionRows, models: Sequence[GuardModel]) -> GuardScore:
    within, areas = np.zeros(len(rows.person)), np.zeros(len(rows.person))
    for number, model in enumerate(models):
        own = rows.recording == number
        within[own], areas[own] = (
            is_inside(model, rows.take(own)),
            guard_areas(model, rows.take(own)),
        )
    outside = len(set(rows.person[within == 0.0].tolist()))
    people = len(set(rows.person.tolist()))
    held = round(float(within.sum()))
    disc, window = _disc(rows, held)
    return GuardScore(
        kind, rows.horizon_s, seen, len(within), people,
        held / len(within), binomial_interval(held, len(within)),
        (people - outside) / people, binomial_interval(people - outside, people),
        float(areas.mean()), disc, window,
    )  # fmt: skip


def _disc(rows: MotionRows, held: int) -> tuple[float, float]:
    """Smallest area of a disc of one radius with `held` of the rows inside, and its window."""
    reach = rows.reach_s[:, None]
    found = []
    for window, velocity in zip(WINDOWS_S, rows.velocities_mps, strict=True):
        errors: Floats = np.hypot(*(rows.moved_m - velocity * reach).T)
        at = max(held, 1) - 1
        found.append((math.pi * float(np.partition(errors, at)[at]) ** 2, window))
    return min(found)


def binomial_interval(hits: int, trials: int, *, confidence: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson interval of a probability from independent trials."""
    out = 0.5 * (1.0 - confidence)
    low = float(beta.ppf(out, hits, trials - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - out, hits + 1, trials - hits)) if hits < trials else 1.0
    return low, high


def guard_lines(scores: Sequence[GuardScore]) -> Iterator[str]:
    """The scores as the lines of a Markdown table."""
    yield (
        "| kind | seen | ahead s | rows | people | inside % (95 %) | people never outside % (95 %) "
        "| area m² | disc m² (window s) |"
    )
    yield "| --- " * 9 + "|"
    for score in scores:
        yield (
            f"| {score.kind} | {score.seen} | {score.horizon_s:g} | {score.rows} | {score.people} "
            f"| {_percent(score.inside, score.row_interval)} "
            f"| {_percent(score.whole, score.people_interval)} "
            f"| {score.area_m2:.2f} | {score.disc_m2:.2f} ({score.disc_window_s:g}) |"
        )


def _percent(share: float, interval: tuple[float, float]) -> str:
    return f"{100 * share:.2f} ({100 * interval[0]:.2f}-{100 * interval[1]:.2f})"
