"""manifest.json survives writing and reading bit for bit, and no malformed one is believed."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime_fixture import fake_manifest

from workbench.errors import InputError
from workbench.runtime.bundle import first_difference
from workbench.runtime.manifest import (
    Field,
    Golden,
    Kernel,
    Manifest,
    manifest_from_json,
    manifest_to_json,
)
from workbench.runtime.runs import packed_runs, unpacked_runs


def _small(query: tuple[float, ...], result: tuple[float, ...]) -> Manifest:
    return replace(
        fake_manifest(),
        kernel=Kernel("wb_decide", len(query), len(result), 0),
        query=(Field("all", 0, len(query), None),),
        result=(Field("all", 0, len(result), None),),
        golden=(Golden(query, result, 3),),
    )


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(), min_size=1, max_size=9), st.lists(st.floats(), min_size=1, max_size=9))
def test_golden_numbers_come_back_bit_for_bit(query: list[float], result: list[float]) -> None:
    read = manifest_from_json(manifest_to_json(_small(tuple(query), tuple(result)))).golden[0]
    assert first_difference(query, read.query) is None
    assert first_difference(result, read.result) is None
    assert read.returns == 3


@given(st.lists(st.sampled_from([0.0, -0.0, 1.5, math.nan, math.inf]), max_size=40))
def test_runs_of_one_number_are_written_once_and_come_back_bit_for_bit(
    numbers: list[float],
) -> None:
    items = packed_runs(numbers)
    assert first_difference(numbers, unpacked_runs(items, most=len(numbers))) is None
    assert all(isinstance(item, str) or item[0] >= 4 for item in items)  # type: ignore[index]
    assert len(packed_runs([0.0] * 9000 + numbers[:1])) <= 2


def test_the_whole_manifest_comes_back() -> None:
    manifest = replace(fake_manifest(), golden=fake_manifest().golden[:1])
    assert manifest_from_json(manifest_to_json(manifest)) == manifest
    without_region = replace(manifest, region=None)
    assert manifest_from_json(manifest_to_json(without_region)) == without_region


def _edit(*path: str | int, to: Any) -> Callable[[dict[str, Any]], None]:
    def apply(content: dict[str, Any]) -> None:
        place: Any = content
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = to

    return apply


def _drop(*path: str | int) -> Callable[[dict[str, Any]], None]:
    def apply(content: dict[str, Any]) -> None:
        place: Any = content
        for key in path[:-1]:
            place = place[key]
        del place[path[-1]]

    return apply


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_edit("format", to=1), "format 1 is unknown, this workbench reads format 2"),
        (_edit("format", to=True), "format: expected an integer"),
        (_edit("format", to="1"), "format: expected an integer"),
        (_drop("format"), "format: expected this key"),
        (_edit("extra", to=1), r"unknown keys \['extra'\]"),
        (_edit("name", to=7), "name: expected a text, got 7"),
        (_edit("flags", to=[1]), "flags: expected a text, got 1"),
        (_edit("flags", to="-O2"), "flags: expected a list"),
        (_edit("rigor", to="PROVED"), "rigor: expected one of"),
        (_edit("steps", to=0), "expected steps >= 1"),
        (_edit("steps", to=59), "horizon_s = steps"),
        (_edit("step_s", to="0.05"), "step_s: expected a finite number"),
        (_edit("horizon_s", to=True), "horizon_s: expected a finite number"),
        (_edit("kernel", to=[]), "kernel: expected an object"),
        (_edit("kernel", "file", to="../evil.so"), "kernel.file: expected 'kernel.so'"),
        (_edit("kernel", "entry", to="wb decide"), "to be a C name"),
        (_edit("kernel", "query_size", to=0), "query_size >= 1"),
        (_edit("kernel", "query_size", to=5000), r"its size is 5000 \(kernel.query_size\)"),
        (_edit("kernel", "result_size", to=7), r"its size is 7 \(kernel.result_size\)"),
        (_edit("query", 1, "offset", to=8), "expected 'initial_radius' at offset 21, got 8"),
        (_edit("query", 1, "offset", to=-1), "offset >= 0"),
        (_edit("query", 1, "count", to=0), "count >= 1"),
        (_edit("query", 1, "name", to="initial_center"), "distinct, non-empty query field names"),
        (_edit("query", 1, to=None), r"query\[1\]: expected an object, got NoneType"),
        (_edit("query", 1, "default", to=[0.0]), "expected 21 finite default values, got 1"),
        (_edit("query", 1, "default", to=["0"] * 21), r"query\[1\].default: expected a finite"),
        (_edit("query", 1, "default", to=5), r"query\[1\].default: expected a list or null"),
        (_edit("query", 1, "unit", to="m"), r"query\[1\]: unknown keys"),
        (_drop("query", 1, "default"), r"query\[1\].default: expected this key"),
        (_edit("result", 0, "default", to=None), r"result\[0\]: unknown keys"),
        (_edit("states", to=[]), "expected at least one state"),
        (_edit("states", 1, "name", to="station"), "distinct, non-empty state names"),
        (_edit("parameters", 0, "name", to=""), "field ''|non-empty parameter names"),
        (_edit("parameters", 0, "lower", to=5.0), "lower <= nominal <= upper"),
        (_edit("vehicle", "wheelbase_m", to=-1.75), "wheelbase_m, front_m and half_width_m > 0"),
        (_edit("vehicle", "rear_m", to=-0.1), "rear_m >= 0"),
        (_edit("vehicle", "colour", to="red"), "vehicle.colour: expected a finite number"),
        (_edit("region", "warmth", to=[0.0, 1.0]), "the region names"),
        (_edit("region", "speed", to=[1.0, 0.0]), r"region.speed: expected \[lower, upper\]"),
        (_edit("region", "speed", to=[1.0]), r"region.speed: expected \[lower, upper\]"),
        (_edit("levels", to=[]), "expected shares that fall from 1 on, level by level, got"),
        (_edit("levels", 0, "share", to=0.9), "expected shares that fall from 1 on"),
        (_edit("levels", 2, "share", to=0.7), "expected shares that fall from 1 on"),
        (_edit("levels", 1, "share", to=0.0), "level 'two thirds': expected a name and a share"),
        (_edit("levels", 1, "share", to=1.1), "level 'two thirds': expected a name and a share"),
        (_edit("levels", 1, "name", to="whole"), "distinct, non-empty level names"),
        (_edit("levels", 1, "name", to=""), "level '': expected a name"),
        (_edit("deciding_level", to="half"), "deciding_level: expected one of"),
        (_edit("deciding", to="neither"), "deciding: expected one of .*'both'.*, got 'neither'"),
        (_edit("brake", "deceleration_min_mps2", to=0.0), "brake: expected a finite decel"),
        (_edit("brake", "delay_s", to=-0.1), "brake: expected finite delay_s"),
        (_edit("brake", "strength", to=1.0), r"brake: unknown keys \['strength'\]"),
        (_drop("brake", "build_up_s"), "brake.build_up_s: expected this key"),
        (_edit("guard", "speed_max_mps", to=0.0), "guard: expected finite limits > 0"),
        (_edit("guard", "accel_max_mps2", to=-1.0), "guard: expected finite limits > 0"),
        (_edit("guard", "jerk", to=1.0), r"guard: unknown keys \['jerk'\]"),
        (_edit("budget", to=0), "budget: expected at least 1 step, got 0"),
        (_edit("budget", to=1.5), "budget: expected an integer"),
        (_edit("tubes", to=""), "tubes: expected kernel and form"),
        (_edit("tubes", to=["local"]), "tubes: expected a text"),
        (_drop("tubes"), "tubes: expected this key"),
        (_edit("assumptions", 0, "evidence", to=None), r"assumptions\[0\].evidence"),
        (_edit("golden", to=[]), "at least one golden vector"),
        (_edit("golden", 0, "query", to=["0x1p0"]), "golden vector 0: expected"),
        (_edit("golden", 0, "query", 3, to=[10**9, "0x0p0"]), r"golden\[0\].query: expected at m"),
        (_edit("golden", 0, "query", 3, to=[0, "0x0p0"]), r"one by one or as \[how many, number\]"),
        (_edit("golden", 0, "query", 3, to=[True, "0x0p0"]), r"one by one or as \[how many"),
        (_edit("golden", 0, "query", 3, to=[5, 0.0]), r"golden\[0\].query: .*float.hex"),
        (_edit("golden", 0, "query", 3, to=["0x0p0"]), r"golden\[0\].query: .*float.hex"),
        (_edit("golden", 0, "query", 3, to="1.0x"), r"golden\[0\].query: .*float.hex"),
        (_edit("golden", 0, "query", 3, to="0x1p9999"), r"golden\[0\].query: .*float.hex"),
        (
            _edit("golden", 0, "query", 3, to=1.0),
            r"golden\[0\].query: .*float.hex writes it, got 1.0",
        ),
    ],
)
def test_a_malformed_manifest_names_the_key(
    edit: Callable[[dict[str, Any]], None], message: str
) -> None:
    manifest = replace(fake_manifest(), golden=fake_manifest().golden[:1])
    content = json.loads(manifest_to_json(manifest))
    edit(content)
    with pytest.raises(InputError, match=message) as caught:
        manifest_from_json(json.dumps(content))
    assert "workbench build" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected JSON"),
        ("{", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        ('{"format": NaN}', "NaN is not a JSON number"),
        ("[]", "expected an object, got list"),
        (
            '{"format": 2, "rigor": "ENCLOSED", "name": 1e999, "guard": '
            '{"speed_max_mps": 1, "accel_max_mps2": 1}}',
            "name: expected a text",
        ),
    ],
)
def test_text_that_is_no_manifest_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        manifest_from_json(text)


def test_numbers_that_overflow_are_refused() -> None:
    text = manifest_to_json(fake_manifest()).replace('"step_s": 0.05', '"step_s": 1e999')
    with pytest.raises(InputError, match="step_s: expected a finite number, got inf"):
        manifest_from_json(text)
    with pytest.raises(InputError, match="finite default"):
        Field("a", 0, 1, (math.nan,))
