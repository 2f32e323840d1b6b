"""`workbench-monitor`: the monitor on a vehicle's bus, from refusing start-up to orderly end."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import enum
import gc
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final, final

from workbench.runtime.bundle import Bundle, load_bundle
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.onboard.attending import Attendant, say
from workbench.runtime.onboard.bus import (
    Bus,
    BusSettings,
    PythonCanBus,
    cannot_listen_only,
)
from workbench.runtime.onboard.control import ControlSocket
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.listening import listened
from workbench.runtime.onboard.loop import End, Loop, MonotonicClock
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.playback_settings import log_header
from workbench.runtime.onboard.proved import check_proved
from workbench.runtime.onboard.recorder import RecordedCore, Recorder, RecorderSettings
from workbench.runtime.onboard.refusing import RefusedError, refusing
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.onboard.states import Mode
from workbench.runtime.signed_bundle import load_signed_bundle

MODES: Final = {mode.name.lower(): mode for mode in Mode}


@final
class Exit(enum.IntEnum):
    """Exit status; every one from BUNDLE to VEHICLE is a refusal at start-up, before any frame."""

    ORDERLY = 0
    MISUSE = 2
    BUNDLE = 10
    UNSIGNED = 11
    FLOAT_MODE = 12
    NOT_FOR_DRIVING = 13
    SENSORS = 14
    CONTROL = 15
    LOG = 16
    BUS = 17
    PROTOCOL = 18
    VEHICLE = 19
    AT_ONCE = 30
    DEFECT = 70


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    made = argparse.ArgumentParser(prog="workbench-monitor", description=__doc__)
    made.add_argument("--bundle", type=Path, required=True, help="folder that `build` wrote")
    made.add_argument("--interface", required=True, help="of python-can, such as socketcan")
    made.add_argument("--channel", required=True, help="of that interface, such as can0")
    made.add_argument("--bitrate", type=int, help="where the interface sets it (default: as it is)")
    made.add_argument(
        "--mode", choices=MODES, default="shadow",
        help="shadow listens only (default); gate lets an upstream controller's commands pass "
        "within what is proved; drive runs our own controller",
    )  # fmt: skip
    made.add_argument("--public-key", type=Path, help="needed in gate and drive")
    made.add_argument("--control", type=Path, help="private folder for arming; gate and drive")
    made.add_argument("--upstream-channel", help="of the same interface; gate")
    made.add_argument("--log", type=Path, help="folder for a new log")
    made.add_argument(
        "--wait", type=float, default=10.0, metavar="S", help="for the reports (default: 10 s)"
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Start up or refuse, run, end; see docs/on-the-vehicle.md for every exit status."""
    args = parser().parse_args(arguments)
    misuse = _misuse(args)
    if misuse:
        parser().error(misuse)
    try:
        return _run(args)
    except RefusedError as refusal:
        say(f"workbench-monitor: refused: {refusal}")
        return refusal.status


def _misuse(args: argparse.Namespace) -> str:
    sends, gates = args.mode != "shadow", args.mode == "gate"
    if sends and args.control is None:
        return f"--mode {args.mode} needs --control: nobody could arm it, or disarm it"
    if gates is (args.upstream_channel is None):
        return "--mode gate and --upstream-channel belong together"
    if gates and args.upstream_channel == args.channel:
        return "--upstream-channel: expected another bus than --channel, where nothing is gated"
    if not 0.0 <= args.wait <= 3600.0:
        return f"--wait: expected 0 to 3600 s, got {args.wait!r}"
    return ""


def _run(args: argparse.Namespace) -> int:
    bundle, settings = _loaded(args)
    mode = MODES[args.mode]
    path = bundle.manifest.path
    assert path is not None, "asked for in _loaded"
    with refusing(Exit.NOT_FOR_DRIVING):
        core = Core(bundle, path, settings, mode=mode)
    with contextlib.ExitStack() as open_things:
        control = None
        if args.control is not None:
            with refusing(Exit.CONTROL):
                control = ControlSocket(args.control)
            open_things.callback(control.close)
        buses = _opened(args, open_things)
        with refusing(Exit.BUS):
            seen = listened(buses[0], settings, wait_us=round(args.wait * 1e6))
        _check_vehicle(seen, settings)
        clock = MonotonicClock()
        recorder = None
        if args.log is not None:
            with refusing(Exit.LOG):
                header = log_header(
                    bundle, path, settings, mode=mode, manifest_sha256=bundle.manifest_sha256,
                    started_unix_us=time.time_ns() // 1000 - clock.now_us(),
                )  # fmt: skip
                recorder = Recorder.start(header, RecorderSettings(folder=args.log))
            open_things.callback(recorder.close)
        told = core if recorder is None else RecordedCore(core, recorder)
        attendant = Attendant(
            clock=clock, control=control, recorder=recorder,
            upstream=(buses[1], told.receive_upstream) if len(buses) > 1 else None,
        )  # fmt: skip
        loop = Loop(
            told, buses[0],
            open_bus=lambda: PythonCanBus(_bus_settings(args)), sends=args.mode != "shadow",
            clock=clock, surroundings=attendant,
        )  # fmt: skip
        return _driven(loop, args.mode)


def _loaded(args: argparse.Namespace) -> tuple[Bundle, OnboardSettings]:
    """Bundle and settings: signature and hashes first, then everything else."""
    signed = args.public_key is not None
    if not signed and args.mode != "shadow":
        raise RefusedError(
            Exit.UNSIGNED,
            f"--mode {args.mode} needs --public-key: nothing unsigned drives; `workbench sign`",
        )
    fault = float_mode_fault()
    if fault is not None:
        raise RefusedError(Exit.FLOAT_MODE, f"before anything was loaded, {fault}")
    with refusing(Exit.BUNDLE):
        if signed:
            bundle = load_signed_bundle(args.bundle, args.public_key)
        else:
            say("workbench-monitor: warning: the bundle's signature is not checked")
            bundle = load_bundle(args.bundle)
    manifest = bundle.manifest
    parts = ("drive_by_wire", "path", "monitor", "sensors")
    missing = [name for name in parts if getattr(manifest, name) is None]
    if missing:
        raise RefusedError(
            Exit.NOT_FOR_DRIVING, f"{args.bundle}: the manifest lacks {missing}; build it for a car"
        )
    with refusing(Exit.NOT_FOR_DRIVING):
        check_proved(manifest, MODES[args.mode])
    with refusing(Exit.SENSORS):
        tag = int(bundle.manifest_sha256[:2], 16)
        settings = settings_from(manifest, signed=signed, tag=tag)
    return bundle, settings


def _bus_settings(args: argparse.Namespace) -> BusSettings:
    return BusSettings(
        args.interface, args.channel, args.bitrate, listens_only=args.mode == "shadow"
    )


def _opened(args: argparse.Namespace, open_things: contextlib.ExitStack) -> list[Bus]:
    """The vehicle's bus and, in GATE, the upstream controller's, which is only listened to."""
    wanted = [_bus_settings(args)]
    if args.upstream_channel is not None:
        upstream = dataclasses.replace(
            wanted[0], channel=args.upstream_channel, listens_only=False
        )  # somebody must acknowledge what the upstream controller sends
        wanted.append(upstream)
    warning = cannot_listen_only(wanted[0])
    if warning:
        say(f"workbench-monitor: warning: {warning}")
    buses: list[Bus] = []
    with refusing(Exit.BUS):
        for settings in wanted:
            bus = PythonCanBus(settings)
            open_things.callback(bus.close)
            buses.append(bus)
    return buses


def _check_vehicle(seen: Intake, settings: OnboardSettings) -> None:
    """Refuse a bus that is not that of the bundle's vehicle, as far as it shows."""
    missing = [name for name in seen.names.needed if name not in seen.reports]
    if missing or seen.foreign:
        found = ", ".join(f"{n.total} of {name}" for name, n in seen.foreign.items()) or "none"
        raise RefusedError(
            Exit.PROTOCOL,
            f"the bundle drives {seen.vehicle.name}; missing reports: {missing}, reports of other "
            f"protocols: {found}; check channel, bitrate and bundle",
        )
    place = seen.names.identity
    report = None if place is None else seen.reports.get(place.message)
    if report is None or place is None or settings.maker is None:
        return
    maker = report.values[place.signal]
    if maker != settings.maker:
        raise RefusedError(
            Exit.VEHICLE, f"the vehicle reports maker {int(maker):#x}, expected {settings.maker:#x}"
        )


def _driven(loop: Loop, mode: str) -> int:
    def stop(*_: object) -> None:
        loop.stop()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, stop)
    # What was made so far stays: later collections need not look at it.
    gc.collect()
    gc.freeze()
    say(f"workbench-monitor: listening in mode {mode}")
    try:
        end = loop.run()
    except Exception as error:
        say(f"workbench-monitor: defect, now silent: {type(error).__name__}: {error}")
        return Exit.DEFECT
    say(f"workbench-monitor: ended: {loop.counts}")
    return Exit.ORDERLY if end is End.ORDERLY else Exit.AT_ONCE


if __name__ == "__main__":
    sys.exit(main())
