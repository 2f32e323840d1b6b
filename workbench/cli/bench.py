"""`workbench bench`: tightness, escapes, time and memory of every tube, side by side."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli import bench_decision, bench_files, bench_onboard, bench_online
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.bench import ColdStart, KernelTime, Loop, MethodScore, SamplePlan
    from workbench.bench.decision_board import DecisionBoard
    from workbench.bench.intent_cost import UpdateCost
    from workbench.bench.onboard_board import OnboardBoard
    from workbench.bench.online_board import OnlineBoard
    from workbench.report.page import Page

HELP: Final = (
    "Score every tube (validated as one set and in cells, online in both forms) on the benchmark "
    "loops against the same sampled trajectories and against validated ones, and time the online "
    "ones; the online kernels in all forms, steps and cells; the whole decision; the intent "
    "filter; the monitor on the vehicle. The seed is fixed. Exit status 1 if any trajectory leaves "
    "a tube, compiled code computes other bits than its source, a decision exceeds its budget, or "
    "a limit of the monitor on the vehicle is not kept."
)
EXAMPLE: Final = """\
workbench bench --quick --only B1 --only B2
workbench bench --board tightness --only B2-slow
workbench bench --board online --only B1 --plot out/online.html
workbench bench --board decision --plot out/decision.html
workbench bench --board onboard --quick
"""

USUAL: Final = ("tightness", "time", "online", "decision", "intent", "cold-start")
BOARDS: Final = (*USUAL, "onboard")
"""The last takes every core of the machine for a while, and is only measured where it is named."""

_SEED: Final = 1
_TRAJECTORIES: Final = 200_000
_TRAJECTORIES_QUICK: Final = 20_000


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"{_TRAJECTORIES_QUICK} trajectories per loop instead of {_TRAJECTORIES}",
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="NAME",
        help="only this loop, such as B1-small (can be given more than once)",
    )
    parser.add_argument(
        "--board",
        action="append",
        choices=BOARDS,
        default=[],
        help="measure only this: tightness and escapes of the tubes, time of the online ones, "
        "the online kernels (width, escapes, time, instructions, memory, agreement), the whole "
        "decision (time, its bound, growth, memory, agreement), one update of the intent filter "
        "(time beside plain Python, instructions), cold start of the runtime, or "
        "`onboard`, the monitor on the vehicle (time and period beside busy cores, heap, memory, "
        "start of the program) "
        "(can be given more than once; default: all but `onboard`)",
    )
    parser.add_argument(
        "--bundle",
        type=Path,
        metavar="DIR",
        help="bundle whose cold start is measured and that the board `onboard` drives (default: "
        "the shipped vehicle's, built for it)",
    )
    bench_online.configure(parser)
    bench_decision.configure(parser)
    bench_onboard.configure(parser)
    bench_files.configure(parser)


def run(args: argparse.Namespace) -> int:
    """Measure, print, and return 1 if any trajectory escapes."""
    from workbench.bench import SamplePlan, bench_loops
    from workbench.bench.intent_cost import update_text
    from workbench.bench.scoreboard import HORIZONS_S, SAMPLE_STEP_S
    from workbench.bench.text import cold_start_text, tightness_text, times_text
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.output import emit

    boards = args.board or USUAL
    _check(args, boards)
    loops = bench_loops(tuple(args.only))
    count = _TRAJECTORIES_QUICK if args.quick else _TRAJECTORIES
    plan = SamplePlan(count, max(HORIZONS_S), SAMPLE_STEP_S, _SEED)
    cold = _cold_start(args.bundle) if "cold-start" in boards else None
    times = _times(loops) if "time" in boards else []
    scores = _scores(loops, plan) if "tightness" in boards else {}
    online = _online(args, loops, count) if "online" in boards else []
    decision = bench_decision.measure(args, seed=_SEED) if "decision" in boards else None
    onboard = bench_onboard.measure(args) if "onboard" in boards else None
    texts = [tightness_text(loop, scores[loop.benchmark.name]) for loop in loops if scores]
    texts += [times_text(times)] if times else []
    intent = _intent(quick=args.quick) if "intent" in boards else ()
    boards_texts = _board_texts(online, decision, onboard)
    if intent:
        boards_texts["intent"] = update_text(intent)
    bench_files.write(args, boards_texts, _pages(args, online, decision))
    texts += boards_texts.values()
    texts += [cold_start_text(cold)] if cold else []
    found = sum(method.horizons[-1].escapes for loop in scores.values() for method in loop)
    texts += [f"escapes: {found} in all (seed {_SEED})"] if scores else []
    bad = found + sum(board.escapes + board.disagreements for board in online)
    bad += decision.disagreements + decision.overspent if decision else 0
    bad += onboard.failing if onboard else 0
    emit(
        args,
        "\n\n".join(texts),
        {"seed": _SEED, "trajectories": count, "escapes": found if scores else None,
         "tightness": scores, "times": times, "online": online,
         "decision": decision, "intent": intent, "onboard": onboard, "cold_start": cold},
    )  # fmt: skip
    return CLAIM_FAILS if bad else DONE


def _check(args: argparse.Namespace, boards: Sequence[str]) -> None:
    """Refuse what cannot be measured or written, before any work."""
    if args.bundle is not None and not args.bundle.is_dir():
        raise InputError(
            f"--bundle: expected a bundle folder, got {args.bundle}; `workbench build` writes one"
        )
    bench_files.check(args, boards)
    if "onboard" in boards:
        bench_onboard.check(args.bundle)


def _online(
    args: argparse.Namespace, loops: Sequence[Loop], trajectories: int
) -> list[OnlineBoard]:
    return bench_online.measure(args, loops, trajectories=trajectories, seed=_SEED)


def _intent(*, quick: bool) -> tuple[UpdateCost, ...]:
    from workbench.bench.intent_cost import units_of_work, update_costs
    from workbench.cli.output import Progress

    with Progress("updates of the intent filter", units_of_work()) as progress:
        return update_costs(rounds=200 if quick else 2000, advance_by=progress.advance)


def _board_texts(
    online: Sequence[OnlineBoard], decision: DecisionBoard | None, onboard: OnboardBoard | None
) -> dict[str, str]:
    """The tables of the boards that have documents, by the board's name."""
    from workbench.bench import decision_text, onboard_text, online_text

    texts = {}
    if online:
        tables = [online_text.online_text(board) for board in online]
        texts["online"] = "\n\n".join([*tables, online_text.summary_text(online, _SEED)])
    if decision is not None:
        tables = [decision_text.decision_text(decision), decision_text.summary_text(decision)]
        texts["decision"] = "\n\n".join(tables)
    if onboard is not None:
        tables = [onboard_text.onboard_text(onboard), onboard_text.claims_text(onboard)]
        texts["onboard"] = "\n\n".join(tables)
    return texts


def _pages(
    args: argparse.Namespace, online: Sequence[OnlineBoard], decision: DecisionBoard | None
) -> list[Page]:
    """The pages of the same boards, where one is asked for."""
    if args.plot is None:
        return []
    from workbench.cli.bench_decision_page import decision_page

    command = bench_files.this_command(args)
    pages = [bench_online.online_page(online, command)] if online else []
    return pages + ([decision_page(decision, command)] if decision is not None else [])


def _times(loops: Sequence[Loop]) -> list[KernelTime]:
    from workbench.bench import kernel_times
    from workbench.cli.output import Progress

    times: list[KernelTime] = []
    with Progress("time of online tubes", len(loops)) as progress:
        for loop in loops:
            times += kernel_times(loop.benchmark)
            progress.advance()
    return times


def _scores(loops: Sequence[Loop], plan: SamplePlan) -> dict[str, tuple[MethodScore, ...]]:
    from workbench.bench import score_loop
    from workbench.bench.scoreboard import units_of_work
    from workbench.cli.output import Progress

    scores = {}
    for loop in loops:
        name = loop.benchmark.name
        with Progress(f"tightness of {name}", units_of_work(loop, plan)) as progress:
            scores[name] = score_loop(loop, plan, advance=progress.advance)
    return scores


def _cold_start(bundle: Path | None) -> ColdStart:
    from workbench.bench import cold_start

    if bundle is not None:
        return cold_start(bundle)
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.models.vehicle import gem_e2

    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        spec = MonitorSpec(gem_e2(), horizon_s=3.0, step_s=0.05)
        return cold_start(build_bundle(spec, Path(folder) / "bundle"))
