"""How far people can get, fitted to recordings: the guard of least area holding a share of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.guard_model import GuardFit, GuardModel, distances, family
from workbench.estimation.guard_motion import Floats, MotionRows, motion_rows
from workbench.estimation.guard_shape import least_shape
from workbench.estimation.people_data import PersonTrack

HORIZONS_S = (0.5, 1.0, 2.0)
"""Times ahead at which the fit wants the recorded positions inside."""
FRESH_S = 1.8
"""The fit looks at people measured no longer ago than this."""
ENOUGH_PEOPLE = 100
"""A family with fewer people shares its shape with all; a kind with fewer, its size."""
MARGIN, MARGIN_PEOPLE = 1.05, 10.0
"""Radii and speed limit grow by MARGIN + MARGIN_PEOPLE / people: few people, much unseen."""
FAULT_MPS = 12.0
"""Nobody on foot, on a board or on a bicycle among people is this fast: a jump of the labels."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class GuardRows:
    """What a fit is made from: the rows at each horizon, and whose they are.

    parts: one for each of HORIZONS_S, velocity known, FRESH_S old at most; kinds, recordings:
    names, by the numbers of persons and of recordings in `parts`.
    """

    parts: tuple[MotionRows, ...]
    kinds: tuple[str, ...]
    recordings: tuple[str, ...]

    @classmethod
    def of(cls, tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack]) -> GuardRows:
        """tracks, measured: as `motion_rows`."""
        every = [motion_rows(tracks, measured, horizon) for horizon in HORIZONS_S]
        return cls(
            tuple(r.take((r.motion.age_s <= FRESH_S) & r.motion.known) for r in every),
            tuple(track.kind for track in tracks),
            tuple(dict.fromkeys(track.recording for track in tracks)),
        )

    def without(self, recording: str) -> GuardRows:
        """All but those of one recording."""
        number = self.recordings.index(recording)
        parts = tuple(part.take(part.recording != number) for part in self.parts)
        return dataclasses.replace(self, parts=parts)

    def of_kinds(self, kinds: Sequence[str]) -> GuardRows:
        """Those of the people of these kinds."""
        wanted = np.array([kind in kinds for kind in self.kinds], np.bool_)
        return dataclasses.replace(
            self, parts=tuple(part.take(wanted[part.person]) for part in self.parts)
        )

    def plausible(self) -> GuardRows:
        """Those that imply no more than FAULT_MPS."""
        return dataclasses.replace(
            self, parts=tuple(part.take(_speeds(part) <= FAULT_MPS) for part in self.parts)
        )

    @property
    def people(self) -> NDArray[np.intp]:
        """Numbers of the people who have rows at every horizon."""
        return np.unique(self.parts[-1].person)

    @property
    def kinds_seen(self) -> tuple[str, ...]:
        """The kinds of `people`, sorted."""
        return tuple(sorted({self.kinds[number] for number in self.people}))


def fit_guard(
    tracks: Sequence[PersonTrack], measured: Sequence[PersonTrack], *, inside: float
) -> GuardFit:
    """`fit_rows` of people: tracks and measured as `motion_rows`."""
    return fit_rows(GuardRows.of(tracks, measured), inside=inside)


def fit_rows(rows: GuardRows, *, inside: float) -> GuardFit:
    """For each kind the model of least area that has a share `inside` of the positions inside.

    Shape: `least_shape` of the family, or of everybody where the family has fewer than
    ENOUGH_PEOPLE. Size: scaled (`GuardModel.scaled`) until half of the permitted share is outside,
    all recordings together, at the worst horizon, then by MARGIN + MARGIN_PEOPLE / people. A kind
    with fewer than ENOUGH_PEOPLE takes the less of its own size, with the margin of so few, and of
    the larger of its own and that of all who share the shape, with the margin of its family. Speed
    limit: what a tenth of the permitted share exceeds on average to a horizon of 1 s or more, with
    the margin of the kind, or that of the family for a kind with few people: who sits may get up.
    Rows faster than FAULT_MPS are faults of the measurement and left out (scores count them).
    Rigor: none; a statement about the recordings at hand: what was outside there will be outside
    again. Raises InputError without usable rows.
    """
    rows = rows.plausible()
    models: dict[str, GuardModel] = {}
    shapes: dict[tuple[str, ...], GuardModel] = {}
    for kind in rows.kinds_seen:
        kinds = fitted_together(rows, kind)
        group = rows.of_kinds(kinds)
        if kinds not in shapes:
            shapes[kinds] = least_shape(group.parts, outside=1.0 - inside)
        near = rows.of_kinds(family(kind))
        models[kind] = _sized(shapes[kinds], rows.of_kinds((kind,)), near, group, inside)
    if not models:
        raise InputError(
            f"expected tracks longer than {HORIZONS_S[-1]} s to fit a guard to, got none; "
            "give recordings with longer tracks"
        )
    return GuardFit(models)


def fitted_together(rows: GuardRows, kind: str) -> tuple[str, ...]:
    """The kinds whose people share a shape with `kind`: its family, or all where it has few."""
    seen = rows.kinds_seen
    near = tuple(other for other in seen if other in family(kind))
    return near if len(rows.of_kinds(near).people) >= ENOUGH_PEOPLE else seen


def _sized(
    shape: GuardModel, own: GuardRows, near: GuardRows, group: GuardRows, inside: float
) -> GuardModel:
    half, tenth = 0.5 * (1.0 - inside), 0.1 * (1.0 - inside)
    size = _size(shape, own, half)
    chosen, who = size * _margin(own), own
    if len(own.people) < ENOUGH_PEOPLE:
        chosen, who = min(chosen, max(size, _size(shape, group, half)) * _margin(near)), near
    sized = shape.scaled(chosen)
    limits = dataclasses.replace(sized.limits, speed_mps=_top_mps(who, tenth) * _margin(who))
    return dataclasses.replace(sized, limits=limits, provenance=_provenance(own, group))


def _margin(rows: GuardRows) -> float:
    return MARGIN + MARGIN_PEOPLE / len(rows.people)


def _size(shape: GuardModel, rows: GuardRows, outside: float) -> float:
    """The factor with which, at the worst horizon, a share `outside` of the rows is outside."""
    return max(float(np.quantile(_needed(shape, part), 1.0 - outside)) for part in rows.parts)


def _top_mps(rows: GuardRows, outside: float) -> float:
    long = [part for part in rows.parts if part.horizon_s >= 1.0]
    return max(float(np.quantile(_speeds(part), 1.0 - outside)) for part in long)


def _needed(shape: GuardModel, rows: MotionRows) -> Floats:
    """For each row the smallest factor of `scaled` with which it is in the acceleration disc, (n,).

    The radius is the larger of f (r + q t + A t^2/2) and f (r + A t^2/2) + (1 - c) |w| t, q being
    the fitted error: e is within it from the smaller of both solutions on.
    """
    motion, reach = rows.motion, rows.reach_s
    error, _ = distances(shape.kept, rows)
    bare = shape.position_m + 0.5 * shape.limits.acceleration_mps2 * reach * reach
    least = (1.0 - shape.kept) * motion.speed_mps * reach
    fitted = error / (bare + shape.fitted_error(motion) * reach)
    return np.maximum(np.minimum(fitted, (error - least) / bare), 1e-6)


def _speeds(rows: MotionRows) -> Floats:
    return np.asarray(np.hypot(*rows.moved_m.T) / rows.reach_s)


def _provenance(own: GuardRows, group: GuardRows) -> str:
    recordings = len(np.unique(group.parts[-1].recording))
    kinds = ", ".join(own.kinds_seen)
    shared = len(group.people) - len(own.people)
    beside = f", shape with {shared} others" if shared else ""
    return f"{len(own.people)} people ({kinds}) in {recordings} recordings{beside}"
