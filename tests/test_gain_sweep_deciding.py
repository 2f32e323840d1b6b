"""A sweep's decision is the best of what keeps every bound in every case, and the vehicle file with
it differs in the gains alone."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest
from gain_sweep_cases import row, study, vehicle
from hypothesis import given
from hypothesis import strategies as st

from workbench.cli import gains_front
from workbench.errors import InputError
from workbench.models.vehicle import load_vehicle
from workbench.report import gain_front
from workbench.simulation.gain_sweep.deciding import cost_rows, verdict
from workbench.simulation.gain_sweep.gains import own_gains
from workbench.simulation.gain_sweep.plan import Decision, load_plan
from workbench.simulation.gain_sweep.points import points
from workbench.simulation.gain_sweep.vehicle_text import with_written_gains
from workbench.simulation.simulated import simulated_path

TRADE = ("lateral_3s_m", "delay_margin_s")
PLAIN = Decision({}, {}, TRADE, "lateral_3s_m")
BOUNDED = Decision({"phase_deg": 40.0}, {"settling_s": 9.0}, TRADE, "lateral_3s_m")
VALUES = st.sampled_from([0.5, 1.0, 2.0, math.nan])


@given(st.lists(st.tuples(VALUES, VALUES), min_size=1, max_size=9))
def test_the_front_is_what_nothing_beats(pairs: list[tuple[float, float]]) -> None:
    rows = [row(k, lateral_3s_m=a, delay_margin_s=b) for k, (a, b) in enumerate(pairs)]
    found = verdict(rows, PLAIN)
    costs = [
        (math.inf if math.isnan(a) else a, math.inf if math.isnan(b) else -b) for a, b in pairs
    ]
    expected = {
        k for k, (a, b) in enumerate(costs)
        if not any(c <= a and d <= b and (c, d) != (a, b) for c, d in costs)
    }  # fmt: skip
    assert {point.index for point in found.front} == expected
    assert found.best is not None
    assert costs[found.best.index] == min(costs)


def test_gains_that_are_drawn_again_stand_once_on_the_front() -> None:
    rows = [row(0, lateral_3s_m=3.0), row(1), row(2, kp=0.1), row(3)]
    assert rows[2]["kp"] == rows[1]["kp"]
    assert [point.index for point in verdict(rows, PLAIN).front] == [1, 3]


def test_of_very_many_points_a_page_shows_the_front_and_some(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = verdict([row(k, lateral_3s_m=3.0 if k < 30 else 1.0) for k in range(31)], PLAIN)
    assert len(gains_front.points_table(found).rows) == 31
    monkeypatch.setattr(gains_front, "_MOST", 5)
    table = gains_front.points_table(found)
    assert [cells[0] for cells in table.rows] == [0, 1, 2, 3, 30]
    assert "5 of 31 points" in table.caption
    assert "is drawn" not in gain_front.front_figure(found).caption
    monkeypatch.setattr(gain_front, "_MOST_DRAWN", 10)
    assert "one in 4 is drawn" in gain_front.front_figure(found).caption


def test_the_worst_case_counts() -> None:
    rows = [
        row(0), row(0, 1, lateral_3s_m=3.0, delay_margin_s=0.2),
        row(1, lateral_3s_m=2.0), row(1, 1, lateral_3s_m=2.0),
    ]  # fmt: skip
    found = verdict(rows, PLAIN)
    assert found.present.figures["lateral_3s_m"] == 3.0
    assert found.present.figures["delay_margin_s"] == 0.2
    assert found.best is found.points[1]
    assert found.changes


def test_bounds_and_stability_exclude() -> None:
    good = {"phase_deg": 41.0, "settling_s": 8.0}
    rows = [
        row(0, **good, lateral_3s_m=4.0), row(1, **good, lateral_3s_m=1.0, stable=False),
        row(2, phase_deg=39.0, settling_s=8.0, lateral_3s_m=1.0),
        row(3, phase_deg=41.0, settling_s=math.nan, lateral_3s_m=1.0),
        row(4, **good, lateral_3s_m=2.0),
    ]  # fmt: skip
    found = verdict(rows, BOUNDED)
    assert [point.keeps for point in found.points] == [True, False, False, False, True]
    assert found.best is found.points[4]
    assert "phase margin (deg) 39 < 40" in found.points[2].fails
    assert found.kept == 2
    nothing = verdict(rows[1:4], BOUNDED)
    assert nothing.best is None
    assert cost_rows(nothing) == []


def test_costs_say_which_way() -> None:
    rows = [row(0), row(1, lateral_3s_m=0.5, delay_margin_s=0.5, growth=math.nan)]
    words = {figure.name: word for figure, _, _, word in cost_rows(verdict(rows, PLAIN))}
    assert words["lateral_3s_m"] == "better"
    assert words["delay_margin_s"] == "worse"
    assert words["growth"] == "worse"
    assert words["phase_deg"] == "same"


def test_the_file_differs_in_the_gains_alone(tmp_path: Path) -> None:
    text = simulated_path().read_text(encoding="utf-8")
    gains = {"kp": 0.0125, "ki": 0.001, "kd": 0.3, "look-ahead": 7.5}
    written = tmp_path / "vehicle.toml"
    written.write_text(with_written_gains(text, gains, 'said "so"\nwith a \\'), encoding="utf-8")
    found = load_vehicle(written)
    assert found.steering_pid.proportional_radps_per_m == 0.0125
    assert found.steering_pid.integral_radps_per_ms == 0.001
    assert found.steering_pid.derivative_rad_per_m == 0.3
    assert found.steering_pid.look_ahead_m == 7.5
    assert found.steering_pid.provenance.strip() == 'said "so"\nwith a \\'
    before, after = tomllib.loads(text), tomllib.loads(written.read_text(encoding="utf-8"))
    assert before.pop("steering_pid") != after.pop("steering_pid")
    assert before == after


def test_speed_gains_are_written_where_they_change(tmp_path: Path) -> None:
    text = simulated_path().read_text(encoding="utf-8")
    own = own_gains(vehicle())
    same = with_written_gains(text, own, "why")
    before, after = tomllib.loads(text), tomllib.loads(same)
    assert before["speed_pid"] == after["speed_pid"]
    assert after["steering_pid"]["provenance"] == "why"
    written = tmp_path / "vehicle.toml"
    written.write_text(with_written_gains(text, own | {"speed-kp": 0.9}, "why"), encoding="utf-8")
    found = load_vehicle(written)
    assert own_gains(found) == own | {"speed-kp": 0.9}
    assert found.speed_pid.provenance == "why"


@pytest.mark.parametrize("text", ["[other]\na = 1\n", "steering_pid = { a = 1 }\n"])
def test_a_file_without_the_section_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="section of its own"):
        with_written_gains(text, dict.fromkeys(("kp", "ki", "kd", "look-ahead"), 1.0), "why")


def test_points_are_the_same_by_index_and_in_their_ranges(tmp_path: Path) -> None:
    plan = load_plan(study(tmp_path))
    found = points(plan, vehicle(), range(4))
    assert found[0]["kp"] == vehicle().steering_pid.proportional_radps_per_m
    assert found[2:] == points(plan, vehicle(), [2, 3])
    for each in found[1:]:
        assert 0.008 <= each["kp"] <= 0.012
        assert each["kd"] == 0.08
        assert 5.0 <= each["look-ahead"] <= 8.0
    assert len({each["kp"] for each in found}) == 4


def test_a_grid_has_its_ends(tmp_path: Path) -> None:
    plan = load_plan(study(tmp_path, 'method = "sobol"', 'method = "grid"'))
    assert plan.count == 9
    found = points(plan, vehicle(), range(1, 10))
    assert {each["kp"] for each in found} == {0.008, 0.01, 0.012}
    assert len({(each["kp"], each["look-ahead"]) for each in found}) == 9


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("kp = [0.008, 0.012]", "kp = [0.012, 0.008]", "swap them"),
        ("kp = [0.008, 0.012]", "kq = [0.008, 0.012]", "kq"),
        ("look-ahead = [5.0, 8.0]", "look-ahead = [-5.0, 8.0]", "distances >= 0"),
        ("points = 3", "points = 2.5", "whole numbers"),
        ('method = "sobol"', 'method = "random"', "one of"),
        ("speeds_mps = [2.0]", "speeds_mps = [0.0]", "speeds > 0"),
        ("[[0.0, 0.0], [0.05, 0.05]]", "[]", "not empty"),
        ("radius_factor = 0.5", "radius_factor = 0", "number > 0"),
        ('choose = "lateral_3s_m"', 'choose = "phase_deg"', "one of those traded"),
        ("phase_deg = 40", "beauty = 40", "expected a figure"),
        ('name = "small"', 'name = ""', "text in quotes"),
    ],
)
def test_a_study_that_cannot_be_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = study(tmp_path, old, new)
    with pytest.raises(InputError, match=said) as refused:
        load_plan(file)
    assert str(file) in str(refused.value)
