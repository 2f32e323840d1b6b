"""Pictures of where people are thought to go: their way, the predicted ways, and probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.errors import InputError
from workbench.report.curves import Values, require_shape
from workbench.report.drawing import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    Dashes,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.page import Block, Notice, Page, Section
from workbench.report.tables import Table

_GOAL_STYLES = tuple(
    zip(
        (VERMILLION, YELLOW, GREEN, PURPLE, ORANGE, BLUE),
        (dashes for dashes in DASHES if dashes not in ("-", ":")),
        strict=True,
    )
)
_BOLDEST, _FAINTEST = 2.8, 0.8


@final
@dataclass(frozen=True, slots=True)
class PredictedWay:
    """A predicted way (k, 2) in m to the goal of this index, and its probability."""

    goal: int
    probability: float
    xy_m: Values


@final
@dataclass(frozen=True, slots=True)
class PersonPicture:
    """One person: what was measured and answered, and one moment at which the ways are drawn.

    title: who; goals: names; goal_xy_m (g, 2), goal_spread_m (g,); reached: index of the goal that
    was reached in the end, None where unknown; t_s (n,), xy_m (n, 2): measurements; probability
    (n, g): answers after each; unknown (n,): probability that the goal is none of them; drawn:
    index of the measurement after which `ways` were predicted. InputError on other shapes.
    """

    title: str
    goals: tuple[str, ...]
    goal_xy_m: Values
    goal_spread_m: Values
    reached: int | None
    t_s: Values
    xy_m: Values
    probability: Values
    unknown: Values
    drawn: int
    ways: tuple[PredictedWay, ...]

    def __post_init__(self) -> None:
        n, g = len(self.t_s), len(self.goals)
        require_shape("measured places", self.xy_m, (n, 2))
        require_shape("goals", self.goal_xy_m, (g, 2))
        require_shape("spreads of goals", self.goal_spread_m, (g,))
        require_shape("probabilities of goals", self.probability, (n, g))
        require_shape("probabilities of the unknown goal", self.unknown, (n,))
        if not 0 <= self.drawn < n:
            raise InputError(f"expected one of {n} measurements to draw at, got {self.drawn}")


@final
@dataclass(frozen=True, slots=True)
class IntentReport:
    """What is on the page: summary sentences, people, tables, and the calibration of the answers.

    stated, reached, count (b,): per bin the mean stated probability, the share reached and how
    many; empty where nothing was labelled.
    """

    title: str
    lead: tuple[str, ...]
    people: tuple[PersonPicture, ...]
    tables: tuple[Table, ...]
    stated: Values
    reached: Values
    count: Values
    notes: tuple[str, ...]


def intent_page(report: IntentReport, *, version: str, command: str) -> Page:
    """The page of one evaluation; version and command say what made it."""
    blocks: list[Section] = []
    if report.people:
        blocks.append(Section("People", tuple(person_figure(each) for each in report.people)))
    numbers: list[Block] = list(report.tables)
    if len(report.stated):
        numbers.append(calibration_figure(report))
    if numbers:
        blocks.append(Section("Scores", tuple(numbers)))
    notes = tuple(Notice("Note.", note) for note in report.notes)
    blocks.append(Section("How to read this", notes))
    return Page(report.title, report.lead, tuple(blocks), version, command)


def person_figure(person: PersonPicture) -> Figure:
    """The scene from above with the ways, and the probability of each goal over time."""
    at_s = person.t_s[person.drawn]
    panels = (
        svg_panel(
            partial(_paint_plane, person=person), label=f"{person.title}: seen from above",
            width_in=4.6, height_in=3.8,
        ),
        svg_panel(
            partial(_paint_time, person=person), label=f"{person.title}: probability over time",
            width_in=4.6, height_in=3.8,
        ),
    )  # fmt: skip
    legend = (
        Key("measured", BLUE, mark="o"),
        Key("measured later", BLUE, "2 3"),
        Key("predicted, the bolder the likelier", SKY),
        *(
            Key(f"goal {name}" + (", reached" if index == person.reached else ""),
                _style(index)[0], DASHES[_style(index)[1]])
            for index, name in enumerate(person.goals)
        ),
        Key("none of the goals", INK, "2 3"),
    )  # fmt: skip
    caption = (
        f"{person.title}. First: discs are the goals with their spread; the ways start at the last "
        f"measurement at {at_s:.1f} s and know nothing later. Second: what was answered after each "
        f"measurement; the vertical line is {at_s:.1f} s. The coloured lines sum to 1; the dotted "
        "one is the filter's doubt that the goal is known at all."
    )
    return Figure(panels, legend, caption, answers_table(person))


def answers_table(person: PersonPicture) -> Table:
    """The probability of each goal after each measurement."""
    headings = ("time (s)", *(f"p({name}) (1)" for name in person.goals), "p(none of them) (1)")
    rows = [
        (round(float(t), 3), *(float(p) for p in row), float(u))
        for t, row, u in zip(person.t_s, person.probability, person.unknown, strict=True)
    ]
    return Table(f"Answers about {person.title}", headings, rows, folded=True)


def calibration_figure(report: IntentReport) -> Figure:
    """Share of goals that were reached against the probability stated for them."""
    panel = svg_panel(
        partial(_paint_calibration, report=report), label="Calibration of the answers",
        width_in=3.8, height_in=3.4,
    )  # fmt: skip
    caption = (
        "Each dot is a tenth of the scale: the mean probability given to goals, and the share of "
        "them that were reached. On the line the answers mean what they say; below it they "
        "promise too much."
    )
    rows = [
        (float(s), float(r), int(c))
        for s, r, c in zip(report.stated, report.reached, report.count, strict=True)
    ]
    numbers = Table("Calibration", ("stated (1)", "reached (1)", "answers"), rows, folded=True)
    return Figure((panel,), (Key("answers", BLUE), Key("perfect", INK, "2 3")), caption, numbers)


def _style(goal: int) -> tuple[str, Dashes]:
    """Colour of a goal, and dashes of its line over time."""
    return _GOAL_STYLES[goal % len(_GOAL_STYLES)]


def _paint_plane(canvas: Canvas, *, person: PersonPicture) -> None:
    axes: Axes = canvas.add_subplot()
    angle = np.linspace(0.0, 2.0 * np.pi, 61)
    for index, (place, spread) in enumerate(
        zip(person.goal_xy_m, person.goal_spread_m, strict=True)
    ):
        ring = place + spread * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        axes.fill(*ring.T, facecolor=_style(index)[0], alpha=0.45, linewidth=0.0)
        axes.annotate(person.goals[index], place, ha="center", va="center", color=INK)
        if index == person.reached:
            axes.plot(*ring.T, color=INK, linewidth=1.6)
    for way in sorted(person.ways, key=lambda each: each.probability):
        width = _FAINTEST + (_BOLDEST - _FAINTEST) * way.probability
        axes.plot(*way.xy_m.T, color=SKY, linewidth=width, zorder=2.0)
    seen, later = person.xy_m[: person.drawn + 1], person.xy_m[person.drawn :]
    axes.plot(*later.T, color=BLUE, linewidth=1.2, linestyle=":", zorder=2.5)
    axes.plot(*seen.T, color=BLUE, linewidth=2.2, marker=".", markersize=5, zorder=3.0)
    axes.plot(*person.xy_m[person.drawn], color=BLUE, marker="o", markersize=7, zorder=3.0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _paint_time(canvas: Canvas, *, person: PersonPicture) -> None:
    axes: Axes = canvas.add_subplot()
    # An answer holds until the next measurement.
    for index in range(len(person.goals)):
        colour, dashes = _style(index)
        axes.step(
            person.t_s, person.probability[:, index], where="post", color=colour, linestyle=dashes,
            linewidth=2.6 if index == person.reached else 1.6,
        )  # fmt: skip
    axes.step(person.t_s, person.unknown, where="post", color=INK, linewidth=1.0, linestyle=":")
    axes.axvline(person.t_s[person.drawn], color=INK, linewidth=1.0)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("probability (1)")


def _paint_calibration(canvas: Canvas, *, report: IntentReport) -> None:
    axes: Axes = canvas.add_subplot()
    axes.plot((0.0, 1.0), (0.0, 1.0), color=INK, linestyle=":", linewidth=1.0)
    axes.plot(report.stated, report.reached, color=BLUE, linewidth=1.2)
    size = 12.0 + 90.0 * np.sqrt(report.count / max(float(report.count.max()), 1.0))
    axes.scatter(report.stated, report.reached, s=size, color=BLUE, zorder=3.0)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_aspect("equal")
    axes.set_xlabel("stated probability (1)")
    axes.set_ylabel("share reached (1)")
