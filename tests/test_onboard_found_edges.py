"""What the bus says is found to its edges: ages to the microsecond, rates to the frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from onboard_intakes import PLACE, intake

from workbench.runtime.onboard.counting import NEVER, Count, FrameRate, Strike, Strikes
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.found_on_bus import found_in_reports, found_in_sets, found_on_bus
from workbench.runtime.onboard.intake import BusError, Intake, Report
from workbench.runtime.onboard.limits import pacmod2_limits
from workbench.runtime.onboard.set_streams import SetCounts, SetSeen
from workbench.runtime.protocols import NoSet, PeopleSeen, Reason, Refusal, SetFault

NOW_US = 5_000_000
LIMITS = pacmod2_limits(localisation_age_us=900_000, people_age_us=600_000)
NEEDED = intake().names.needed
SPEED = "VEHICLE_SPEED_RPT"
NOBODY = PeopleSeen(1, 1.0, 30.0, ())
Told = list[tuple[Fault, int]]


def told(found: Iterable[Found]) -> Told:
    return [(each.fault, each.since_us) for each in found]


def details(found: Iterable[Found]) -> list[str]:
    return [each.detail for each in found]


def fresh(now_us: int = NOW_US, *, reports_us: int | None = None) -> Intake:
    """One that heard every needed report, and both sets, just now."""
    found = intake()
    at_us = now_us if reports_us is None else reports_us
    found.reports.update({name: Report({}, at_us, b"", at_us) for name in NEEDED})
    found.last_us = now_us
    found._localisation.seen = SetSeen(PLACE, now_us, now_us, (now_us, now_us), 0)
    found._people.seen = SetSeen(NOBODY, now_us, now_us, (now_us, now_us), 0)
    return found


def once(at_us: int) -> Count:
    return NEVER.more(at_us)


def rate(frames: int, at_us: int) -> FrameRate:
    counted = FrameRate()
    for _ in range(frames):
        counted.take(at_us)
    return counted


def test_reports_are_stale_after_their_age_and_since_then() -> None:
    found = fresh(1_000_000)
    assert told(found_in_reports(found, LIMITS, 1_100_000)) == []
    stale = list(found_in_reports(found, LIMITS, 1_100_001))
    assert told(stale) == [(Fault.STALE_REPORT, 1_100_000)] * len(NEEDED)
    assert details(stale) == [f"{name}: 100001 us old" for name in NEEDED]


def test_reports_that_never_came_are_stale_since_the_start() -> None:
    stale = list(found_in_reports(intake(), LIMITS, 5))
    assert told(stale) == [(Fault.STALE_REPORT, 0)] * len(NEEDED)
    assert details(stale) == [f"{name}: none yet" for name in NEEDED]


@pytest.mark.parametrize("reason", Reason)
@pytest.mark.parametrize("in_a_row", range(5))
def test_a_sentinel_is_found_at_once_and_every_refusal_at_the_third(
    reason: Reason, in_a_row: int
) -> None:
    found, refusal = fresh(), Refusal(reason, 1, SPEED, None, "")
    row = Count(9, in_a_row, 1 if in_a_row else None, 4_990_000)
    found.refusals[SPEED], found.last_refusal[SPEED] = row, refusal
    sentinel = reason in (Reason.ERROR, Reason.NOT_AVAILABLE, Reason.SAID_INVALID)
    expected = []
    if sentinel and in_a_row:
        expected.append((Fault.NOT_AVAILABLE, 4_990_000, f"{refusal}"))
    if in_a_row >= LIMITS.refused_in_a_row:
        expected.append((Fault.OUT_OF_RANGE, 4_990_000, f"{in_a_row} in a row: {refusal}"))
    seen = found_in_reports(found, LIMITS, NOW_US)
    assert [(each.fault, each.since_us, each.detail) for each in seen] == expected


@pytest.mark.parametrize(
    ("period_us", "most"),
    [(33_333, 27), (30_000, 30), (20_000, 45), (900_000, 1), (900_001, 0), (2_000_000, 0)],
)
def test_frames_that_come_half_as_often_again_as_they_may_are_replayed(
    period_us: int, most: int
) -> None:
    """Within 0.6 s as many as fit, and half of that, rounded down."""
    limits = replace(LIMITS, report_period_us=period_us)
    for frames in (0, most, most + 1):
        found = fresh()
        if frames:
            found.arrivals[SPEED] = rate(frames, NOW_US)
        seen = list(found_in_reports(found, limits, NOW_US))
        assert told(seen) == [(Fault.REPLAYED, NOW_US)] * (frames > most)
        assert frames <= most or details(seen) == [
            f"{SPEED}: {frames} frames within 0.6 s, expected at most {most}"
        ]


@pytest.mark.parametrize(
    ("at_us", "now_us", "counts"),
    [(500_000, 1_000_000, True), (499_999, 1_000_000, False),
     (500_000, 1_099_999, True), (500_000, 1_100_000, False)],
)  # fmt: skip
def test_frames_count_for_half_a_second_in_tenths(at_us: int, now_us: int, counts: bool) -> None:
    found = fresh(now_us)
    found.arrivals[SPEED] = rate(28, at_us)
    assert told(found_in_reports(found, LIMITS, now_us)) == [(Fault.REPLAYED, now_us)] * counts


def test_sets_are_lost_by_the_earliest_instant_of_their_stamps() -> None:
    found = fresh()
    found._localisation.seen = SetSeen(PLACE, 0, 0, (1_000_000, 1_300_000), 0)
    assert told(found_in_sets(found, LIMITS, 1_900_000)) == []
    lost = list(found_in_sets(found, LIMITS, 1_900_001))
    assert told(lost) == [(Fault.LOCALISATION_LOST, 1_900_000)]
    assert details(lost) == ["900001 us old, 900000 us are allowed"]
    found = fresh()
    found._people.seen = SetSeen(NOBODY, 0, 0, (1_000_000, 1_300_000), 0)
    assert told(found_in_sets(found, LIMITS, 1_600_000)) == []
    assert told(found_in_sets(found, LIMITS, 1_600_001)) == [(Fault.PEOPLE_LOST, 1_600_000)]


def test_sets_that_never_came_are_lost_since_the_start() -> None:
    nothing = f"{NoSet(SetFault.NOTHING_YET)}"
    lost = list(found_in_sets(intake(), LIMITS, NOW_US))
    assert told(lost) == [(Fault.LOCALISATION_LOST, 0), (Fault.PEOPLE_LOST, 0)]
    assert details(lost) == [nothing, nothing]


@pytest.mark.parametrize(
    ("last_us", "fault", "since_us"),
    [(4_990_000, SetFault.OVER_CAPACITY, 4_990_000), (None, SetFault.OVER_CAPACITY, NOW_US),
     (4_990_000, SetFault.TRACK_TWICE, 0)],
)  # fmt: skip
def test_too_many_people_are_no_lost_set(
    last_us: int | None, fault: SetFault, since_us: int
) -> None:
    found = fresh()
    found._people.seen = NoSet(fault)
    if last_us is not None:
        found._people.counts = SetCounts(faults={fault: once(last_us)})
    over = Fault.OVER_CAPACITY if fault is SetFault.OVER_CAPACITY else Fault.PEOPLE_LOST
    assert told(found_in_sets(found, LIMITS, NOW_US)) == [(over, since_us)]


def against(what: str, counts: SetCounts, now_us: int = NOW_US) -> list[Found]:
    found = fresh(now_us)
    (found._localisation if what == "localisation" else found._people).counts = counts
    seen = list(found_in_sets(found, LIMITS, now_us))
    assert all(each.detail.startswith(f"{what}: ") for each in seen)
    return seen


@pytest.mark.parametrize("what", ["localisation", "people"])
class TestEachSender:
    def test_enough_strikes_of_a_kind_are_its_fault(self, what: str) -> None:
        strikes = Strikes({}, {strike: k for k, strike in enumerate(Strike)})
        expected = [(Fault[strike.name], k) for k, strike in enumerate(Strike)]
        assert told(against(what, SetCounts(strikes=strikes))) == expected
        few = Strikes(dict.fromkeys(Strike, 4), {})
        assert against(what, SetCounts(strikes=few)) == []

    @pytest.mark.parametrize("fault", SetFault)
    def test_a_dropped_set_is_out_of_order_as_long_as_a_report_counts(
        self, what: str, fault: SetFault
    ) -> None:
        dropped = (SetFault.OUT_OF_ORDER, SetFault.REPEATED, SetFault.REGRESSED)
        counts = SetCounts(faults={fault: once(1_000_000)})
        expected = [(Fault.OUT_OF_ORDER, 1_000_000)] * (fault in dropped)
        assert told(against(what, counts, 1_100_000)) == expected
        assert told(against(what, counts, 1_100_001)) == []

    @pytest.mark.parametrize("since_us", [0, 7])
    def test_late_sets_count_since_the_first_in_a_row(self, what: str, since_us: int) -> None:
        late = once(since_us).more(9)
        assert told(against(what, SetCounts(late=late))) == [(Fault.LATE, since_us)]
        assert against(what, SetCounts(late=late.ended())) == []

    def test_a_jump_counts_since_the_last(self, what: str) -> None:
        jumps = once(7).more(9)
        assert told(against(what, SetCounts(jumps=jumps))) == [(Fault.CLOCK_JUMP, 9)]
        assert against(what, SetCounts(jumps=jumps.ended())) == []


def on_bus(found: Intake, now_us: int = NOW_US, *, commands_pass: bool = False) -> Told:
    return told(found_on_bus(found, LIMITS, now_us, commands_pass=commands_pass))


@pytest.mark.parametrize("kind", BusError)
def test_an_error_of_the_bus_counts_for_its_time(kind: BusError) -> None:
    fault, within_us = {
        BusError.ERROR_FRAME: (Fault.ERROR_FRAME, 100_000),
        BusError.LATE: (Fault.NOT_COVERED, 100_000),
    }.get(kind, (Fault.BUS_ERROR, 1_000_000))
    for age_us in (0, within_us, within_us + 1):
        found = fresh()
        found.bus_error(kind, NOW_US - age_us)
        expected = [(fault, NOW_US - age_us)] * (age_us <= within_us)
        assert on_bus(found) == expected
        assert details(found_on_bus(found, LIMITS, NOW_US, commands_pass=False)) == [
            kind.value
        ] * len(expected)


@pytest.mark.parametrize("last_us", [None, 1_000_000])
def test_silence_counts_from_its_limit_on(last_us: int | None) -> None:
    found = fresh()
    found.last_us = last_us
    begun_us = last_us or 0
    assert on_bus(found, begun_us + 100_000) == []
    assert on_bus(found, begun_us + 100_001) == [(Fault.BUS_SILENT, begun_us + 100_000)]


@pytest.mark.parametrize("commands_pass", [False, True])
@pytest.mark.parametrize("name", ["ACCEL_CMD", "HEARTBEAT"])
def test_our_own_frames_from_outside_count_for_a_second(name: str, commands_pass: bool) -> None:
    """A vehicle's commands may come from whoever is watched; what only we say may not."""
    counts = name == "HEARTBEAT" or not commands_pass
    for age_us in (0, 1_000_000, 1_000_001):
        found = fresh()
        found.spoofed[name] = once(NOW_US - age_us)
        expected = [(Fault.SPOOFED, NOW_US - age_us)] * (counts and age_us <= 1_000_000)
        assert on_bus(found, commands_pass=commands_pass) == expected


@pytest.mark.parametrize("age_us", [0, 1_000_000, 1_000_001])
def test_other_protocols_and_steps_back_count_for_a_second(age_us: int) -> None:
    at_us, recent = NOW_US - age_us, age_us <= 1_000_000
    found = fresh()
    found.foreign["pacmod3"] = once(at_us)
    assert on_bus(found) == [(Fault.WRONG_PROTOCOL, at_us)] * recent
    found = fresh()
    found.backwards = once(at_us)
    assert on_bus(found) == [(Fault.CLOCK_BACKWARDS, at_us)] * recent


@pytest.mark.parametrize(
    ("frames", "at_us", "now_us", "busy"),
    [(500, NOW_US, NOW_US, False), (501, NOW_US, NOW_US, True),
     (501, 900_000, 1_000_000, True), (501, 899_999, 1_000_000, False),
     (501, 900_000, 1_099_999, True), (501, 900_000, 1_100_000, False)],
)  # fmt: skip
def test_a_bus_is_busy_beyond_so_many_frames_in_tenths_of_a_second(
    frames: int, at_us: int, now_us: int, busy: bool
) -> None:
    found = fresh(now_us)
    found.frames = rate(frames, at_us)
    assert on_bus(found, now_us) == [(Fault.BUS_BUSY, now_us)] * busy


@pytest.mark.parametrize("waits_us", [66_666, 66_667])
@pytest.mark.parametrize("came", [False, True])
def test_a_busy_bus_that_withholds_a_report_is_flooded(came: bool, waits_us: int) -> None:
    """Who has not reported yet is waited for since the first instant."""
    begun_us = 1_000_000 if came else 0
    now_us = begun_us + waits_us
    found = fresh(now_us)
    found.frames = rate(501, now_us)
    if came:
        found.reports[SPEED] = Report({}, begun_us, b"", begun_us)
    else:
        del found.reports[SPEED]
    flooded = [(Fault.BUS_FLOOD, begun_us + 66_666)] * (waits_us > 66_666)
    assert on_bus(found, now_us) == [(Fault.BUS_BUSY, now_us), *flooded]
    if flooded:
        last = list(found_on_bus(found, LIMITS, now_us, commands_pass=False))[-1]
        assert last.detail == f"501 frames within 0.2 s, and {SPEED} is 66667 us old"
