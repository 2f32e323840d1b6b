"""Sensors of a scenario: where the car is and who is around, each with its errors and its losses.

As values, and as frames on the bus.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, final

from workbench.estimation.intents_on_bus import forwarded_frames
from workbench.estimation.people_estimator import PeopleEstimator, Sighting, Wanted
from workbench.estimation.people_guards import ON_FOOT
from workbench.estimation.person_intents import Forwarded
from workbench.runtime.protocols import (
    CAPACITY,
    Localised,
    PeopleSeen,
    PersonKind,
    Refusal,
    SentPerson,
    localisation_frames,
    people_frames,
)
from workbench.simulation.frames import Point
from workbench.simulation.occlusion import hidden, shadow_discs
from workbench.simulation.pacmod2_unit import CanFrame
from workbench.simulation.plants.chassis import Motion
from workbench.simulation.scenarios.scenario import Ghost, Sensing
from workbench.simulation.walkers.pedestrian import PersonNow

LOCALISED_US: Final = 100_000
"""The localiser says ten times a second where the car is."""
RANGED_US: Final = 333_333
"""Its errors change when ranges come, three times a second, and stay the same in between."""
PEOPLE_US: Final = 200_000
CLOCK_US: Final = 7_000_000
"""By so much the sensors' clock is ahead of the monitor's."""
_REMEMBERED_S: Final = 2.0
"""Who is not seen any more is reported from where they were seen last, for so long."""
_GIVEN_UP_S: Final = 1.0
"""And then, as somebody who may be there, for so long: who knew them can let go of them."""
_ASSUMED_TRACK: Final = 60_000
_UNSEEN_MPS: Final = 2.5
_FASTEST_MPS: Final = {PersonKind.ON_FOOT: 2.5, PersonKind.ON_WHEELS: 7.0}
_LARGEST_BODY_M: Final = 0.9
_RIM_M: Final = 4.0
"""People are reported so much farther than is watched: who leaves does not vanish at the rim."""


@final
@dataclass(slots=True)
class _Remembered:
    """A person as measured last, on the scenario's clock."""

    person: SentPerson
    seen_s: float


@final
@dataclass(slots=True)
class Sensors:
    """Measures a scene; errors by chance, uniform within what `Sensing` says.

    estimator: finds out what people want, None where that is not sent. Times of the scenario are in
    s, those of the bus in us; begun_us: the scenario's beginning on the bus.
    """

    sensing: Sensing
    chance: random.Random
    begun_us: int
    estimator: PeopleEstimator | None = None
    wanted: Mapping[str, tuple[Wanted, ...]] = field(default_factory=dict)
    _sets: dict[str, int] = field(default_factory=lambda: {"localisation": 0, "people": 0})
    _tracks: dict[str, int] = field(default_factory=dict)
    _seen: dict[str, _Remembered] = field(default_factory=dict)
    _ranged_us: int = 0
    _errors: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def localised(self, motion: Motion, at_us: int) -> Localised | None:
        """One localisation; None where it is lost."""
        sensing, chance = self.sensing, self.chance
        number = self._next("localisation")
        if at_us >= self._ranged_us:
            self._ranged_us += RANGED_US
            self._errors = (
                *self._off(sensing.position_m),
                chance.uniform(-sensing.heading_rad, sensing.heading_rad),
                chance.uniform(-sensing.speed_mps, sensing.speed_mps),
            )
        dx_m, dy_m, turned, faster_mps = self._errors
        if chance.random() < sensing.dropped or self.lost("localisation", at_us):
            return None
        return Localised(
            number=number,
            stamp_s=_stamp_s(at_us),
            x_m=motion.x_m + dx_m,
            y_m=motion.y_m + dy_m,
            heading_rad=math.remainder(motion.heading + turned, math.tau),
            speed_mps=motion.speed_mps + faster_mps,
            x_radius_m=sensing.position_m,
            y_radius_m=sensing.position_m,
            heading_radius_rad=sensing.heading_rad,
            speed_radius_mps=sensing.speed_mps,
        )

    def people(
        self, people: Iterable[PersonNow], motion: Motion, eye: Point, at_us: int
    ) -> PeopleSeen | None:
        """One set of people; None where it is lost.

        eye: what the sensor looks from; whoever is behind a box is not seen from there.
        """
        number, t_s = self._next("people"), self._scenario_s(at_us)
        self._look(people, motion, eye, t_s)
        if self.lost("people", at_us):
            return None
        found = [*self._reported(t_s), *self._assumed(eye)]
        within = sorted(self._nearby(found, motion), key=lambda each: each[0])
        watched_m = self.sensing.watched_m
        if len(within) > CAPACITY:
            # A set takes no more: it says less far around that everybody is in it.
            watched_m = min(watched_m, max(within[CAPACITY][0], 0.0))
        sent = tuple(each for _, each in within[:CAPACITY])
        return PeopleSeen(number, _stamp_s(at_us), watched_m, sent)

    def wants(self, seen: PeopleSeen, at_us: int) -> dict[int, Forwarded]:
        """What people of this set may want, by track; {} where nobody estimates that."""
        if self.estimator is None:
            return {}
        t_s = self._scenario_s(at_us)
        told = self.estimator.at(t_s).wanted
        self.wanted = {str(self._tracks[name]): wanted for name, wanted in told.items()}
        ways = self.estimator.ways(t_s)
        tracks = {each.track for each in seen.people}
        return {
            track: ways[name]
            for name, track in self._tracks.items()
            if track in tracks and name in ways
        }

    def _look(self, people: Iterable[PersonNow], motion: Motion, eye: Point, t_s: float) -> None:
        """Measure everybody who is in sight and near, and who is falsely detected."""
        for k, ghost in enumerate(self.sensing.ghosts):
            if ghost.from_s <= t_s <= ghost.until_s:
                self._seen[f"ghost {k}"] = _Remembered(self._ghost(k, ghost), t_s)
        for person in people:
            place = (person.x_m, person.y_m)
            away_m = math.dist(place, (motion.x_m, motion.y_m))
            if away_m > self.sensing.watched_m + _RIM_M or hidden(
                place, eye, self.sensing.occluders
            ):
                continue
            measured = self._measured(person)
            self._seen[person.name] = _Remembered(measured, t_s)
            if self.estimator is not None:
                self.estimator.measure(
                    Sighting(person.name, person.kind, t_s, measured.x_m, measured.y_m)
                )

    def _measured(self, person: PersonNow) -> SentPerson:
        sensing = self.sensing
        track = self._tracks.setdefault(person.name, len(self._tracks))
        (dx_m, dy_m), (dvx, dvy) = self._off(sensing.person_m), self._off(sensing.person_mps)
        kind = PersonKind.ON_FOOT if person.kind in ON_FOOT else PersonKind.ON_WHEELS
        return SentPerson(
            track, kind, person.x_m + dx_m, person.y_m + dy_m,
            person.body_radius_m + sensing.person_m, person.vx_mps + dvx, person.vy_mps + dvy,
            sensing.person_mps, 0.0,
        )  # fmt: skip

    def _reported(self, t_s: float) -> list[SentPerson]:
        """Everybody seen within the last seconds, each with the age of what is said of them; for
        some time more somebody assumed in their place, who can do all that they could."""
        known = self._seen.items()
        most_s = _REMEMBERED_S + _GIVEN_UP_S
        self._seen = {name: r for name, r in known if t_s - r.seen_s <= most_s}
        return [
            _aged(each.person, t_s - each.seen_s)
            if t_s - each.seen_s <= _REMEMBERED_S
            else _given_up(each.person, t_s - each.seen_s)
            for each in self._seen.values()
        ]

    def _ghost(self, number: int, ghost: Ghost) -> SentPerson:
        sensing = self.sensing
        track = self._tracks.setdefault(f"ghost {number}", len(self._tracks))
        return SentPerson(
            track, PersonKind.ON_FOOT, ghost.x_m, ghost.y_m, 0.3 + sensing.person_m, 0.0, 0.0,
            sensing.person_mps, 0.0,
        )  # fmt: skip

    def _assumed(self, eye: Point) -> list[SentPerson]:
        """Somebody, on foot or on wheels, at every place where one could step out of a shadow."""
        if not self.sensing.assumes_unseen:
            return []
        discs = [
            disc
            for box in self.sensing.occluders
            for disc in shadow_discs(eye, box, reach_m=self.sensing.watched_m)
        ]
        return [
            SentPerson(
                _ASSUMED_TRACK + k, PersonKind.ASSUMED, x, y, r + _LARGEST_BODY_M, 0.0, 0.0,
                _UNSEEN_MPS, 0.0,
            )
            for k, (x, y, r) in enumerate(discs)
        ]  # fmt: skip

    def _nearby(
        self, people: Iterable[SentPerson], motion: Motion
    ) -> Iterator[tuple[float, SentPerson]]:
        """Those whose disc is near enough to be reported, with its distance from the car."""
        for person in people:
            away_m = math.dist((person.x_m, person.y_m), (motion.x_m, motion.y_m))
            away_m -= person.position_radius_m
            if away_m <= self.sensing.watched_m + _RIM_M:
                yield away_m, person

    def _next(self, what: str) -> int:
        self._sets[what] += 1
        return self._sets[what] % 256

    def lost(self, what: str, at_us: int) -> bool:
        """Whether nothing of a kind is measured at an instant of the bus."""
        t_s = self._scenario_s(at_us)
        return any(
            each.what == what and each.from_s <= t_s < each.until_s
            for each in self.sensing.dropouts
        )

    def _scenario_s(self, at_us: int) -> float:
        return (at_us - self.begun_us) / 1e6

    def _off(self, radius: float) -> Point:
        """Uniform within a disc."""
        size, turn = radius * math.sqrt(self.chance.random()), self.chance.uniform(0.0, math.tau)
        return size * math.cos(turn), size * math.sin(turn)


def _aged(person: SentPerson, age_s: float) -> SentPerson:
    if age_s <= 0.0:
        return person
    x, y, r = person.x_m, person.y_m, person.position_radius_m
    return SentPerson(
        person.track, person.kind, x, y, r, person.x_speed_mps, person.y_speed_mps,
        person.velocity_radius_mps, age_s,
    )  # fmt: skip


def _given_up(person: SentPerson, age_s: float) -> SentPerson:
    """Somebody who may be where this person was, and can be as fast as anybody of their kind."""
    return SentPerson(
        person.track, PersonKind.ASSUMED, person.x_m, person.y_m, person.position_radius_m, 0.0,
        0.0, _FASTEST_MPS[person.kind], age_s,
    )  # fmt: skip


def _stamp_s(at_us: int) -> float:
    return (at_us + CLOCK_US) / 1e6


def place_frames(place: Localised) -> list[CanFrame]:
    """A localisation on the bus."""
    return _sent(localisation_frames(place))


def set_frames(seen: PeopleSeen) -> list[CanFrame]:
    """A set of people on the bus."""
    return _sent(
        people_frames(
            seen.people, number=seen.number, stamp_s=seen.stamp_s,
            watched_radius_m=seen.watched_radius_m,
        )
    )  # fmt: skip


def way_frames(
    seen: PeopleSeen, wants: Mapping[int, Forwarded], *, body_m: float
) -> list[CanFrame]:
    """What they may want on the bus; body_m: as `forwarded_frames`."""
    sent = forwarded_frames(seen, wants, body_m=body_m)
    assert not isinstance(sent, Refusal), sent
    return list(sent.frames)


def _sent(frames: Sequence[CanFrame] | Refusal) -> list[CanFrame]:
    assert not isinstance(frames, Refusal), frames
    return list(frames)
