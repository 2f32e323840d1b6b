"""Report figures label every axis with its unit and draw the numbers they are given."""

from __future__ import annotations

import dataclasses
import json
import math
import re

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

import report_cases as cases

from workbench.claims import Rigor, Verdict
from workbench.errors import InputError
from workbench.report.curves import Growth, Origin, first_escape_s, mean_ratio
from workbench.report.drawing import VERDICT_COLOURS
from workbench.report.figures import comparison_table, growth_figure, tube_figure
from workbench.report.plane import corners, plane_figure
from workbench.report.scene import Detail, scene_json
from workbench.report.timeline import decision_table, verdict_timeline
from workbench.simulation.frames import Frame, PersonFrame

TIMES = np.linspace(0.0, 3.0, 61)


def growth(label: str, half_widths: np.ndarray, origin: Origin = Origin.PROVED) -> Growth:
    return Growth(label, origin, Rigor.NUMERICAL, TIMES, half_widths)


def texts(svg: str) -> str:
    return " | ".join(re.findall(r"<text[^>]*>([^<]*)</text>", svg))


def test_tube_has_one_panel_per_state_with_units() -> None:
    figure = tube_figure(cases.tube(), cases.samples())
    assert len(figure.panels) == len(cases.NAMES)
    assert "rigor NUMERICAL" in figure.caption
    for name, unit, panel in zip(cases.NAMES, cases.UNITS, figure.panels, strict=True):
        assert name in texts(panel)
        assert f"({unit})" in texts(panel)
        assert "time (s)" in texts(panel)


def test_thin_tube_is_drawn_about_its_centre_and_a_wide_one_is_not() -> None:
    panels = tube_figure(cases.tube()).panels
    assert "x − centre (m)" in texts(panels[0])
    assert "− centre" not in texts(panels[1])


def test_growth_is_labelled_logarithmic_exactly_where_it_is() -> None:
    near = growth("near", np.stack([1.0 + TIMES], axis=1))
    far = growth("far", np.stack([100.0 + TIMES], axis=1))
    assert "log scale" not in texts(growth_figure([near], names=["y"], units=["m"]).panels[0])
    both = texts(growth_figure([near, far], names=["y"], units=["m"]).panels[0])
    assert "half width (m), log scale" in both
    assert "mathdefault" not in both


def test_growth_of_a_state_without_width_can_be_drawn() -> None:
    flat = growth("flat", np.zeros((61, 1)))
    assert "half width (m)" in texts(growth_figure([flat], names=["y"], units=["m"]).panels[0])


def test_ratio_and_first_escape_follow_their_definitions() -> None:
    sampled = growth("sampled", np.stack([np.ones(61), np.zeros(61)], axis=1), Origin.SAMPLES)
    double = growth("double", np.stack([2.0 * np.ones(61), np.ones(61)], axis=1))
    ratios = mean_ratio(double, sampled)
    assert ratios[0] == pytest.approx(2.0)
    assert math.isnan(ratios[1])
    assert first_escape_s(double, sampled) is None
    shrinking = growth("shrinking", np.stack([1.5 - 0.5 * TIMES, np.ones(61)], axis=1))
    assert first_escape_s(shrinking, sampled) == pytest.approx(1.05)
    table = comparison_table([sampled, shrinking], names=["a", "b"])
    column = list(table.headings).index("a sample escapes at (s)")
    assert table.rows[0][column] == pytest.approx(1.05)
    assert not {"finding", "detail"} & set(table.headings)


def test_an_excess_below_the_error_of_the_runs_is_no_escape() -> None:
    bound = growth("bound", np.ones((61, 1)))
    beyond = growth("runs", np.full((61, 1), 1.0 + 1e-7), Origin.SAMPLES)
    assert first_escape_s(bound, beyond) == 0.0
    assert first_escape_s(bound, dataclasses.replace(beyond, error=np.full((61, 1), 2e-7))) is None
    assert first_escape_s(bound, dataclasses.replace(beyond, error=np.full((61, 1), 5e-8))) == 0.0


def test_bound_that_ends_early_is_not_extended() -> None:
    short = Growth("short", Origin.PROVED, Rigor.NUMERICAL, TIMES[:31], 3.0 * np.ones((31, 1)))
    sampled = growth("sampled", np.ones((61, 1)), Origin.SAMPLES)
    assert math.isnan(short.at(TIMES)[31, 0])
    assert mean_ratio(short, sampled)[0] == pytest.approx(3.0)


def test_plane_and_timeline_name_units_and_verdicts() -> None:
    frame = cases.frame(2.7, ("Ada", "Ben"))
    plane = texts(plane_figure(frame).panels[0])
    for label in ("x (m)", "y (m)", "Ada", "Ben"):
        assert label in plane
    line = texts(verdict_timeline(cases.frames()).panels[0])
    for label in ("time (s)", "speed (m/s)", "clearance (m)", "SAFE", "UNPROVED", "INVALID"):
        assert label in line
    for label in ("LookAhead", "FailSafe", "violation", "alert"):
        assert label in line


def test_tubes_have_the_colours_of_the_policies_that_they_decide() -> None:
    frame = cases.frame(2.7, ("Ada", "Ben"))
    said = dict(zip(("LookAhead", "FailSafe"), (Verdict.SAFE, Verdict.INVALID), strict=True))
    frame = dataclasses.replace(
        frame,
        verdict=Verdict.UNPROVED,
        policies=tuple(
            dataclasses.replace(answer, verdict=said[answer.policy]) for answer in frame.policies
        ),
    )
    panel = plane_figure(frame).panels[0].lower()
    for verdict in Verdict:
        drawn = VERDICT_COLOURS[verdict].lower() in panel
        assert drawn == (verdict in said.values())
    keys = [key.label for key in plane_figure(frame).legend]
    assert "TRACK, then BRAKE to standstill, FailSafe INVALID" in keys
    assert "where the guard lets them be" in keys


def test_the_table_of_decisions_holds_every_policy_set_violation_and_alert() -> None:
    frames = cases.frames(40)
    table = decision_table(frames)
    cells = [dict(zip(table.headings, row, strict=True)) for row in table.rows]
    for frame, row in zip(frames, cells, strict=True):
        for answer in frame.policies:
            assert f"{answer.policy} {answer.verdict.value}" in str(row["each policy"])
        for level in frame.levels:
            told = str(row[f"{level.tube}: nested sets, the largest first"])
            assert told.split() == [verdict.value for verdict in level.verdicts]
        assert row["violations"] == "; ".join(frame.violations)
        assert row["alert"] == (frame.alert or "")


def test_plane_uses_one_scale_for_both_axes() -> None:
    panel = plane_figure(cases.frame(2.7, ("Ada",))).panels[0]
    ticks = re.findall(r'<use xlink:href="#\w+" x="([\d.]+)" y="([\d.]+)"', panel)
    rows = [float(y) for _, y in ticks]
    columns = [float(x) for x, _ in ticks]
    axis_y = max(set(rows), key=rows.count)
    xs = sorted(x for x, y in zip(columns, rows, strict=True) if y == axis_y)
    ys = sorted(y for x, y in zip(columns, rows, strict=True) if y != axis_y)
    labels = [float(t.replace("−", "-")) for t in texts(panel).split(" | ") if _is_number(t)]
    x_step = labels[1] - labels[0]
    y_step = labels[-1] - labels[-2]
    assert (xs[1] - xs[0]) / x_step == pytest.approx((ys[1] - ys[0]) / y_step, rel=0.01)


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[−-]?\d+(\.\d+)?", text) is not None


def test_corners_of_a_turned_rectangle() -> None:
    turned = corners((1.0, 2.0, math.pi / 2, 3.0, 0.5))
    assert turned[0] == pytest.approx((0.5, 5.0))
    assert turned[2] == pytest.approx((1.5, -1.0))


def test_verdict_colours_differ() -> None:
    assert len(set(VERDICT_COLOURS.values())) == len(Verdict)


def restored(flat: list[int], width: int) -> list[list[float]]:
    rows = np.cumsum(np.array(flat).reshape(-1, width), axis=0)
    return [list(row / 100.0) for row in rows]


def test_scene_data_give_back_positions_within_a_centimetre() -> None:
    frames = cases.frames(40)
    data = json.loads(scene_json(frames, Detail(frames=99, rectangles=99, discs=99, people=9)))
    for frame, row in zip(frames, data["frames"], strict=True):
        assert row["c"][0] / 100.0 == pytest.approx(frame.x_m, abs=0.006)
        assert row["s"] == pytest.approx(frame.speed_mps, abs=0.006)
        boxes = restored(row["o"], 5)
        assert len(boxes) == len(frame.occupancy)
        for box, shape in zip(boxes, frame.occupancy, strict=True):
            assert box[:2] == pytest.approx(shape[:2], abs=0.006)
            assert box[3:] == pytest.approx(shape[3:], abs=0.006)
        for person, entry in zip(frame.people, row["p"], strict=True):
            assert data["texts"][entry[0]] == person.name
            discs = restored(entry[1:], 3)
            assert discs[0] == pytest.approx((person.x_m, person.y_m, 0.3), abs=0.006)
            assert discs[-1] == pytest.approx(person.predicted[-1], abs=0.006)
        stops = restored(row["h"], 5)
        assert len(stops) == len(frame.stop_occupancy)
        assert stops[-1][:2] == pytest.approx(frame.stop_occupancy[-1][:2], abs=0.006)
        assert restored(row["g"][0], 3)[-1] == pytest.approx(frame.people[0].guarded[-1], abs=0.006)
        verdicts = [name for name, _ in data["verdicts"]]
        assert [[data["texts"][p], verdicts[v]] for p, v, _, _ in row["q"]] == [
            [answer.policy, answer.verdict.value] for answer in frame.policies
        ]
        assert [[data["texts"][m[0]], *(verdicts[v] for v in m[1:])] for m in row["m"]] == [
            [level.tube, *(verdict.value for verdict in level.verdicts)] for level in frame.levels
        ]
        assert tuple(data["texts"][w] for w in row["w"]) == frame.violations
        assert (row["z"] is None) == (frame.alert is None)
    assert restored(data["paths"][0], 2)[-1] == pytest.approx(frames[0].path[-1], abs=0.006)


def test_failed_proofs_leave_no_shapes_but_a_missing_pose_is_refused() -> None:
    frame = dataclasses.replace(
        cases.frame(0.0, ("Ada",)), occupancy=((math.nan,) * 5, (1e300, 0.0, 0.0, 1.0, 1.0))
    )
    row = json.loads(scene_json([frame], Detail(9, 9, 9, 9)))["frames"][0]
    assert row["o"] == []
    assert "x (m)" in texts(plane_figure(frame).panels[0])
    with pytest.raises(InputError, match="expected finite numbers"):
        dataclasses.replace(frame, x_m=math.nan)
    with pytest.raises(InputError, match="clearance"):
        dataclasses.replace(frame, clearance_m=1e300)
    with pytest.raises(InputError, match="Ada"):
        PersonFrame("Ada", 0.0, math.inf, 0.3)


def test_shapes_that_do_not_fit_are_refused() -> None:
    tube = cases.tube()
    with pytest.raises(InputError, match="`lower`"):
        dataclasses.replace(tube, lower=tube.lower_at)
    with pytest.raises(InputError, match="half widths of 'a'"):
        growth_figure([growth("a", np.ones((61, 3)))], names=["y"], units=["m"])
    with pytest.raises(InputError, match="half widths"):
        growth("b", np.ones((60, 1)))


def test_nobody_and_nothing_proved_can_be_drawn() -> None:
    bare = Frame(0.0, 0.0, 0.0, 0.0, 2.3, 0.5, 0.6, 0.0, Verdict.INVALID, "BRAKE", "NaN", None)
    assert "y (m)" in texts(plane_figure(bare).panels[0])
    assert "time (s)" in texts(verdict_timeline([bare]).panels[0])


def test_what_is_reached_for_certain_is_drawn_but_no_bound_to_compare() -> None:
    sampled = growth("sampled", np.stack([TIMES], axis=1), Origin.SAMPLES)
    reached = growth("reached", np.stack([TIMES], axis=1), Origin.REACHED)
    tight = growth("tight", np.stack([1.1 * TIMES], axis=1))
    curves = [sampled, reached, tight]
    assert [row[0] for row in comparison_table(curves, names=["x"]).rows] == ["tight"]
    assert len(growth_figure(curves, names=["x"], units=["m"]).legend) == 3
