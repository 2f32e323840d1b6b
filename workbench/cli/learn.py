"""`workbench learn`: a bound fitted to sampled trajectories, with its honest statement."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    check_whole_steps,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.learn_options import add_sample_options, check_published, chosen_plan
from workbench.cli.learn_sources import MODEL, Source, add_source_options, chosen_source
from workbench.cli.output import Progress, emit, warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.sensitivity import Discrepancy
    from workbench.sensitivity.discrepancy import Growth
    from workbench.sensitivity.learning.statement import Statement

__all__ = ["add_sample_options", "configure", "learned_bound", "learned_from", "run"]

HELP = (
    "Learns a bound on the spread from pairs of sampled trajectories (DryVR's exponentials and "
    "others), of the model, of a plant, of recordings or of your own function, and states what the "
    "pairs support. It proves nothing: its grade is SAMPLED."
)
EXAMPLE = """\
workbench learn --save out/learned.json
workbench learn --epsilon 0.001 --delta 1e-6 --seed 7
workbench learn --form matrix --system b1 --wait-and-judge --hold-out 2000
workbench learn --from single-track --pairs 500 --resume out/pairs
workbench learn --from car.py:drive --start position 0.9 1.1 --start speed 1.8 2.2
"""

_LITTLE: Final = 0.5
_USUAL: Final = 0.05


def configure(parser: argparse.ArgumentParser) -> None:
    """Whose runs, time grid, sample, form, and the files to write."""
    add_subject_options(parser)
    add_source_options(parser)
    add_time_options(parser, step_s=0.02)
    add_sample_options(parser)
    parser.add_argument(
        "--resume", type=Path, metavar="DIR",
        help="keep drawn pairs in this folder; the same command goes on where it was interrupted",
    )  # fmt: skip
    add_file_option(parser, "--save", text="write the bound as JSON, for `workbench examine`")


def run(args: argparse.Namespace) -> int:
    """Learn, show and save."""
    check_steps(args)
    check_whole_steps(args)
    check_published(args)
    writable_file(args.save, "--save")
    source = chosen_source(args)
    bound = learned_from(args, source)
    if args.save:
        from workbench.cli.learned_file import save_learned

        save_learned(args.save, bound, source=source)
    emit(args, _text(args, source, bound), _data(args, source, bound))
    judged = bound.statements[0]
    if judged.epsilon >= _LITTLE and not args.published:
        warn(_too_few(source, judged))
    return 0


def _too_few(source: Source, judged: Statement) -> str:
    from workbench.sensitivity.scenario import judged_pairs_needed, pairs_needed

    if judged.argument.name == "A_PRIORI":
        needed = pairs_needed(_USUAL, delta=judged.delta, parameters=judged.counted)
    else:
        needed = judged_pairs_needed(_USUAL, delta=judged.delta, support=judged.counted)
    mend = f"give --pairs {needed} (or --epsilon {_USUAL:g})"
    if source.pairs.most is not None:
        mend = f"{needed} pairs are needed, and these recordings give {source.pairs.most}"
    promised = "nothing" if judged.epsilon >= 1.0 else "almost nothing"
    return (
        f"--pairs {judged.pairs} promises {promised}: the probability that a further pair leaves "
        f"the bound is only known to be at most {judged.epsilon:.3g}; for at most {_USUAL:g} {mend}"
    )


def learned_bound(args: argparse.Namespace, subject: Subject) -> tuple[Discrepancy, Growth]:
    """The bound of this model that the options ask for, and its formula."""
    whole = argparse.Namespace(
        **{"source": MODEL, "start": [], "radius": [], "jobs": None, "resume": None, **vars(args)}
    )
    check_published(whole)
    bound = learned_from(whole, chosen_source(whole, subject))
    return bound, bound.growth


def learned_from(args: argparse.Namespace, source: Source) -> Discrepancy:
    """The bound of this source that the options ask for, with a progress bar."""
    if args.published:
        return _published(args, source)
    from workbench.sensitivity.learning.drawing import Drawing
    from workbench.sensitivity.learning.learn import learn_from_pairs

    plan = chosen_plan(args, source)
    store = _store(args, source)
    fresh = f" and {plan.fresh} fresh ones" if plan.fresh else ""
    label = f"learning from {plan.count} pairs{fresh}"
    # The fit itself comes last, and has no steps to count.
    with (
        Progress(label, plan.total + plan.total // 10 + 1) as progress,
        Drawing(
            source.pairs, plan.total, source.workforce, store=store, drawn=progress.advance
        ) as pairs,
    ):
        return learn_from_pairs(
            pairs, count=plan.count, form=plan.form, evidence=plan.evidence, region=source.box
        )


def _published(args: argparse.Namespace, source: Source) -> Discrepancy:
    from workbench.sensitivity.learning.published import PublishedTool

    if source.simulator is None or source.box is None or args.resume is not None:
        what = "--resume" if args.resume is not None else f"--from {source.kind}"
        raise InputError(
            f"--published: expected a simulator to start ten runs of, got {what}; leave it out"
        )
    tool = PublishedTool(seed=args.seed % 2**64, step_s=args.step)
    # What a function prints must not spoil what this command prints.
    with Progress("learning from ten runs", 1), contextlib.redirect_stdout(sys.stderr):
        return tool.learn_from(source.simulator, box=source.box)


def _store(args: argparse.Namespace, source: Source) -> Any:
    if args.resume is None:
        return None
    if source.simulator is None:
        raise InputError(
            f"--resume: expected runs that are simulated, got the recordings of --from "
            f"{source.kind}; leave --resume out"
        )
    from workbench import __version__
    from workbench.sensitivity.learning.store import PairStore

    recipe = {
        "version": __version__, "source": source.kind, "runs_of": source.identity,
        "seed": args.seed, "horizon_s": args.horizon, "step_s": args.step,
        "pairs_per_block": source.workforce.chunk,
    }  # fmt: skip
    return PairStore.opened(args.resume, recipe)


def _half_widths(source: Source, bound: Discrepancy, times: tuple[float, ...]) -> Any:
    """From the half widths of the set, one row per time."""
    import numpy as np

    start = source.pairs.scale.tolist()
    return np.array([bound.radius(start, t) for t in times])


def _text(args: argparse.Namespace, source: Source, bound: Discrepancy) -> str:
    from workbench.cli.learned_growth import growth_fields

    times = shown_instants(args.horizon)
    values = _half_widths(source, bound, times)
    fields = growth_fields(bound.growth)
    per_state = {
        heading: fields[name]
        for name, heading in (
            ("factor", "factor"), ("amplitude", "amplitude"), ("rate_per_s", "rate (1/s)"),
        )
        if name in fields
    }  # fmt: skip
    table = text_table(
        ["state", "unit", "half width", *per_state, *(f"{t:g} s" for t in times)],
        [
            [
                name, unit, half, *(column[i] for column in per_state.values()),
                *(float(value) for value in values[:, i]),
            ]
            for i, (name, unit, half) in enumerate(
                zip(source.names, source.units, source.pairs.scale.tolist(), strict=True)
            )
        ],
    )  # fmt: skip
    return "\n".join(
        [
            f"{source.title}: bound on the distance of two runs that start half widths apart "
            f"({bound.rigor.name}, seed {args.seed})",
            bound.norm,
            table,
            *(f"statement: {each}" for each in bound.statements),
            *([f"wrote {args.save}"] if args.save else []),
        ]
    )


def _data(args: argparse.Namespace, source: Source, bound: Discrepancy) -> dict[str, object]:
    from workbench.cli.learned_growth import form_of, growth_fields

    times = shown_instants(args.horizon)
    return {
        "name": source.title,
        "source": source.kind,
        "rigor": bound.rigor,
        "horizon_s": bound.horizon_s,
        "step_s": args.step,
        "seed": args.seed,
        "states": bound.names,
        "form": form_of(bound.growth),
        "norm": bound.norm,
        **growth_fields(bound.growth),
        "statement": bound.statements[0],
        "statements": bound.statements,
        "instants_s": times,
        "half_widths": _half_widths(source, bound, times),
        "saved": args.save,
    }
