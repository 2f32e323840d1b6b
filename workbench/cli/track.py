"""`workbench track`: a folder of images or a video becomes tracks of people on the ground."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

from workbench.cli.analysis_options import writable_file
from workbench.cli.common import output_folder, replacing
from workbench.cli.output import Progress, emit
from workbench.cli.track_options import add_options
from workbench.cli.track_summary import summarised
from workbench.cli.track_tables import FILES
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.track_page import Album
    from workbench.cli.track_tables import Note
    from workbench.estimation.ranging import Sight
    from workbench.perception.footage import Footage
    from workbench.perception.images import Frame
    from workbench.perception.network import Network
    from workbench.perception.people import Around, Looking
    from workbench.runtime.onboard.dead_reckoning import Pose

HELP = (
    "Finds people in the images of a folder or a video with a YOLO network (ONNX), places them on "
    "the ground as discs that hold them, and follows them from image to image. Writes peds.csv and "
    "vehicles.csv, which `workbench intent` and `workbench replay` read, tracks.csv with discs of "
    "position and velocity of everybody seen, unseen for a moment, or assumed where nobody can be "
    "seen, and detections.csv. Columns: docs/ranging.md. Needs the perception extra."
)
EXAMPLE = """\
workbench track images --rate 10 --network yolo.onnx --camera camera.toml --out people
workbench track drive.mp4 --network yolo.onnx --camera camera.toml --vehicle poses.csv --out people
workbench track images --network yolo.onnx --camera camera.toml --out people --plot people.html
"""


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Everything that was asked for, read and checked before the first image."""

    recording: str
    network: Network
    sight: Sight
    looking: Looking
    footage: Footage
    pose_at: Callable[[float], Pose]
    limits: tuple[str, ...]


def configure(parser: argparse.ArgumentParser) -> None:
    """Images, network, camera, where the vehicle was, what is relied on, and what to write."""
    add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Check, look at every image, and write all files or none."""
    import onnxruntime  # noqa: F401 - the first to be missed, so that its extra is named

    _check(args)
    with output_folder(args.out):
        task = _task(args)
        notes, album = _looked(args, task)
        if not notes:
            raise InputError(f"{args.images}: expected at least one image, found none")
        summary = summarised(
            task.recording, notes, task.limits, confirmed_after=args.confirmed, sure_m=args.sure
        )
        files = _files(args, task, notes)
        if album is not None:
            from workbench.cli.track_page import page_text

            files[args.plot] = page_text(args, album, summary)
        with contextlib.ExitStack() as stack:
            for path, text in files.items():
                stack.enter_context(replacing(path)).write_text(text, encoding="utf-8")
    emit(args, summary.text([*files]), {"summary": summary, "wrote": [*files]})
    return 0


def _check(args: argparse.Namespace) -> None:
    if args.vehicle is None:
        for option in ("unsure", "reference_ahead"):
            if getattr(args, option) is not None:
                name = "--" + option.replace("_", "-")
                raise InputError(f"{name}: expected beside --vehicle FILE; leave it out, or add it")
    if args.vehicle is not None and args.vehicle.resolve().parent == args.out.resolve():
        raise InputError(
            f"--out: expected another folder than that of --vehicle, got {args.out} for both, "
            "whose vehicles.csv would be written over"
        )
    if args.out.exists() and not args.out.is_dir():
        raise InputError(f"--out: expected a folder, got the file {args.out}; name a folder")
    for name in FILES:
        writable_file(args.out / name, "--out")
        if args.plot is not None and args.plot.resolve() == (args.out / name).resolve():
            raise InputError(f"--plot: expected another file than the table {args.plot}")
    writable_file(args.plot, "--plot")


def _task(args: argparse.Namespace) -> _Task:
    from workbench.cli.track_options import chosen_looking, chosen_network, chosen_poses
    from workbench.estimation.camera import load_camera
    from workbench.estimation.ranging import sight_of
    from workbench.perception.footage import footage

    camera, looking = load_camera(args.camera), chosen_looking(args)
    pose_at, standing = chosen_poses(args)
    limits = (*looking.view.limits(camera), *_more_limits(args), *standing)
    own = args.images.resolve()
    recording = args.recording or (own.name if own.is_dir() else own.stem)
    images = footage(args.images, rate_hz=args.rate, start_s=args.start)
    return _Task(
        recording, chosen_network(args), sight_of(camera), looking, images, pose_at, limits
    )


def _more_limits(args: argparse.Namespace) -> tuple[str, ...]:
    foot, wheels = args.foot, args.wheels
    return (
        f"nobody on foot exceeds {foot[0]:g} m/s and {foot[1]:g} m/s^2, nobody on wheels "
        f"{wheels[0]:g} m/s and {wheels[1]:g} m/s^2",
        f"who is not detected for {args.forget:g} s is given up; from then on only assumed people "
        "stand for them, and none does where the view is open",
    )


def _looked(args: argparse.Namespace, task: _Task) -> tuple[tuple[Note, ...], Album | None]:
    """What is kept of every image; for a page also small copies of some."""
    from workbench.cli.track_tables import noted
    from workbench.perception.people import look

    album = None
    if args.plot is not None:
        from workbench.cli.track_page import Album

        album = Album(task.sight, task.looking.view, task.footage.count, sure_m=args.sure)
    with Progress("looking", task.footage.count) as bar:

        def passed(frames: Iterator[Frame]) -> Iterator[Frame]:
            for frame in frames:
                if album is not None:
                    album.take(frame)
                yield frame

        def kept(around: Around) -> Note:
            note = noted(around)
            if album is not None:
                album.mark(around, note)
            bar.advance()
            return note

        answers = look(
            task.network, passed(task.footage.frames), task.sight, pose_at=task.pose_at,
            looking=task.looking,
        )  # fmt: skip
        return tuple(kept(around) for around in answers), album


def _files(args: argparse.Namespace, task: _Task, notes: tuple[Note, ...]) -> dict[Path, str]:
    from workbench.cli.track_tables import tables
    from workbench.models.vehicle import gem_e2

    texts = tables(task.recording, notes, gem_e2().geometry, sure_m=args.sure)
    return {args.out / name: text for name, text in texts.items()}
