"""A report that the vehicle cannot have is believed by nobody, and counted."""

from __future__ import annotations

import pytest
from onboard_core_bench import identifier
from onboard_watching_cases import (
    S,
    look,
    told,
    watching,
    with_speed,
    with_wheel,
)

from workbench.runtime.onboard.faults import Fault, Found


@pytest.mark.parametrize(("value", "believed"), [(15.0, True), (15.01, False), (-5.0, True),
                                                 (-5.01, False), (0.0, True)])  # fmt: skip
def test_a_speed_is_believed_within_its_range(value: float, believed: bool) -> None:
    assert with_speed(watching(), value, S) == (value if believed else None)


@pytest.mark.parametrize(("value", "believed"), [(10.75, True), (10.751, False), (-10.75, True),
                                                 (-10.751, False), (0.0, True)])  # fmt: skip
def test_a_wheel_is_believed_within_its_range(value: float, believed: bool) -> None:
    assert with_wheel(watching(), value, S) == (value if believed else None)


@pytest.mark.parametrize(
    ("span_us", "change", "believed"),
    [(62_500, 1.0, True), (62_500, 1.01, False), (62_500, -1.0, True), (62_500, -1.01, False),
     (0, 0.25, True), (0, 0.26, False)],
)  # fmt: skip
def test_a_speed_changes_as_fast_as_a_car_can(span_us: int, change: float, believed: bool) -> None:
    watch = watching()
    with_speed(watch, 2.0, S)
    assert with_speed(watch, 2.0 + change, S + span_us) == (2.0 + change if believed else 2.0)


@pytest.mark.parametrize(("change", "believed"), [(1.25, True), (1.251, False)])
def test_a_wheel_turns_as_fast_as_it_can(change: float, believed: bool) -> None:
    watch = watching()
    with_wheel(watch, 2.0, S)
    assert with_wheel(watch, 2.0 + change, S + 62_500) == (2.0 + change if believed else 2.0)


def test_a_frame_from_before_the_last_is_counted_as_that_and_not_as_impossible() -> None:
    watch = watching()
    with_speed(watch, 2.0, S)
    for _ in range(3):
        with_speed(watch, 9.0, S - 1)
    assert watch.intake.backwards.total == 3
    assert told(look(watch, S), Fault.OUT_OF_RANGE) is None


def test_what_cannot_be_read_goes_on_to_those_who_count_it() -> None:
    watch = watching()
    watch.receive(identifier("VEHICLE_SPEED_RPT"), bytes(1), S)
    assert watch.intake.refusals["VEHICLE_SPEED_RPT"].total == 1


@pytest.mark.parametrize("at_us", [0, S])
def test_the_third_impossible_value_in_a_row_is_a_fault(at_us: int) -> None:
    watch = watching()
    for count in range(1, 5):
        assert with_speed(watch, 15.5, at_us) is None
        found = told(look(watch, at_us), Fault.OUT_OF_RANGE)
        detail = "VEHICLE_SPEED_RPT.VEHICLE_SPEED: 15.5, expected -5 to 15"
        expected = Found(Fault.OUT_OF_RANGE, detail, at_us) if count >= 3 else None
        assert found == expected
    assert with_speed(watch, 1.0, at_us) == 1.0
    assert told(look(watch, at_us), Fault.OUT_OF_RANGE) is None
    for count in range(1, 4):
        assert with_speed(watch, 3.0, at_us) == 1.0
        found = told(look(watch, at_us), Fault.OUT_OF_RANGE)
        assert (found is not None) is (count == 3)
    assert found is not None
    changed = "changed by 2, at most 0.25 is possible"
    assert found.detail == f"VEHICLE_SPEED_RPT.VEHICLE_SPEED: {changed}"
