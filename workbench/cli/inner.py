"""`workbench inner`: how tight a tube is, proved from below by validated trajectories."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import (
    Subject,
    add_file_option,
    add_subject_options,
    add_time_options,
    check_steps,
    chosen_subject,
    command_line,
    count,
    seed,
    shown_instants,
    text_table,
    writable_file,
)
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.reach import ReachTube
    from workbench.reach.inner.hull import InnerHull

HELP: Final = (
    "Proves how tight the validated tube is: extremal initial states, parameters and disturbances "
    "are searched, their trajectories enclosed, and the width that they reach for certain is set "
    "beside the tube's. Exit status 1 when either proof ends before the horizon."
)
EXAMPLE: Final = """\
workbench inner --system b1
workbench inner --system b2 --rounds 4 --plot out/inner.html
"""

_MOST_STEPS: Final = 1_000
_MOST_STARTS: Final = 100_000
_MOST_ROUNDS: Final = 1_000
_RATIOS: Final = (
    "half width of the tube, half width reached for certain, and their ratio: the true set is at "
    "most this factor narrower than the tube; 1 would be perfect"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Loop, time grid, effort of the search, and the file to write."""
    add_subject_options(parser)
    add_time_options(parser, step_s=0.05)
    parser.add_argument(
        "--starts",
        type=count,
        default=64,
        metavar="N",
        help="random starts of the search (default: 64)",
    )
    parser.add_argument(
        "--rounds",
        type=count,
        default=3,
        metavar="N",
        help="rounds of gradient and coordinate search (default: 3)",
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the starts (default: 1)"
    )
    add_file_option(parser, "--plot", text="write a page with both sets")


def run(args: argparse.Namespace) -> int:
    """Compute and show; 0 when both proofs reach the horizon, 1 when not."""
    check_steps(args, most=_MOST_STEPS)
    for option, most in (("starts", _MOST_STARTS), ("rounds", _MOST_ROUNDS)):
        given = getattr(args, option)
        if given > most:
            raise InputError(f"--{option}: expected at most {most}, got {given}; give fewer")
    writable_file(args.plot, "--plot")
    subject = chosen_subject(args)
    tube, inner = _computed(args, subject)
    if args.plot:
        _write_page(args, subject, tube, inner)
    from workbench.cli.analysis_results import ending

    lines = [
        f"{subject.name}: half widths that no trajectory leaves, and that trajectories reach",
        text_table(*_table(subject, tube, inner, horizon_s=args.horizon)),
        ending(tube),
        _inner_ending(inner),
        *([f"wrote {args.plot}"] if args.plot else []),
    ]
    emit(args, "\n".join(lines), _data(args, subject, tube, inner))
    return 0 if tube.complete and inner.complete else 1


def _computed(args: argparse.Namespace, subject: Subject) -> tuple[ReachTube, InnerHull]:
    from workbench.cli.output import Progress
    from workbench.reach import ValidatedTube, compute_tube
    from workbench.reach.inner.extremes import SearchEffort
    from workbench.reach.inner.hull import inner_hull

    with Progress("tube and validated trajectories", 2) as progress:
        tube = compute_tube(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=args.horizon,
            method=ValidatedTube(args.step),
        )
        progress.advance()
        inner = inner_hull(
            subject.system,
            initial_set=subject.initial_set,
            horizon_s=args.horizon,
            step_s=args.step,
            effort=SearchEffort(args.starts, args.rounds, every=2, seed=args.seed),
        )
        progress.advance()
    return tube, inner


def _shown_rows(inner: InnerHull, horizon_s: float) -> list[int]:
    """The instants nearest to those that tables show, as far as both proofs go."""
    import numpy as np

    nearest = {int(np.argmin(np.abs(inner.times - t))) for t in shown_instants(horizon_s)}
    return sorted(nearest - {0})


def _table(
    subject: Subject, tube: ReachTube, inner: InnerHull, *, horizon_s: float
) -> tuple[list[str], list[list[str | int | float | None]]]:
    """Headings and a row per state: tube, reached and ratio at each shown instant, mean ratio."""
    from workbench.reach.inner.hull import proved_ratio

    ratio, rows = proved_ratio(tube, inner), _shown_rows(inner, horizon_s)
    rows = [k for k in rows if k < len(tube.times)]
    headings = ["state", "unit"]
    for k in rows:
        headings += [f"{inner.times[k]:g} s tube", "reached", "ratio"]
    means = _mean_ratios(tube, inner)
    outer, width = tube.half_width_at(), 0.5 * inner.width_at()
    body: list[list[str | int | float | None]] = [
        [
            state.name,
            state.unit,
            *(_number(v) for k in rows for v in (outer[k, i], width[k, i], ratio[k, i])),
            means[i],
        ]
        for i, state in enumerate(subject.system.ode.states)
    ]
    return [*headings, "mean ratio"], body


def _mean_ratios(tube: ReachTube, inner: InnerHull) -> list[float | None]:
    """Per state, over the instants after the start where both proofs hold."""
    import numpy as np

    from workbench.reach.inner.hull import proved_ratio

    ratio = proved_ratio(tube, inner)
    known = np.isfinite(ratio) & (inner.times > 0.0)[:, None]
    return [
        float(np.mean(ratio[known[:, i], i])) if known[:, i].any() else None
        for i in range(len(inner.names))
    ]


def _number(value: float) -> float | None:
    import math

    return float(value) if math.isfinite(value) else None


def _inner_ending(inner: InnerHull) -> str:
    text = (
        f"reached: {inner.status.name}, {inner.rigor.name}, {len(inner.choices)} validated "
        f"trajectories up to {inner.times[-1]:.3f} s"
    )
    return text if inner.complete else f"{text} only ({inner.message})"


def _data(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, inner: InnerHull
) -> dict[str, object]:
    """Both sets, their ratios, and the witness of every face at the last instant."""
    return {
        "name": subject.name,
        "status": tube.status,
        "rigor": tube.rigor,
        "inner_status": inner.status,
        "inner_rigor": inner.rigor,
        "states": inner.names,
        "instants_s": inner.times,
        "inner_lower": inner.lower_at,
        "inner_upper": inner.upper_at,
        "tube_lower": tube.lower_at,
        "tube_upper": tube.upper_at,
        "mean_ratio": _mean_ratios(tube, inner),
        "witnesses": {
            name: [_witness(inner, name, upper=upper) for upper in (False, True)]
            for name in inner.names
        },
        "files": [args.plot] if args.plot else [],
    }


def _witness(inner: InnerHull, name: str, *, upper: bool) -> dict[str, object]:
    found = inner.witness_of(name, len(inner.times) - 1, upper=upper)
    held = {w: found.signal[:, i] for i, w in enumerate(found.disturbances)}
    return {
        "initial_state": found.initial_state, "parameters": found.parameters, "disturbances": held,
    }  # fmt: skip


def _write_page(
    args: argparse.Namespace, subject: Subject, tube: ReachTube, inner: InnerHull
) -> None:
    from workbench import __version__
    from workbench.claims import weakest
    from workbench.cli.analysis_results import ending
    from workbench.report.inner import BothSides, both_sides_figure
    from workbench.report.page import Claim, Claims, Page, Section, write_page
    from workbench.report.tables import Table

    rows = min(len(tube.times), len(inner.times))
    rigor = weakest(tube.rigor, inner.rigor)
    sets = BothSides(
        inner.names,
        tuple(state.unit for state in subject.system.ode.states),
        inner.times[:rows],
        tube.lower_at[:rows],
        tube.upper_at[:rows],
        inner.lower_at[:rows],
        inner.upper_at[:rows],
        rigor,
    )
    statement = (
        "At each instant the hull of the reachable states contains the inner set and lies in the "
        f"tube, up to {inner.times[rows - 1]:g} s."
    )
    ratios = Table(_RATIOS, *_table(subject, tube, inner, horizon_s=args.horizon))
    page = Page(
        f"Reachable states of {subject.name} from both sides",
        [ending(tube), _inner_ending(inner)],
        [
            Section("What is claimed", [Claims([Claim(statement, rigor)])]),
            Section("Both sets", [both_sides_figure(sets)]),
            Section("How tight the tube is", [ratios]),
        ],
        __version__,
        command_line("inner", args),
    )
    write_page(Path(args.plot), page.html())
