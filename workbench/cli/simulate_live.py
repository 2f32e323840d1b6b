"""`workbench simulate --real-time`: the real process drives a signed bundle with the scenario's
path."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.common import writable_folder
from workbench.cli.private_key import write_pair
from workbench.cli.sign import sign_bundle
from workbench.cli.simulate_subject import chosen_sensors, chosen_vehicle
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.simulate_drive import Driven
    from workbench.simulation.live_drive import Installed, LiveDrive
    from workbench.simulation.rig import Trial

_LATE_S: Final = 0.02


def driven_live(
    args: argparse.Namespace, trial: Trial, progress: Callable[[int, int], None]
) -> Driven:
    """Build, sign with a key that nobody keeps, start, arm, drive; the bundle stays in OUT/bundle,
    the log in OUT/log.

    Raises InputError where one of them is there already, before any work.
    """
    from workbench.runtime import load_bundle
    from workbench.simulation.bus_drive import Recorded
    from workbench.simulation.bus_world import BusSetting, BusWorld
    from workbench.simulation.live_drive import drive_live
    from workbench.simulation.rig import Rig

    out = writable_folder(args.out)
    log = out / "log"
    for there in (log, out / "bundle"):
        if there.exists():
            raise InputError(
                f"--out: expected a folder without a bundle and a log of the monitor, got {there}; "
                "name another one, or move it away"
            )
    with tempfile.TemporaryDirectory(prefix="workbench-") as place:
        installed = _installed(args, trial, Path(place))
        progress(0, 1)
        rig = Rig(load_bundle(installed.bundle), chosen_vehicle(args))
        world = BusWorld(rig.scene(trial), BusSetting(rig.settings.maker), seed=trial.seed)
        begun_s = time.monotonic()
        live = drive_live(world, installed, log, Recorded(), progress=progress)
        took_s = time.monotonic() - begun_s
    return rig, live.driven, took_s, _notes(live)


def _installed(args: argparse.Namespace, trial: Trial, keys: Path) -> Installed:
    """A bundle for this scenario, as it would stand on the vehicle."""
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import Deciding
    from workbench.simulation.live_drive import Installed
    from workbench.simulation.rig import path_table
    from workbench.simulation.simulated import HORIZON_S, MONITOR, STEP_S, simulated_sensors

    spec = MonitorSpec(
        chosen_vehicle(args), args.horizon or HORIZON_S, STEP_S, path=path_table(trial.scenario),
        deciding=Deciding(args.policy), monitor=MONITOR,
        sensors=chosen_sensors(args) or simulated_sensors(),
    )  # fmt: skip
    bundle = build_bundle(spec, args.out / "bundle")
    private = keys / "drive.key"
    public, _ = write_pair(private)
    sign_bundle(bundle, private)
    return Installed(bundle, public)


def _notes(live: LiveDrive) -> tuple[str, ...]:
    compared = live.compared
    same = "differ from" if compared.mismatches else "are those of"
    notes = [
        f"driven in real time by workbench-monitor as a process of its own, ready after "
        f"{live.ready_s:.1f} s, exit status {live.status}; its log {live.log}: {compared.turns} "
        f"turns with {compared.decisions} decisions made again {same} the log"
    ]
    if live.behind_s > _LATE_S or live.lost:
        notes.append(
            f"this machine did not keep up: the world was up to {1e3 * live.behind_s:.0f} ms late, "
            f"and {live.lost} frames were lost on the line"
        )
    unsent = _unsent(live.said)
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
