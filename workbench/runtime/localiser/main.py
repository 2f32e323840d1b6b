"""`workbench-localiser`: the localiser on a vehicle's bus, from refusals to an orderly end."""

from __future__ import annotations

import argparse
import contextlib
import enum
import gc
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final, final

from workbench.runtime.floats import float_mode_fault
from workbench.runtime.localiser.core import LocaliserCore
from workbench.runtime.localiser.folder import Built, load_localiser
from workbench.runtime.localiser.journal import Journal
from workbench.runtime.localiser.numbers import Numbers
from workbench.runtime.onboard.attending import say
from workbench.runtime.onboard.bus import Bus, BusSettings, PythonCanBus
from workbench.runtime.onboard.loop import Loop, MonotonicClock
from workbench.runtime.onboard.refusing import RefusedError, refusing
from workbench.runtime.onboard.report_names import REPORT_NAMES, report_names
from workbench.runtime.protocols import Decoded, decode, load_protocol

_NAME: Final = "workbench-localiser"
_LISTEN_US: Final = 50_000
FASTEST_HZ: Final = 30.0


@final
class Exit(enum.IntEnum):
    """Exit status; every one from LOCALISER to PROTOCOL is a refusal at start-up, before any frame.

    The numbers are those of `workbench-monitor`.
    """

    ORDERLY = 0
    MISUSE = 2
    LOCALISER = 10
    FLOAT_MODE = 12
    LOG = 16
    BUS = 17
    PROTOCOL = 18
    DEFECT = 70


def parser() -> argparse.ArgumentParser:
    """The command's options."""
    made = argparse.ArgumentParser(prog=_NAME, description=__doc__)
    made.add_argument(
        "--localiser", type=Path, required=True, help="folder that `build-localiser` wrote"
    )
    made.add_argument("--public-key", type=Path, help="then only what this key signed is loaded")
    made.add_argument("--interface", required=True, help="of python-can, such as socketcan")
    made.add_argument("--channel", required=True, help="of that interface, such as can0")
    made.add_argument("--bitrate", type=int, help="where the interface sets it (default: as it is)")
    made.add_argument(
        "--protocol", choices=REPORT_NAMES, help="of the vehicle (default: what was built for)"
    )
    made.add_argument("--level", type=float, help="of the sets sent (default: what was built for)")
    made.add_argument(
        "--rate", type=float, default=10.0, metavar="HZ", help="sets per second (default: 10)"
    )
    made.add_argument("--log", type=Path, metavar="FILE", help="new file: one JSON line a second")
    made.add_argument(
        "--wait", type=float, default=10.0, metavar="S", help="for the reports (default: 10 s)"
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Start up or refuse, run, end; see docs/localisation.md for every exit status."""
    args = parser().parse_args(arguments)
    if not 1.0 <= args.rate <= FASTEST_HZ:
        parser().error(f"--rate: expected 1 to {FASTEST_HZ:g} sets per second, got {args.rate!r}")
    if not 0.0 <= args.wait <= 3600.0:
        parser().error(f"--wait: expected 0 to 3600 s, got {args.wait!r}")
    try:
        return _run(args)
    except RefusedError as refusal:
        say(f"{_NAME}: refused: {refusal}")
        return refusal.status


def _run(args: argparse.Namespace) -> int:
    built = _loaded(args)
    with refusing(Exit.LOCALISER):
        level = built.numbers.level if args.level is None else args.level
        core = LocaliserCore(
            built.numbers, built.steps, level=level, period_us=round(1e6 / args.rate)
        )
    settings = BusSettings(args.interface, args.channel, args.bitrate, listens_only=False)
    with contextlib.ExitStack() as open_things:
        with refusing(Exit.BUS):
            bus = PythonCanBus(settings)
            open_things.callback(bus.close)
            _require_reports(bus, built.numbers, wait_us=round(args.wait * 1e6))
        with refusing(Exit.LOG):
            journal = Journal(core, args.log)
        open_things.callback(journal.close)
        loop = Loop(
            core, bus, open_bus=lambda: PythonCanBus(settings), sends=True,
            clock=MonotonicClock(), surroundings=journal,
        )  # fmt: skip
        return _driven(loop, level)


def _loaded(args: argparse.Namespace) -> Built:
    fault = float_mode_fault()
    if fault is not None:
        raise RefusedError(Exit.FLOAT_MODE, f"before anything was loaded, {fault}")
    if args.public_key is None:
        say(f"{_NAME}: warning: the localiser's signature is not checked")
    with refusing(Exit.LOCALISER):
        built = load_localiser(args.localiser, public_key=args.public_key)
    name = built.numbers.vehicle.protocol
    if args.protocol not in (None, name):
        raise RefusedError(
            Exit.PROTOCOL, f"--protocol: expected {name}, which this was built for, got "
            f"{args.protocol}; build another localiser for that vehicle",
        )  # fmt: skip
    return built


def _require_reports(bus: Bus, numbers: Numbers, *, wait_us: int) -> None:
    """Refuse a bus without the reports that the estimate needs."""
    protocol = load_protocol(numbers.vehicle.protocol)
    names = report_names(protocol)
    missing = {names.speed.message, names.steering.output.message}
    clock = MonotonicClock()
    while missing and clock.now_us() <= wait_us:
        heard = bus.receive(_LISTEN_US)
        if heard is not None and heard.error is None:
            frame = decode(protocol, heard.identifier, heard.data)
            if isinstance(frame, Decoded):
                missing.discard(frame.message)
    if missing:
        raise RefusedError(
            Exit.PROTOCOL,
            f"the localiser is built for {protocol.name}; missing reports: {sorted(missing)}; "
            "check channel, bitrate and vehicle",
        )


def _driven(loop: Loop, level: float) -> int:
    def stop(*_: object) -> None:
        loop.stop()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, stop)
    # What was made so far stays: later collections need not look at it.
    gc.collect()
    gc.freeze()
    say(f"{_NAME}: listening, sets of level {level:g}")
    try:
        loop.run()
    except Exception as error:
        say(f"{_NAME}: defect, now silent: {type(error).__name__}: {error}")
        return Exit.DEFECT
    say(f"{_NAME}: ended: {loop.counts}")
    return Exit.ORDERLY


if __name__ == "__main__":
    sys.exit(main())
