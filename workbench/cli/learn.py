"""`workbench learn`: a bound fitted to sampled trajectories, with its honest statement."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    check_whole_steps,
    chosen_subject,
    count,
    seed,
    share,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.output import Progress, emit, warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.sensitivity import Discrepancy
    from workbench.sensitivity.learned import ExponentialEnvelope
    from workbench.sensitivity.scenario import ScenarioStatement

HELP = (
    "Learns a bound on the spread from pairs of sampled trajectories (DryVR's exponentials), and "
    "states what the pairs support. It proves nothing: its grade is SAMPLED."
)
EXAMPLE = """\
workbench learn --save out/learned.json
workbench learn --epsilon 0.001 --delta 1e-6 --seed 7
"""

_MOST_PAIRS: Final = 2_000_000
_LITTLE: Final = 0.5
_USUAL: Final = 0.05


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, time grid, sample, and the file to write."""
    add_subject_options(parser)
    add_time_options(parser, step_s=0.02)
    add_sample_options(parser)
    add_file_option(parser, "--save", text="write the bound as JSON, for `workbench examine`")


def add_sample_options(parser: argparse.ArgumentParser) -> None:
    """Add `--pairs`, `--epsilon`, `--delta` and `--seed`; `learned_bound` reads them."""
    size = parser.add_mutually_exclusive_group()
    size.add_argument(
        "--pairs", type=count, default=2000, metavar="N", help="pairs of runs (default: 2000)"
    )
    size.add_argument(
        "--epsilon",
        type=share,
        metavar="E",
        help="take as many pairs as this probability of violation needs",
    )
    parser.add_argument(
        "--delta",
        type=share,
        default=1e-6,
        metavar="D",
        help="1 - confidence of the statement (default: 1e-6)",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the random numbers (default: 1)"
    )


def run(args: argparse.Namespace) -> int:
    """Learn, show and save."""
    check_steps(args)
    check_whole_steps(args)
    writable_file(args.save, "--save")
    subject = chosen_subject(args)
    bound, envelope = learned_bound(args, subject)
    if args.save:
        from workbench.cli.learned_file import save_learned

        save_learned(args.save, bound, subject)
    emit(args, _text(args, subject, bound, envelope), _data(args, subject, bound, envelope))
    if envelope.evidence.epsilon >= _LITTLE:
        warn(_too_few(envelope.evidence))
    return 0


def _too_few(evidence: ScenarioStatement) -> str:
    from workbench.sensitivity.scenario import pairs_needed

    needed = pairs_needed(_USUAL, delta=evidence.delta, parameters=evidence.parameters)
    promised = "nothing" if evidence.epsilon >= 1.0 else "almost nothing"
    return (
        f"--pairs {evidence.pairs} promises {promised}: the probability that a further pair leaves "
        f"the bound is only known to be at most {evidence.epsilon:.3g}; for at most {_USUAL:g} "
        f"give --pairs {needed} (or --epsilon {_USUAL:g})"
    )


def learned_bound(
    args: argparse.Namespace, subject: Subject
) -> tuple[Discrepancy, ExponentialEnvelope]:
    """The bound that the options ask for, and its formula."""
    from workbench.sensitivity import LearnedExponential, learn_discrepancy
    from workbench.sensitivity.learned import ExponentialEnvelope

    pairs = args.pairs
    if args.epsilon is not None:
        pairs = LearnedExponential.promising(
            args.epsilon,
            delta=args.delta,
            system=subject.system,
            seed=args.seed,
            step_s=args.step,
        ).pairs
    if pairs > _MOST_PAIRS:
        raise InputError(
            f"expected at most {_MOST_PAIRS} pairs, got {pairs}; give fewer --pairs or a larger "
            "--epsilon"
        )
    method = LearnedExponential(pairs=pairs, seed=args.seed, step_s=args.step, delta=args.delta)
    with Progress(f"learning from {pairs} pairs", 1):
        bound = learn_discrepancy(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=args.horizon,
            method=method,
        )
    assert isinstance(bound.growth, ExponentialEnvelope)
    return bound, bound.growth


def _text(
    args: argparse.Namespace, subject: Subject, bound: Discrepancy, envelope: ExponentialEnvelope
) -> str:
    import numpy as np

    from workbench.cli.analysis_results import radii

    times = shown_instants(args.horizon)
    values = radii(bound, subject, np.array(times))
    table = text_table(
        ["state", "unit", "amplitude", "rate (1/s)", *(f"{t:g} s" for t in times)],
        [
            [
                state.name,
                state.unit,
                envelope.amplitude[i],
                envelope.rate_per_s[i],
                *(float(value) for value in values[:, i]),
            ]
            for i, state in enumerate(subject.system.ode.states)
        ],
    )
    return "\n".join(
        [
            f"{subject.name}: amplitude_i exp(rate_i t) bounds the distance in state i "
            f"({bound.rigor.name}, seed {args.seed})",
            table,
            f"statement: {envelope.evidence}",
            *([f"wrote {args.save}"] if args.save else []),
        ]
    )


def _data(
    args: argparse.Namespace, subject: Subject, bound: Discrepancy, envelope: ExponentialEnvelope
) -> dict[str, object]:
    import numpy as np

    from workbench.cli.analysis_results import radii

    times = np.array(shown_instants(args.horizon))
    return {
        "name": subject.name,
        "rigor": bound.rigor,
        "horizon_s": bound.horizon_s,
        "step_s": args.step,
        "seed": args.seed,
        "states": bound.names,
        "norm": bound.norm,
        "scale": envelope.scale,
        "amplitude": envelope.amplitude,
        "rate_per_s": envelope.rate_per_s,
        "statement": envelope.evidence,
        "instants_s": times,
        "half_widths": radii(bound, subject, times),
        "saved": args.save,
    }
