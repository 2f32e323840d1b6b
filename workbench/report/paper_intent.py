"""The paper's figure of intents: predicted ways to three goals, and their probabilities."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.estimation.goals import centres_m, spreads_m
from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
from workbench.estimation.intent_filter import Intents, answer, follow
from workbench.estimation.intent_scenarios import CROSSING, errands
from workbench.estimation.intent_trajectory import trajectories
from workbench.report.drawing import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    SKY,
    VERMILLION,
    YELLOW,
    Dashes,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.intent import PersonPicture, PredictedWay, answers_table

_STYLES: Final[tuple[tuple[str, Dashes], ...]] = (
    (VERMILLION, "--"), (YELLOW, "-."), (GREEN, (0.0, (9.0, 3.0))),
)  # fmt: skip
_ERRAND, _AFTER_S = 1, 0.6
_NOISE_M, _SEED, _PERIOD_S = 0.2, 3, 0.2
_LEAST, _WAYS_S = 0.02, 20.0
_SIZE_IN: Final = (4.7, 3.8)


def intent_person() -> PersonPicture:
    """A generated walker among three goals who changes their mind once, as the filter follows them
    at the paper's 5 Hz with errors of 0.2 m; drawn 0.6 s after the change."""
    errand, settings = errands()[_ERRAND], FilterSettings.chosen()
    names = [goal.name for goal in CROSSING]
    track = errand.track(period_s=_PERIOD_S, noise_m=_NOISE_M, seed=_SEED)
    intents = Intents.of_person(CROSSING, track.recording, track.agent, seed=_SEED)
    beliefs = follow(track, intents, settings, NumpyUpdate())
    prior = np.full(len(CROSSING), 1.0 / len(CROSSING))
    answers = np.array([answer(belief, prior, settings) for belief in beliefs])
    drawn = int(np.searchsorted(track.t_s, errand.turned_s() + _AFTER_S))
    ways = trajectories(
        beliefs[drawn], np.append(answers[drawn], 0.0), settings, least=_LEAST, horizon_s=_WAYS_S,
        step_s=_PERIOD_S,
    )  # fmt: skip
    return PersonPicture(
        f"A generated walker, {errand.name}", tuple(names), centres_m(CROSSING),
        spreads_m(CROSSING), errand.right, track.t_s, track.xy_m, answers,
        np.array([belief.unknown for belief in beliefs]), drawn,
        tuple(PredictedWay(names.index(way.goal), way.probability, way.xy_m)
              for way in ways if way.goal is not None),
    )  # fmt: skip


def intent_figure(person: PersonPicture) -> Figure:
    """Left the ways, right the probabilities, as in the paper."""
    panels = tuple(
        svg_panel(
            partial(_alone, paint=paint, person=person), label=label, width_in=_SIZE_IN[0],
            height_in=_SIZE_IN[1],
        )
        for paint, label in ((_paint_ways, "seen from above"), (_paint_odds, "over time"))
    )  # fmt: skip
    at_s = person.t_s[person.drawn]
    caption = (
        f"{person.title}: measured at 5 Hz with errors of {_NOISE_M:g} m. First: the ways "
        f"predicted at {at_s:.1f} s, {_AFTER_S:g} s after the change of mind; second: the answers "
        "after each measurement."
    )
    return Figure(panels, _legend(person), caption, answers_table(person))


def _legend(person: PersonPicture) -> tuple[Key, ...]:
    return (
        Key("measured", BLUE, mark="o"),
        Key("measured later", BLUE, "2 3"),
        Key("predicted, the bolder the likelier", SKY),
        *(Key(f"goal {name}", colour, DASHES[dashes])
          for name, (colour, dashes) in zip(person.goals, _STYLES, strict=True)),
    )  # fmt: skip


def intent_picture() -> Canvas:
    """The same on one canvas, for a file."""
    person = intent_person()
    with matplotlib.rc_context({"font.size": 9.0, "text.parse_math": False}):
        canvas = Canvas(figsize=(10.4, 4.8), layout="constrained", facecolor="white")
        left, right = canvas.subplots(1, 2)
        _paint_ways(left, person)
        _paint_odds(right, person)
        handles = [key.handle() for key in _legend(person)]
        canvas.legend(
            handles=handles, loc="outside lower center", ncols=3, handlelength=3.5, frameon=False
        )
    return canvas


def _alone(
    canvas: Canvas, *, paint: Callable[[Axes, PersonPicture], None], person: PersonPicture
) -> None:
    paint(canvas.add_subplot(), person)


def _paint_ways(axes: Axes, person: PersonPicture) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 61)
    for place, spread, name, (colour, _) in zip(
        person.goal_xy_m, person.goal_spread_m, person.goals, _STYLES, strict=True
    ):
        ring = place + spread * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        axes.fill(*ring.T, facecolor=colour, alpha=0.8, linewidth=0.0)
        axes.annotate(
            name, (place[0], place[1] + 1.4 * spread), ha="center", va="bottom", color=INK
        )
    for way in person.ways:
        axes.plot(*way.xy_m.T, color=SKY, linewidth=0.9 + 2.2 * way.probability)
    seen, later = person.xy_m[: person.drawn + 1], person.xy_m[person.drawn :]
    axes.plot(*later.T, color=BLUE, linewidth=1.0, linestyle=":")
    axes.plot(*seen.T, color=BLUE, linewidth=1.6, marker=".", markersize=4)
    axes.plot(*seen[-1], color=BLUE, marker="o", markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _paint_odds(axes: Axes, person: PersonPicture) -> None:
    """An answer holds until the next measurement."""
    for column, (colour, dashes) in zip(person.probability.T, _STYLES, strict=True):
        axes.step(person.t_s, column, where="post", color=colour, ls=dashes, linewidth=1.8)
    axes.axvline(person.t_s[person.drawn], color="0.5", linewidth=1.0)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("probability (1)")
