"""`workbench simulate --real-time`: the real process drives a signed bundle with the scenario's
path, with `--localiser` told by the real localiser."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.interruption import ended_kindly
from workbench.cli.private_key import read_private_key, signature_file, write_pair
from workbench.cli.sign import sign_bundle
from workbench.cli.simulate_localiser import INSTEAD, built_localiser, ranging_of
from workbench.cli.simulate_subject import chosen_sensors, chosen_vehicle
from workbench.errors import InputError
from workbench.runtime.keys import public_key_beside

if TYPE_CHECKING:
    from workbench.cli.simulate_drive import Driven
    from workbench.simulation.live_drive import LiveDrive
    from workbench.simulation.live_processes import Installed
    from workbench.simulation.ranged_place import Ranging
    from workbench.simulation.rig import Trial

_LATE_S: Final = 0.02


def driven_live(
    args: argparse.Namespace, trial: Trial, progress: Callable[[int, int], None]
) -> Driven:
    """Build, sign with a key that nobody keeps, start, arm, drive; the bundle stays in OUT/bundle,
    logs in OUT/log, a localiser in OUT/localiser. Within `live_folder`.
    """
    from workbench.runtime import load_bundle
    from workbench.simulation.bus_drive import Recorded
    from workbench.simulation.bus_world import BusSetting
    from workbench.simulation.live_drive import drive_live
    from workbench.simulation.rig import Rig

    with tempfile.TemporaryDirectory(prefix="workbench-") as place:
        keys = Path(place) / "drive.key"
        write_pair(keys)
        installed, ranging = _installed(args, trial, keys), None
        if args.localiser:
            installed, ranging = _with_localiser(args, installed, keys)
        keys.unlink()
        progress(0, 1)
        rig = Rig(load_bundle(installed.bundle), chosen_vehicle(args))
        setting = BusSetting(rig.settings.maker, ranging=ranging)
        world = rig.world(trial, setting)
        begun_s = time.monotonic()
        live = drive_live(world, installed, args.out / "log", Recorded(), progress=progress)
        took_s = time.monotonic() - begun_s
    return rig, live.driven, took_s, _notes(live)


@contextlib.contextmanager
def live_folder(out: Path) -> Iterator[None]:
    """For a drive that leaves bundle, localiser and log in a folder: where the block fails they go
    again, so that the same command can be given once more. SIGTERM and SIGHUP break it off as
    Ctrl-C does.

    Raises InputError where one of them is there already.
    """
    made = [out / name for name in ("log", "bundle", "localiser")]
    for there in made:
        if there.exists():
            raise InputError(
                f"--out: expected a folder without bundle, localiser and log, got {there}; "
                "name another one, or move it away"
            )
    with ended_kindly():
        try:
            yield
        except BaseException:
            for each in made:
                shutil.rmtree(each, ignore_errors=True)
            raise


def _installed(args: argparse.Namespace, trial: Trial, private: Path) -> Installed:
    """A bundle for this scenario, as it would stand on the vehicle; private: the key it is signed
    with."""
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import Deciding
    from workbench.simulation.live_processes import Installed
    from workbench.simulation.rig import path_table
    from workbench.simulation.simulated import (
        HORIZON_S,
        MONITOR,
        STEP_S,
        ranged_sensors,
        simulated_sensors,
    )

    sensors = chosen_sensors(args)
    if sensors is None:
        sensors = ranged_sensors() if args.localiser else simulated_sensors()
    spec = MonitorSpec(
        chosen_vehicle(args), args.horizon or HORIZON_S, STEP_S, path=path_table(trial.scenario),
        deciding=Deciding(args.policy), monitor=MONITOR, sensors=sensors,
    )  # fmt: skip
    bundle = build_bundle(spec, args.out / "bundle")
    sign_bundle(bundle, private)
    return Installed(bundle, public_key_beside(private))


def _with_localiser(
    args: argparse.Namespace, installed: Installed, private: Path
) -> tuple[Installed, Ranging]:
    """The same vehicle with a signed localiser, and the ranges that this one hears."""
    from workbench.runtime.contents import CHECKSUM_FILE
    from workbench.runtime.signature import SIGNATURE_FILE

    folder = args.out / "localiser"
    built = built_localiser(args, folder)
    path, sums = folder / SIGNATURE_FILE, (folder / CHECKSUM_FILE).read_bytes()
    path.write_bytes(signature_file(sums, read_private_key(private), path)[0])
    installed = dataclasses.replace(installed, localiser=folder)
    return installed, ranging_of(built, elsewhere=True)


def _notes(live: LiveDrive) -> tuple[str, ...]:
    compared = live.compared
    same = "differ from" if compared.mismatches else "are those of"
    notes = [
        f"driven in real time by workbench-monitor as a process of its own, ready after "
        f"{live.ready_s:.1f} s, exit status {live.monitor.status}; its log {live.log}: "
        f"{compared.turns} turns with {compared.decisions} decisions made again {same} the log"
    ]
    if live.localiser is not None:
        notes += [
            INSTEAD,
            f"workbench-localiser was another process, exit status {live.localiser.status}, and "
            f"sent {live.located} sets of where the car was while the scenario ran; they are not "
            "held against the truth here, because its clock is its own",
        ]
    if live.behind_s > _LATE_S or live.lost:
        notes.append(
            f"this machine did not keep up: the world was up to {1e3 * live.behind_s:.0f} ms late, "
            f"and {live.lost} frames were lost on the line"
        )
    unsent = _unsent(live.monitor.said)
    if unsent:
        notes.append(
            f"the monitor held back {unsent} frames that it could not send in time, and braked for "
            "it; give it a processor of its own"
        )
    return tuple(notes)


def _unsent(said: str) -> int:
    """Frames that it counted as not sent."""
    _, _, rest = said.rpartition("unsent=")
    digits = rest.partition(",")[0]
    return int(digits) if digits.isdigit() else 0
