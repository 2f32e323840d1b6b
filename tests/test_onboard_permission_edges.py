"""The monitor hears of each decision when it began and when it ended, and forgets when told to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from onboard_core_cases import PATH, SETTINGS, bundle
from runtime_world import observation

from workbench.claims import Verdict
from workbench.runtime import Action, Bundle, Decision, Observation
from workbench.runtime.onboard.permission import Permission
from workbench.runtime.onboard.times import seconds
from workbench.runtime.policies import Deciding
from workbench.runtime.policies.cycle import Hypothesis

AT_US, TOOK_US = 1_000_000, 10_000
LATENCY_US = round(SETTINGS.timing.latency_s * 1e6)


def permission(deciding: Deciding = Deciding.LOOK_AHEAD) -> Permission:
    """Of a car that does not drive; deciding: whose TRACK counts once it does."""
    usual = bundle()
    changed = replace(usual.manifest, deciding=deciding.value)
    return Permission(Bundle(changed, usual._kernel, usual.manifest_sha256), PATH, SETTINGS)


def seen(stamp_us: int) -> Observation:
    """A car that moves, far from everybody: whoever needs a standstill first cannot permit it."""
    return replace(observation(), stamp_s=seconds(stamp_us))


def ends(at_us: int) -> Callable[[], int]:
    """A clock that may be read once."""
    left = [at_us]
    return left.pop


def decided(
    asked: Permission, at_us: int = AT_US, *, took_us: int = TOOK_US, stamp_us: int | None = None
) -> Decision:
    ended_us = at_us + took_us
    stamp_us = at_us if stamp_us is None else stamp_us
    decision, told_us = asked.decide(seen(stamp_us), at_us, ends(ended_us))
    assert told_us == ended_us
    return decision


def violated(decision: Decision) -> set[Hypothesis]:
    return {violation.hypothesis for violation in decision.violations}


def test_every_decision_reads_the_clock_once_and_says_when_it_ended() -> None:
    asked = permission()
    for at_us in (AT_US, AT_US + 100_000, AT_US + 200_000):
        decision = decided(asked, at_us)
        assert (decision.verdict, decision.action) == (Verdict.SAFE, Action.TRACK)
        assert asked.turn(at_us + TOOK_US).action is Action.TRACK


def test_a_decision_that_judges_nothing_reads_the_clock_all_the_same() -> None:
    asked = permission()
    nowhere = replace(seen(AT_US), x=(float("nan"), 0.0))
    decision, ended_us = asked.decide(nowhere, AT_US, ends(AT_US + TOOK_US))
    assert (decision.verdict, decision.action) == (Verdict.INVALID, Action.BRAKE)
    assert ended_us == AT_US + TOOK_US


@pytest.mark.parametrize("took_us", [LATENCY_US - 1, LATENCY_US + 1])
def test_the_age_of_a_decision_is_that_of_its_end(took_us: int) -> None:
    late = took_us > LATENCY_US
    assert (Hypothesis.AGE in violated(decided(permission(), took_us=took_us))) is late


@pytest.mark.parametrize("ahead_us", [0, 1, TOOK_US])
def test_what_is_stamped_after_a_decision_began_was_not_measured_before_it(ahead_us: int) -> None:
    decision = decided(permission(), stamp_us=AT_US + ahead_us)
    assert (Hypothesis.CLOCK in violated(decision)) is (ahead_us > 0)
    assert decision.action is (Action.BRAKE if ahead_us else Action.TRACK)


def test_the_first_instant_of_all_is_zero() -> None:
    assert permission().turn(0).violation is None
    assert decided(permission(), 0, took_us=0).action is Action.TRACK
    before = permission().turn(-1).violation
    assert before is not None
    assert before.hypothesis is Hypothesis.CLOCK


def test_the_bundle_decides_while_the_car_drives_and_otherwise_the_log_is_served() -> None:
    """A moving car never begins what `FailSafe` proves; `LookAhead` permits it at once."""
    asked = permission(Deciding.FAIL_SAFE)
    assert decided(asked).action is Action.TRACK
    for k, drives in enumerate((True, False, True)):
        at_us = AT_US + (k + 1) * 1_000_000
        asked.begin(at_us, drives=drives, station_m=0.0)
        assert asked.turn(at_us).action is Action.BRAKE
        assert decided(asked, at_us).action is (Action.BRAKE if drives else Action.TRACK)


@pytest.mark.parametrize("drives", [False, True])
def test_a_new_beginning_permits_nothing_and_knows_no_instant_before_it(drives: bool) -> None:
    asked, again_us = permission(), AT_US + 20_000
    assert decided(asked).action is Action.TRACK
    asked.begin(again_us, drives=drives, station_m=None)
    earlier = asked.turn(again_us - 1)
    assert earlier.action is Action.BRAKE
    assert earlier.violation is not None
    assert earlier.violation.hypothesis is Hypothesis.CLOCK
    now = asked.turn(again_us)
    assert (now.action, now.violation) == (Action.BRAKE, None)
    # What the monitor before has judged is the first that this one sees.
    assert decided(asked, again_us, stamp_us=AT_US).action is Action.TRACK


def test_a_decision_from_before_a_new_beginning_is_none() -> None:
    asked = permission()
    decided(asked)
    asked.begin(AT_US + 200_000, drives=False, station_m=None)
    assert violated(decided(asked, AT_US + 100_000)) == {Hypothesis.CLOCK}


def test_held_means_that_nothing_is_permitted_until_the_next_decision() -> None:
    asked, now_us = permission(), AT_US + TOOK_US
    assert decided(asked).action is Action.TRACK
    assert asked.turn(now_us).action is Action.TRACK
    asked.hold(now_us + 1_000)
    assert asked.turn(now_us + 2_000).action is Action.BRAKE
    decided(asked, AT_US + 100_000)
    assert asked.turn(AT_US + 100_000 + TOOK_US).action is Action.TRACK
