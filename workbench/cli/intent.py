"""`workbench intent`: where recorded people go, asked again and again while they walk."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    add_file_option,
    seed,
    separate_files,
    text_table,
    writable_file,
)
from workbench.cli.intent_people import SCORES, add_score_option, run_score
from workbench.cli.output import Progress, emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.intent_folder import Folder
    from workbench.estimation.intent_choice import Varied
    from workbench.estimation.intent_scenarios import Noticed
    from workbench.estimation.intent_scores import Answered, Calibrated, Score

HELP = (
    "A folder of recordings with goals: a particle filter per person says how likely each goal is, "
    "from what was measured until then and nothing later. With goal_labels.csv it is scored beside "
    "simpler answers, each recording by what the others teach. --answers answers a table of "
    "questions instead. Columns: docs/people-intent.md. Needs the analysis extra."
)
EXAMPLE = """\
workbench intent recordings/ucy --plot out/intent.html
workbench intent recordings/ucy --recording ucy_zara01 --priors equal --filter paper
workbench intent recordings/ucy --answers queries.csv --out answers.csv
workbench intent recordings/yard --learn-goals yard-goals.csv
workbench intent recordings/ucy --fit out/motion.toml
workbench intent recordings/kitti --score guard
workbench intent recordings/ucy --score guard --fit-on 'ucy_zara*'
"""

_NO_LABELS: Final = "no usable row of goal_labels.csv: nothing to score"
_RUNS: Final = 40
_NOISE_M: Final = 0.1
_PERIODS_S: Final = (0.2, 1.2)


def configure(parser: argparse.ArgumentParser) -> None:
    """Folder, goals, filter, and what to write."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder with peds.csv[.gz]")
    parser.add_argument("--recording", metavar="NAME", help="judge or draw this recording only")
    parser.add_argument("--agent", metavar="NAME", help="draw this person (default: up to three)")
    add_file_option(parser, "--goals", text="table of goals (default: the folder's goals.csv)")
    parser.add_argument("--scene", metavar="NAME", help="which scene's goals all recordings have")
    parser.add_argument(
        "--priors", choices=("learned", "equal"), default="learned",
        help="what is known before a person is seen (default: learned from other recordings)",
    )  # fmt: skip
    parser.add_argument(
        "--filter", choices=("chosen", "paper"), default="chosen",
        help="paper: no unknown goal, no doubt of the entrance (default: chosen)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the particles (default: 1)"
    )
    add_file_option(parser, "--answers", text="table of questions to answer; needs --out")
    add_file_option(parser, "--out", text="table to write the answers to")
    add_file_option(parser, "--motion", text="fitted motion of people (default: the shipped one)")
    add_file_option(parser, "--plot", text="page to draw")
    add_file_option(parser, "--learn-goals", text="write goals learned from the ends of tracks")
    add_file_option(parser, "--fit", text="fit the motion of people to this folder and write it")
    parser.add_argument(
        "--credit",
        default="",
        metavar="TEXT",
        help="whose recordings they are; goes into --fit's file",
    )
    add_score_option(parser)
    parser.add_argument(
        "--scenarios", action="store_true",
        help="also walk generated errands: goals that change, goals that are not in the set",
    )  # fmt: skip
    parser.add_argument(
        "--vary", action="store_true",
        help="also score with each number of the filter halved and doubled (minutes)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Check, then learn goals, fit, answer, or evaluate."""
    _check(args)
    if args.learn_goals is not None:
        return _learn(args)
    if args.fit is not None:
        return _fit(args)
    if args.answers is not None:
        return _answer(args)
    return _evaluate(args) if args.score == SCORES[0] else run_score(args)


def _check(args: argparse.Namespace) -> None:
    if (args.answers is None) != (args.out is None):
        raise InputError("expected --answers FILE and --out FILE together, got one of them")
    tasks = ("learn_goals", "fit", "answers", "plot")
    given = ["--" + name.replace("_", "-") for name in tasks if getattr(args, name) is not None]
    if args.credit and args.fit is None:
        raise InputError("--credit: expected --fit FILE beside it, whose provenance it becomes")
    if args.fit_on and args.score != "guard":
        raise InputError("--fit-on: expected --score guard beside it, which it is about")
    if args.score != SCORES[0]:
        given.append(f"--score {args.score}")
    if len(given) > 1:
        raise InputError(f"expected one of {', '.join(given)} at a time; use a run for each")
    separate_files(args, "out", "answers", "goals", "motion")
    for option in ("out", "plot", "learn_goals", "fit"):
        writable_file(getattr(args, option), "--" + option.replace("_", "-"))


def _learn(args: argparse.Namespace) -> int:
    from workbench.cli.common import write_text
    from workbench.cli.intent_folder import known_recording
    from workbench.estimation.goals import MeanShift, goals_csv, learn_goals
    from workbench.estimation.people_data import by_recording, load_tracks

    tracks = load_tracks(args.folder)
    known_recording(args.recording, tracks)
    groups = {
        name: own for name, own in by_recording(tracks).items() if args.recording in (None, name)
    }
    if args.scene is not None:
        groups = {args.scene: [track for own in groups.values() for track in own]}
    scenes = {name: learn_goals(own, MeanShift.people()) for name, own in groups.items()}
    write_text(args.learn_goals, goals_csv(scenes))
    counts = ", ".join(f"{name}: {len(goals)}" for name, goals in scenes.items())
    emit(args, f"goals {counts}\nwrote {args.learn_goals}",
         {"goals": scenes, "wrote": args.learn_goals})  # fmt: skip
    return 0


def _fit(args: argparse.Namespace) -> int:
    from workbench.cli.common import write_text
    from workbench.estimation.motion_fit import fit_motion

    with Progress("fitting", 1):
        motion = fit_motion(args.folder, credit=args.credit)
    write_text(args.fit, motion.toml())
    emit(args, f"{motion.provenance}\nwrote {args.fit}",
         {"motion": motion, "wrote": args.fit})  # fmt: skip
    return 0


def _answer(args: argparse.Namespace) -> int:
    from workbench.cli.common import write_text
    from workbench.cli.intent_answers import answer_queries, read_queries
    from workbench.cli.intent_folder import read_folder

    queries = read_queries(args.answers)
    asked, placed = (
        {query.key[0] for query in queries if (query.h_s is None) is of_goals}
        for of_goals in (True, False)
    )
    folder = read_folder(args, asked, helped=placed)
    text = answer_queries(args, folder, queries)
    write_text(args.out, text)
    rows = text.count("\n") - 1
    emit(args, f"{len(queries)} questions, {rows} rows of answers in {args.out}",
         {"questions": len(queries), "rows": rows, "out": args.out})  # fmt: skip
    return 0


def _evaluate(args: argparse.Namespace) -> int:
    from workbench.cli.intent_folder import read_folder

    folder = read_folder(args)
    answers = _judged(args, folder)
    scores, table = _scores(answers)
    errands = _errands(args) if args.scenarios else []
    variations = _varied(args, folder) if args.vary else []
    if args.plot is not None:
        from workbench.cli.intent_page import write_intent_page

        write_intent_page(args, folder, scores, table)
    priors = {name: folder.prior_of(name, args.priors).source for name in folder.recordings()}
    text = [_score_text(scores) if scores else _NO_LABELS]
    text += ["priors: " + "; ".join(f"{name}: {source}" for name, source in priors.items())]
    if variations:
        text += ["", _varied_text(variations)]
    if errands:
        text += ["", _errand_text(errands)]
    text += [f"wrote {args.plot}"] if args.plot is not None else []
    data = {"scores": scores, "calibration": table, "priors": priors, "errands": errands,
            "variations": variations, "plot": args.plot}  # fmt: skip
    emit(args, "\n".join(text), data)
    return 0


def _judged(args: argparse.Namespace, folder: Folder) -> tuple[Answered, ...]:
    """Answers about the labelled people, recording by recording."""
    from workbench.cli.intent_folder import chosen_filter
    from workbench.estimation.intent_cloud import NumpyUpdate
    from workbench.estimation.intent_scores import cross_validated, walks

    people = walks(folder.tracks, folder.measured, folder.labels, folder.goals)
    held = sorted({walk.measured.recording for walk in people})
    if args.recording is not None:
        held = [name for name in held if name == args.recording]
    if not held:
        return ()
    found: list[Answered] = []
    with Progress("judging recordings", len(held)) as bar:
        for name in held:
            found += cross_validated(
                people, folder.labels, held=name,
                settings=chosen_filter(args), update=NumpyUpdate(), seed=args.seed,
            )  # fmt: skip
            bar.advance()
    return tuple(found)


def _scores(answers: tuple[Answered, ...]) -> tuple[tuple[Score, ...], list[Calibrated]]:
    from workbench.estimation.intent_scores import FILTER, calibration, scored

    return scored(answers), calibration(answers, FILTER) if answers else []


def _score_text(scores: tuple[Score, ...]) -> str:
    from workbench.estimation.intent_scores import METHODS, POINTS

    cells = {(each.method, each.point): each for each in scores}
    points = [point for point in POINTS if any(each.point == point for each in scores)]

    def shown(method: str, point: str) -> str:
        each = cells[method, point]
        return f"{each.accuracy:.2f} / {each.log_loss:.3f} / {each.brier:.3f}"

    counts = [str(cells[METHODS[0], point].count) for point in points]
    rows: list[list[str | int | float | None]] = [["people", *counts]]
    rows += [[method, *(shown(method, point) for point in points)] for method in METHODS]
    return "accuracy / log-loss / Brier\n" + text_table(["after", *points], rows)


def _varied(args: argparse.Namespace, folder: Folder) -> list[Varied]:
    from workbench.cli.intent_folder import chosen_filter
    from workbench.cli.intent_update import quick_update
    from workbench.estimation.intent_choice import variants, varied
    from workbench.estimation.intent_scores import walks

    people = walks(folder.tracks, folder.measured, folder.labels, folder.goals)
    choices = variants(chosen_filter(args))
    if not people:
        return []
    with Progress("varying the filter", len(choices)) as bar, quick_update() as update:
        return varied(people, folder.labels, choices, update=update, seed=args.seed,
                      progress=bar.advance)  # fmt: skip


def _varied_text(variations: list[Varied]) -> str:
    points = [each.point for each in variations[0].scores]
    rows: list[list[str | int | float | None]] = [
        [each.change, *(f"{score.log_loss:.3f}" for score in each.scores)] for each in variations
    ]
    return "log-loss of the filter with learned priors\n" + text_table(["filter", *points], rows)


def _errands(args: argparse.Namespace) -> list[Noticed]:
    from workbench.cli.intent_folder import chosen_filter
    from workbench.estimation.intent_cloud import NumpyUpdate
    from workbench.estimation.intent_scenarios import errands, noticed

    return [
        noticed(errand, period_s=period_s, noise_m=_NOISE_M, runs=_RUNS,
                settings=chosen_filter(args), update=NumpyUpdate())
        for errand in errands()
        for period_s in _PERIODS_S
    ]  # fmt: skip


def _errand_text(errands: list[Noticed]) -> str:
    headings = ["generated errand", "measured every (s)", "runs", "noticed", "median (s)",
                "90 % (s)"]  # fmt: skip
    return text_table(headings, [
        [each.name, each.period_s, each.runs, each.share, each.median_s, each.late_s]
        for each in errands
    ])  # fmt: skip
