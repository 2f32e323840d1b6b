"""Where a run gets its people from: straight on from the past of their tracks, or estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

from workbench.estimation.people_estimator import PeopleEstimator, PeopleNow, Sighting
from workbench.runtime import MotionLimits
from workbench.simulation.people import PeopleModel, seen_people
from workbench.simulation.recording import Track


class PeopleSource(Protocol):
    """What a run tells its monitor of people; asked at instants that do not run backwards."""

    @property
    def intent_note(self) -> str:
        """How it is predicted where people go, in a sentence for a report."""

    @property
    def guard_note(self) -> str:
        """What nobody is taken to exceed, as the end of a sentence for a report."""

    def observe(self, t_s: float) -> PeopleNow:
        """Everybody at t_s, from what was measured by then."""
        ...


@final
@dataclass(frozen=True, slots=True)
class StraightPeople:
    """`seen_people`: everybody goes straight on, under limits of speed and acceleration."""

    tracks: Sequence[Track]
    models: PeopleModel
    limits: MotionLimits

    @property
    def intent_note(self) -> str:
        """As `PeopleSource` says."""
        on_foot = self.models.on_foot
        return (
            "People are extrapolated at constant velocity with a growing radius "
            f"({on_foot.provenance} figures); who is not seen for {on_foot.max_age_s:g} s is "
            f"assumed to be there, for {on_foot.gone_age_s:g} s to have left."
        )

    @property
    def guard_note(self) -> str:
        """As `PeopleSource` says."""
        return limits_note(self.models, self.limits)

    def observe(self, t_s: float) -> PeopleNow:
        """As `PeopleSource` says."""
        return PeopleNow(seen_people(self.tracks, t_s, self.models, self.limits))


def limits_note(models: PeopleModel, limits: MotionLimits) -> str:
    """What nobody exceeds under assumed limits, in words."""
    return (
        f"nobody to exceed {limits.speed_mps:g} m/s on foot, "
        f"{models.on_wheels.unseen_speed_mps:g} m/s on wheels or "
        f"{limits.acceleration_mps2:g} m/s^2"
    )


@final
class EstimatedPeople:
    """A `PeopleEstimator` that gets every sample of the tracks when its time has come.

    tracks: what is measured of people, which need not be where they are.
    """

    def __init__(
        self, tracks: Sequence[Track], estimator: PeopleEstimator, *, notes: tuple[str, str]
    ) -> None:
        """notes: `intent_note` and `guard_note`."""
        found = [
            Sighting(track.name, track.kind, sample.t_s, sample.x_m, sample.y_m)
            for track in tracks
            for sample in track.samples
        ]
        self._waiting = sorted(found, key=lambda seen: seen.t_s, reverse=True)
        self._estimator = estimator
        self._notes = notes

    @property
    def intent_note(self) -> str:
        """As `PeopleSource` says."""
        return self._notes[0]

    @property
    def guard_note(self) -> str:
        """As `PeopleSource` says."""
        return self._notes[1]

    def observe(self, t_s: float) -> PeopleNow:
        """As `PeopleSource` says."""
        while self._waiting and self._waiting[-1].t_s <= t_s:
            self._estimator.measure(self._waiting.pop())
        return self._estimator.at(t_s)
