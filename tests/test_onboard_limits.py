"""The shipped limits keep the distances from each other and the figures that are stated."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from workbench.errors import InputError
from workbench.runtime.onboard.limits import FaultLimits, pacmod2_limits
from workbench.runtime.onboard.times import TURN_US
from workbench.runtime.protocols import load_protocol

LIMITS = pacmod2_limits(localisation_age_us=900_000, people_age_us=600_000)
NUMBERS = [each.name for each in dataclasses.fields(FaultLimits) if each.name != "speed_mps"]


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("wrong", [0, -1, 0.0, math.nan])
def test_a_limit_that_is_no_positive_number_is_refused(name: str, wrong: float) -> None:
    with pytest.raises(InputError, match=name):
        dataclasses.replace(LIMITS, **{name: wrong})


@pytest.mark.parametrize("name", NUMBERS)
def test_any_positive_limit_will_do(name: str) -> None:
    assert getattr(dataclasses.replace(LIMITS, **{name: 1e-9}), name) == 1e-9


@pytest.mark.parametrize("wrong", [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0), (0.0, math.nan)])
def test_speeds_have_a_lowest_and_a_highest(wrong: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="speed_mps"):
        dataclasses.replace(LIMITS, speed_mps=wrong)


def test_every_limit_is_the_one_in_the_documents_table() -> None:
    """A number that is changed by mistake, in either place, is noticed."""
    document = (Path(__file__).parent.parent / "docs" / "on-the-vehicle.md").read_text()
    rows = dict(re.findall(r"(?m)^\| `(\w+)` \| (-?[\d.]+(?: to [\d.]+)?) \|", document))
    limits = pacmod2_limits(localisation_age_us=900_000, people_age_us=600_000)
    written = {**dataclasses.asdict(limits), "speed_mps": "{} to {}".format(*limits.speed_mps)}
    for name in ("localisation_age_us", "people_age_us"):
        del written[name]
    assert {name: rows[name] for name in written} == {k: str(v) for k, v in written.items()}


def test_ages_are_three_periods_of_a_thirtieth_of_a_second() -> None:
    assert LIMITS.report_period_us == 1_000_000 // 30
    assert LIMITS.report_age_us == math.ceil(3 * LIMITS.report_period_us / 1000) * 1000
    assert LIMITS.report_age_us >= 3 * TURN_US
    assert (LIMITS.localisation_age_us, LIMITS.people_age_us) == (900_000, 600_000)


def test_what_happened_once_counts_for_a_second_and_so_long_a_brake_is_held() -> None:
    second = 1_000_000
    assert LIMITS.recent_us == LIMITS.release_us == LIMITS.enable_us == second


def test_commands_are_repeated_within_a_fifth_followed_within_half_frozen_after_more() -> None:
    assert (LIMITS.echo_us, LIMITS.follow_us, LIMITS.frozen_us) == (200_000, 500_000, 600_000)


def test_a_command_that_is_repeated_differs_by_less_than_three_counts() -> None:
    for message in ("ACCEL_RPT", "BRAKE_RPT"):
        found = load_protocol("pacmod2").by_name[message].signal("COMMANDED_VALUE")
        assert LIMITS.count == 2.5 * found.factor / found.divisor


def test_what_a_car_can_do_is_the_shuttle_s_with_a_margin() -> None:
    assert LIMITS.speed_mps == (-5.0, 15.0)
    assert (LIMITS.accel_mps2, LIMITS.speed_step_mps) == (12.0, 0.3)
    assert (LIMITS.wheel_rate_radps, LIMITS.wheel_step_rad) == (20.0, 0.2)
    assert LIMITS.yaw_rate_radps == 0.05


def test_a_foot_and_standstill_begin_at_a_twentieth() -> None:
    assert LIMITS.pedal == LIMITS.stands_mps == 0.05


def test_errors_and_ways_of_the_slow_checks() -> None:
    assert (LIMITS.pedal_error, LIMITS.wheel_error_rad) == (0.15, 0.6)
    assert (LIMITS.frozen_mps, LIMITS.frozen_m, LIMITS.agree_m) == (0.6, 0.25, 2.0)


def test_so_many_refusals_in_a_row_and_frames_on_a_bus() -> None:
    assert LIMITS.refused_in_a_row == 3
    # A fifth of a second at 2500 frames a second, about half of what 500 kbit/s carries.
    assert LIMITS.busy_frames == 2500 // 5
