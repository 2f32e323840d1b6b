"""`workbench examine`: a learned bound against the proved ones, with a witness when it fails."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    add_subject_options,
    add_time_options,
    check_steps,
    check_whole_steps,
    chosen_subject,
    count,
)
from workbench.cli.common import add_output_option, output_folder
from workbench.cli.derive import METHODS
from workbench.cli.learn import add_sample_options, learned_bound, learned_from
from workbench.cli.learn_options import check_published
from workbench.cli.learn_sources import COMPILED, MODEL, Source, add_source_options, chosen_source
from workbench.cli.output import Progress, emit, warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.examine_text import Outcome
    from workbench.sensitivity import Discrepancy, Examiner
    from workbench.sensitivity.learning.pairs import Simulator
    from workbench.sets import Box

HELP = (
    "Holds a learned bound against samples, a search by gradients and curvature, and the proved "
    "bounds of the same loop, set and horizon. Ends in refuted (with a witness that can be "
    "replayed), consistent, or implied by proof. Of a plant or your own function only runs are "
    "known: nothing is proved then. Exit status 1 when refuted."
)
EXAMPLE = """\
workbench examine --out out/examine
workbench examine --learned out/learned.json --samples 5000
workbench examine --system b1 --form matrix --method blocks local-blocks
workbench examine --from single-track --pairs 100 --samples 100
workbench examine --replay out/examine/witness.json
"""

ALL: Final = "all"
_METHODS: Final = ("norm-max", "norm-sum", "growth-matrix")
_GOALS: Final = 8
_SECOND_ORDER: Final = 2


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, time grid, how the bound is learned or read, how hard to try, where to write."""
    add_subject_options(parser)
    add_source_options(parser)
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
        "--rounds", type=count, metavar="N",
        help="gradient steps (default: 6; of a plant or function none, as each costs many runs: "
        "its gradients are finite differences)",
    )  # fmt: skip
    parser.add_argument(
        "--starts", type=count, default=3, metavar="N",
        help="different pairs that set out where the bound is tightest (default: 3)",
    )  # fmt: skip
    parser.add_argument(
        "--any-centre", action="store_true",
        help="also try pairs that do not contain the middle of the initial set",
    )  # fmt: skip
    parser.add_argument(
        "--method", nargs="+", choices=(*METHODS, ALL), default=list(_METHODS), metavar="NAME",
        help="proved bounds beside the validated tube, as `workbench derive` names them, or "
        f"{ALL} (default: {' '.join(_METHODS)})",
    )  # fmt: skip
    add_output_option(parser, default="out/examine")


def run(args: argparse.Namespace) -> int:
    """Examine, show and write; 1 when the bound is refuted."""
    check_steps(args)
    check_whole_steps(args)
    args.resume = None
    if args.replay:
        return _replay(args)
    from workbench.cli.examine_text import data, doubts, text
    from workbench.sensitivity import ExaminationVerdict

    with output_folder(args.out) as folder:
        outcome = _model(args, folder) if _of_model(args) else _simulated(args, folder)
        _write_page(args, outcome, folder / "examine.html")
    emit(args, text(args, outcome), data(args, outcome))
    for doubt in doubts(outcome):
        warn(doubt)
    refuted = outcome.found.verdict is ExaminationVerdict.REFUTED
    return 1 if refuted else 0


def _of_model(args: argparse.Namespace) -> bool:
    return args.source in (MODEL, COMPILED)


def _model(args: argparse.Namespace, folder: Path) -> Outcome:
    """The examination of a bound on the model's runs, with all that is known of the model."""
    from workbench.cli.analysis_results import integration_error
    from workbench.cli.examine_bounds import proved_beside
    from workbench.cli.examine_text import Outcome
    from workbench.cli.learned_file import load_learned, save_witness
    from workbench.reach.inner.distance import proved_distance
    from workbench.sensitivity import cross_examine
    from workbench.sensitivity.witness import Witness

    subject = chosen_subject(args)
    if args.learned:
        learned = _long_enough(args, load_learned(args.learned, subject))
    else:
        learned = learned_bound(args, subject)[0]
    beside = proved_beside(
        subject, horizon_s=args.horizon, step_s=args.step, methods=_methods(args)
    )
    with Progress("examining", 1):
        found = cross_examine(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=args.horizon,
            learned=learned,
            proved=list(beside.bounds.values()),
            method=_examiner(args, beside.tube.rigor.name, rounds=6),
        )
    witness, sure = found.witness, None
    if isinstance(witness, Witness):
        sure = proved_distance(
            subject.system,
            (witness.first, witness.second),
            parameters=witness.parameters,
            time_s=witness.time_s,
            state=witness.coordinate,
        )
        save_witness(folder / "witness.json", witness, subject, verdict=found.verdict.name)
    else:
        save_witness(folder / "witness.json", None, subject, verdict=found.verdict.name)
    states = subject.system.ode.states
    error = integration_error(subject, horizon_s=args.horizon, step_s=args.step)
    units = tuple(state.unit for state in states)
    return Outcome(subject.name, units, learned, found, beside, error, sure, _how(args))


def _simulated(args: argparse.Namespace, folder: Path) -> Outcome:
    """The examination of a bound on a black box's runs."""
    from workbench.cli.examine_text import Outcome
    from workbench.cli.examine_witness import save_simulated
    from workbench.cli.learned_file import load_learned
    from workbench.sensitivity.examine_simulator import cross_examine_simulator
    from workbench.sensitivity.witness import SimulatedWitness

    source = chosen_source(args)
    simulator, box = _simulator(source)
    if args.learned:
        learned = _long_enough(args, load_learned(args.learned, source=source))
    else:
        check_published(args)
        learned = learned_from(args, source)
    with Progress("examining", _runs(args, len(source.names))) as progress:
        found = cross_examine_simulator(
            simulator,
            initial_set=box,
            learned=learned,
            method=_examiner(args, "SAMPLED", rounds=0),
            workforce=source.workforce,
            ran=progress.advance,
        )
    witness = found.witness
    assert witness is None or isinstance(witness, SimulatedWitness)
    save_simulated(folder / "witness.json", witness, source, verdict=found.verdict.name)
    return Outcome(source.title, source.units, learned, found, None, None, None, _how(args))


def _simulator(source: Source) -> tuple[Simulator, Box]:
    if source.simulator is None or source.box is None:
        raise InputError(
            f"--from {source.kind}: expected a simulator, which can run from chosen states, got "
            "recordings; hold out some of them instead (`workbench learn --hold-out N`)"
        )
    return source.simulator, source.box


def _runs(args: argparse.Namespace, states: int) -> int:
    """About how many pairs will run, for the progress bar."""
    samples: int = args.samples
    rounds: int = args.rounds or 0
    return (4 if args.any_centre else 3) * samples + rounds * _GOALS * states * (states + 4)


def _how(args: argparse.Namespace) -> str:
    if _of_model(args):
        return "searched by samples, gradients and curvature of the model"
    what = f"the runs of --from {args.source}"
    if args.rounds:
        return f"searched by samples and finite differences of {what}; nothing is proved"
    return f"searched by samples of {what} alone, without gradients; nothing is proved"


def _methods(args: argparse.Namespace) -> list[str]:
    """In the order of `workbench derive`; the tube of the last one is there already."""
    chosen = METHODS if ALL in args.method else args.method
    return [name for name in METHODS[:-1] if name in chosen]


def _examiner(args: argparse.Namespace, stays: str, *, rounds: int) -> Examiner:
    from workbench.claims import Rigor
    from workbench.sensitivity import Examiner

    return Examiner(
        samples=args.samples,
        seed=args.seed + 1,  # other pairs than those it was learned from
        step_s=args.step,
        goals_per_coordinate=_GOALS,
        rounds=rounds if args.rounds is None else args.rounds,
        starts=args.starts,
        second_order_rounds=_SECOND_ORDER,
        any_centre=args.any_centre,
        closer=True,
        stays_in_region=Rigor[stays],
    )


def _long_enough(args: argparse.Namespace, learned: Discrepancy) -> Discrepancy:
    if learned.horizon_s < args.horizon:
        raise InputError(
            f"{args.learned}: expected a bound up to the horizon of {args.horizon:g} s, got one up "
            f"to {learned.horizon_s:g} s; pass --horizon {learned.horizon_s:g} or learn again"
        )
    return learned


def _replay(args: argparse.Namespace) -> int:
    from workbench.cli.examine_text import told
    from workbench.cli.examine_witness import load_simulated
    from workbench.cli.learned_file import load_witness
    from workbench.sensitivity.learning.by_workers import ByWorkers
    from workbench.sensitivity.witness import AnyWitness

    witness: AnyWitness
    if _of_model(args):
        subject: Subject = chosen_subject(args)
        witness = load_witness(args.replay, subject)
        distance, error = witness.replay(subject.system), witness.integration_error
    else:
        source: Source = chosen_source(args)
        witness = load_simulated(args.replay, source)
        replayed = ByWorkers(_simulator(source)[0], source.workforce)
        distance, error = witness.replay(replayed), 0.0
    refutes = distance - error > witness.bound
    outcome = "refuted" if refutes else "not refuted by this pair"
    text = f"{told(witness)}\nreplayed: the distance is {distance!r}; the bound is {outcome}"
    data = {"witness": witness, "replayed_distance": distance, "refutes": refutes}
    emit(args, text, data)
    return 1 if refutes else 0


def _write_page(args: argparse.Namespace, outcome: Outcome, target: Path) -> None:
    from workbench.cli.examine_page import examination_page
    from workbench.report.page import write_page

    write_page(target, examination_page(args, outcome).html())
