"""Who is in a scenario: parts that make new people for each run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack
from workbench.models.spline_path import SplinePath
from workbench.runtime import MotionLimits
from workbench.simulation.frames import Point
from workbench.simulation.walkers.field_walkers import Errand, FieldCrowd, Ground
from workbench.simulation.walkers.moving import Who, body_radius_m
from workbench.simulation.walkers.pedestrian import Pedestrian
from workbench.simulation.walkers.pursuing import Chase, Pursuer
from workbench.simulation.walkers.recorded import Recorded
from workbench.simulation.walkers.scripted import Script, Scripted, group
from workbench.simulation.walkers.wandering import Wanderer


class Part(Protocol):
    """Some of the people of a scenario."""

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]
    ) -> Sequence[Pedestrian]:
        """New ones for a run. path: the car's; before: those of the parts before."""


@final
@dataclass(frozen=True, slots=True)
class Company:
    """A `Cast` of parts, in order. Raises InputError when two people of a run share a name."""

    parts: tuple[Part, ...]

    def people(self, seed: int, path: SplinePath) -> tuple[Pedestrian, ...]:
        """As `Cast` says."""
        found: tuple[Pedestrian, ...] = ()
        for part in self.parts:
            found = (*found, *part.people(seed, path, found))
        return found


@final
@dataclass(frozen=True, slots=True)
class Told:
    """Scripted people: one, or with offsets (m) one per offset."""

    who: Who
    script: Script
    offsets: tuple[Point, ...] = ()

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]  # noqa: ARG002
    ) -> Sequence[Pedestrian]:  # fmt: skip
        """As `Part` says."""
        if self.offsets:
            return group(self.who, self.script, self.offsets)
        return (Scripted(self.who, self.script),)


@final
@dataclass(frozen=True, slots=True)
class InField:
    """People of a potential field, who keep away from all people of the parts before too."""

    errands: tuple[Errand, ...]
    ground: Ground

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]  # noqa: ARG002
    ) -> Sequence[Pedestrian]:  # fmt: skip
        """As `Part` says."""
        return FieldCrowd(self.errands, self.ground, before, seed=seed).people


@final
@dataclass(frozen=True, slots=True)
class FromRecording:
    """Recorded people; tracks: in the scene's plane and time; radius_m: None for their kind's."""

    tracks: tuple[PersonTrack, ...]
    radius_m: float | None = None

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]  # noqa: ARG002
    ) -> Sequence[Pedestrian]:  # fmt: skip
        """As `Part` says."""
        return tuple(Recorded(self._who(track), track) for track in self.tracks)

    def _who(self, track: PersonTrack) -> Who:
        radius_m = body_radius_m(track.kind) if self.radius_m is None else self.radius_m
        return Who(track.agent, track.kind, radius_m)


@final
@dataclass(frozen=True, slots=True)
class Chasing:
    """Somebody who wants to be hit."""

    who: Who
    chase: Chase

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]  # noqa: ARG002
    ) -> Sequence[Pedestrian]:  # fmt: skip
        """As `Part` says."""
        return (Pursuer(self.who, self.chase, path),)


@final
@dataclass(frozen=True, slots=True)
class ByChance:
    """Somebody who does anything; start: place (m) and velocity (m/s); hold_s as `Wanderer`."""

    who: Who
    start: tuple[Point, Point]
    limits: MotionLimits
    hold_s: tuple[float, float]

    def people(
        self, seed: int, path: SplinePath, before: Sequence[Pedestrian]  # noqa: ARG002
    ) -> Sequence[Pedestrian]:  # fmt: skip
        """As `Part` says."""
        wanderer = Wanderer(self.who, self.start, limits=self.limits, hold_s=self.hold_s, seed=seed)
        return (wanderer,)


def checked(company: Company, path: SplinePath) -> Company:
    """The company, once its people have been made: all numbers are in order and every name is
    given once. Raises InputError."""
    names: set[str] = set()
    for who in _names(company):
        if who in names:
            raise InputError(f"person {who!r} stands twice; give each a name of their own")
        names.add(who)
    company.people(0, path)
    return company


def _names(company: Company) -> list[str]:
    found: list[str] = []
    for part in company.parts:
        match part:
            case Told(who=who, offsets=offsets) if offsets:
                found += [f"{who.name} {k}" for k in range(1, len(offsets) + 1)]
            case Told(who=who) | Chasing(who=who) | ByChance(who=who):
                found.append(who.name)
            case InField(errands=errands):
                found += [errand.who.name for errand in errands]
            case FromRecording(tracks=tracks):
                found += [track.agent for track in tracks]
    return found
