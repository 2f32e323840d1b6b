"""Every limit of an observation's own numbers may be reached and not be passed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from runtime_world import observation, observed, standing

from workbench.runtime import Watched
from workbench.runtime.observation import (
    Observation,
    ObservedPerson,
    fault_in_observation,
    tracked_people,
)
from workbench.runtime.person_tubes import FOREVER_S

LIMITS = {
    "x": 1e7, "y": 1e7, "heading": 1e6, "steering": math.pi, "speed": 100.0,
    "speed_integral": 1e7, "offset_integral": 1e7, "skew_s": 10.0,
}  # fmt: skip
FAR = standing("far", 30.0, 9.0)


def fault(seen: Observation) -> str | None:
    return fault_in_observation(seen, tracked_people(seen))


@pytest.mark.parametrize("name", list(LIMITS))
def test_an_interval_may_reach_its_limits(name: str) -> None:
    limit, plain = LIMITS[name], observation()
    beyond = math.nextafter(limit, math.inf)
    for ends in ((-limit, limit), (limit, limit), (-limit, -limit), (0.0, 0.0)):
        assert fault(replace(plain, **{name: ends})) is None
    for ends in ((-beyond, 0.0), (0.0, beyond), (1.0, -1.0), (math.nan, 0.0), (0.0, math.nan)):
        assert f"{name}: " in (fault(replace(plain, **{name: ends})) or "")


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stamp_may_reach_the_end_of_all_time(sign: float) -> None:
    assert fault(replace(observation(), stamp_s=sign * FOREVER_S)) is None
    beyond = math.nextafter(FOREVER_S, math.inf)
    assert "stamp_s" in (fault(replace(observation(), stamp_s=sign * beyond)) or "")


@pytest.mark.parametrize(
    ("watched", "fits"),
    [
        (Watched(1e7, -1e7, 0.0), True),
        (Watched(-1e7, 1e7, 1e7), True),
        (Watched(0.0, 0.0, 0.5), True),
        (Watched(1.01e7, 0.0, 1.0), False),
        (Watched(0.0, -1.01e7, 1.0), False),
        (Watched(0.0, 0.0, -1e-9), False),
        (Watched(0.0, 0.0, 1.01e7), False),
        (Watched(0.0, 0.0, math.nan), False),
    ],
)
def test_a_watched_disc_may_be_a_point_and_as_far_as_a_car(watched: Watched, fits: bool) -> None:
    assert (fault(replace(observation(), watched=watched)) is None) is fits


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_guard_may_be_a_minute_old_or_early(sign: float) -> None:
    for at_s, fits in ((60.0, True), (math.nextafter(60.0, 61.0), False)):
        found = fault(observation(observed(FAR, at_s=sign * at_s)))
        assert (found is None or "at_s" not in found) is fits


@pytest.mark.parametrize(("low", "from_s"), [(-0.5, -0.5), (0.0, 0.0), (0.4, 0.0)])
def test_a_guard_s_tube_begins_where_the_people_s_clock_may_be(low: float, from_s: float) -> None:
    seen = replace(observation(observed(FAR, at_s=0.45)), skew_s=(low, 0.5))
    (tracked,) = tracked_people(seen)
    guard = tracked.tubes[-1]
    begun_s = {run[0].from_s for run in guard.bounds}
    assert (begun_s, guard.until_s) == ({from_s}, FOREVER_S)


def test_a_person_is_seen_unless_said_to_be_assumed() -> None:
    assert not ObservedPerson("Ann", (), observed(FAR).guard).assumed
