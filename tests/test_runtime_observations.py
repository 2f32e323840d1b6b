"""Whatever an observation holds there is a decision, and only a sound one reaches the kernel."""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_fixture import fake_manifest
from runtime_world import (
    TIMING,
    Asked,
    arc_table,
    assert_invalid,
    observation,
    observed,
    standing,
)

from workbench.claims import Verdict
from workbench.runtime import (
    Action,
    Bundle,
    Deciding,
    Disc,
    Guard,
    MotionLimits,
    Observation,
    ObservedPerson,
    Person,
    Watched,
)
from workbench.runtime.bundle import Result
from workbench.runtime.person_guard import guard_disc
from workbench.runtime.person_tubes import MOST_PEOPLE, RadiusBetween, timed_discs

FAR = standing("far", 30.0, 9.0)
AHEAD = standing("Ann", 8.0, 0.5)


def _seen(**change: Any) -> ObservedPerson:
    return observed(replace(FAR, **change))


def _guarded(**change: Any) -> ObservedPerson:
    person = observed(FAR)
    return replace(person, guard=replace(person.guard, **change))


_GUARDS = (guard_disc(observed(FAR).guard, from_s=0.0, until_s=9.0),)
_FOUR = (FAR.intent,) * 4


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"x": (math.nan, 0.0)}, "x: expected lower <= upper"),
        ({"y": (0.0, math.inf)}, "y: expected lower <= upper"),
        ({"heading": (0.1, -0.1)}, "heading: expected lower <= upper"),
        ({"steering": (-4.0, 0.0)}, "steering: expected lower <= upper within +-3.14159"),
        ({"speed": (1.0, 1e9)}, "speed: expected lower <= upper within +-100"),
        ({"speed_integral": (math.nan, math.nan)}, "speed_integral"),
        ({"offset_integral": (-math.inf, 0.0)}, "offset_integral"),
        ({"reference_speed_mps": math.nan}, "reference speed: the proof covers [0.0, 6.0] m/s"),
        ({"reference_speed_mps": 6.1}, "reference speed: the proof covers [0.0, 6.0] m/s"),
        ({"speed": (5.0, 6.5)}, "speed: the proof covers [-0.5, 6.0], got [5.0, 6.5]"),
        ({"speed": (-0.6, 1.0)}, "speed: the proof covers [-0.5, 6.0], got [-0.6, 1.0]"),
        ({"y": (1.9, 2.3)}, "offset: the proof covers [-2.0, 2.0]"),
        ({"x": (-60.0, -59.0)}, "no path coordinates: "),
        ({"x": None}, "invalid: TypeError"),
        ({"people": None}, "invalid: TypeError"),
        ({"people": (None,)}, "invalid: AttributeError"),
        ({"people": (_seen(x_m=math.nan),)}, "person 'far': tube 0: expected x_m from"),
        ({"people": (_seen(growth_mps2=math.inf),)}, "person 'far': tube 0: expected growth2_mps2"),
        ({"people": (_seen(y_m=-2e7),)}, "person 'far': tube 0: expected y_m from -1e+07"),
        ({"people": (_seen(vx_mps=-101.0),)}, "person 'far': tube 0: expected vx_mps from -100"),
        ({"people": (_seen(radius_m=-0.1),)}, "person 'far': expected a guard with radii and lim"),
        ({"people": (_seen(growth_mps=1e5),)}, "person 'far': tube 0: expected growth_mps from"),
        ({"people": (observed(FAR), observed(FAR))}, "expected distinct names, got ['far', 'far']"),
        ({"people": (_guarded(at_s=math.nan),)}, "person 'far': expected a guard of within +-60 s"),
        ({"people": (_guarded(at_s=-61.0),)}, "person 'far': expected a guard of within +-60 s"),
        ({"people": (_guarded(velocity=Disc(0.0, 0.0, -0.1)),)}, "radii and limits >= 0"),
        ({"people": (_guarded(velocity=Disc(math.nan, 0.0, 0.1)),)}, "tube 1: expected vx_mps"),
        ({"people": (_guarded(limits=MotionLimits(math.nan, 1.0)),)}, "radii and limits >= 0"),
        ({"people": (_guarded(limits=MotionLimits(1.0, -1.0)),)}, "radii and limits >= 0"),
        ({"people": (_guarded(limits=MotionLimits(1.0, 1e5)),)}, "tube 1: expected growth2_mps2"),
        ({"people": (replace(observed(FAR), intent=_GUARDS),)}, "of kind intent, got ['guard']"),
        ({"people": (replace(observed(FAR), intent=_FOUR),)}, "expected 1 to 4 tubes, got 5"),
        ({"skew_s": (0.1, -0.1)}, "skew_s: expected lower <= upper within +-10"),
        ({"skew_s": (math.nan, 0.0)}, "skew_s: expected lower <= upper within +-10"),
        ({"watched": Watched(math.nan, 0.0, 9.0)}, "watched: expected a disc"),
        ({"watched": Watched(0.0, 0.0, -1.0)}, "watched: expected a disc"),
        ({"watched": None}, "invalid: AttributeError"),
    ],
)
def test_an_observation_that_cannot_be_used_brakes(change: dict[str, Any], reason: str) -> None:
    monitor = Asked()
    assert monitor.step(observation()).action is Action.TRACK
    assert_invalid(monitor.step(replace(observation(), **change)), reason)
    assert monitor.step(observation()).action is Action.TRACK


@pytest.mark.parametrize("stamp_s", [math.nan, math.inf, -2e9, None])
def test_a_stamp_that_is_no_instant_is_invalid(stamp_s: Any) -> None:
    monitor = Asked().monitor
    assert_invalid(monitor.step(replace(observation(), stamp_s=stamp_s)), "invalid: ")


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.floats(), min_size=22, max_size=22),
    st.lists(st.floats(), max_size=32),
    st.sampled_from(Deciding),
)
def test_any_numbers_get_a_decision(
    state: list[float], people: list[float], deciding: Deciding
) -> None:
    names = [*list(Observation.__dataclass_fields__)[:7], "skew_s"]
    ends = dict(zip(names, zip(state[:16:2], state[1:16:2], strict=True), strict=True))
    crowd = []
    for k in range(0, len(people) // 16 * 16, 16):
        numbers = people[k : k + 16]
        guard = Guard(
            numbers[7], Disc(*numbers[8:11]), Disc(*numbers[11:14]), MotionLimits(*numbers[14:])
        )
        crowd.append(ObservedPerson(f"{k}", (Person("?", *numbers[:7]).intent,), guard))
    seen = replace(
        observation(),
        **ends,
        reference_speed_mps=state[16],
        watched=Watched(*state[17:20]),
        stamp_s=state[20],
        people=tuple(crowd),
    )
    monitor = Asked(deciding=deciding).monitor
    decision = monitor.step(seen)
    assert decision.action is Action.BRAKE or decision.verdict is Verdict.SAFE
    assert monitor.turn(state[21]).action in Action


def test_a_crowd_beyond_the_capacity_brakes_and_is_never_cut() -> None:
    crowd = [replace(FAR, name=f"p{k}", x_m=30.0 + k) for k in range(MOST_PEOPLE)]
    decision = Asked().step(observation(*crowd))
    assert (decision.verdict, decision.clearance_person) == (Verdict.SAFE, "p0")
    assert_invalid(Asked().step(observation(*crowd, FAR)), "expected at most 32 people, got 33")
    last = Asked().step(observation(*crowd[1:], AHEAD))
    assert (last.verdict, last.clearance_person) == (Verdict.UNPROVED, "Ann")


def test_more_pieces_than_the_kernel_holds_are_not_judged() -> None:
    times = [0.25 * k for k in range(17)]
    tube = timed_discs(times, [30.0] * 17, [9.0] * 17, [0.3] * 17, between=RadiusBetween.LARGER)
    crowd = [replace(observed(FAR), name=f"p{k}", intent=(tube,) * 3) for k in range(MOST_PEOPLE)]
    assert_invalid(
        Asked().step(observation(*crowd)), "people's tubes have 1600 pieces, the kernel holds 1024"
    )
    assert Asked().step(observation(*crowd[:20])).verdict is Verdict.SAFE


def test_somebody_without_a_prediction_is_never_passed_for_safe() -> None:
    unknown = replace(observed(FAR), intent=())
    decision = Asked().step(observation(unknown))
    assert (decision.verdict, decision.action) == (Verdict.UNPROVED, Action.BRAKE)
    assert decision.reason == "unproved: nothing is predicted of far at 0.00 s"
    assert decision.clearance_m is None


def test_a_changed_rounding_mode_brakes_before_the_kernel_is_asked() -> None:
    library = ctypes.CDLL(None)
    monitor = Asked()
    try:
        if library.fesetround(0x400 if fake_manifest().machine == "x86_64" else 0x800000) != 0:
            pytest.skip("rounding modes of this machine are not known here")
        assert_invalid(monitor.step(observation()), "ARITHMETIC: rounding is not to nearest")
    finally:
        library.fesetround(0)


def test_the_vehicle_keeps_its_stretch_of_a_path_that_meets_itself() -> None:
    ring = arc_table(0.1, nodes=520, start_m=0.0)
    lost = Asked(path=ring)
    seen = observation(at=(3.0, 0.45))
    seen = replace(seen, heading=(0.3, 0.3))
    assert_invalid(lost.step(seen), "equally near")
    second_lap = Asked(path=ring, start_station_m=64.0)
    decision = second_lap.step(seen)
    assert decision.verdict is Verdict.SAFE
    assert decision.tube_upper[0][0] > 65.0


def test_the_sets_sent_to_the_kernel_contain_the_observed_ones_and_are_nested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent = _spied(monkeypatch)
    seen = replace(
        observation(),
        speed=(0.1, 0.7),
        steering=(-0.3, 0.1),
        offset_integral=(0.1, 0.2),
        reference_speed_mps=3.1,
    )
    Asked().step(seen)
    center, radius = sent["initial_center"], sent["initial_radius"]
    assert center[:7] == center[7:14] == center[14:]
    for level, share in enumerate((1.0, 2 / 3, 1 / 3)):
        c, r = (numbers[7 * level : 7 * level + 7] for numbers in (center, radius))
        for index, (low, high) in ((2, seen.steering), (3, seen.speed), (6, seen.offset_integral)):
            middle, half = 0.5 * (low + high), 0.5 * (high - low) * share
            assert c[index] - r[index] <= middle - half + 1e-15
            assert c[index] + r[index] >= middle + half - 1e-15
            assert r[index] == pytest.approx(half)
        assert c[0] - r[0] <= -0.1 * share
        assert c[0] + r[0] >= 0.1 * share
        assert r[0] == pytest.approx(0.1 * share, rel=0.02)
        assert r[5] == 0.0
    assert sent["parameters"] == [3.1, 0.0]
    assert (sent["front_m"], sent["rear_m"], sent["half_width_m"]) == ((2.3,), (0.4,), (0.6,))
    assert sent["clearance_required_m"] == (0.5,)


def test_people_are_sent_with_their_guards_over_all_the_time_that_is_asked_about(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent = _spied(monkeypatch)
    late = replace(observed(FAR, at_s=-0.3), name="late")
    Asked().step(replace(observation(FAR, late), skew_s=(-0.02, 0.01)))
    assert sent["people_count"] == (2.0,)
    assert sent["tubes_count"] == (4.0,)
    tubes = [sent["people_tubes"][k : k + 5] for k in range(0, 20, 5)]
    assert [(tube[0], tube[1]) for tube in tubes] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    starts = {
        index: [sent["people_pieces"][9 * int(tube[3]) + 1] for tube in tubes if tube[0] == index][
            1
        ]
        for index in (0, 1)
    }
    assert starts == {0: -0.02, 1: -0.3}
    assert sent["skew_s"] == (-0.02, 0.01)
    assert sent["switch_s"] == TIMING.switch_s
    assert sent["brake_s"] == (0.0, pytest.approx(0.09))


def test_the_kernel_is_asked_for_a_start_only_where_the_car_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent = _spied(monkeypatch)
    stands, moves = observation(speed=(0.0, 0.05)), observation(speed=(0.01, 0.05))
    asked = Asked(deciding=Deciding.FAIL_SAFE)
    found = []
    for seen in (stands, moves, stands, stands):
        asked.step(seen)
        found.append(sent["start_s"])
    begin_s = (0.0, pytest.approx(TIMING.latency_s + TIMING.send_gap_s, abs=1e-5))
    assert found == [(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), begin_s]
    # Now TRACK begins, shortly before a stamp and then long before.
    assert asked.step(stands).action is Action.TRACK
    asked.clock.now_s += 0.02
    assert asked.monitor.turn().action is Action.TRACK
    asked.step(stands, after_s=0.04, age_s=0.05)
    assert sent["start_s"] == (pytest.approx(0.01, abs=1e-5), pytest.approx(0.01, abs=1e-5))
    asked.step(stands)
    assert sent["start_s"] == (0.0, 0.0)


def _spied(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    sent: dict[str, Any] = {}
    call = Bundle.call

    def spy(self: Bundle, values: Any) -> Result:
        sent.update(values)
        return call(self, values)

    monkeypatch.setattr(Bundle, "call", spy)
    return sent
