"""Every step that keeps an observation sound is needed: without it a true state lies outside."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from typing import Any

import pytest
import test_onboard_observing as drawn
from onboard_worst_cases import CHECKS

from workbench.runtime.onboard import crowd, dead_reckoning, readings, stamps
from workbench.runtime.onboard.dead_reckoning import Quantity
from workbench.runtime.onboard.stamps import Stamps

MOST_SEEDS = 40
Plant = tuple[Callable[..., Any], *tuple[tuple[str, str], ...]]
_LOW = "min(apart - change for apart, change in changes) - most_us - ROUNDING_US"
_HIGH = "min(apart + change for apart, change in changes) - least_us + ROUNDING_US"

FAULTS: dict[str, Plant] = {
    "values do not grow upwards with age": (
        Quantity.within, ("max(rises * ahead_s, -falls * back_s)", "0.0"),
    ),
    "values do not grow downwards with age": (
        Quantity.within, ("max(-falls * ahead_s, rises * back_s)", "0.0"),
    ),
    "reports are taken to be of their arrival": (readings.sample_of, ("at_us - most_us", "at_us")),
    "the gain of the speed report is taken to be 1": (
        readings.speed_of, ("settings.speed_gain", "(1.0, 1.0)"),
    ),
    "the largest gain alone is used": (
        readings.speed_of, ("settings.speed_gain", "settings.speed_gain[1:] * 2"),
    ),
    "the map of the steering wheel has no error": (
        readings.steering_of,
        ("settings.road_wheel(low), settings.road_wheel(high)",
         "(low / 20.0, low / 20.0), (high / 20.0, high / 20.0)"),
    ),
    "the wheelbase is known": (
        dead_reckoning.per_wheelbase, ("1.0 / wheelbase_m[0]", "1.0 / wheelbase_m[1]"),
    ),
    "the newest frame shows the offset": (
        Stamps._offset_us, (_LOW, "changes[-1][0]"), (_HIGH, "changes[-1][0] + 1"),
    ),
    "the quickest frame took no time": (
        Stamps._offset_us, ("- most_us - ROUNDING_US", "- ROUNDING_US"),
    ),
    "the quickest frame took all the time": (
        Stamps._offset_us, ("- least_us + ROUNDING_US", "- most_us + ROUNDING_US"),
    ),
    "clocks do not drift": (stamps.StampBounds.drifted_us, ("* self.drift_ppm", "* 0")),
    "the stamp is at the end of its interval": (
        dead_reckoning.reckoned, ("span_s(0, last - first)", "(0.0, 0.0)"),
    ),
    "the stamp is at the begin of its interval": (
        dead_reckoning.reckoned,
        ("span_s(0, last - first)", "span_s(last - first, last - first)"),
    ),
    "the heading stays while a piece lasts": (
        dead_reckoning._moved,
        ("hull((0.0, 0.0), product((0.0, duration[1]), turn))", "(0.0, 0.0)"),
    ),
    "the heading turns the other way": (
        dead_reckoning._moved,
        ("product(duration, turn))", "product(duration, (-turn[1], -turn[0])))"),
    ),
    "sine and cosine change places": (
        dead_reckoning._moved, ("_cosine(headings)", "_sine(headings)"),
    ),
    "people's age has the wrong sign": (
        crowd.observed_person, ("seconds(at_us - now_us)", "seconds(now_us - at_us)"),
    ),
    "people are where they were at the stamp": (
        crowd.observed_person, ("age_us = round(sent.age_s * 1e6)", "age_us = 0"),
    ),
    "AGE is added": (
        crowd.observed_person, ("= round(sent.age_s * 1e6)", "= -round(sent.age_s * 1e6)"),
    ),
    "the people's clock is known": (
        crowd.observed_person, ("longest_s(max(last_us - at_us, at_us - first_us))", "0.0"),
    ),
    "velocities do not change meanwhile": (
        crowd.observed_person, ("limits.acceleration_mps2 * unsure_s", "0.0"),
    ),
    "everybody is on foot": (crowd._bounds, ("return wheels", "return foot")),
    "half of the way since the stamp": (crowd.watched_now, ("+ way_m +", "+ 0.5 * way_m +")),
    "the car's box has no size": (crowd.watched_now, ("+ middle.radius", "")),
    "nobody unseen walks": (crowd.watched_now, ("settings.unseen_speed_mps * elapsed_s", "0.0")),
    "the disc was rounded down": (
        crowd.watched_now, ('rounding("PEOPLE", "WATCHED_RADIUS")', "0.0"),
    ),
}  # fmt: skip


def plant(
    patch: pytest.MonkeyPatch, function: Callable[..., Any], *changes: tuple[str, str]
) -> None:
    """The function with pieces of its text replaced, wherever it is called from."""
    text = textwrap.dedent(inspect.getsource(function))
    for old, new in changes:
        assert text.count(old) == 1, (function, old, text.count(old))
        text = text.replace(old, new)
    space = dict(function.__globals__)
    exec(compile("from __future__ import annotations\n" + text, "planted", "exec"), space)
    patch.setattr(function, "__code__", space[function.__name__].__code__)


def caught_by() -> str | None:
    """The first check or scenario that notices."""
    for check in CHECKS:
        try:
            check()
        except AssertionError:
            return check.__name__
    for seed in range(MOST_SEEDS):
        try:
            wrong, _ = drawn.run(seed, until_us=2_000_000)
        except AssertionError as error:
            return f"seed {seed}: {error}"
        if wrong:
            return f"seed {seed}: {wrong[0]}"
    return None


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_caught(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plant(monkeypatch, *FAULTS[name])
    assert caught_by() is not None


@pytest.mark.parametrize("module", [readings, crowd])
def test_forgotten_rounding_is_caught(module: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "rounding", lambda *_names: 0.0)
    assert caught_by() is not None


def test_nothing_planted_nothing_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    plant(monkeypatch, crowd.watched_now, ("+ way_m +", "+ 1.0 * way_m +"))
    monkeypatch.setattr("test_onboard_observing_faults.MOST_SEEDS", 5)
    assert caught_by() is None
