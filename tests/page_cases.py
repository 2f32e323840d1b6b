"""A small instance of every page of the product, for the tests that look at all of them."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
import report_cases as cases
from gain_sweep_cases import row
from page_cases_bounds import TIMES, derive, examine, inner, reach, sampled
from test_bench_decision_board import BOARD
from test_report_simulation import curves, report

from workbench.claims import Verdict
from workbench.cli.bench_decision_page import decision_page
from workbench.models.control_view import quick_study
from workbench.models.gains import Effort, LateralLoop, study_gains
from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.models.vehicle import gem_e2
from workbench.reach.robustness.verdict import (
    MARGIN_NAMES,
    Margin,
    OverSize,
    Robust,
    Robustness,
)
from workbench.report.conformance import ConformanceReport, conformance_page
from workbench.report.demo import demo_page
from workbench.report.footage import DrawnPerson, Footage, Glimpse, MarkedBox
from workbench.report.frontier import (
    Frontier,
    FrontierPoint,
    GrowthCurve,
    frontier_figure,
    growth_panels,
)
from workbench.report.gain_front import front_page
from workbench.report.gains import GainReport, gains_page
from workbench.report.gains_robust import RobustReport, robust_page
from workbench.report.intent import IntentReport, PersonPicture, PredictedWay, intent_page
from workbench.report.localisation import LocalisationReport, localisation_page
from workbench.report.page import Page, Section
from workbench.report.paper import results_figure
from workbench.report.paper_intent import intent_figure
from workbench.report.replay import replay_page
from workbench.report.simulation import simulation_page
from workbench.report.simulation_plots import Braking
from workbench.report.survey import Bar, SurveyReport, survey_page
from workbench.report.tables import Table
from workbench.simulation.gain_sweep.deciding import verdict
from workbench.simulation.gain_sweep.plan import GAINS, Decision
from workbench.simulation.paper.panels import Panel

MADE: dict[str, Any] = {"version": "0", "command": "workbench"}
NUMBERS = Table("numbers", ("what", "value (s)"), (("a", 0.123456789), ('b, "c"', None)))
BOX = (1.0, 0.5, 0.1, 1.5, 0.7)
TWO = cases.tube()
TWO = dataclasses.replace(
    TWO, names=TWO.names[:2], units=TWO.units[:2], lower=TWO.lower[:, :2], upper=TWO.upper[:, :2],
    lower_at=TWO.lower_at[:, :2], upper_at=TWO.upper_at[:, :2],
)  # fmt: skip


def demo(_: Path) -> str:
    growths = tuple(
        dataclasses.replace(g, half_widths=g.half_widths[:, :2]) for g in cases.growths()
    )
    runs = cases.samples()
    runs = dataclasses.replace(runs, states=runs.states[:, :, :2])
    made = dataclasses.replace(cases.demo_report(), tube=TWO, samples=runs, growths=growths)
    return demo_page(made, **MADE).html()


def replay(_: Path) -> str:
    return replay_page(cases.replay_report(count=20), **MADE).html()


def simulation(_: Path) -> str:
    drive = curves(braking=(Braking(0.5, 1.0, True), Braking(1.5, 2.0, False)))
    return simulation_page(report(cases.frames(30), drive), **MADE).html()


def survey(_: Path) -> str:
    bars = tuple(
        Bar(plant, who, (1.0 + k, 0.5 + k, 2.0 + k), 0.1, 0.02 * k)
        for plant in ("bicycle", "multi-body")
        for k, who in enumerate(("both", "LookAhead"))
    )
    return survey_page(
        SurveyReport("Survey", ("Lead.",), bars, (NUMBERS,), ("A note.",)), **MADE
    ).html()


def conformance(_: Path) -> str:
    half = np.ones((3, 11, 2)) * (1.0 + TIMES)[None, :, None]
    far = half * np.array([0.3, 0.8, 1.2])[:, None, None] * TIMES[None, :, None]
    made = ConformanceReport(
        "Conformance", ("Lead.",), TIMES, ("offset (m)", "heading (rad)"), far, half,
        ("one*", "other"), np.array([1.0, 0.6]), (NUMBERS,), ("A note.",),
    )  # fmt: skip
    return conformance_page(made, **MADE).html()


def localisation(_: Path) -> str:
    middle = np.stack([10.0 * TIMES, TIMES**2, 0.1 * TIMES], axis=1)
    made = LocalisationReport(
        "Localisation", ("Lead.",), TIMES, middle, 0.1 + 0.0 * middle, 0.99, TIMES,
        np.ones(11, dtype=bool), ("b1",), np.array([[5.0, 3.0]]), middle[:, :2], (NUMBERS,), ("n",),
    )  # fmt: skip
    return localisation_page(made, **MADE).html()


def person() -> PersonPicture:
    sure = np.stack([0.2 + 0.6 * TIMES, 0.5 - 0.3 * TIMES, 0.3 - 0.3 * TIMES], axis=1)
    way = np.stack([TIMES, TIMES], axis=1)
    goals = np.array([[5.0, 5.0], [0.0, 5.0], [5.0, 0.0]])
    return PersonPicture(
        "Ada", ("north", "west", "south"), goals, np.full(3, 0.6), 0, TIMES, way, sure,
        0.1 + 0.0 * TIMES, 5, (PredictedWay(0, 0.5, way + 0.5), PredictedWay(1, 0.3, way - 0.5)),
    )  # fmt: skip


def intent(_: Path) -> str:
    stated = np.array([0.1, 0.5, 0.9])
    made = IntentReport(
        "Intents", ("Lead.",), (person(),), (NUMBERS,), stated, stated**2, 10 * stated, ("n",)
    )
    return intent_page(made, **MADE).html()


def paper(_: Path) -> str:
    way, later = ((0.0, 0.0), (9.0, 0.0)), ((4.0, -2.0), (4.0, 2.0))
    panels = [
        Panel(
            "crossing", "Crossing", 1.0, 3.0, way, way[:1] * 2, BOX, 2.0, ((BOX,),) * 3,
            (Verdict.SAFE, Verdict.UNPROVED, Verdict.INVALID), tracks, "why", (1.0, 0.9, 0.8),
            (later[:1] * 2,), (later,), ((4.0, 0.0, 0.5),), (3.0, 3.0, 2.0),
        )
        for tracks in (True, False)
    ]  # fmt: skip
    sections = [
        Section("Results", [results_figure(panels)]),
        Section("I", [intent_figure(person())]),
    ]
    return Page("Paper", ("Lead.",), sections, "0", "workbench").html()


def gains(_: Path) -> str:
    study = study_gains(gem_e2(), effort=Effort(points=9, speeds=3, patterns=3))
    return gains_page(GainReport(study, quick_study(gem_e2()), TWO), **MADE).html()


def front(_: Path) -> str:
    trade = ("lateral_3s_m", "delay_margin_s")
    rows = [
        row(k, lateral_3s_m=1.0 + k % 3, delay_margin_s=1.0 + k, **dict.fromkeys(GAINS, 0.1 * k))
        for k in range(6)
    ]
    found = verdict(rows, Decision({}, {"lateral_3s_m": 2.5}, trade, "lateral_3s_m"))
    return front_page("Front", ("Lead.",), found, (NUMBERS,) * 3, ("0", "workbench")).html()


def robust(_: Path) -> str:
    ranges, car = Ranges((1.7, 1.9), (0.9, 1.1), (0.0, 0.1)), Car(1.9, 1.1, 0.1)
    margins = tuple(Margin(name, 1.0, 1.2, car, 9) for name in MARGIN_NAMES)
    proved = Robustness(ranges, Robust.PROVED, None, margins)
    none = tuple(Margin(name, None, None, None, 0) for name in MARGIN_NAMES)
    sizes = OverSize((0.0, 1.0, 2.0), (proved, proved, Robustness(ranges, Robust.OPEN, None, none)))
    made = RobustReport("a car", LateralLoop.of(gem_e2()), proved, sizes, None, None)
    return robust_page(made, **MADE).html()


def decision_bench(_: Path) -> str:
    return decision_page(BOARD, "workbench").html()


def online_bench(_: Path) -> str:
    points = [
        FrontierPoint(series, step, 1 + k, 10.0 * (k + 1), 1.5 - 0.1 * k)
        for k, (series, step) in enumerate([("a", 0.1), ("b", 0.1), ("b", 0.05)])
    ]
    grown = {
        "B1": [GrowthCurve(name, (1.0, 2.0), (k, 2.0 * k)) for k, name in ((1.0, "a"), (2.0, "b"))]
    }
    blocks = [
        frontier_figure([Frontier("B1", points, {27: 1.01}, 4.0)], signal="y"),
        growth_panels(grown, over="horizon (s)", logarithmic=False),
    ]
    return Page("Online", ("Lead.",), [Section("All", blocks)], "0", "workbench").html()


def image(grey: int) -> bytes:
    import PIL.Image

    stream = io.BytesIO()
    PIL.Image.new("RGB", (64, 48), (grey, grey, grey)).save(stream, format="JPEG")
    return stream.getvalue()


def track(_: Path) -> str:
    someone = DrawnPerson("1", "#0072B2", (9.0, 2.0, 0.5), (0.5, 0.0), ((8.5, 2.0),), True)
    glimpses = [
        Glimpse(
            0.1 * k, f"{k}.jpg", image(80 * k),
            (MarkedBox((0.2, 0.2, 0.5 + 0.1 * k, 0.9), "1", "#0072B2", ()),),
            (dataclasses.replace(someone, place=(9.0 - k, 2.0, 0.5)),), (), ((5.0, -2.0, 1.0),), (),
        )
        for k in range(3)
    ]  # fmt: skip
    player = Footage(glimpses, ((1.0, 0.0), (9.0, 5.0), (9.0, -5.0)), (1.0, 0.0), 3, "Images.")
    sections = [Section("Images", [player]), Section("Tracks", [NUMBERS])]
    return Page("Track", ("Lead.",), sections, "0", "workbench").html()


PAGES = (
    demo, replay, simulation, survey, conformance, localisation, intent, paper, gains, front,
    robust, decision_bench, online_bench, reach, inner, sampled, derive, examine, track,
)  # fmt: skip

MADE_BY = {
    "report/conformance.py": conformance,
    "report/demo.py": demo,
    "report/gain_front.py": front,
    "report/gains.py": gains,
    "report/gains_robust.py": robust,
    "report/intent.py": intent,
    "report/localisation.py": localisation,
    "report/replay.py": replay,
    "report/simulation.py": simulation,
    "report/survey.py": survey,
    "cli/bench_decision_page.py": decision_bench,
    "cli/bench_files.py": decision_bench,  # Joins the pages of boards.
    "cli/bench_online.py": online_bench,
    "cli/comparison_page.py": derive,
    "cli/examine_page.py": examine,
    "cli/inner.py": inner,
    "cli/reach.py": reach,
    "cli/reach_learned.py": reach,  # The same blocks.
    "cli/reach_sampled.py": sampled,
    "cli/reproduce_page.py": paper,
    "cli/track_page.py": track,
    "report/view.py": reach,  # Saves figures of the other pages; see test_notebook.py.
}
"""Which page here stands for what each module that makes a page makes."""
