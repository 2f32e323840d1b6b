"""Questions put to recordings: what was measured by a time, and where the person was later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.motion_filter import Estimate, MotionNumbers, estimates
from workbench.estimation.people_data import PersonTrack
from workbench.estimation.prediction import ConstantVelocity

Values = NDArray[np.float64]
Numbers = NDArray[np.intp]
EVERY_S = 0.5
"""A question about each person this often, from their second measurement on."""
HORIZONS_S = np.round(np.arange(1, 26) * 0.2, 1)
SCORED_S = (1.0, 2.0, 3.0, 5.0)
FRESH_S = 1.2
"""The usual time between two measurements of people clicked in video; older ones are stale."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Queries:
    """n questions: about person who (n,) at at_s (n,), having measured `last` (n,) + 1 positions.

    measured: everybody's measurements; age_s (n,): since the last one; truth_m (n, h, 2): the place
    HORIZONS_S later, NaN where the track has ended; recordings: the names, of each its number in
    recording (n,).
    """

    measured: tuple[PersonTrack, ...]
    who: Numbers
    at_s: Values
    last: Numbers
    age_s: Values
    truth_m: Values
    recordings: tuple[str, ...]
    recording: Numbers

    @property
    def leads_s(self) -> Values:
        """(n, h), from the last measurement to the time asked about."""
        leads: Values = self.age_s[:, None] + HORIZONS_S
        return leads

    @property
    def fresh(self) -> NDArray[np.bool_]:
        """(n,), the last measurement is at most FRESH_S old."""
        fresh: NDArray[np.bool_] = self.age_s <= FRESH_S + 1e-9
        return fresh

    def errors_m(self, places_m: Values) -> Values:
        """(n, h), distances of predicted places (n, h, 2) from the true ones."""
        off = places_m - self.truth_m
        errors: Values = np.hypot(off[..., 0], off[..., 1])
        return errors


def ask(tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack]) -> Queries:
    """Questions every 0.5 s from each person's second measurement until 0.5 s before their end.

    tracks: where people were; measured: of the same people in the same order, what was measured.
    Between samples people are taken to move straight. Raises InputError where nobody was measured
    twice.
    """
    rows, truths = [], []
    names = tuple(dict.fromkeys(track.recording for track in tracks))
    for index, (track, seen) in enumerate(zip(tracks, measured, strict=True)):
        if len(seen.t_s) < 2:
            continue
        for instant in np.arange(seen.t_s[1], track.t_s[-1] - EVERY_S, EVERY_S):
            at_s = float(instant)
            last = len(seen.until(at_s).t_s) - 1
            age_s = max(at_s - seen.t_s[last], 0.0)
            rows.append((index, at_s, last, age_s, names.index(track.recording)))
            truths.append(_truth(track, at_s + HORIZONS_S))
    if not rows:
        raise InputError(
            f"expected people who were measured twice and seen for {2 * EVERY_S} s, got none "
            f"among {len(tracks)}; give longer recordings"
        )
    table = np.array(rows, dtype=np.float64)
    persons, lasts, places = (table[:, column].astype(np.intp) for column in (0, 2, 4))
    return Queries(
        tuple(measured), persons, table[:, 1], lasts, table[:, 3], np.array(truths), names, places
    )


def _truth(track: PersonTrack, times_s: Values) -> Values:
    places = np.column_stack([np.interp(times_s, track.t_s, axis) for axis in track.xy_m.T])
    places[times_s > track.t_s[-1] + 1e-6] = np.nan
    return places


def constant_velocity(queries: Queries, method: ConstantVelocity) -> Values:
    """(n, h, 2), what constant velocity says."""
    histories = [
        queries.measured[who].until(at) for who, at in zip(queries.who, queries.at_s, strict=True)
    ]
    velocity = np.array([method.velocity_mps(history) for history in histories])
    place = np.array([history.xy_m[-1] for history in histories])
    places: Values = place[:, None] + queries.leads_s[..., None] * velocity[:, None]
    return places


def known_by_then(queries: Queries, numbers: MotionNumbers) -> list[Estimate]:
    """The estimate of each question, from the measurements until its time."""
    asked = sorted(set(queries.who.tolist()))
    found = estimates([queries.measured[index] for index in asked], numbers)
    of_person = dict(zip(asked, found, strict=True))
    return [of_person[w][k] for w, k in zip(queries.who.tolist(), queries.last, strict=True)]


def preferred_velocity(
    queries: Queries, known: Sequence[Estimate], numbers: MotionNumbers, horizons_s: Values
) -> tuple[Values, Values]:
    """What `PreferredVelocity` says: places (n, h, 2), and the believed speed (n,) at that time.

    known: as `known_by_then` gives them. The formula of `forecast_step` once more, for all
    questions at a time: a CasADi map over so many is slower by far.
    """
    means, age = np.array([each.mean for each in known]), queries.age_s
    square = np.sum((means[:, 1] + means[:, 2]) ** 2, axis=1)
    believed = square / (square + numbers.standing_mps**2) / (1 + (age / numbers.trusted_s) ** 4)
    lead, moved = age[:, None] + horizons_s, np.zeros((len(age), len(horizons_s), 2))
    for row, constant in ((1, numbers.preferred_s), (2, numbers.wavering_s)):
        moved += (-constant * np.expm1(-lead / constant))[..., None] * means[:, row, None]
    fading = np.exp(-age / numbers.wavering_s)[:, None]
    speeds = believed * np.hypot(*(means[:, 1] + means[:, 2] * fading).T)
    return means[:, 0, None] + believed[:, None, None] * moved, speeds
