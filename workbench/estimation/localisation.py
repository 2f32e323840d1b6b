"""The vehicle's state from ranges and reports: where it is, which way it faces, how it moves."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.estimation.lanes import Array, lanes
from workbench.estimation.localisation_filter import FilterFunctions
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_start import spread_headings
from workbench.estimation.localisation_states import HYPOTHESES, STATES, WINDOW

Flags = NDArray[np.bool_]
_SIZE: Final = len(STATES)
_HEADING: Final = STATES.index("heading")
# Longest step of the prediction: longer spans are cut.
_STEP_S: Final = 0.05
# A place less sure than this is no place: the window goes on.
_PLACED_M: Final = 0.5
# What nothing but motion can tell, and so is not learned at a standstill.
_MOTION_ONLY: Final = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0])


class Status(enum.Enum):
    """What is known of a car."""

    UNPLACED = "not placed: fewer ranges from a standing car than are needed"
    HEADING_INVALID = "the place is known, the heading is not"
    VALID = "place and heading are known"
    LOST = "ranges contradict the estimate, or none was accepted for too long"


@final
@dataclass(frozen=True, slots=True)
class Belief:
    """Means (n, 7) and covariances (n, 7, 7) over `STATES`."""

    mean: Array
    covariance: Array


@final
@dataclass(frozen=True, slots=True)
class Localisation:
    """What is known of n cars at stamp_s; a vehicle estimates one, n = 1.

    belief: only of cars that are aligned. hypotheses: of each car HYPOTHESES beliefs, one after the
    other, with their log weights (n, h); None when all are aligned. commands (n, 2): acceleration
    and steering rate in force. slow_since_s: since when the reports say that it stands. window:
    beacons (n, w, 3), ranges (n, w), received (n, w), and how many are from this standstill.
    refused: ranges refused in a row, by the likeliest hypothesis of who is not aligned; ranged_s:
    when the last one was accepted.
    """

    stamp_s: float
    belief: Belief
    hypotheses: Belief | None
    logs: Array
    placed: Flags
    aligned: Flags
    commands: Array
    slow_since_s: Array
    standing: Flags
    window: tuple[Array, Array, Array, NDArray[np.int64]]
    refused: NDArray[np.int64]
    ranged_s: Array


@final
@dataclass(frozen=True, slots=True)
class Localiser:
    """The filter of a site and a wheelbase; all of its functions are pure.

    Order of use: `begin`, then for each message in the order of its instant `reported` (speed and
    steering, about 30 Hz) or `ranged` (one beacon); who is LOST begins anew. Instants are of one
    clock, those at which what was measured held. The car must stand while it is placed, and drive
    some metres until its heading is known.
    """

    site: Site
    predict: Callable[..., tuple[Array, ...]]
    report_speed: Callable[..., tuple[Array, ...]]
    report_steering: Callable[..., tuple[Array, ...]]
    range_update: Callable[..., tuple[Array, ...]]
    locate: Callable[..., tuple[Array, ...]]
    collapse: Callable[..., tuple[Array, ...]]

    @classmethod
    def of(cls, site: Site, functions: FilterFunctions) -> Localiser:
        """The filter with these functions: `filter_functions` of the site, or what a compiler made
        of them (`casadi.external`)."""
        return cls(site, *(lanes(function) for function in functions.all()))

    def begin(self, *, at_s: float, cars: int) -> Localisation:
        """Nothing is known of any of the cars."""
        n = cars
        none = Belief(np.zeros((n, _SIZE)), np.tile(np.eye(_SIZE), (n, 1, 1)))
        window = (np.zeros((n, WINDOW, 3)), np.ones((n, WINDOW)), np.zeros((n, WINDOW)),
                  np.zeros(n, dtype=np.int64))  # fmt: skip
        return Localisation(
            stamp_s=at_s, belief=none, hypotheses=_repeated(none), logs=np.zeros((n, HYPOTHESES)),
            placed=np.zeros(n, dtype=bool), aligned=np.zeros(n, dtype=bool),
            commands=np.zeros((n, 2)), slow_since_s=np.full(n, np.inf),
            standing=np.zeros(n, dtype=bool), window=window,
            refused=np.zeros(n, dtype=np.int64), ranged_s=np.full(n, -np.inf),
        )  # fmt: skip

    def reported(
        self, known: Localisation, *, at_s: float, speed_mps: Array, steering_rad: Array,
        commands: Array,
    ) -> Localisation:  # fmt: skip
        """After reports of speed and steering (n each).

        commands (n, 2): the acceleration and steering rate in force from now on; zeros where they
        are not known, and then `site.motion` must allow for what the driver does.
        """
        known = self.moved_on(known, at_s=at_s)
        slow = np.abs(speed_mps) < self.site.reports.standing_mps
        since = np.where(slow, np.minimum(known.slow_since_s, at_s), np.inf)
        standing = (at_s - since >= self.site.reports.standing_s) & (commands[:, 0] <= 0.0)
        known = dataclasses.replace(
            known, slow_since_s=since, standing=standing, commands=np.array(commands, dtype=float)
        )

        def fused(belief: Belief, times: int) -> Belief:
            learning = np.repeat(self._learning(known), times, axis=0)
            for update, value in ((self.report_speed, speed_mps),
                                  (self.report_steering, steering_rad)):  # fmt: skip
                found = update(belief.mean, belief.covariance, np.repeat(value, times), learning)
                belief = Belief(*found)
            return belief

        return self._aligned(_with_each(known, fused))

    def ranged(
        self, known: Localisation, *, at_s: float, beacon: int, range_m: Array, received: Flags
    ) -> Localisation:
        """After ranges (n) to one of the site's beacons; `received` says which cars got theirs."""
        known = self.moved_on(known, at_s=at_s)
        n, place = len(range_m), self.site.beacons[beacon]
        at = np.tile([place.x_m, place.y_m, place.height_m], (n, 1))
        value = np.where(received, range_m, 1.0)
        learning, logs = self._learning(known), known.logs
        many, hypotheses, likely = HYPOTHESES, known.hypotheses, np.ones(n, dtype=bool)
        if hypotheses is not None:
            found = self.range_update(
                hypotheses.mean, hypotheses.covariance,
                *(np.repeat(a, many, axis=0) for a in (value, at, learning)),
            )  # fmt: skip
            hypotheses = _where(np.repeat(received, many), Belief(*found[:2]), hypotheses)
            likely = found[3].reshape(n, many)[np.arange(n), np.argmax(logs, axis=1)] > 0.5
            logs = logs + np.where(received[:, None], found[4].reshape(n, many), 0.0)
        belief = known.belief
        found = self.range_update(belief.mean, belief.covariance, value, at, learning)
        accepted = np.where(known.aligned, found[3][:, 0] > 0.5, likely)
        known = dataclasses.replace(
            known, belief=_where(received, Belief(*found[:2]), belief), hypotheses=hypotheses,
            logs=logs,
            refused=np.where(received, np.where(accepted, 0, known.refused + 1), known.refused),
            ranged_s=np.where(received & accepted, at_s, known.ranged_s),
        )  # fmt: skip
        return self._placed(known, (at, value, received.astype(float)))

    def moved_on(self, known: Localisation, *, at_s: float) -> Localisation:
        """The same at a later instant, without any news; InputError for an earlier one."""
        if not at_s >= known.stamp_s:
            raise InputError(
                f"at_s: expected an instant not before {known.stamp_s!r} s, up to which messages "
                f"are used, got {at_s!r}; sort them by their instants"
            )
        span = at_s - known.stamp_s
        if span == 0.0:
            return known
        count = math.ceil(span / _STEP_S)

        def later(belief: Belief, times: int) -> Belief:
            commands = np.repeat(known.commands, times, axis=0)
            standing = np.repeat(known.standing.astype(float), times)
            step = np.full(len(standing), span / count)
            for _ in range(count):
                found = self.predict(belief.mean, belief.covariance, commands, step, standing)
                belief = Belief(*found)
            return belief

        return dataclasses.replace(_with_each(known, later), stamp_s=at_s)

    def status(self, known: Localisation, car: int = 0, *, now_s: float | None = None) -> Status:
        """What is known of one car; at now_s, or at its stamp."""
        limits = self.site.limits
        if not known.placed[car]:
            return Status.UNPLACED
        age_s = (known.stamp_s if now_s is None else now_s) - known.ranged_s[car]
        if known.refused[car] >= limits.lost_after or age_s > limits.range_age_s:
            return Status.LOST
        spread = known.belief.covariance[car, _HEADING, _HEADING]
        sure = known.aligned[car] and spread <= limits.heading_rad**2
        return Status.VALID if sure else Status.HEADING_INVALID

    def _learning(self, known: Localisation) -> Array:
        """Which states a measurement may teach (n, 7).

        At a standstill: neither heading, scale nor zero, and no coordinate that is surer than
        still_m already, for errors of ranges between standing antennas need not be independent.
        """
        learning = np.where(known.standing[:, None], _MOTION_ONLY, np.ones(_SIZE))
        deviation2 = np.stack([known.belief.covariance[:, k, k] for k in (0, 1)], axis=1)
        sure = (known.standing & known.aligned)[:, None] & (
            deviation2 < self.site.limits.still_m**2
        )
        learning[:, :2] = np.where(sure, 0.0, learning[:, :2])
        return learning

    def _placed(self, known: Localisation, entry: tuple[Array, Array, Array]) -> Localisation:
        """Put one more range of unplaced standing cars into their windows; place who has enough."""
        if known.placed.all():
            return known
        filling = known.standing & ~known.placed
        kept = [
            np.concatenate([old[:, 1:], new[:, None]], axis=1)
            for old, new in zip(known.window[:3], entry, strict=True)
        ]
        count = np.where(filling, known.window[3] + 1, 0)
        known = dataclasses.replace(known, window=(kept[0], kept[1], kept[2], count))
        full = filling & (count >= WINDOW)
        if not full.any():
            return known
        place, covariance = self.locate(*kept)
        sure = full & (np.trace(covariance, axis1=1, axis2=2) <= _PLACED_M**2)
        assert known.hypotheses is not None, "kept until all are aligned"
        spread = Belief(*spread_headings(self.site, place, covariance))
        return dataclasses.replace(
            known, placed=known.placed | sure,
            hypotheses=_where(np.repeat(sure, HYPOTHESES), spread, known.hypotheses),
            logs=np.where(sure[:, None], 0.0, known.logs),
            refused=np.where(sure, 0, known.refused),
            ranged_s=np.where(sure, known.stamp_s, known.ranged_s),
        )  # fmt: skip

    def _aligned(self, known: Localisation) -> Localisation:
        """Join the hypotheses of those whose heading has become sure; drop them when all are."""
        hypotheses = known.hypotheses
        if hypotheses is None or not (known.placed & ~known.standing).any():
            return known
        n = len(known.placed)
        joined = Belief(*self.collapse(
            hypotheses.mean.reshape(n, -1), hypotheses.covariance.reshape(n, -1), known.logs
        ))  # fmt: skip
        sure = joined.covariance[:, _HEADING, _HEADING] <= self.site.limits.heading_rad**2
        newly = known.placed & ~known.standing & ~known.aligned & sure
        aligned = known.aligned | newly
        return dataclasses.replace(
            known, belief=_where(newly, joined, known.belief), aligned=aligned,
            hypotheses=None if aligned.all() else hypotheses,
        )  # fmt: skip


def _repeated(belief: Belief) -> Belief:
    return Belief(*(np.repeat(a, HYPOTHESES, axis=0) for a in (belief.mean, belief.covariance)))


def _where(chosen: Flags, new: Belief, old: Belief) -> Belief:
    return Belief(
        np.where(chosen[:, None], new.mean, old.mean),
        np.where(chosen[:, None, None], new.covariance, old.covariance),
    )


def _with_each(known: Localisation, change: Callable[[Belief, int], Belief]) -> Localisation:
    """Beliefs and hypotheses changed; `change` is told how many there are of each car."""
    hypotheses = known.hypotheses
    return dataclasses.replace(
        known,
        belief=change(known.belief, 1),
        hypotheses=None if hypotheses is None else change(hypotheses, HYPOTHESES),
    )
