"""What `workbench replay` was asked to replay: a recording, a ROS bag or a log."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.replay_people import given_people_options
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.simulation.recording import Recording

_LOGS: Final = (".mcap", ".blf", ".asc", ".log")


def is_log(args: argparse.Namespace) -> bool:
    """Is the subject a log of the vehicle's? A file is, unless a topic map makes it a bag."""
    subject: Path = args.subject
    named = subject.suffix.lower() in _LOGS and not subject.is_dir()
    return args.topics is None and (named or subject.is_file())


def require_log_options(args: argparse.Namespace, *, default_out: Path) -> None:
    """Raise InputError where options were given that mean nothing for a log."""
    given = {
        "--recording": args.recording,
        "--agent": args.agent,
        "--vehicle": args.vehicle,
        "--horizon": args.horizon,
        "--step": args.step,
        "--out": None if args.out == default_out else args.out,
    }
    given["--people"] = None if args.people == "straight" else args.people
    wrong = [option for option, value in given.items() if value is not None]
    wrong += given_people_options(args)
    if wrong:
        raise InputError(
            f"{', '.join(wrong)}: expected beside a folder of recordings, got the file "
            f"{args.subject}; leave it out to replay a log"
        )


def recording_of(args: argparse.Namespace) -> Recording:
    """The recording in a folder or a bag. Raises InputError for one that is not there."""
    if args.run is not None:
        raise InputError(
            f"--run: expected beside a log, got {args.subject}; leave it out, or name the log"
        )
    if args.topics is not None:
        return _of_bag(args)
    if args.recording is None:
        raise InputError(
            "--recording: expected the name of a recording of the folder, got none; add it, or "
            "name a log instead of the folder"
        )
    from workbench.simulation.recording import load_recording

    return load_recording(args.subject, args.recording, agent=args.agent)


def _of_bag(args: argparse.Namespace) -> Recording:
    from workbench.simulation.ros_bag import recording_of_bag
    from workbench.simulation.ros_topics import TopicMap

    if args.recording is not None or args.agent is not None:
        raise InputError(
            "--recording, --agent: expected beside a folder of recordings, got a bag, which is "
            "one recording whose agent the map names; leave them out"
        )
    return recording_of_bag(args.subject, TopicMap.read(args.topics))
