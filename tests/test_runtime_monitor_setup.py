"""A monitor is made only of a bundle that fits it and of settings that make sense."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from runtime_fixture import arc_table, fake_bundle, observation, write_bundle

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.runtime import Monitor, load_bundle
from workbench.runtime.manifest import Field, Manifest


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"release_steps": 0}, "release_steps >= 1"),
        ({"clearance_required_m": -0.1}, "clearance_required_m >= 0"),
        ({"clearance_required_m": math.nan}, "clearance_required_m >= 0"),
        ({"start_station_m": math.inf}, "finite start_station_m"),
    ],
)
def test_a_monitor_is_not_made_with_senseless_settings(
    arguments: dict[str, Any], message: str
) -> None:
    usual: dict[str, Any] = {"release_steps": 1, "clearance_required_m": 0.5}
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
        (lambda m: replace(m, query=_renamed(m.query, "people")), "'people': 7"),
        (lambda m: replace(m, result=_renamed(m.result, "occupancy")), "'occupancy': 300"),
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
        Monitor(bundle, arc_table(0.0), release_steps=1, clearance_required_m=0.5)


def test_a_region_left_open_restricts_nothing(tmp_path: Path) -> None:
    bundle = load_bundle(write_bundle(tmp_path, change=lambda m: replace(m, region=None)))
    monitor = Monitor(bundle, arc_table(0.0), release_steps=1, clearance_required_m=0.5)
    assert monitor.step(replace(observation(), speed=(-0.6, 1.0))).verdict is Verdict.SAFE
