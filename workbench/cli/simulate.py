"""`workbench simulate`: scenarios driven by the monitor, with a page of what happened."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import count, seed, text_table
from workbench.cli.common import add_output_option
from workbench.cli.output import emit
from workbench.cli.simulate_localiser import add_localiser_options, require_localiser_options
from workbench.cli.simulate_subject import add_rig_options, require_rig_options
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.simulation.scenarios.scenario import Scenario

HELP: Final = (
    "Drives a car through a scenario: the monitor that runs on the vehicle, over CAN frames, with "
    "a plant, sensors and people that the analysis did not write. Writes report.html, run.jsonl "
    "and turns.csv. Exit status 1 when it goes otherwise than the scenario expects."
)
EXAMPLE: Final = """\
workbench simulate --list
workbench simulate paper_crossing_simulation --out out/crossing
workbench simulate my_scenario.toml --plant multi-body --policy LookAhead
workbench simulate my_scenario.toml --plant every --policy every --desk
workbench simulate --all --desk --jobs 4
workbench simulate paper_crossing_vehicle --localiser --out out/ranged
"""
PLANTS: Final = ("bicycle", "single-track", "multi-body")
POLICIES: Final = ("LookAhead", "FailSafe", "both")
EVERY: Final = "every"
"""Each of them in turn, in a table."""
_DRIVES: Final = "--desk, --real-time, --intents"
_OF_DRIVES: Final = (
    "plant", "seed", "horizon", "vehicle", "sensors", "bundle", "intents", "localiser", "site",
    "desk", "real_time",
)  # fmt: skip


def configure(parser: argparse.ArgumentParser) -> None:
    """What is driven, by whom, and how."""
    parser.add_argument(
        "scenario", nargs="*", metavar="SCENARIO",
        help="name of the library, TOML file or CommonRoad XML; several make a table, no pages",
    )  # fmt: skip
    parser.add_argument("--list", action="store_true", help="list the library and its expectations")
    parser.add_argument("--all", action="store_true", help="the whole library on every plant")
    parser.add_argument(
        "--plant", choices=(*PLANTS, EVERY),
        help="what drives (default: single-track; each of them with --all)",
    )  # fmt: skip
    parser.add_argument(
        "--policy", choices=(*POLICIES, EVERY), default="both",
        help="whose TRACK counts (default: both)",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=0, metavar="N",
        help="of errors, actuators and people; 0 takes the middle of all actuators (default: 0)",
    )  # fmt: skip
    add_rig_options(parser, bundle="built for driving (default: it is built)")
    parser.add_argument(
        "--intents", action="store_true",
        help="estimate what people want from the scenario's goals, and tell the monitor",
    )  # fmt: skip
    add_localiser_options(parser)
    parser.add_argument(
        "--desk", action="store_true", help="without frames, faster, and without a page"
    )
    parser.add_argument(
        "--real-time", action="store_true",
        help="the real workbench-monitor process on a serial line, as long as the scenario takes "
        "(with --localiser, the real workbench-localiser too)",
    )  # fmt: skip
    parser.add_argument(
        "--jobs", type=count, default=1, metavar="N", help="processes for a table (default: 1)"
    )
    add_output_option(parser, default="out/simulation")


def run(args: argparse.Namespace) -> int:
    """List, drive one, or drive many; 0 where all went as expected."""
    _require(args)
    if args.list:
        return _list(args)
    if several(args):
        from workbench.cli.simulate_table import drive_many

        return drive_many(args)
    from workbench.cli.simulate_drive import drive_one

    return drive_one(args)


def several(args: argparse.Namespace) -> bool:
    """Whether a table is asked for."""
    asked = EVERY in (args.plant, args.policy)
    return bool(args.all or len(args.scenario) > 1 or asked)


def _require(args: argparse.Namespace) -> None:
    """Raise InputError where options contradict each other."""
    ways = [args.list, args.all, bool(args.scenario)]
    if sum(ways) != 1:
        raise InputError(
            "expected one of SCENARIO, --all and --list; `workbench simulate --list` shows the "
            "library"
        )
    if sum((args.desk, args.real_time, args.intents)) > 1:
        raise InputError(f"expected one of {_DRIVES}, got several; leave out all but one")
    if several(args) and (args.real_time or args.intents):
        raise InputError(
            "--real-time, --intents: expected one SCENARIO, plant and policy, got several; name one"
        )
    if args.jobs != 1 and not several(args):
        raise InputError(
            f"--jobs: expected with a table of several drives, got {args.jobs} without; leave it "
            "out"
        )
    ignored = [name for name in _OF_DRIVES if args.list and getattr(args, name)]
    if ignored:
        raise InputError(
            f"--list: expected alone, got --{ignored[0].replace('_', '-')} with it; leave it out"
        )
    require_rig_options(args)
    require_localiser_options(args)
    if args.bundle is not None and args.real_time:
        raise InputError(
            "--real-time: expected without --bundle: the process drives the path of its bundle, "
            "so that one is built with the scenario's; leave --bundle out"
        )


def _list(args: argparse.Namespace) -> int:
    from workbench.simulation.scenarios.shipped import library, named

    found = [named(name) for name in library()]
    rows: list[list[str | int | float | None]] = [
        [each.name, each.title, *(_expected(each, policy) for policy in POLICIES)] for each in found
    ]
    data = [
        {
            "name": each.name, "title": each.title, "story": each.story,
            "duration_s": each.duration_s, "goals": [goal.name for goal in each.goals],
            "expected": {policy: _expected(each, policy) for policy in POLICIES},
        }
        for each in found
    ]  # fmt: skip
    emit(args, text_table(["scenario", "what happens", *POLICIES], rows), data)
    return 0


def _expected(scenario: Scenario, policy: str) -> str:
    return scenario.expected[policy].value
