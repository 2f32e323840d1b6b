"""The page of `workbench intent --plot`: a few people with their ways, and the scores."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from workbench import __version__
from workbench.cli.analysis_options import command_line
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.intent_folder import Folder
    from workbench.estimation.intent_scores import Calibrated, Score
    from workbench.estimation.people_data import PersonTrack
    from workbench.report.intent import PersonPicture
    from workbench.report.tables import Table

_DRAWN_PEOPLE: Final = 3
_ENOUGH_MEASURED: Final = 8
_LEAST: Final = 0.05
_HORIZON_S: Final = 20.0
_NOTES: Final = (
    "An answer at a time uses what was measured of the person until then, and nothing later. "
    "Between measurements it stays as it is.",
    "The probability given out is the filter's, with each goal weighted by the square root of how "
    "often it was taken in other recordings (with --priors equal: all the same) and by the way "
    "that the person goes right now; as far as the filter doubts that the goal is a known one, by "
    "these weights alone.",
    "The predicted ways are means of the particles' motion, no bounds. The safety of a drive does "
    "not rest on them but on the guard, which assumes no goal.",
)


def write_intent_page(
    args: argparse.Namespace,
    folder: Folder,
    scores: Sequence[Score],
    calibrated: Sequence[Calibrated],
) -> None:
    """Draw and write. Raises InputError when --agent names nobody, or nobody can be drawn."""
    import numpy as np

    from workbench.report.intent import IntentReport, intent_page
    from workbench.report.page import write_page

    people = tuple(_picture(args, folder, track) for track in _shown(args, folder))
    report = IntentReport(
        f"Where people of {folder.path.resolve().name} go",
        _lead(scores, len(people)),
        people,
        _tables(scores),
        np.array([each.stated for each in calibrated]),
        np.array([each.reached for each in calibrated]),
        np.array([each.count for each in calibrated], dtype=np.float64),
        _NOTES,
    )
    command = command_line("intent", args, positional=("folder",))
    write_page(args.plot, intent_page(report, version=__version__, command=command).html())


def _shown(args: argparse.Namespace, folder: Folder) -> list[PersonTrack]:
    """The person asked for, else the ones measured longest of those who reached a goal."""
    here = [
        track
        for track in folder.measured
        if args.recording in (None, track.recording) and len(track.t_s)
    ]
    if args.agent is not None:
        found = [track for track in here if track.agent == args.agent]
        if not found:
            raise InputError(
                f"--agent: nobody called {args.agent!r} was measured; people here: "
                f"{', '.join(track.agent for track in here[:20])}"
            )
        return found[:1]
    labelled = {(each.recording, each.agent) for each in folder.labels if each.usable}
    chosen = [track for track in here if track.key in labelled] or here
    lively = [track for track in chosen if len(track.t_s) >= _ENOUGH_MEASURED] or chosen
    if not lively:
        raise InputError("--plot: nobody was measured, so that there is nothing to draw")
    first: dict[str, PersonTrack] = {}
    for track in lively:
        first.setdefault(track.recording, track)
    return [*first.values()][:_DRAWN_PEOPLE]


def _picture(args: argparse.Namespace, folder: Folder, track: PersonTrack) -> PersonPicture:
    import numpy as np

    from workbench.cli.intent_folder import chosen_filter
    from workbench.estimation.goals import centres_m, spreads_m
    from workbench.estimation.intent_cloud import NumpyUpdate
    from workbench.estimation.intent_filter import Intents, answer, follow
    from workbench.estimation.intent_trajectory import trajectories
    from workbench.report.intent import PersonPicture, PredictedWay

    goals = folder.goals[folder.scenes[track.recording]]
    prior = folder.prior_of(track.recording, args.priors).probability
    settings = chosen_filter(args)
    intents = Intents.of_person(goals, track.recording, track.agent, seed=args.seed)
    beliefs = follow(track, intents, settings, NumpyUpdate())
    answers = np.array([answer(belief, prior, settings) for belief in beliefs])
    drawn = min(len(beliefs) // 3, len(beliefs) - 1)
    ways = trajectories(
        beliefs[drawn], np.append(answers[drawn], 0.0), settings, least=_LEAST,
        horizon_s=_HORIZON_S, step_s=0.2,
    )  # fmt: skip
    names = [goal.name for goal in goals]
    reached = {(each.recording, each.agent): each.goal for each in folder.labels if each.usable}
    return PersonPicture(
        f"{track.agent} of {track.recording}", tuple(names), centres_m(goals), spreads_m(goals),
        names.index(reached[track.key]) if track.key in reached else None, track.t_s, track.xy_m,
        answers, np.array([belief.unknown for belief in beliefs]), drawn,
        tuple(PredictedWay(names.index(way.goal), way.probability, way.xy_m)
              for way in ways if way.goal is not None),
    )  # fmt: skip


def _lead(scores: Sequence[Score], people: int) -> tuple[str, ...]:
    from workbench.estimation.intent_scores import BEARING_PRIOR, FILTER

    drawn = f"{people} people are drawn." if people != 1 else "One person is drawn."
    if not scores:
        return (drawn, "The folder has no labels, so that nothing is scored.")
    by_method = {
        method: [each.log_loss for each in scores if each.method == method]
        for method in (FILTER, BEARING_PRIOR)
    }
    better = sum(a < b for a, b in zip(by_method[FILTER], by_method[BEARING_PRIOR], strict=True))
    return (
        f"{drawn} Everything learned about a recording comes from the others.",
        f"The filter's log-loss is below that of bearing x prior at {better} of "
        f"{len(by_method[FILTER])} points of the tracks.",
    )


def _tables(scores: Sequence[Score]) -> tuple[Table, ...]:
    """One table per measure: methods down, points across."""
    from workbench.report.tables import Table

    if not scores:
        return ()
    methods = list(dict.fromkeys(each.method for each in scores))
    points = list(dict.fromkeys(each.point for each in scores))
    measures = {
        "Log-loss (nats; lower is better)": "log_loss",
        "Brier score (lower is better)": "brier",
        "Accuracy (share whose likeliest goal was right)": "accuracy",
    }
    cells = {(each.method, each.point): each for each in scores}
    return tuple(
        Table(
            f"{caption}, cross-validated by recording",
            ("method", *(f"after {point}" for point in points)),
            [(method, *(getattr(cells[method, point], name) for point in points))
             for method in methods],
        )
        for caption, name in measures.items()
    )  # fmt: skip
