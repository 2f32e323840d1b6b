"""Fit how people move to a folder of recordings; any set of recordings can be left out.

Candidates on fixed grids are scored once per recording; a fit is the best of them over the
recordings that it may use. Nothing of a recording that is left out touches a fit.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.field_paths import Others, paths, starts
from workbench.estimation.goal_answers import goals_reached, neighbours
from workbench.estimation.motion_filter import Estimate, MotionNumbers
from workbench.estimation.motion_parameters import MotionParameters
from workbench.estimation.motion_queries import (
    HORIZONS_S,
    SCORED_S,
    Queries,
    ask,
    constant_velocity,
    known_by_then,
    preferred_velocity,
)
from workbench.estimation.people_data import load_measured, load_tracks
from workbench.estimation.potential_field import Field, Repulsion
from workbench.estimation.prediction import ConstantVelocity
from workbench.estimation.quantile_radii import QuantileRadii, fit_radii

Values = NDArray[np.float64]
BASELINE = ConstantVelocity(window_s=1.0)
"""Of windows of 0.05 to 3 s about the best on all recordings tried; see docs/people-motion.md."""
LEVELS = (0.5, 0.9, 0.99)
KNOTS_S = tuple(0.5 * k for k in range(1, 13))
LEAST_ERRORS = 100
WALKING_DEVIATION_MPS = 1.2
WAVERING_S = 1.0
BODIES_M = 0.5
"""Distance of two people's centres at which they touch."""
EVERY_THIRD = 3
"""Ways to a goal are long and alike: each third question is enough to choose the field."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """Summed errors of candidates: of_each (c, r, s) and of constant velocity, baseline (r, s).

    r: recordings; s: the scored horizons, once over all questions and once over the fresh ones.
    """

    of_each: Values
    baseline: Values

    def best(self, recordings: NDArray[np.bool_]) -> int:
        """The candidate with the least mean error relative to constant velocity's."""
        of_each = self.of_each[:, recordings].sum(axis=1)
        baseline = self.baseline[recordings].sum(axis=0)
        used = baseline > 0.0
        return int(np.argmin((of_each[:, used] / baseline[used]).mean(axis=1)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """What fits are made from: questions, the constant velocity's errors, scored candidates.

    motions, fields: the scores of `MOTIONS` and `FIELDS`; goals_m: (n, 2), the goal that each
    question's person reached, NaN where none is known; others: their neighbours at the time.
    """

    queries: Queries
    baseline_m: Values
    motions: Scored
    fields: Scored
    goals_m: Values
    others: Others


MOTIONS = tuple(
    MotionNumbers(noise, WALKING_DEVIATION_MPS, keeps, wavers, WAVERING_S, standing, trusted)
    for noise, keeps, wavers, standing, trusted in itertools.product(
        (0.015, 0.03),
        (60.0, 120.0, 240.0),
        (0.07, 0.14, 0.28),
        (0.1, 0.15, 0.2, 0.3),
        (2.0, 3.0, 4.0),
    )
)
"""Every combination is a candidate; those with the same filter stand together."""


def _fields() -> tuple[Field, ...]:
    laws = [
        Repulsion(s, r) for s, r in ((0.0, 0.3), (0.1, 0.3), (0.1, 0.6), (0.3, 0.3), (0.3, 0.6))
    ]
    return tuple(
        Field(relaxation, softening, law, law)
        for relaxation, softening, law in itertools.product((2.0, 3.0, 4.0), (2.0, 3.0), laws)
    )


FIELDS = _fields()


def fit_motion(folder: Path, *, credit: str = "") -> MotionParameters:
    """Fit everything to all recordings of a folder in the data layout.

    credit: whose recordings they are; it goes into the file beside their names.
    motion: least mean distance at 1, 2, 3 and 5 s relative to constant velocity's, among `MOTIONS`;
    field: likewise among `FIELDS`, for people whose goal is known afterwards; radii: split
    conformal quantiles of what is left. Uses peds, control_points, goals and goal_labels; without
    goals, everybody's own last place is their goal. Vehicles repel as people do: their numbers are
    not fitted. Raises InputError where a table cannot be used or too few people are in it.
    """
    material = gather(Path(folder))
    everything = np.ones(len(material.queries.recordings), dtype=np.bool_)
    recordings = ", ".join(material.queries.recordings)
    told = f"{credit}; " if credit else ""
    return fitted(material, everything, f"{told}fitted to the recordings {recordings}")


def gather(folder: Path) -> Material:
    """Read a folder, ask the questions and score all candidates on each recording."""
    tracks, measured = load_tracks(folder), load_measured(folder)
    queries = ask(tracks, measured)
    baseline = queries.errors_m(constant_velocity(queries, BASELINE))
    goals = goals_reached(folder, tracks, queries)
    known = known_by_then(queries, MOTIONS[0])
    others = neighbours(queries, known, radius_m=BODIES_M)
    motions = Scored(np.array(_motion_sums(queries)), _sums(queries, baseline))
    chosen = np.isfinite(goals[:, 0]) & (np.arange(len(goals)) % EVERY_THIRD == 0)
    some = np.flatnonzero(chosen)
    sums = [
        _sums(queries, _goal_errors(queries, known, each, goals, others, some)) for each in FIELDS
    ]
    only = np.where(chosen[:, None], baseline, np.nan)
    return Material(
        queries, baseline, motions, Scored(np.array(sums), _sums(queries, only)), goals, others
    )


def fitted(material: Material, recordings: NDArray[np.bool_], provenance: str) -> MotionParameters:
    """The fit to some of the recordings, as a mask over `material.queries.recordings`."""
    numbers = MOTIONS[material.motions.best(recordings)]
    field = FIELDS[material.fields.best(recordings)]
    errors, toward, speeds = errors_of(material, numbers, field)
    used = recordings[material.queries.recording] & material.queries.fresh
    return MotionParameters(
        numbers, field, _radii(material, errors, speeds, used),
        _radii(material, toward, speeds, used), provenance,
    )  # fmt: skip


@functools.lru_cache(maxsize=4)
def errors_of(
    material: Material, numbers: MotionNumbers, field: Field
) -> tuple[Values, Values, Values]:
    """Errors (n, h) without and with the goal, and the believed speeds (n,); remembered, as fits
    that leave different recordings out often choose the same numbers."""
    queries = material.queries
    known = known_by_then(queries, numbers)
    places, speeds = preferred_velocity(queries, known, numbers, HORIZONS_S)
    some = np.flatnonzero(np.isfinite(material.goals_m[:, 0]))
    toward = _goal_errors(queries, known, field, material.goals_m, material.others, some)
    return queries.errors_m(places), toward, speeds


def _radii(
    material: Material, errors: Values, speeds: Values, used: NDArray[np.bool_]
) -> QuantileRadii:
    many = np.repeat(speeds[used][:, None], len(HORIZONS_S), axis=1)
    return fit_radii(
        material.queries.leads_s[used].ravel(), errors[used].ravel(), many.ravel(),
        levels=LEVELS, knots_s=KNOTS_S, least=LEAST_ERRORS,
    )  # fmt: skip


def _motion_sums(queries: Queries) -> list[Values]:
    sums, same_filter, known = [], None, []
    for numbers in MOTIONS:
        if numbers.row[:5] != same_filter:
            same_filter, known = numbers.row[:5], known_by_then(queries, numbers)
        places, _ = preferred_velocity(queries, known, numbers, HORIZONS_S)
        sums.append(_sums(queries, queries.errors_m(places)))
    return sums


def _goal_errors(
    queries: Queries, known: Sequence[Estimate], field: Field, goals_m: Values, others: Others,
    some: NDArray[np.intp],
) -> Values:  # fmt: skip
    """(n, h), NaN for questions that are not among `some`."""
    errors = np.full((len(known), len(HORIZONS_S)), np.nan)
    near = Others(others.discs[some], others.vehicles[some])
    begin, lead = starts([known[k] for k in some]), queries.leads_s[some]
    lead = np.minimum(lead, HORIZONS_S[-1] + 2.0)
    off = paths(field, begin, goals_m[some], lead, others=near) - queries.truth_m[some]
    errors[some] = np.hypot(off[..., 0], off[..., 1])
    return errors


def _sums(queries: Queries, errors: Values) -> Values:
    """(r, 2 s): errors at the scored horizons, summed over all and over the fresh questions."""
    columns = np.searchsorted(HORIZONS_S, np.array(SCORED_S) - 1e-6)
    scored = np.nan_to_num(errors[:, columns])
    both = np.concatenate([scored, scored * queries.fresh[:, None]], axis=1)
    sums = np.zeros((len(queries.recordings), both.shape[1]))
    np.add.at(sums, queries.recording, both)
    return sums
