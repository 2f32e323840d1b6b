"""What the frames themselves say: missing, refused, too many, not ours to receive. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from workbench.runtime.onboard.counting import Count, Strike
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.intake import BusError, Intake
from workbench.runtime.onboard.limits import FaultLimits
from workbench.runtime.onboard.set_streams import SetCounts, SetSeen
from workbench.runtime.protocols import Localised, NoSet, PeopleSeen, Reason, SetFault

_SENTINELS: Final = (Reason.ERROR, Reason.NOT_AVAILABLE, Reason.SAID_INVALID)
_DROPPED: Final = (SetFault.OUT_OF_ORDER, SetFault.REPEATED, SetFault.REGRESSED)
_STRIKES: Final = {
    Strike.DUPLICATE: Fault.DUPLICATE,
    Strike.REPLAYED: Fault.REPLAYED,
    Strike.INTEGRITY: Fault.INTEGRITY,
}
_RATE_BACK_US: Final = 500_000
_RATE_SPAN_US: Final = 600_000
_BUSY_BACK_US: Final = 100_000


def found_in_reports(intake: Intake, limits: FaultLimits, now_us: int) -> Iterator[Found]:
    """STALE_REPORT, NOT_AVAILABLE, OUT_OF_RANGE and REPLAYED of each needed report."""
    most = 3 * _RATE_SPAN_US // (2 * limits.report_period_us)
    for name in intake.names.needed:
        report = intake.reports.get(name)
        if report is None:
            yield Found(Fault.STALE_REPORT, f"{name}: none yet", 0)
        elif now_us - report.at_us > limits.report_age_us:
            since_us = report.at_us + limits.report_age_us
            detail = f"{name}: {now_us - report.at_us} us old"
            yield Found(Fault.STALE_REPORT, detail, since_us)
        row, refusal = intake.refusals.get(name), intake.last_refusal.get(name)
        if row is not None and refusal is not None and row.in_a_row:
            if refusal.reason in _SENTINELS:
                yield Found(Fault.NOT_AVAILABLE, f"{refusal}", _last(row))
            if row.in_a_row >= limits.refused_in_a_row:
                detail = f"{row.in_a_row} in a row: {refusal}"
                yield Found(Fault.OUT_OF_RANGE, detail, _last(row))
        rate = intake.arrivals.get(name)
        count = 0 if rate is None else rate.within_us(now_us, back_us=_RATE_BACK_US)
        if count > most:
            detail = f"{name}: {count} frames within 0.6 s, expected at most {most}"
            yield Found(Fault.REPLAYED, detail, now_us)


def found_in_sets(intake: Intake, limits: FaultLimits, now_us: int) -> Iterator[Found]:
    """Everything about the sets of localisation and of people."""
    seen = intake.localisation
    yield from _missing(seen, Fault.LOCALISATION_LOST, limits.localisation_age_us, now_us)
    people = intake.people
    if isinstance(people, NoSet) and people.fault is SetFault.OVER_CAPACITY:
        last = intake.people_counts.faults.get(people.fault)
        yield Found(Fault.OVER_CAPACITY, f"{people}", now_us if last is None else _last(last))
    else:
        yield from _missing(people, Fault.PEOPLE_LOST, limits.people_age_us, now_us)
    for what, counts in (
        ("localisation", intake.localisation_counts),
        ("people", intake.people_counts),
    ):
        yield from _against(what, counts, limits, now_us)


def _missing(
    seen: SetSeen[Localised] | SetSeen[PeopleSeen] | NoSet, fault: Fault, age_us: int, now_us: int
) -> Iterator[Found]:
    if isinstance(seen, NoSet):
        yield Found(fault, f"{seen}", 0)
    elif now_us - seen.stamp_us[0] > age_us:
        detail = f"{now_us - seen.stamp_us[0]} us old, {age_us} us are allowed"
        yield Found(fault, detail, seen.stamp_us[0] + age_us)


def _against(what: str, counts: SetCounts, limits: FaultLimits, now_us: int) -> Iterator[Found]:
    for strike, since_us in counts.strikes.enough_since_us.items():
        yield Found(_STRIKES[strike], f"{what}: {strike.value}, too often", since_us)
    for fault in _DROPPED:
        count = counts.faults.get(fault)
        if count is not None and _recent(count, limits.report_age_us, now_us):
            yield Found(Fault.OUT_OF_ORDER, f"{what}: {fault.value}", _last(count))
    if counts.late.in_a_row:
        yield Found(Fault.LATE, f"{what}: later than it may be", counts.late.row_since_us or 0)
    if counts.jumps.in_a_row:
        yield Found(Fault.CLOCK_JUMP, f"{what}: the sender's clock", _last(counts.jumps))


def found_on_bus(
    intake: Intake, limits: FaultLimits, now_us: int, *, commands_pass: bool
) -> Iterator[Found]:
    """Faults of the bus, of who sends on it, and of how much.

    commands_pass: somebody else commands the vehicle on this bus, as in SHADOW.
    """
    for kind, count in intake.bus_errors.items():
        if kind is BusError.ERROR_FRAME:
            if _recent(count, limits.report_age_us, now_us):
                yield Found(Fault.ERROR_FRAME, kind.value, _last(count))
        elif kind is BusError.LATE:
            if _recent(count, limits.report_age_us, now_us):
                yield Found(Fault.NOT_COVERED, kind.value, _last(count))
        elif _recent(count, limits.recent_us, now_us):
            yield Found(Fault.BUS_ERROR, kind.value, _last(count))
    last_us = 0 if intake.last_us is None else intake.last_us
    if now_us - last_us > limits.report_age_us:
        since_us = last_us + limits.report_age_us
        yield Found(Fault.BUS_SILENT, f"nothing for {now_us - last_us} us", since_us)
    for name, count in intake.spoofed.items():
        ours = name in intake.own.by_name or not commands_pass
        if ours and _recent(count, limits.recent_us, now_us):
            yield Found(Fault.SPOOFED, f"{name} from somebody else", _last(count))
    for name, count in intake.foreign.items():
        if _recent(count, limits.recent_us, now_us):
            yield Found(Fault.WRONG_PROTOCOL, f"a report of {name}", _last(count))
    if _recent(intake.backwards, limits.recent_us, now_us):
        detail = "a frame before the one before it"
        yield Found(Fault.CLOCK_BACKWARDS, detail, _last(intake.backwards))
    yield from _busy(intake, limits, now_us)


def _busy(intake: Intake, limits: FaultLimits, now_us: int) -> Iterator[Found]:
    count = intake.frames.within_us(now_us, back_us=_BUSY_BACK_US)
    if count <= limits.busy_frames:
        return
    yield Found(Fault.BUS_BUSY, f"{count} frames within 0.2 s", now_us)
    for name in intake.names.needed:
        report = intake.reports.get(name)
        waits_us = now_us - (0 if report is None else report.at_us)
        if waits_us > 2 * limits.report_period_us:
            detail = f"{count} frames within 0.2 s, and {name} is {waits_us} us old"
            yield Found(Fault.BUS_FLOOD, detail, now_us - waits_us + 2 * limits.report_period_us)


def _recent(count: Count, within_us: int, now_us: int) -> bool:
    return count.last_us is not None and now_us - count.last_us <= within_us


def _last(count: Count) -> int:
    return 0 if count.last_us is None else count.last_us
