"""What `workbench replay` tells its monitor of people: straight on, or estimated intents."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import add_file_option
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.goals import Goal
    from workbench.estimation.people_guards import Guards
    from workbench.estimation.person_intents import Forwarding
    from workbench.runtime import Bundle
    from workbench.simulation.people_sources import PeopleSource
    from workbench.simulation.recording import Recording
    from workbench.simulation.replay import ReplaySettings

_THRESHOLD: Final = 0.26
_LEVEL: Final = 0.9
_RADIUS_M: Final = 0.5
_HEADROOM: Final = 1.2
_SEED: Final = 1
# Predictions reach a little farther than the tubes that are held against them.
_BEYOND_S: Final = 0.5
_OF_INTENTS: Final = (
    "goals", "scene", "intent_threshold", "intent_level", "most_likely", "radius", "guard"
)  # fmt: skip


def add_people_options(parser: argparse.ArgumentParser) -> None:
    """Add `--people` and what goes with it; `chosen_people` reads them."""
    parser.add_argument(
        "--people", choices=("straight", "intents"), default="straight",
        help="straight: on at the velocity of now; intents: filters of position, goal and guard, "
        "each person's own (default: straight)",
    )  # fmt: skip
    add_file_option(parser, "--goals", text="table of goals (default: nobody's goal is known)")
    parser.add_argument("--scene", metavar="NAME", help="which scene of --goals it is")
    parser.add_argument(
        "--intent-threshold", type=float, metavar="P",
        help=f"tell of every intent at least so probable, above 1/4 (default: {_THRESHOLD:g})",
    )  # fmt: skip
    parser.add_argument(
        "--intent-level", type=float, metavar="Q",
        help=f"share of people within the radius: 0.5, 0.9 or 0.99 (default: {_LEVEL:g})",
    )  # fmt: skip
    parser.add_argument(
        "--most-likely", action="store_true", default=None,
        help="tell of the likeliest intent alone, with one radius for all times, as the paper does",
    )  # fmt: skip
    parser.add_argument(
        "--radius", type=float, metavar="M",
        help=f"that radius, beside --most-likely (default: {_RADIUS_M:g})",
    )  # fmt: skip
    parser.add_argument(
        "--guard", choices=("assumed", "fitted"),
        help="assumed: limits of the vehicle file; fitted: as far as recorded people got "
        "(default: assumed)",
    )  # fmt: skip


def require_people_options(args: argparse.Namespace) -> None:
    """Raise InputError where options contradict each other or the default of --people."""
    given = given_people_options(args)
    if args.people == "straight" and given:
        raise InputError(
            f"{', '.join(given)}: expected beside --people intents, got --people straight; add it, "
            "or leave them out"
        )
    if args.radius is not None and not args.most_likely:
        raise InputError("--radius: expected --most-likely beside it, whose radius it is")
    fitted = {"--intent-threshold": args.intent_threshold, "--intent-level": args.intent_level}
    wrong = [name for name, value in fitted.items() if value is not None]
    if args.most_likely and wrong:
        raise InputError(
            f"{', '.join(wrong)}: expected without --most-likely, which tells of one intent with "
            "--radius; leave one of the two out"
        )
    if args.scene is not None and args.goals is None:
        raise InputError("--scene: expected --goals FILE beside it, whose scene it names")


def given_people_options(args: argparse.Namespace) -> list[str]:
    """Those that mean something beside --people intents alone."""
    return [
        "--" + name.replace("_", "-") for name in _OF_INTENTS if getattr(args, name) is not None
    ]


def chosen_people(
    args: argparse.Namespace, recording: Recording, settings: ReplaySettings, bundle: Bundle
) -> PeopleSource | None:
    """The source that the options name; None is the replay's own, straight on."""
    if args.people == "straight":
        return None
    from workbench.estimation.intent_cloud import FilterSettings, NumpyUpdate
    from workbench.estimation.motion_parameters import shipped_motion
    from workbench.estimation.people_estimator import Bodies, EstimatorSettings, PeopleEstimator
    from workbench.simulation.people_sources import EstimatedPeople

    on_foot, on_wheels = settings.people.on_foot, settings.people.on_wheels
    error_m = max(on_foot.position_error_m, on_wheels.position_error_m)
    bodies = Bodies(on_foot.body_radius_m, on_wheels.body_radius_m, error_m)
    goals = _goals(args)
    forwarding, told = _forwarding(args, bundle.manifest.horizon_s + _BEYOND_S)
    guards, guarded = _guards(args, settings)
    estimator = PeopleEstimator(
        EstimatorSettings(
            goals, FilterSettings.chosen(), NumpyUpdate(), shipped_motion().numbers, forwarding,
            guards, bodies, on_foot.max_age_s, on_foot.gone_age_s, _HEADROOM, _SEED,
        )
    )  # fmt: skip
    known = f"{len(goals)} known goals and the unknown one" if goals else "no known goals"
    note = (
        f"Where people go is estimated, with {known}: {told}. Who is not seen for "
        f"{on_foot.max_age_s:g} s is assumed to be there, for {on_foot.gone_age_s:g} s to have "
        "left. Who breaks the limits of their guard is named (LIMITS), and has wider ones from "
        "then on."
    )
    return EstimatedPeople(recording.people, estimator, notes=(note, guarded))


def _goals(args: argparse.Namespace) -> tuple[Goal, ...]:
    from workbench.estimation.goals import load_goals

    if args.goals is None:
        return ()
    scenes = load_goals(args.goals)
    if args.scene is None and len(scenes) == 1:
        return next(iter(scenes.values()))
    if args.scene not in scenes:
        raise InputError(
            f"--scene: expected one of {', '.join(scenes)}, whose goals {args.goals} has, got "
            f"{args.scene}"
        )
    return scenes[args.scene]


def _forwarding(args: argparse.Namespace, until_s: float) -> tuple[Forwarding, str]:
    """What is passed on, and in words."""
    from workbench.estimation.motion_parameters import shipped_motion
    from workbench.estimation.person_intents import EveryIntent, MostLikelyIntent

    motion = shipped_motion()
    if args.most_likely:
        radius_m = _RADIUS_M if args.radius is None else args.radius
        likeliest = MostLikelyIntent(motion, radius_m, until_s)
        return likeliest, f"LookAhead is told of the likeliest intent, within {radius_m:g} m"
    threshold = _THRESHOLD if args.intent_threshold is None else args.intent_threshold
    level = _LEVEL if args.intent_level is None else args.intent_level
    levels = motion.free.levels
    if level not in levels:
        raise InputError(
            f"--intent-level: expected one of {', '.join(map(str, levels))}, which were fitted, "
            f"got {level:g}"
        )
    every = EveryIntent(motion, threshold, level, until_s)
    return every, (
        f"LookAhead is told of every intent of at least {threshold:g}, with radii that held "
        f"{level:g} of the people they were fitted to"
    )


def _guards(args: argparse.Namespace, settings: ReplaySettings) -> tuple[Guards, str]:
    """What FailSafe is told, and in words."""
    from workbench.estimation.guard_shipped import shipped_guards
    from workbench.estimation.people_guards import FittedGuards
    from workbench.simulation.people_sources import limits_note

    if args.guard == "fitted":
        return FittedGuards(shipped_guards()), (
            "people on foot to move as those recorded in Crowds by Example (2007) did, and people "
            "on wheels as is assumed of them (shipped guards, held to no less than the bundle's "
            "limits)"
        )
    return settings.people.guards(settings.limits), limits_note(settings.people, settings.limits)
