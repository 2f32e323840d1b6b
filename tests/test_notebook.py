"""Every result that a user holds plots itself with units, gives tidy rows with all its numbers,
shows itself in a notebook and saves itself as a page."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")
pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

import casadi as ca
import report_cases as cases
from gain_sweep_cases import row
from matplotlib.figure import Figure
from page_cases_bounds import examined
from test_every_page import by_colour_alone, unlabelled
from test_report_pages import Strict

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models import System, system_from_casadi
from workbench.reach import ReachTube, SearchEffort, TubeStatus, compute_tube, inner_hull
from workbench.report.drawing import DASHES, Key
from workbench.report.notebook import beside, both_sides, view
from workbench.report.view import View
from workbench.sensitivity import GrowthMatrix, Inputs, derive_discrepancy
from workbench.sets import Box
from workbench.simulation.campaign.tallies import Rate, Tally
from workbench.simulation.gain_sweep.deciding import verdict
from workbench.simulation.gain_sweep.plan import GAINS, Decision

START = Box(("x", "v"), (1.0, 0.0), (1.1, 0.1))


def spring() -> System:
    x, v = ca.SX.sym("x"), ca.SX.sym("v")
    return system_from_casadi(ca.vertcat(x, v), ca.vertcat(v, -x), ("x", "v"), units=("m", "m/s"))


SYSTEM = spring()


@pytest.fixture(scope="module")
def tube() -> ReachTube:
    return compute_tube(SYSTEM, initial_set=START, horizon_s=0.2)


def checked(shown: View, folder: Path) -> Figure:
    """What holds of every view."""
    canvas = shown.plot()
    assert isinstance(canvas, Figure)
    assert canvas.get_facecolor() == (1.0, 1.0, 1.0, 1.0)
    canvas.savefig(folder / "x.png")
    assert not [label for axes in canvas.axes for label in unlabelled(axes)]
    assert not any(by_colour_alone(axes) for axes in canvas.axes)
    told = {text.get_text() for legend in canvas.legends for text in legend.get_texts()}
    assert {key.label for figure in shown.figures for key in figure.legend} <= told
    Strict(shown._repr_html_())
    shown.save(folder / "page.html")
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert all(panel in page for figure in shown.figures for panel in figure.panels)
    assert len({tuple(each) for each in shown.rows()}) == 1
    return canvas


def test_a_tube_has_a_row_per_instant_and_state(tube: ReachTube, tmp_path: Path) -> None:
    shown = view(tube, SYSTEM)
    canvas = checked(shown, tmp_path)
    assert [axes.get_ylabel() for axes in canvas.axes] == ["x (m)", "v (m/s)"]
    rows = shown.rows()
    assert len(rows) == 2 * len(tube.times)
    for k, each in enumerate(rows):
        instant, state = divmod(k, 2)
        assert (each["state"], each["unit"]) == (("x", "m"), ("v", "m/s"))[state]
        assert each["time_s"] == tube.times[instant]
        assert each["lower_at"] == tube.lower_at[instant, state]
        assert each["upper_at"] == tube.upper_at[instant, state]
    assert [rows[3][name] for name in ("lower", "upper", "until_s")] == [
        tube.lower[1, 1], tube.upper[1, 1], tube.times[2],
    ]  # fmt: skip
    assert rows[-1]["lower"] is None


def test_bounds_and_tubes_stand_side_by_side(tube: ReachTube, tmp_path: Path) -> None:
    bound = derive_discrepancy(
        SYSTEM, region=Box(("x", "v"), (0.0, -1.0), (2.0, 1.0)), horizon_s=0.2,
        method=GrowthMatrix(cells=1, inputs=Inputs.SHARED),
    )  # fmt: skip
    shown = beside({"growth": bound, "tube": tube}, SYSTEM, initial_set=START)
    canvas = checked(shown, tmp_path)
    assert [len(axes.lines) for axes in canvas.axes] == [2, 2]
    for each in shown.rows():
        if each["bound"] == "growth":
            column = ("x", "v").index(str(each["state"]))
            radius = bound.radius(START.radius, float(each["time_s"] or 0.0))
            assert each["half_width"] == radius[column]
    last = {(each["bound"], each["state"]): each["half_width"] for each in shown.rows()}
    assert last["tube", "v"] == tube.half_width_at()[-1, 1]


def test_a_tube_and_what_is_reached_in_it(tube: ReachTube, tmp_path: Path) -> None:
    effort = SearchEffort(starts=4, rounds=1, every=1, seed=1)
    step_s = float(tube.times[1])
    inner = inner_hull(SYSTEM, initial_set=START, horizon_s=0.2, step_s=step_s, effort=effort)
    shown = both_sides(tube, inner, SYSTEM)
    checked(shown, tmp_path)
    for each in shown.rows():
        assert each["outer_lower"] <= each["inner_lower"] <= each["inner_upper"]  # type: ignore[operator]
        assert each["inner_upper"] <= each["outer_upper"]  # type: ignore[operator]
    other = inner_hull(SYSTEM, initial_set=START, horizon_s=0.2, step_s=0.04, effort=effort)
    with pytest.raises(InputError, match="same instants"):
        both_sides(tube, other, SYSTEM)


def test_an_examination_shows_every_curve(tmp_path: Path) -> None:
    x = ca.SX.sym("x")
    found = examined()
    shown = view(found, system_from_casadi(x, -x, ("x",), units=("m",)))
    checked(shown, tmp_path)
    curves = {str(each["bound"]) for each in shown.rows()}
    assert curves == {"sampled and searched", "sampled", "learned", "proof 0", "proof 1", "proof 2"}
    learned = [each["half_width"] for each in shown.rows() if each["bound"] == "learned"]
    assert learned == found.learned[:, 0].tolist()


def test_a_gain_sweep_has_a_row_per_choice_of_gains(tmp_path: Path) -> None:
    rows = [
        row(k, lateral_3s_m=3.0 - k, delay_margin_s=1.0, **dict.fromkeys(GAINS, 0.1 * k))
        for k in range(3)
    ]
    trade = ("lateral_3s_m", "delay_margin_s")
    shown = view(verdict(rows, Decision({}, {}, trade, "lateral_3s_m")))
    checked(shown, tmp_path)
    assert [each["recommended"] for each in shown.rows()] == [False, False, True]
    assert [each["lateral_3s_m"] for each in shown.rows()] == [3.0, 2.0, 1.0]
    assert [each["present"] for each in shown.rows()] == [True, False, False]


def test_decisions_have_a_row_each(tmp_path: Path) -> None:
    frames = cases.frames(20)
    shown = view(frames)
    checked(shown, tmp_path)
    assert [each["verdict"] for each in shown.rows()] == [f.verdict.value for f in frames]
    assert [each["clearance_m"] for each in shown.rows()] == [f.clearance_m for f in frames]
    assert view(list(frames)).rows() == shown.rows()


def test_a_survey_has_a_row_per_contender(tmp_path: Path) -> None:
    rate = Rate(1.0, 0.5, 2.0)
    tallies = [
        Tally("bicycle", who, 10, 2, 1, 0.3, 1.0, rate, rate, 5, 2.0, 0.2, 1.5, 1.0, 0.9, 100, 0.0,
              0.0, 0.1, 3, 4)
        for who in ("both", "LookAhead")
    ]  # fmt: skip
    shown = view(tallies)
    checked(shown, tmp_path)
    assert [each["contender"] for each in shown.rows()] == ["both", "LookAhead"]
    assert shown.rows()[0]["needless_per_km"] == 1.0
    assert shown.rows()[0]["stops_high"] == 2.0


def test_a_tube_that_proves_nothing_is_refused_in_words() -> None:
    nothing, start = np.zeros((0, 2)), np.zeros((1, 2))
    empty = ReachTube(
        np.zeros(1), nothing, nothing, start, start, ("x", "v"), TubeStatus.ENCLOSURE_FAILED,
        Rigor.ENCLOSED, "too wide",
    )  # fmt: skip
    with pytest.raises(InputError, match="too wide"):
        view(empty, SYSTEM)


def test_what_cannot_be_shown_is_refused_in_words(tube: ReachTube) -> None:
    with pytest.raises(InputError, match="which names the units"):
        view(tube)
    x = ca.SX.sym("z")
    with pytest.raises(InputError, match="the states x, v, got one with z"):
        view(tube, system_from_casadi(x, -x, ("z",)))
    with pytest.raises(InputError, match="got int"):
        view(3)
    with pytest.raises(InputError, match=r"plot\(\) of its own"):
        view(SimpleNamespace(plot=lambda: None))
    for sequence in ([], [3], [*cases.frames(1), 3]):
        with pytest.raises(InputError, match="at least one Frame"):
            view(sequence)
    with pytest.raises(InputError, match="at least one bound"):
        beside({}, SYSTEM, initial_set=START)


def test_rows_become_a_data_frame_where_pandas_is(
    tube: ReachTube, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = view(tube, SYSTEM)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match="pip install pandas"):
        shown.frame()
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=list))  # type: ignore[arg-type]
    assert shown.frame() == shown.rows()


def test_a_legend_of_matplotlib_has_the_dashes_of_the_page() -> None:
    from workbench.report.view import _handle

    looks = {
        str(_handle(Key("x", "#0072B2", svg))._dash_pattern)  # type: ignore[attr-defined]
        for svg in DASHES.values()
    }
    assert len(looks) == len(DASHES)
