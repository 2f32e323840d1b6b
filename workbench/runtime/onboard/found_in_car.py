"""What the vehicle's own reports say about who drives it and in which state it is. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from workbench.runtime.floats import float_mode_fault
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.following import reported
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.limits import FaultLimits
from workbench.runtime.onboard.report_names import Place
from workbench.runtime.onboard.states import COMMANDING, Standing, State


def found_in_mode(
    intake: Intake, limits: FaultLimits, now_us: int, standing: Standing
) -> Iterator[Found]:
    """NOT_ENABLED, NOT_FORWARD and DRIVER_OVERRIDE while the car is commanded.

    While ARMED an override is being cleared and the vehicle is being enabled, so that neither bit
    counts; the time for it does, and the driver's feet do.
    """
    if standing.state not in COMMANDING:
        return
    names, arming = intake.names, standing.state is State.ARMED
    yield from _driver(intake, limits)
    if not arming:
        for place in names.overridden:
            if reported(intake, place):
                yield _said(Fault.DRIVER_OVERRIDE, place, intake)
        for place in names.enabled:
            if not reported(intake, place):
                yield _said(Fault.NOT_ENABLED, place, intake)
        if reported(intake, names.unheard):
            yield _said(Fault.NOT_ENABLED, names.unheard, intake)
    elif now_us - standing.since_us > limits.enable_us:
        since_us = standing.since_us + limits.enable_us
        yield Found(Fault.NOT_ENABLED, "the vehicle does not enable", since_us)
    yield from _vehicle(intake)


def reasons_not_to_arm(
    intake: Intake, limits: FaultLimits, now_us: int, *, maker: int | None
) -> Iterator[Found]:
    """What must not be when the operator arms, besides all faults that are found anyway.

    maker: the code expected, None for any; it must have been reported where the protocol can.
    """
    identity = intake.names.identity
    if maker is not None and identity is not None and identity.message not in intake.reports:
        yield Found(Fault.WRONG_VEHICLE, f"no {identity.message} yet", 0)
    yield from _driver(intake, limits)
    yield from _vehicle(intake)
    names = intake.names
    enabled = [place for place in names.enabled if reported(intake, place)]
    for place in enabled[:1]:
        found = _said(Fault.NOT_ENABLED, place, intake)
        yield Found(found.fault, f"somebody else has enabled it ({found.detail})", found.since_us)
    if not stands(intake, limits):
        value = reported(intake, names.speed)
        yield Found(Fault.NOT_OBSERVED, f"the car does not stand: {value} m/s", now_us)


def stands(intake: Intake, limits: FaultLimits) -> bool:
    """Whether the car is reported to stand; False where nothing is."""
    value = reported(intake, intake.names.speed)
    return value is not None and abs(value) <= limits.stands_mps


def enabled_since(intake: Intake, since_us: int) -> bool:
    """Whether every enable flag came, set, after an instant."""
    for place in intake.names.enabled:
        report = intake.reports.get(place.message)
        if report is None or report.at_us <= since_us or not report.values[place.signal]:
            return False
    return True


def found_in_setting(
    intake: Intake, *, maker: int | None, signed: bool, now_us: int
) -> Iterator[Found]:
    """WRONG_VEHICLE, BUNDLE and FLOAT_MODE. maker: the code expected, None for any."""
    identity = intake.names.identity
    if identity is not None and maker is not None:
        value = reported(intake, identity)
        if value is not None and int(value) != maker:
            detail = f"maker 0x{int(value):06X}, expected 0x{maker:06X}"
            yield Found(Fault.WRONG_VEHICLE, detail, intake.reports[identity.message].at_us)
    if not signed:
        yield Found(Fault.BUNDLE, "no signature was verified", 0)
    fault = float_mode_fault()
    if fault is not None:
        yield Found(Fault.FLOAT_MODE, fault, now_us)


def _driver(intake: Intake, limits: FaultLimits) -> Iterator[Found]:
    for place in (intake.names.accelerator.manual, intake.names.brake.manual):
        value = reported(intake, place)
        if value is not None and value > limits.pedal:
            detail = f"{place.message}.{place.signal} is {value:.3f}"
            yield Found(Fault.DRIVER_OVERRIDE, detail, intake.reports[place.message].at_us)


def _vehicle(intake: Intake) -> Iterator[Found]:
    """What the vehicle says of itself: gear, faults, emergency stop."""
    names = intake.names
    gear = reported(intake, names.gear.output)
    if gear is not None and int(gear) != names.forward:
        yield _said(Fault.NOT_FORWARD, names.gear.output, intake)
    stopped = () if names.stopped is None else (names.stopped,)
    for place in (*names.faulty, *stopped):
        if reported(intake, place):
            yield _said(Fault.NOT_ENABLED, place, intake)


def _said(fault: Fault, place: Place, intake: Intake) -> Found:
    report = intake.reports.get(place.message)
    if report is None:
        return Found(fault, f"{place.message} has not come", 0)
    detail = f"{place.message}.{place.signal} is {report.values[place.signal]:g}"
    return Found(fault, detail, report.at_us)
