"""Whether the vehicle does what it was told: commands against reports, brakes against bounds."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, final

from workbench.runtime.onboard.actuation import Outputs
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.limits import FaultLimits
from workbench.runtime.onboard.report_names import Place, SystemPlaces
from workbench.runtime.onboard.times import seconds
from workbench.runtime.policies import BrakeBounds

MOST_SENT: Final = 32
_FORGET_S: Final = 1.0
"""Rates that are a little wrong add up; what the wheel stayed behind fades within this time."""


def reported(intake: Intake, place: Place) -> float | None:
    """The last accepted value of a signal, or None before the first."""
    report = intake.reports.get(place.message)
    return None if report is None else report.values[place.signal]


@final
@dataclass(frozen=True, slots=True)
class Following:
    """What was sent in the last second, and how the vehicle has followed; each method returns the
    next value.

    sent: instant and outputs of each turn since commands go out; apart_us: since when the output of
    a system has been too far from its command; wheel: instant and angle of the last look at the
    steering wheel; behind_rad: how far it has stayed behind the rates commanded since, fading: its
    target lies ahead of it as long as it turns, so that the distance to it says nothing;
    acceleration_mps2: what was commanded last; pushed_mps: what commands add up to at pushed_us
    since the speed report last changed; braking: since when BRAKE is sent, and the fastest that
    the car can have been then (m/s).
    """

    sent: tuple[tuple[int, Outputs], ...] = ()
    apart_us: Mapping[str, int] = field(default_factory=dict)
    wheel: tuple[int, float] | None = None
    behind_rad: float = 0.0
    acceleration_mps2: float = 0.0
    pushed_mps: float = 0.0
    pushed_us: int = 0
    braking: tuple[int, float] | None = None

    def silent(self) -> Following:
        """Nothing is commanded."""
        return Following()

    def commanding(
        self,
        at_us: int,
        outputs: Outputs,
        *,
        acceleration_mps2: float,
        brakes_from_mps: float | None,
    ) -> Following:
        """One turn's commands. brakes_from_mps: the speed now where BRAKE is sent, else None."""
        braking = None
        if brakes_from_mps is not None:
            braking = (at_us, brakes_from_mps) if self.braking is None else self.braking
        return dataclasses.replace(
            self,
            sent=(*self.sent, (at_us, outputs))[-MOST_SENT:],
            acceleration_mps2=acceleration_mps2,
            pushed_mps=self._pushed_mps(at_us),
            pushed_us=at_us,
            braking=braking,
        )

    def compared(self, intake: Intake, limits: FaultLimits, now_us: int) -> Following:
        """With what has been reported until now."""
        wheel = reported(intake, intake.names.steering.output)
        behind_rad = 0.0 if wheel is None else self._behind_rad(wheel, now_us)
        errors = dict(_errors(intake))
        if "steering" in errors:
            errors["steering"] = abs(behind_rad), errors["steering"][1]
        apart = {
            name: self.apart_us.get(name, at_us)
            for name, (error, at_us) in errors.items()
            if error > (limits.wheel_error_rad if name == "steering" else limits.pedal_error)
        }
        speed = intake.reports.get(intake.names.speed.message)
        pushed_mps = self._pushed_mps(now_us)
        if speed is None or speed.same_since_us == speed.at_us:
            since_us = now_us if speed is None else max(speed.at_us, self.pushed_us)
            pushed_mps = self.acceleration_mps2 * seconds(max(now_us - since_us, 0))
        return dataclasses.replace(
            self,
            apart_us=apart,
            wheel=None if wheel is None else (now_us, wheel),
            behind_rad=behind_rad,
            pushed_mps=pushed_mps,
            pushed_us=now_us,
        )

    def _pushed_mps(self, now_us: int) -> float:
        """With the last command until now."""
        if not self.sent:
            return 0.0
        return self.pushed_mps + self.acceleration_mps2 * seconds(max(now_us - self.pushed_us, 0))

    def _behind_rad(self, wheel_rad: float, now_us: int) -> float:
        """With what it should have turned since the last look, and what it has."""
        if self.wheel is None or not self.sent:
            return 0.0
        then_us, from_rad = self.wheel
        told, span_s = self.sent[-1][1], seconds(max(now_us - then_us, 0))
        most_rad = told.wheel_rate_radps * span_s
        due_rad = min(max(told.wheel_rad - from_rad, -most_rad), most_rad)
        kept = max(1.0 - span_s / _FORGET_S, 0.0)
        return kept * self.behind_rad + due_rad - (wheel_rad - from_rad)

    def found(
        self,
        intake: Intake,
        limits: FaultLimits,
        now_us: int,
        *,
        brake: BrakeBounds,
        error_mps: float,
    ) -> Iterator[Found]:
        """NOT_FOLLOWING, FROZEN and WEAK_BRAKE; brake: what BRAKE does at least; error_mps: of the
        speed report."""
        if not self.sent:
            return
        yield from self._echoed(intake, limits, now_us)
        for name, since_us in self.apart_us.items():
            if now_us - since_us > limits.follow_us:
                detail = f"{name}: its output does not reach its command"
                yield Found(Fault.NOT_FOLLOWING, detail, since_us + limits.follow_us)
        yield from self._frozen(intake, limits, now_us)
        yield from self._weak(intake, limits, brake=brake, error_mps=error_mps)

    def _echoed(self, intake: Intake, limits: FaultLimits, now_us: int) -> Iterator[Found]:
        if now_us - self.sent[0][0] <= limits.echo_us:
            return
        recent = [out for at_us, out in self.sent[:-1] if now_us - at_us <= limits.echo_us]
        recent.append(self.sent[-1][1])
        for name, places in _systems(intake).items():
            value = reported(intake, places.commanded)
            told = [_told(out, name) for out in recent]
            if (
                value is not None
                and not min(told) - limits.count <= value <= max(told) + limits.count
            ):
                detail = (
                    f"{name}: commanded {min(told):.3f} to {max(told):.3f}, reported {value:.3f}"
                )
                yield Found(Fault.NOT_FOLLOWING, detail, now_us)

    def _frozen(self, intake: Intake, limits: FaultLimits, now_us: int) -> Iterator[Found]:
        names = intake.names
        speed = intake.reports.get(names.speed.message)
        wheel = intake.reports.get(names.steering.output.message)
        if speed is not None and now_us - speed.same_since_us > limits.frozen_us:
            value = speed.values[names.speed.signal]
            # A standing car that is braked keeps its speed.
            moves = self.pushed_mps > 0.0 or value > limits.stands_mps
            if moves and abs(self.pushed_mps) > limits.frozen_mps:
                detail = f"speed stays {value} m/s, {self.pushed_mps:.2f} m/s were commanded"
                yield Found(Fault.FROZEN, detail, now_us)
        if wheel is not None and "steering" in self.apart_us:
            since_us = max(self.apart_us["steering"], wheel.same_since_us)
            if now_us - since_us > limits.frozen_us:
                detail = "the steering's report stays the same"
                yield Found(Fault.FROZEN, detail, since_us + limits.frozen_us)

    def _weak(
        self, intake: Intake, limits: FaultLimits, *, brake: BrakeBounds, error_mps: float
    ) -> Iterator[Found]:
        report = intake.reports.get(intake.names.speed.message)
        if self.braking is None or report is None:
            return
        since_us, from_mps = self.braking
        braked_s = seconds(report.at_us - since_us) - brake.delay_s - brake.build_up_s
        # A report is up to a period old when it comes.
        braked_s -= seconds(limits.report_period_us)
        most_mps = from_mps - brake.deceleration_min_mps2 * max(braked_s, 0.0)
        value = report.values[intake.names.speed.signal]
        if value - error_mps > max(most_mps, limits.stands_mps):
            detail = f"{value:.2f} m/s, {max(most_mps, 0.0):.2f} m/s at most were expected"
            yield Found(Fault.WEAK_BRAKE, detail, report.at_us)


def _systems(intake: Intake) -> Mapping[str, SystemPlaces]:
    names = intake.names
    return {"accelerator": names.accelerator, "brake": names.brake, "steering": names.steering}


def _errors(intake: Intake) -> Mapping[str, tuple[float, int]]:
    """How far each system's output is from what the vehicle says was commanded, and when the last
    report came that says so."""
    errors = {}
    for name, places in _systems(intake).items():
        commanded, output = reported(intake, places.commanded), reported(intake, places.output)
        if commanded is not None and output is not None:
            messages = (places.commanded.message, places.output.message)
            at_us = max(intake.reports[message].at_us for message in messages)
            errors[name] = abs(output - commanded), at_us
    return errors


def _told(outputs: Outputs, name: str) -> float:
    told = {
        "accelerator": outputs.accelerator,
        "brake": outputs.brake,
        "steering": outputs.wheel_rad,
    }
    return told[name]
