"""Sets are held whole, however the next ones fail; what is missing or old is not observed."""

from __future__ import annotations

import dataclasses

import pytest
from onboard_intakes import (
    INTEGRALS,
    PLACE,
    WALKER,
    crowd_frames,
    filled,
    give,
    intake,
    observed,
    place_frames,
    why_not,
)
from onboard_sensors import BOUNDS, pacmod2_reports

from workbench.errors import InputError
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.counting import ENOUGH, Strike
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.observing import NotObserved, Unobserved, observe
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.onboard.times import LATEST_US
from workbench.runtime.protocols import (
    NoSet,
    Refusal,
    SetFault,
    localisation_frames,
)


def localisation_of(found: Intake) -> object:
    """As it is now, whatever it was before."""
    return found.localisation


def people_of(found: Intake) -> object:
    """As they are now."""
    return found.people


def test_a_set_is_held_while_the_next_ones_fail() -> None:
    found = filled()
    held = found.localisation
    assert isinstance(held, SetSeen)
    broken = place_frames(2, 1.1)
    give(found, [broken[0], broken[2]], 1_100_000)
    assert found.localisation is held
    counts = found.localisation_counts
    assert counts.faults[SetFault.OUT_OF_ORDER].total == 1
    assert counts.strikes.against == {Strike.INTEGRITY: 1}
    give(found, place_frames(3, 1.2), 1_200_000)
    newer = found.localisation
    assert isinstance(newer, SetSeen)
    assert (newer.value.number, found.localisation_counts.whole) == (3, 2)
    assert found.localisation_counts.strikes.against == {}


def test_a_sender_that_does_not_know_its_heading_is_no_broken_bus() -> None:
    """The localiser says so again and again; the last set ages, and nothing else is found wrong."""
    found = filled()
    held = found.localisation
    for k in range(2, 30):
        place = dataclasses.replace(PLACE, number=k, stamp_s=1.0 + 0.1 * k)
        frames = localisation_frames(place, heading_observed=False)
        assert not isinstance(frames, Refusal)
        give(found, list(frames), 1_000_000 + 100_000 * k)
    counts = found.localisation_counts
    assert found.localisation is held
    assert counts.faults[SetFault.REFUSED].total == 28
    assert counts.strikes.against == {}
    (identifier, data), *_ = place_frames(31, 4.1)
    give(found, [(identifier, bytes([data[0], data[1] ^ 1, *data[2:]]))], 4_200_000)
    assert found.localisation_counts.strikes.against == {Strike.INTEGRITY: 1}


def test_a_header_that_comes_early_loses_the_open_set() -> None:
    found = filled()
    give(found, crowd_frames(2, 1.1, WALKER)[:2], 1_100_000)
    give(found, crowd_frames(3, 1.2), 1_200_000)
    assert found.people_counts.faults[SetFault.OUT_OF_ORDER].total == 1
    people = found.people
    assert isinstance(people, SetSeen)
    assert people.value.number == 3


def test_strikes_add_up_to_five_and_whole_sets_take_them_back() -> None:
    found = filled()
    for number in range(2, 5):
        frames = place_frames(number, 1.0 + number / 10)
        give(found, [each for frame in frames for each in (frame, frame)], number * 1_000_000)
    counts = found.localisation_counts
    # The last frame's repetition comes after the set was whole: 3, 4 (less one each) and so on.
    assert counts.duplicates.total == 12
    assert counts.strikes.against[Strike.DUPLICATE] == ENOUGH
    assert counts.strikes.enough_since_us[Strike.DUPLICATE] == 4_000_000
    give(found, place_frames(5, 1.5), 5_000_000)
    assert counts.strikes.enough_since_us
    assert not found.localisation_counts.strikes.enough_since_us
    replayed = place_frames(5, 1.5)
    for at_us in range(6_000_000, 6_000_006):
        # Not a mere repetition: something else came between.
        give(found, [replayed[0], replayed[1]], at_us)
    assert found.localisation_counts.strikes.against[Strike.REPLAYED] == ENOUGH
    assert found.localisation_counts.faults[SetFault.REPEATED].total == 6


def test_too_many_people_leave_no_earlier_set() -> None:
    found = filled()
    many = [dataclasses.replace(WALKER, track=track) for track in range(33)]
    give(found, crowd_frames(2, 1.1, *many), 1_100_000)
    assert why_not(found, 1_100_000) is Unobserved.OVER_CAPACITY
    # The next header alone changes nothing, its whole set does.
    next_set = crowd_frames(3, 1.2, WALKER)
    give(found, next_set[:1], 1_110_000)
    assert why_not(found, 1_110_000) is Unobserved.OVER_CAPACITY
    give(found, next_set[1:], 1_110_000)
    assert isinstance(people_of(found), SetSeen)
    twice = crowd_frames(4, 1.3, WALKER, dataclasses.replace(WALKER, x_m=1.0))
    give(found, twice, 1_120_000)
    twice_named = people_of(found)
    assert isinstance(twice_named, NoSet)
    assert twice_named.fault is SetFault.TRACK_TWICE
    assert why_not(found, 1_120_000) is Unobserved.PEOPLE


def test_a_sender_that_restarts_waits_until_sets_are_forgotten() -> None:
    found = filled()
    give(found, place_frames(1, 0.1), 1_300_000)
    assert found.localisation_counts.faults[SetFault.REPEATED].total == 1
    found.forget_sets()
    assert isinstance(localisation_of(found), NoSet)
    assert why_not(found, 1_300_000) is Unobserved.LOCALISATION
    give(found, place_frames(2, 0.2), 1_400_000)
    assert isinstance(localisation_of(found), SetSeen)


def test_nothing_is_observed_of_what_is_missing_or_old() -> None:
    assert isinstance(observed(filled(), 1_050_000), Observation)
    assert why_not(intake(), 0) is Unobserved.LOCALISATION
    found = intake()
    give(found, place_frames(1, 1.0), 1_000_000)
    assert why_not(found, 1_000_000) is Unobserved.PEOPLE
    give(found, crowd_frames(1, 1.0), 1_000_000)
    assert why_not(found, 1_000_000) is Unobserved.REPORT
    assert why_not(filled(), 1_100_001) is Unobserved.REPORT
    assert isinstance(observed(filled(), 1_100_000), Observation)
    found = filled()
    give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=0.2), 2_150_000)
    assert isinstance(observed(found, 2_150_000), Observation)
    give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=0.2), 2_230_000)
    assert why_not(found, 2_230_000) is Unobserved.LOCALISATION
    give(found, place_frames(2, 2.2), 2_231_000)
    assert why_not(found, 2_231_000) is Unobserved.PEOPLE
    for now_us in (0, 999_999, LATEST_US + 1, 10**400, -(10**400)):
        assert why_not(filled(), now_us) is Unobserved.CLOCK


def test_a_steering_wheel_out_of_range_is_no_observation() -> None:
    found = filled()
    give(found, pacmod2_reports(speed_mps=1.0, wheel_rad=13.5), 1_010_000)
    assert why_not(found, 1_010_000) is Unobserved.STEERING_RANGE
    broken = dataclasses.replace(BOUNDS, road_wheel=lambda angle: (angle, float("nan")))
    seen = observe(filled(), now_us=1_000_000, integrals=INTEGRALS, settings=broken)
    assert isinstance(seen, NotObserved)
    assert seen.fault is Unobserved.STEERING_RANGE


@pytest.mark.parametrize(
    "change",
    [
        {"speed_gain": (0.0, 1.0)},
        {"speed_gain": (1.1, 1.0)},
        {"wheelbase_m": (0.0, 1.0)},
        {"acceleration_mps2": (0.1, 1.0)},
        {"speed_range_mps": (0.0, float("inf"))},
        {"speed_error_mps": -0.1},
        {"steering_limit_rad": 1.6},
        {"report_delay_us": (2, 1)},
        {"localisation_age_us": 0},
        {"people_age_us": 10**8},
        {"unseen_speed_mps": float("nan")},
        {"on_foot": dataclasses.replace(BOUNDS.on_foot, intent_mps2=9.0)},
    ],
)
def test_bounds_that_make_no_sense_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError):
        dataclasses.replace(BOUNDS, **change)  # type: ignore[arg-type]
