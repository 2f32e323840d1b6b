"""A monitor is made only of a bundle that fits it and of settings that make sense."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from runtime_fixture import fake_bundle, write_bundle
from runtime_world import TIMING, Asked, arc_table, observation

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Action, Deciding, Monitor, load_bundle
from workbench.runtime.manifest import Field, Manifest


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"release_steps": 0}, "release_steps >= 1"),
        ({"clearance_required_m": -0.1}, "clearance_required_m >= 0"),
        ({"clearance_required_m": math.nan}, "clearance_required_m >= 0"),
        ({"start_station_m": math.inf}, "finite start_station_m"),
        ({"clock": lambda: math.nan}, "clock: expected a finite time"),
        ({"clock": lambda: "noon"}, "clock: expected a finite time"),
        ({"clock": time.time}, r"below 1e\+09, got .*time\.monotonic"),
        ({"release_steps": math.nan}, "release_steps >= 1"),
        ({"deciding": "all"}, r"\['both', 'LookAhead', 'FailSafe'\], got 'all'"),
    ],
)
def test_a_monitor_is_not_made_with_senseless_settings(
    arguments: dict[str, Any], message: str
) -> None:
    usual: dict[str, Any] = {"release_steps": 1, "clearance_required_m": 0.5, "timing": TIMING}
    with pytest.raises(InputError, match=message):
        Monitor(fake_bundle(), arc_table(0.0), **(usual | arguments))


def _renamed(fields: tuple[Field, ...], name: str) -> tuple[Field, ...]:
    return tuple(replace(f, name="other") if f.name == name else f for f in fields)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: replace(m, states=m.states[::-1]), "expected a kernel in the states"),
        (
            lambda m: replace(m, parameters=(replace(m.parameters[0], name="v"), m.parameters[1])),
            "the parameter 'reference_speed'",
        ),
        (lambda m: replace(m, parameters=m.parameters[:1]), r"expected {'parameters': 1}"),
        (lambda m: replace(m, query=_renamed(m.query, "path_x")), "'path_x': 2"),
        (lambda m: replace(m, query=_renamed(m.query, "people_tubes")), "'people_tubes': 640"),
        (lambda m: replace(m, result=_renamed(m.result, "stop_lower")), "'stop_lower': 420"),
        (
            lambda m: replace(m, levels=m.levels[:2], deciding_level="whole"),
            "'initial_center': 14",
        ),
        (
            lambda m: replace(m, query=(*m.query[:-1], replace(m.query[-1], default=None))),
            r"needs \['acceleration_bound'\]",
        ),
    ],
)
def test_a_bundle_with_another_interface_is_refused(
    change: Callable[[Manifest], Manifest], message: str, tmp_path: Path
) -> None:
    bundle = load_bundle(write_bundle(tmp_path, change=change))
    with pytest.raises(InputError, match=message):
        Monitor(bundle, arc_table(0.0), release_steps=1, clearance_required_m=0.5, timing=TIMING)


def test_a_region_left_open_restricts_nothing(tmp_path: Path) -> None:
    bundle = load_bundle(write_bundle(tmp_path, change=lambda m: replace(m, region=None)))
    monitor = Monitor(
        bundle, arc_table(0.0), release_steps=1, clearance_required_m=0.5, timing=TIMING
    )
    seen = replace(observation(speed=(-0.6, 1.0)), stamp_s=time.monotonic())
    assert monitor.step(seen).verdict is Verdict.SAFE


@pytest.mark.parametrize("deciding", [*Deciding, *[each.value for each in Deciding], None])
def test_the_bundle_says_who_decides_unless_the_monitor_does(
    deciding: Deciding | str | None,
) -> None:
    asked = Asked() if deciding is None else Asked(deciding=deciding)
    decision = asked.step(observation())
    # The car moves: LookAhead permits it to go on, FailSafe has to see it stand first.
    tracks = decision.action is Action.TRACK
    assert tracks == (deciding in (Deciding.LOOK_AHEAD, "LookAhead", None))
    assert decision.look_ahead.action is Action.TRACK
    assert decision.fail_safe.action is Action.BRAKE
