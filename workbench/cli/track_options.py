"""Options of `workbench track`, and what they choose."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import add_file_option, count, number, positive, share
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.perception.network import Network
    from workbench.perception.people import Looking
    from workbench.runtime.onboard.dead_reckoning import Pose

_HEADS: Final = ("classes", "objectness", "selected")


def add_options(parser: argparse.ArgumentParser) -> None:
    """All of them."""
    parser.add_argument(
        "images", type=Path, metavar="IMAGES",
        help="folder of images, with frames.csv (file, t) or --rate; or a video",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="FOLDER", required=True, help="for the tables")
    add_file_option(parser, "--plot", text="page to draw: images with boxes, and the plan beside")
    parser.add_argument("--rate", type=positive, metavar="HZ", help="images per s of a folder")
    parser.add_argument(
        "--start", type=number, metavar="S", help="when the first image was taken, on --vehicle's "
        "clock (default: as the video or frames.csv says)",
    )  # fmt: skip
    parser.add_argument(
        "--recording", metavar="NAME",
        help="name of the recording in the tables, and of its rows in --vehicle's (default: the "
        "folder's or video's name)",
    )  # fmt: skip
    _add_network_options(parser)
    _add_vehicle_options(parser)
    _add_reliance_options(parser)


def _add_network_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--network", type=Path, metavar="FILE", required=True, help="YOLO network, ONNX"
    )
    parser.add_argument(
        "--confidence", type=share, default=0.25, metavar="P",
        help="least score of what counts as seen (default: 0.25)",
    )  # fmt: skip
    parser.add_argument(
        "--overlap", type=share, default=0.5, metavar="P",
        help="share of overlap above which the worse of two boxes is dropped (default: 0.5)",
    )  # fmt: skip
    parser.add_argument(
        "--names", metavar="A,B,...", help="the network's classes, where its file does not say"
    )
    parser.add_argument(
        "--size", nargs=2, type=count, metavar=("HEIGHT", "WIDTH"),
        help="of the network's input, where its file leaves it open",
    )  # fmt: skip
    parser.add_argument("--head", choices=_HEADS, help="layout of its output, where it is unclear")
    parser.add_argument(
        "--threads", type=count, default=1, metavar="N", help="for the network (default: 1)"
    )


def _add_vehicle_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--camera", type=Path, metavar="FILE", required=True,
        help="camera file, TOML: lens, mounting, detector and people as intervals",
    )  # fmt: skip
    parser.add_argument(
        "--vehicle", type=Path, metavar="FILE",
        help="table of poses (t, x, y, heading; x_half, y_half, heading_half); without it the "
        "vehicle stands at the origin, heading along x",
    )  # fmt: skip
    parser.add_argument(
        "--unsure", nargs=2, type=number, metavar=("M", "RAD"),
        help="half widths of position and heading for a table without them",
    )  # fmt: skip
    parser.add_argument(
        "--reference-ahead", type=number, metavar="M",
        help="how far ahead of the rear axle the table's positions are (default: 0; recordings in "
        "the layout of docs/data-format.md: 0.3)",
    )  # fmt: skip


def _add_reliance_options(parser: argparse.ArgumentParser) -> None:
    for option, default, text in (
        ("--near", 4.0, "from this far ahead the detector is relied on, in m"),
        ("--far", 25.0, "up to this far ahead, in m"),
        ("--inset", 30.0, "this far from the left and right border, in pixels"),
        ("--forget", 1.0, "a track unseen for longer is given up, in s"),
        ("--memory", 1.0, "how long earlier places tell the velocity, in s"),
        ("--sure", 3.0, "peds.csv takes the centres of discs up to this radius, in m"),
    ):
        parser.add_argument(
            option,
            type=positive,
            default=default,
            metavar="X",
            help=f"{text} (default: {default:g})",
        )
    parser.add_argument(
        "--slices", type=count, default=3, metavar="N",
        help="assumed people per edge of the view and per shadow (default: 3)",
    )  # fmt: skip
    for option, most in (("--foot", [2.5, 2.0]), ("--wheels", [7.0, 3.0])):
        parser.add_argument(
            option, nargs=2, type=positive, default=most, metavar=("M/S", "M/S2"),
            help=f"what nobody exceeds (default: {most[0]:g} {most[1]:g})",
        )  # fmt: skip
    parser.add_argument(
        "--confirmed", type=count, default=3, metavar="N",
        help="images after which the summary counts a track as confirmed; people count from their "
        "first image on (default: 3)",
    )  # fmt: skip


def chosen_network(args: argparse.Namespace) -> Network:
    """The network that the options name. Raises InputError for one that cannot be used."""
    from workbench.perception.heads import Head
    from workbench.perception.network import load_network

    names = None if args.names is None else [name.strip() for name in args.names.split(",")]
    return load_network(
        args.network,
        names=names,
        size=None if args.size is None else (args.size[0], args.size[1]),
        head=None if args.head is None else Head(args.head),
        threads=args.threads,
    )


def chosen_looking(args: argparse.Namespace) -> Looking:
    """What is relied on. Raises InputError for a view that cannot be."""
    from workbench.perception.people import Looking
    from workbench.perception.tracks import TrackLimits
    from workbench.perception.unseen import View
    from workbench.runtime.person_guard import MotionLimits

    view = View(args.near, args.far, args.inset, args.slices, assumed=True)
    limits = TrackLimits(
        MotionLimits(*args.foot), MotionLimits(*args.wheels), args.forget, args.memory
    )
    return Looking(args.confidence, args.overlap, view, limits)


def chosen_poses(args: argparse.Namespace) -> tuple[Callable[[float], Pose], tuple[str, ...]]:
    """The vehicle's pose by time, and what that assumes."""
    from workbench.perception.poses import STANDING, load_poses

    if args.vehicle is None:
        return (lambda _: STANDING), ("the vehicle stands at the origin, heading along x",)
    if args.unsure is not None and min(args.unsure) < 0.0:
        raise InputError(f"--unsure: expected two numbers >= 0, got {args.unsure!r}")
    poses = load_poses(
        args.vehicle,
        recording=args.recording,
        half_m_rad=None if args.unsure is None else (args.unsure[0], args.unsure[1]),
        reference_ahead_m=args.reference_ahead or 0.0,
    )
    return poses.at, (f"the vehicle is where {args.vehicle} says, between rows too",)
