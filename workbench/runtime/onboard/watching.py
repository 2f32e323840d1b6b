"""Everything that is received, and what one turn makes of it: observation, reading and faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.contents import Manifest
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.counting import NEVER, Count
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.following import Following, reported
from workbench.runtime.onboard.found_in_car import found_in_mode, found_in_setting, stands
from workbench.runtime.onboard.found_in_intents import found_in_intents
from workbench.runtime.onboard.found_on_bus import found_in_reports, found_in_sets, found_on_bus
from workbench.runtime.onboard.gate import Upstream
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.law_reading import LawReading, middle
from workbench.runtime.onboard.observing import Integrals, NotObserved, Unobserved, observe
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.pid import Reading
from workbench.runtime.onboard.plausibility import Agreement
from workbench.runtime.onboard.states import Mode, Standing, State
from workbench.runtime.onboard.times import seconds
from workbench.runtime.path import PathTable
from workbench.runtime.projection import NoProjection, PathPose
from workbench.runtime.protocols import Decoded, NoSet, decode, load_protocol

_UNOBSERVED: Final = {
    Unobserved.CLOCK: Fault.CLOCK_BACKWARDS,
    Unobserved.LOCALISATION: Fault.LOCALISATION_LOST,
    Unobserved.PEOPLE: Fault.PEOPLE_LOST,
    Unobserved.OVER_CAPACITY: Fault.OVER_CAPACITY,
    Unobserved.REPORT: Fault.STALE_REPORT,
    Unobserved.STEERING_RANGE: Fault.OUT_OF_RANGE,
    Unobserved.CONTRADICTION: Fault.NOT_OBSERVED,
}


@final
@dataclass(frozen=True, slots=True)
class Sight:
    """What one turn sees. observation, reading: None where there is none; station_m: about where on
    the path; read_back_rad: the steering wheel's report, NaN without; people_set: number of the set
    in the observation; found: each fault once."""

    observation: Observation | None
    reading: Reading | None
    station_m: float | None
    read_back_rad: float
    people_set: int
    found: tuple[Found, ...]


@final
class Watch:
    """Takes frames, and looks once per turn; never raises in `receive`. One thread.

    A speed or steering report that the vehicle cannot have (outside its range, or changed faster
    than it can) is counted and goes no further.
    """

    def __init__(
        self, manifest: Manifest, path: PathTable, settings: OnboardSettings, *, mode: Mode
    ) -> None:
        dbw, sensors = settings.drive_by_wire, settings.sensors
        vehicle = load_protocol(dbw.protocol)
        self.intake = Intake(vehicle, load_protocol("workbench"), stamps=sensors.stamps)
        self.following = Following()
        self.upstream = Upstream(dbw) if mode is Mode.GATE else None
        self._manifest, self._path, self._settings, self._mode = manifest, path, settings, mode
        self._station_m = settings.start_station_m
        self._impossible: dict[int, tuple[str, Count]] = {}
        limits = settings.limits
        self._agreement = Agreement()
        self._law_reading = LawReading(middle(sensors.wheelbase_m), settings.reading)
        self._read_us = 0
        names = self.intake.names
        speed, wheel = names.speed, names.steering.output
        reach = dbw.steering.wheel_limit_rad + limits.wheel_step_rad
        self._bounds = {
            vehicle.by_name[speed.message].frame_id: (
                speed.signal, limits.speed_mps, limits.accel_mps2, limits.speed_step_mps,
            ),
            vehicle.by_name[wheel.message].frame_id: (
                wheel.signal, (-reach, reach), limits.wheel_rate_radps, limits.wheel_step_rad,
            ),
        }  # fmt: skip

    def receive(self, identifier: int, data: bytes, at_us: int) -> None:
        """One frame from the vehicle's side."""
        fault = self._impossible_value(identifier, data, at_us)
        if fault is None:
            if identifier in self._impossible:
                self._impossible[identifier] = ("", self._impossible[identifier][1].ended())
            self.intake.receive(identifier, data, at_us)
            return
        count = self._impossible[identifier][1] if identifier in self._impossible else NEVER
        self._impossible[identifier] = (fault, count.more(at_us))

    def look(self, at_us: int, standing: Standing, integrals: Integrals) -> Sight:
        """What is seen at this turn."""
        intake, settings = self.intake, self._settings
        self.following = self.following.compared(intake, settings.limits, at_us)
        self._agreement = self._agreement.with_latest(intake, settings.sensors, settings.limits)
        seen = observe(intake, now_us=at_us, integrals=integrals, settings=settings.sensors)
        observation = None if isinstance(seen, NotObserved) else seen
        pose = None if observation is None else self._projected(observation)
        where = pose if isinstance(pose, PathPose) else None
        found = [*self._found(at_us, standing), *self._unseen(seen, pose, at_us)]
        found += found_in_intents(intake, observation, settings, at_us)
        reading = None
        if observation is not None and where is not None:
            found += self._coarse(observation, where, at_us)
            self._station_m = middle(where.station)
            reading = self._reading(observation, where, at_us, standing)
        first = {each.fault: each for each in reversed(found)}
        people = intake.people
        wheel = reported(intake, intake.names.steering.output)
        return Sight(
            observation,
            reading,
            self._station_m,
            math.nan if wheel is None else wheel,
            0 if isinstance(people, NoSet) else people.value.number,
            tuple(first[fault] for fault in Fault if fault in first),
        )

    @property
    def agreed_m(self) -> float:
        """Way over which reports and localisation have agreed."""
        return self._agreement.agreed_m

    def _found(self, at_us: int, standing: Standing) -> Iterator[Found]:
        intake, settings = self.intake, self._settings
        limits = settings.limits
        yield from found_in_reports(intake, limits, at_us)
        yield from found_in_sets(intake, limits, at_us)
        passes = self._mode is Mode.SHADOW
        yield from found_on_bus(intake, limits, at_us, commands_pass=passes)
        yield from found_in_mode(intake, limits, at_us, standing)
        yield from found_in_setting(
            intake, maker=settings.maker, signed=settings.signed, now_us=at_us
        )
        yield from self.following.found(
            intake, limits, at_us, brake=self._manifest.brake,
            error_mps=settings.drive_by_wire.speed_error_mps,
        )  # fmt: skip
        if self._agreement.contradiction is not None:
            yield self._agreement.contradiction
        if self.upstream is not None:
            yield from self.upstream.found(at_us, age_us=limits.report_age_us)
        for fault, count in self._impossible.values():
            if count.in_a_row >= limits.refused_in_a_row:
                yield Found(Fault.OUT_OF_RANGE, fault, count.last_us or 0)

    def _unseen(
        self, seen: Observation | NotObserved, pose: PathPose | NoProjection | None, at_us: int
    ) -> Iterator[Found]:
        if isinstance(seen, NotObserved):
            yield Found(_UNOBSERVED[seen.fault], f"{seen}", at_us)
        elif isinstance(pose, NoProjection):
            yield Found(Fault.NOT_OBSERVED, f"no path coordinates: {pose.reason}", at_us)

    def _coarse(self, seen: Observation, pose: PathPose, at_us: int) -> Iterator[Found]:
        granted = self._settings.reading
        for name, ends, most in (
            ("offset", pose.offset, granted.offset_m),
            ("heading error", pose.heading_error, granted.heading_rad),
            ("speed", seen.speed, granted.speed_mps),
        ):
            error = 0.5 * (ends[1] - ends[0])
            if not error <= most:
                detail = f"{name} is known within {error:.3f}, the proof grants {most:g}"
                yield Found(Fault.COARSE_READING, detail, at_us)

    def _projected(self, seen: Observation) -> PathPose | NoProjection:
        return self._path.project(seen.x, seen.y, seen.heading, near_station_m=self._station_m)

    def _reading(
        self, seen: Observation, pose: PathPose, at_us: int, standing: Standing
    ) -> Reading | None:
        """What the law reads, with the path's curvature there."""
        path = self._path
        place = (middle(pose.station) - path.start_m) / path.spacing_m
        j = min(max(math.floor(place), 0), len(path.curvature_lower) - 1)
        tracks = standing.state is State.TRACKING
        self._law_reading = self._law_reading.seen(
            seen,
            pose,
            0.5 * (path.curvature_lower[j] + path.curvature_upper[j]),
            elapsed_s=seconds(max(at_us - self._read_us, 0)),
            free=not tracks and stands(self.intake, self._settings.limits),
        )
        self._read_us = at_us
        return self._law_reading.reading

    def _impossible_value(self, identifier: int, data: bytes, at_us: int) -> str | None:
        bounds = self._bounds.get(identifier)
        if bounds is None:
            return None
        frame = decode(self.intake.vehicle, identifier, data)
        if not isinstance(frame, Decoded):
            return None
        signal, (low, high), rate, step = bounds
        value = frame.values[signal]
        if not low <= value <= high:
            return f"{frame.message}.{signal}: {value:g}, expected {low:g} to {high:g}"
        before = self.intake.reports.get(frame.message)
        if before is None or at_us < before.at_us:
            return None
        change, most = value - before.values[signal], step + rate * seconds(at_us - before.at_us)
        if abs(change) <= most:
            return None
        return f"{frame.message}.{signal}: changed by {change:g}, at most {most:g} is possible"
