"""`workbench replay LOG`: what the monitor decided on the vehicle, decided again."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.runtime import Bundle
    from workbench.runtime.onboard.playback import Compared
    from workbench.runtime.onboard.playback_logs import PlayedLog
    from workbench.runtime.onboard.recorder_header import LogHeader

_SHOWN: Final = 20
_NOT_EXACT: Final = (
    "No recorder of ours wrote this log: its times are not the core's own, so that only ACTION, "
    "VERDICT and ALERT of the DECISION frames were held against it, and a difference may come from "
    "the times alone."
)


def replay_log(args: argparse.Namespace) -> int:
    """Replay the log `args.subject` with `args.bundle`, and print how it compares; 1 where it
    differs."""
    from workbench.runtime.onboard.playback import compare
    from workbench.runtime.onboard.playback_logs import open_log
    from workbench.runtime.onboard.playback_settings import core_again

    if args.bundle is None:
        raise InputError(
            f"--bundle: expected the bundle that made the log {args.subject}, got none; add it"
        )
    log = open_log(args.subject, header=args.run)
    if log.header is None:
        raise InputError(
            f"{args.subject}: expected the run.json that workbench-monitor wrote for this drive "
            "beside the log, got none; name it by --run"
        )
    core = core_again(_bundle(args.bundle, log.header), log.header)
    compared = compare(core, log.events, exact=log.exact)
    emit(args, _text(log, compared), _data(log, compared))
    return 1 if compared.mismatches else 0


def _bundle(folder: Path, header: LogHeader) -> Bundle:
    """The bundle, which must be the one that the log was made with."""
    from workbench.runtime import load_bundle
    from workbench.runtime.contents import MANIFEST_FILE

    bundle = load_bundle(folder)
    found = hashlib.sha256((folder / MANIFEST_FILE).read_bytes()).hexdigest()
    if found != header.manifest_sha256:
        raise InputError(
            f"--bundle: expected the bundle whose manifest has the SHA-256 "
            f"{header.manifest_sha256[:16]}..., with which the log was made, got {folder} with "
            f"{found[:16]}...; name the other one"
        )
    return bundle


def _text(log: PlayedLog, compared: Compared) -> str:
    lines = [str(mismatch) for mismatch in compared.mismatches[:_SHOWN]]
    if len(compared.mismatches) > _SHOWN:
        lines.append(f"{len(compared.mismatches) - _SHOWN} more differences not shown")
    if compared.lost:
        lines.append(
            f"{compared.lost} entries are missing from the log, as it says itself; nothing is "
            "claimed of what follows them"
        )
    if not log.exact:
        lines.append(_NOT_EXACT)
    else:
        lines.append(
            f"{compared.compared} decisions were held against every bit on record; of the others "
            "the log has the frames alone."
        )
    same = "differ from" if compared.mismatches else "are those of"
    lines.append(
        f"{log.path}: {compared.turns} turns with {compared.decisions} decisions replayed; they "
        f"{same} the log"
    )
    return "\n".join(lines)


def _data(log: PlayedLog, compared: Compared) -> dict[str, object]:
    return {
        "log": log.path,
        "exact": log.exact,
        "turns": compared.turns,
        "decisions": compared.decisions,
        "compared": compared.compared,
        "lost": compared.lost,
        "mismatches": compared.mismatches,
    }
