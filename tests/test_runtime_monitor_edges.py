"""The kernel is asked about the whole measured set: its rear end, and whether it may stand."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest
from runtime_fixture import fake_bundle
from runtime_world import TIMING, Asked, Clock, arc_table, observation

from workbench.runtime import Bundle, Monitor
from workbench.runtime.bundle import Result

Values = Mapping[str, Sequence[float]]
ROLLS = (0.0, 0.0)


@pytest.fixture
def queries(monkeypatch: pytest.MonkeyPatch) -> list[Values]:
    """What every kernel is called with."""
    found: list[Values] = []
    usual = Bundle.call

    def call(bundle: Bundle, values: Values) -> Result:
        found.append(values)
        return usual(bundle, values)

    monkeypatch.setattr(Bundle, "call", call)
    return found


def rested() -> Asked:
    """A car that has been seen to stand, so that the instant of its standstill is known."""
    asked = Asked(deciding="FailSafe")
    asked.step(observation(speed=(-0.05, 0.05)))
    assert asked.clock.now_s < asked.monitor._state.fail_safe.stands_s < 101.0
    return asked


def asked_at(asked: Asked, stamp_s: float, speed: tuple[float, float]) -> None:
    asked.clock.now_s = stamp_s
    asked.monitor.step(replace(observation(speed=speed), stamp_s=stamp_s))


def test_the_window_begins_16_nodes_before_the_rear_end_of_the_whole_set(
    queries: list[Values],
) -> None:
    # Every 2 m it moves on, and 2 m is where it does: between the rear end of the whole set and
    # those of its parts.
    asked = Asked()
    asked.step(observation(at=(2.08, 0.0)))
    asked.step(observation(at=(2.11, 0.0)))
    starts = [values["path_start_m"][0] for values in queries]
    assert starts == [-4.0, -2.0]


@pytest.mark.parametrize(
    ("speed", "stands"),
    [
        ((-0.05, 0.05), True),
        ((0.0, 0.1), True),
        ((-0.1, 0.0), True),
        # The parts of this one do not hold 0.
        ((-0.4, 0.05), True),
        ((0.001, 0.1), False),
        ((-0.1, -0.001), False),
    ],
)
def test_track_begins_later_only_for_a_car_that_may_stand(
    queries: list[Values], speed: tuple[float, float], stands: bool
) -> None:
    asked = rested()
    asked_at(asked, asked.monitor._state.fail_safe.stands_s + 0.1, speed)
    begins = (0.0, TIMING.latency_s + TIMING.send_gap_s)
    expected = pytest.approx(begins, abs=1e-3) if stands else ROLLS
    assert queries[-1]["start_s"] == expected
    assert (queries[-1]["start_s"][1] > 0.0) is stands


@pytest.mark.parametrize(("before_s", "stands"), [(0.0, True), (1e-6, False)])
def test_a_car_stands_from_the_instant_of_its_standstill_on(
    queries: list[Values], before_s: float, stands: bool
) -> None:
    asked = rested()
    asked_at(asked, asked.monitor._state.fail_safe.stands_s - before_s, (-0.05, 0.05))
    assert (queries[-1]["start_s"] != ROLLS) is stands


# What a manifest says may be rounded.
@pytest.mark.parametrize(
    ("claimed_s", "expected_s"), [(3.0, 3.0), (3.0 - 3e-8, 3.0 - 3e-8), (3.0 + 3e-8, 3.0)]
)
def test_who_looks_ahead_asks_for_no_more_than_the_tubes_hold(
    claimed_s: float, expected_s: float
) -> None:
    usual = fake_bundle()
    manifest = replace(usual.manifest, horizon_s=claimed_s)
    monitor = Monitor(
        Bundle(manifest, usual._kernel, "0" * 64), arc_table(0.0), release_steps=1,
        clearance_required_m=0.5, timing=TIMING, clock=Clock(),
    )  # fmt: skip
    assert monitor._policies.look_ahead.horizon_s == expected_s


def test_a_decision_took_no_longer_than_whoever_asked_had_to_wait() -> None:
    asked = Asked()
    begun_s = time.perf_counter()
    decision = asked.step(observation())
    assert 0.0 < decision.elapsed_s <= time.perf_counter() - begun_s
