"""`workbench examine`: a learned bound against the proved ones, with a witness when it fails."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import (
    Subject,
    add_subject_options,
    add_time_options,
    check_steps,
    check_whole_steps,
    chosen_subject,
    count,
    text_table,
)
from workbench.cli.common import add_output_option, output_folder
from workbench.cli.learn import add_sample_options, learned_bound
from workbench.cli.output import Progress, emit, warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.analysis_results import Array
    from workbench.reach import ReachTube
    from workbench.sensitivity import Discrepancy, Examination, ProvedEnvelope
    from workbench.sensitivity.witness import Witness

HELP = (
    "Holds a learned bound against samples, a gradient search and the proved bounds of the same "
    "loop, set and horizon. Ends in refuted (with a witness that can be replayed), consistent, or "
    "implied by proof. Exit status 1 when refuted."
)
EXAMPLE = """\
workbench examine --out out/examine
workbench examine --learned out/learned.json --samples 5000
workbench examine --replay out/examine/witness.json
"""

_CELLS: Final = 256
_TUBE_STEP_S: Final = 0.02
_GOALS: Final = 4
_ROUNDING: Final = 1e-9
_TUBE: Final = "validated tube"
VERDICTS: Final = {
    "REFUTED": "refuted",
    "CONSISTENT": "consistent (no pair breaks it; this proves nothing)",
    "IMPLIED_BY_PROOF": "implied by proof",
}
_COVERAGE: Final = ["pairs", "number", "inside all along", "largest distance / bound"]
_PROVED: Final = ["proved bound", "rigor", "implies the learned", "largest distance / bound"]


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, time grid, how the bound is learned or read, how hard to try, where to write."""
    add_subject_options(parser)
    add_time_options(parser, step_s=0.02)
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--learned", type=Path, metavar="FILE", help="examine what `workbench learn --save` wrote"
    )
    source.add_argument(
        "--replay", type=Path, metavar="FILE", help="only run the pair of a witness.json again"
    )
    add_sample_options(parser)
    parser.add_argument(
        "--samples", type=count, default=2000, metavar="N", help="pairs per group (default: 2000)"
    )
    parser.add_argument(
        "--rounds", type=count, default=20, metavar="N", help="gradient steps (default: 20)"
    )
    parser.add_argument(
        "--any-centre",
        action="store_true",
        help="also try pairs that do not contain the middle of the initial set",
    )
    add_output_option(parser, default="out/examine")


@final
@dataclass(frozen=True, slots=True)
class Outcome:
    """The examination with what went into it; error: of its runs' distances (K+1, n)."""

    subject: Subject
    learned: Discrepancy
    tube: ReachTube
    methods: list[str]
    found: Examination
    error: Array


def run(args: argparse.Namespace) -> int:
    """Examine, show and write; 1 when the bound is refuted."""
    check_steps(args)
    check_whole_steps(args)
    if args.replay:
        return _replay(args)
    from workbench.cli.learned_file import save_witness
    from workbench.sensitivity import ExaminationVerdict

    subject = chosen_subject(args)
    with output_folder(args.out) as folder:
        outcome = _outcome(args, subject, _learned(args, subject))
        found = outcome.found
        save_witness(folder / "witness.json", found.witness, subject, verdict=found.verdict.name)
        _write_page(args, outcome, folder / "examine.html")
    emit(args, _text(args, outcome), _data(args, outcome))
    for doubt in _doubts(outcome):
        warn(doubt)
    return 1 if found.verdict is ExaminationVerdict.REFUTED else 0


def _learned(args: argparse.Namespace, subject: Subject) -> Discrepancy:
    """What is examined: the file's bound, or one that is learned now."""
    from workbench.cli.learned_file import load_learned

    if not args.learned:
        return learned_bound(args, subject)[0]
    learned = load_learned(args.learned, subject)
    if learned.horizon_s < args.horizon:
        raise InputError(
            f"{args.learned}: expected a bound up to the horizon of {args.horizon:g} s, got one up "
            f"to {learned.horizon_s:g} s; pass --horizon {learned.horizon_s:g} or learn again"
        )
    return learned


def _outcome(args: argparse.Namespace, subject: Subject, learned: Discrepancy) -> Outcome:
    from workbench.cli.analysis_results import derived, ending, envelope_of, hull_of, tube_of
    from workbench.sensitivity import Examiner, cross_examine
    from workbench.sensitivity.sampling import instants

    # A whole number of tube steps between examined instants, so that each is a tube instant.
    step_s = args.step / math.ceil(args.step / _TUBE_STEP_S)
    tube = tube_of(subject, horizon_s=args.horizon, step_s=step_s)
    proved: dict[str, Discrepancy | ProvedEnvelope] = {}
    if tube.complete:
        for each in derived(subject, hull_of(tube), horizon_s=args.horizon, cells=_CELLS):
            if each.bound:
                proved[each.method] = each.bound
        proved[_TUBE] = envelope_of(subject, tube, instants(args.horizon, args.step))
    else:
        warn(f"{ending(tube)}; the proved bounds are left out")
    with Progress("examining", 1):
        found = cross_examine(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=args.horizon,
            learned=learned,
            proved=list(proved.values()),
            method=Examiner(
                samples=args.samples,
                seed=args.seed + 1,  # other pairs than those it was learned from
                step_s=args.step,
                goals_per_coordinate=_GOALS,
                rounds=args.rounds,
                any_centre=args.any_centre,
                stays_in_region=tube.rigor,
            ),
        )
    return Outcome(subject, learned, tube, list(proved), found, _error(args, subject))


def _error(args: argparse.Namespace, subject: Subject) -> Array:
    from workbench.cli.analysis_results import integration_error

    return integration_error(subject, horizon_s=args.horizon, step_s=args.step)


def _replay(args: argparse.Namespace) -> int:
    from workbench.cli.learned_file import load_witness

    subject = chosen_subject(args)
    witness = load_witness(args.replay, subject)
    distance = witness.replay(subject.system)
    refutes = distance - witness.integration_error > witness.bound
    outcome = "refuted" if refutes else "not refuted by this pair"
    text = f"{_told(witness)}\nreplayed: the distance is {distance!r}; the bound is {outcome}"
    data = {"witness": witness, "replayed_distance": distance, "refutes": refutes}
    emit(args, text, data)
    return 1 if refutes else 0


def _told(witness: Witness) -> str:
    return (
        f"witness: two runs are {witness.distance:.6g} apart in {witness.coordinate} at "
        f"{witness.time_s:g} s (integration error {witness.integration_error:.1e}), where the "
        f"bound says {witness.bound:.6g}"
    )


def _lead(outcome: Outcome) -> list[str]:
    found = outcome.found
    verdict = f"verdict: {VERDICTS[found.verdict.name]}"
    return [verdict, *([_told(found.witness)] if found.witness else [])]


def _doubts(outcome: Outcome) -> list[str]:
    """A run beyond a proved bound must not pass in silence, beyond the error of the runs."""
    found = outcome.found
    return [
        f"a run lies beyond the proved bound {name} by the factor {curve.worst_ratio:.9g}, more "
        "than the estimated integration error of the runs: a defect of the proof, or a bad "
        "estimate; try a shorter --step"
        for name, curve in zip(outcome.methods, found.proved, strict=True)
        if not (found.driven - outcome.error <= (1.0 + _ROUNDING) * curve.half_widths).all()
    ]


def _proved_rows(outcome: Outcome) -> list[list[str | int | float | None]]:
    return [
        [name, curve.rigor.name, "yes" if curve.implies_learned else "no", curve.worst_ratio]
        for name, curve in zip(outcome.methods, outcome.found.proved, strict=True)
    ]


def _coverage_rows(found: Examination) -> list[list[str | int | float | None]]:
    return [
        [each.group, each.pairs, f"{each.whole_run:.2%}", each.worst_ratio]
        for each in found.coverage
    ]


def _text(args: argparse.Namespace, outcome: Outcome) -> str:
    found = outcome.found
    tables = [text_table(_COVERAGE, _coverage_rows(found))]
    if found.proved:
        tables += ["", text_table(_PROVED, _proved_rows(outcome))]
    return "\n".join(
        [
            f"{outcome.subject.name}: a learned bound on trial up to {args.horizon:g} s",
            *_lead(outcome),
            "",
            *tables,
            "",
            f"wrote {args.out / 'examine.html'} and {args.out / 'witness.json'}",
        ]
    )


def _data(args: argparse.Namespace, outcome: Outcome) -> dict[str, object]:
    found = outcome.found
    return {
        "name": outcome.subject.name,
        "verdict": found.verdict,
        "horizon_s": args.horizon,
        "witness": found.witness,
        "coverage": [
            {"group": c.group, "pairs": c.pairs, "whole_run": c.whole_run, "worst": c.worst_ratio}
            for c in found.coverage
        ],
        "proved": [
            {"method": row[0], "rigor": row[1], "implies_learned": row[2] == "yes", "worst": row[3]}
            for row in _proved_rows(outcome)
        ],
        "tube_status": outcome.tube.status,
        "files": [args.out / "examine.html", args.out / "witness.json"],
    }


def _write_page(args: argparse.Namespace, outcome: Outcome, target: Path) -> None:
    from workbench.cli.examine_page import examination_page
    from workbench.report.page import write_page
    from workbench.report.tables import Table

    coverage = Table("pairs within the bound", _COVERAGE, _coverage_rows(outcome.found))
    lead = [*_lead(outcome), *_doubts(outcome)]
    write_page(target, examination_page(args, outcome, lead=lead, coverage=coverage).html())
