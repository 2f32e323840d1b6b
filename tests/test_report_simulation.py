"""The page of a simulated drive shows what was decided, failed and was needless, offline."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

import report_cases as cases
from test_report_browser import browse

from workbench.claims import Assumption, Verdict
from workbench.errors import InputError
from workbench.report.demo import telling
from workbench.report.scene import Detail, scene_json
from workbench.report.simulation import SimulationReport, simulation_page
from workbench.report.simulation_levels import failures_table, level_timeline
from workbench.report.simulation_plots import Braking, DriveCurves, drive_figure
from workbench.report.tables import Table
from workbench.report.timeline import decision_table, summary_table, verdict_timeline
from workbench.simulation.frames import Frame, LevelVerdicts

LEVELS = ("whole", "two thirds", "one third")


def frame(t_s: float, *violations: str, alert: str | None = None, level: int = 0) -> Frame:
    """level: how many of the three sets, the largest first, are UNPROVED."""
    said = tuple(Verdict.UNPROVED if k < level else Verdict.SAFE for k in range(3))
    return dataclasses.replace(
        cases.frame(t_s, ("Ada",)), violations=violations, alert=alert,
        levels=(LevelVerdicts("track", said), LevelVerdicts("stop", (Verdict.SAFE,) * 3)),
    )  # fmt: skip


def curves(*, near_m: float = 6.0, braking: tuple[Braking, ...] = ()) -> DriveCurves:
    times = np.arange(0.0, 3.0, 0.1)
    speed = np.full(30, 2.0)
    return DriveCurves(
        times, np.full(30, near_m), speed, np.stack([speed, 1.5 * speed], axis=1), 0.0 * times,
        0.0 * times, times[::3], np.full(10, 4.0), np.full(10, 2.0), braking,
    )  # fmt: skip


def report(
    frames: tuple[Frame, ...], drive: DriveCurves, title: str = "A test"
) -> SimulationReport:
    table = Table("settings", ["setting", "value"], [["seed", 0]])
    return SimulationReport(
        title, "What happens.", ("As expected.",), frames, LEVELS, drive, (), table, ("A note.",),
        (Assumption("model", "holds", ""),),
    )  # fmt: skip


def test_what_failed_is_told_from_when_to_when_with_its_words() -> None:
    frames = (
        frame(0.0), frame(0.1, "LATE: by 3 ms"), frame(0.2, "LATE: by 9 ms"), frame(0.3),
        frame(2.0, "LATE: again", alert="Ada: braking is not proved to keep clear"),
        frame(2.1, alert="Ada: still"),
    )  # fmt: skip
    assert [tuple(row) for row in failures_table(frames).rows] == [
        (0.1, 0.2, "LATE", "by 3 ms"),
        (2.0, 2.0, "LATE", "again"),
        (2.0, 2.1, "alert", "Ada: braking is not proved to keep clear"),
    ]
    nothing = failures_table((frame(0.0), frame(0.1)))
    assert [row[2] for row in nothing.rows] == ["nothing failed, and nobody was alerted"]


def test_a_turn_without_a_decision_is_told_and_is_no_decision() -> None:
    fault = "LOCALISATION_LOST: 1 s old"
    silent = dataclasses.replace(
        frame(0.2, fault), decided=False, verdict=Verdict.INVALID, levels=(), policies=(),
        action="", sent="BRAKE",
    )  # fmt: skip
    frames = (frame(0.0), frame(0.1), silent, frame(0.3))
    assert [tuple(row) for row in failures_table(frames).rows] == [
        (0.2, 0.2, "LOCALISATION_LOST", "1 s old")
    ]
    assert [row[1] for row in decision_table(frames).rows][2] == "no decision"
    counted = {row[0]: row[1] for row in summary_table(frames).rows}
    assert (counted["decisions"], counted["verdict INVALID"]) == (3, 0)
    assert telling(frames).decided
    keys = [key.label for key in verdict_timeline(frames).legend]
    assert "no decision" in keys
    assert "no decision" not in [key.label for key in verdict_timeline(frames[:2]).legend]
    with pytest.raises(InputError, match="at least one decision"):
        telling((silent,))
    rows = json.loads(scene_json(frames, Detail(9, 9, 9, 9)))["frames"]
    assert ["u" in row for row in rows] == [False, False, True, False]


def drawn(panel: str) -> int:
    """Shapes in a picture, the patterns that fill some of them left out."""
    return re.sub(r"<pattern.*?</pattern>", "", panel, flags=re.DOTALL).count("<path")


def test_every_nested_set_has_a_bar_that_changes_with_its_verdict() -> None:
    calm = tuple(frame(0.1 * k) for k in range(20))
    unsure = tuple(frame(0.1 * k, level=2 if k >= 10 else 0) for k in range(20))
    figures = [level_timeline(frames, LEVELS) for frames in (calm, unsure)]
    for figure in figures:
        for tube in ("track", "stop"):
            assert all(f"{tube}: {name}" in figure.panels[0] for name in LEVELS)
    shapes = [drawn(figure.panels[0]) for figure in figures]
    # Two sets turn from one colour to another, so that two more bars are drawn, not one per frame.
    assert shapes[1] - shapes[0] == 2


def test_more_is_drawn_for_what_failed_and_for_alerts() -> None:
    frames = (frame(0.0), frame(0.1, "NOBODY_NEW: 0", alert="0: stop"), frame(0.2))
    panel = level_timeline(frames, LEVELS).panels[0]
    assert "nobody new" in panel
    assert "alert" in panel
    assert "nobody new" not in level_timeline((frame(0.0),), LEVELS).panels[0]


@pytest.mark.parametrize("needless", [True, False])
def test_braking_is_shaded_as_needless_or_not(needless: bool) -> None:
    plain = drive_figure(curves()).panels[0]
    panel = drive_figure(curves(braking=(Braking(1.0, 1.5, needless),))).panels[0]
    vermillion = "#d55e00"
    # In each of five plots.
    assert drawn(panel) - drawn(plain) == 5
    assert panel.count("fill: url(") - plain.count("fill: url(") == (5 if needless else 0)
    assert (panel.lower().count(vermillion) > plain.lower().count(vermillion)) == needless


def test_braking_that_nobody_can_judge_looks_like_neither() -> None:
    panels = [
        drive_figure(curves(braking=(Braking(1.0, 1.5, needless),))).panels[0]
        for needless in (True, False, None)
    ]
    assert len(set(panels)) == 3


def test_a_drive_with_nobody_near_says_so() -> None:
    far = drive_figure(dataclasses.replace(curves(near_m=40.0), clearance_m=np.full(10, np.nan)))
    assert "nobody within 15 m" in far.panels[0]
    assert "nobody within" not in drive_figure(curves()).panels[0]


def test_curves_of_other_lengths_are_refused() -> None:
    with pytest.raises(InputError, match="speed_mps"):
        dataclasses.replace(curves(), speed_mps=np.zeros(29))
    with pytest.raises(InputError, match="clearance_m"):
        dataclasses.replace(curves(), clearance_m=np.zeros(9))
    empty = np.zeros(0)
    with pytest.raises(InputError, match="at least one turn"):
        dataclasses.replace(curves(), t_s=empty)


def test_numbers_stand_in_the_table_as_given() -> None:
    table = drive_figure(curves()).numbers
    assert table is not None
    assert list(table.rows[3]) == pytest.approx([0.3, 6.0, 2.0, 2.0, 3.0, 0.0, 0.0])
    gone = drive_figure(dataclasses.replace(curves(), nearest_m=np.full(30, np.nan))).numbers
    assert gone is not None
    assert gone.rows[0][1] is None


def test_the_page_refers_to_nothing_outside_and_escapes_what_it_is_given() -> None:
    text = simulation_page(
        report(cases.frames(), curves(), title=cases.HOSTILE), version="0", command="workbench"
    ).html()
    assert "<script>alert" not in text
    for needed in ("What happens.", "As expected.", "A note.", "holds", 'class="scene"'):
        assert needed in text
    assert not re.findall(r"(?:src|href)=\"(?!#|data:)", text)


def test_the_player_works_on_a_phone_without_a_message_in_the_console(
    require_tool: Callable[..., str], tmp_path: Path
) -> None:
    browser = require_tool("chromium", "chromium-browser", "google-chrome")
    last = cases.frames()[-1]
    silent = dataclasses.replace(last, t_s=last.t_s + 0.1, decided=False, policies=(), levels=())
    page = simulation_page(
        report((*cases.frames(), silent), curves(braking=(Braking(1.0, 2.0, needless=True),))),
        version="0", command="x",
    )  # fmt: skip
    found, console = browse(browser, page.html(), tmp_path)
    assert console == ""
    assert "wide=false" in found
    assert "played=true" in found
    assert "inked=true" in found
