"""`workbench can decode`: reads a log of CAN frames with the codecs that run on the vehicle."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import text_table
from workbench.cli.output import emit
from workbench.errors import InputError
from workbench.runtime.protocols import (
    PROTOCOLS,
    IntentSet,
    LocalisationSet,
    NoSet,
    PersonSet,
    Protocol,
    Refusal,
    SetFault,
    decode_received,
    load_protocol,
)
from workbench.runtime.protocols.tables import RANGES

if TYPE_CHECKING:
    import can

    from workbench.runtime.protocols import Decoded

HELP = (
    "Decodes a log of CAN frames (candump's .log, .asc, .blf, .csv, .trc) as the vehicle would: "
    "every value by name, or why a frame is refused. Exit status 1 when frames are refused, also "
    "for unknown identifiers, or sets of frames are broken. What each protocol says and does not: "
    "docs/can-protocols.md."
)
EXAMPLE = """\
workbench can decode --protocol pacmod2 drive.log
workbench can decode --protocol pacmod2 --protocol workbench drive.log --refused --json
"""
_MOST_ROWS: Final = 200


@final
@dataclass(frozen=True, slots=True)
class _Row:
    """One frame of the log: when, which, and what it says."""

    time_s: float
    frame_id: int
    message: str
    said: Decoded | Refusal


@final
@dataclass(slots=True)
class _Counts:
    """What is kept of a log, whose length is not known."""

    rows: list[_Row]
    frames: Counter[str]
    refused: Counter[str]
    reasons: Counter[str]
    sets: dict[str, PersonSet | LocalisationSet | IntentSet]
    broken: Counter[str]
    left_out: int = 0


def configure(parser: argparse.ArgumentParser) -> None:
    """The action, the log, and what of it to show."""
    parser.add_argument("action", choices=["decode"], help="what to do with the log")
    parser.add_argument("file", type=Path, metavar="FILE", help="log of CAN frames")
    parser.add_argument(
        "--protocol",
        action="append",
        required=True,
        choices=(*PROTOCOLS, RANGES),
        help="whose frames these are; twice for a bus that carries two",
    )
    parser.add_argument("--refused", action="store_true", help="show refused frames only")
    parser.add_argument(
        "--most",
        type=int,
        default=_MOST_ROWS,
        metavar="N",
        help=f"show at most N frames; all are counted (default: {_MOST_ROWS})",
    )


def run(args: argparse.Namespace) -> int:
    """Read, decode, count and show."""
    if args.most < 0:
        raise InputError(f"--most: expected a number of frames >= 0, got {args.most}")
    protocols = _chosen(args.protocol)
    counts = _Counts([], Counter(), Counter(), Counter(), _no_sets(protocols), Counter())
    for received in _frames(args.file):
        _take(counts, _row(protocols, received), args)
    if not counts.frames:
        raise InputError(f"expected a log with frames, got {args.file} without any; name another")
    notes = _notes(protocols, counts)
    emit(args, _text(counts, notes, protocols), _data(args, counts, notes, protocols))
    lost = any(collected.frames.lost for collected in counts.sets.values())
    return 1 if counts.refused or counts.broken or lost else 0


def _chosen(names: list[str]) -> list[Protocol]:
    """The protocols, whose identifiers must differ: one frame cannot mean two things."""
    protocols = [load_protocol(name) for name in dict.fromkeys(names)]
    meant: dict[int, str] = {}
    for protocol in protocols:
        for frame_id in protocol.by_id:
            other = meant.setdefault(frame_id, protocol.name)
            if other != protocol.name:
                raise InputError(
                    f"--protocol: expected protocols that can share a bus, got {other} and "
                    f"{protocol.name}, which both use identifier 0x{frame_id:X}; choose one"
                )
    return protocols


def _frames(file: Path) -> Iterator[can.Message]:
    """The log's frames. Raises InputError for what python-can cannot read."""
    import can

    expected = f"expected a log of CAN frames (.log of candump, .asc, .blf, .csv, .trc), got {file}"
    try:
        with can.LogReader(file) as reader:
            yield from reader
    except OSError as error:
        raise InputError(f"{expected} ({error.strerror or error})") from error
    except Exception as error:
        # The readers of python-can fail in many ways where a line or a block is not theirs.
        raise InputError(f"{expected}, which cannot be read ({str(error)[:200]!r})") from error


def _row(protocols: list[Protocol], received: can.Message) -> _Row:
    frame_id = received.arbitration_id
    protocol = next((each for each in protocols if frame_id in each.by_id), protocols[0])
    said = decode_received(protocol, received)
    return _Row(received.timestamp, frame_id, said.message or f"0x{frame_id:X}", said)


def _take(counts: _Counts, row: _Row, args: argparse.Namespace) -> None:
    counts.frames[row.message] += 1
    _collect(counts, row.said)
    if isinstance(row.said, Refusal):
        counts.refused[row.message] += 1
        counts.reasons[row.said.reason.value] += 1
    elif args.refused:
        return
    if len(counts.rows) < args.most:
        counts.rows.append(row)
    else:
        counts.left_out += 1


def _no_sets(protocols: list[Protocol]) -> dict[str, PersonSet | LocalisationSet | IntentSet]:
    if all(protocol.name != "workbench" for protocol in protocols):
        return {}
    return {"localisation": LocalisationSet(), "people": PersonSet(), "intents": IntentSet()}


def _collect(counts: _Counts, said: Decoded | Refusal) -> None:
    """Put sets together, and count what breaks them."""
    for name, collected in counts.sets.items():
        taken = collected.taking(said)
        if taken.frames is collected.frames:
            continue
        counts.sets[name] = taken
        outcome = taken.outcome
        fault = outcome.fault if isinstance(outcome, NoSet) else SetFault.UNFINISHED
        if fault is not SetFault.UNFINISHED and outcome != collected.outcome:
            counts.broken[f"{name}: {fault.value}"] += 1


def _notes(protocols: list[Protocol], counts: _Counts) -> dict[str, str]:
    """What a reader must know about the messages and signals that were seen."""
    notes: dict[str, str] = {}
    for protocol in protocols:
        for message in protocol.by_id.values():
            if message.name in counts.frames:
                about = {"": message.note} | {s.name: s.note for s in message.signals}
                notes |= {f"{message.name}.{k}".rstrip("."): v for k, v in about.items() if v}
    return notes


def _shown(protocols: list[Protocol], said: Decoded | Refusal) -> str:
    """Values with units and names of choices, or the refusal."""
    if isinstance(said, Refusal):
        return f"refused: {said}"
    message = next(p.by_id[said.frame_id] for p in protocols if said.frame_id in p.by_id)
    words = []
    for signal in message.signals:
        value = said.values[signal.name]
        named = signal.choices.get(int(value), f"{value:.12g}")
        words.append(f"{signal.name} {named} {signal.unit}".rstrip())
    return ", ".join(words)


def _text(counts: _Counts, notes: dict[str, str], protocols: list[Protocol]) -> str:
    frames, refused = counts.frames.total(), counts.refused.total()
    parts = []
    if counts.rows:
        rows: list[list[str | int | float | None]] = [
            [f"{r.time_s:.6f}", f"0x{r.frame_id:03X}", r.message, _shown(protocols, r.said)]
            for r in counts.rows
        ]
        parts.append(text_table(["time [s]", "id", "message", "values"], rows))
    if counts.left_out:
        parts.append(f"{counts.left_out} more frames not shown; --most N shows more")
    summary: list[list[str | int | float | None]] = [
        [name, count, counts.refused[name]] for name, count in sorted(counts.frames.items())
    ]
    parts.append(text_table(["message", "frames", "refused"], summary))
    for name, collected in counts.sets.items():
        sets = collected.frames
        parts.append(
            f"{name}: {sets.completed} whole sets, {sets.lost} unfinished ones, "
            f"{sets.duplicates} frames twice"
        )
    parts += [f"{count} times {why}" for why, count in counts.broken.most_common()]
    if notes:
        parts.append("\n".join(f"{place}: {note}" for place, note in notes.items()))
    why = "".join(f"; {count} {reason}" for reason, count in counts.reasons.most_common())
    parts.append(f"{frames} frames, {refused} refused{why}")
    return "\n\n".join(parts)


def _data(
    args: argparse.Namespace, counts: _Counts, notes: dict[str, str], protocols: list[Protocol]
) -> dict[str, object]:
    return {
        "file": args.file,
        "protocols": {protocol.name: protocol.dbc_sha256 for protocol in protocols},
        "frames": counts.frames.total(),
        "refused": counts.refused.total(),
        "reasons": counts.reasons,
        "messages": {
            name: {"frames": count, "refused": counts.refused[name]}
            for name, count in sorted(counts.frames.items())
        },
        "sets": {
            name: {
                "whole": collected.frames.completed,
                "unfinished": collected.frames.lost,
                "frames_twice": collected.frames.duplicates,
            }
            for name, collected in counts.sets.items()
        },
        "broken": counts.broken,
        "notes": notes,
        "left_out": counts.left_out,
        "rows": [_row_data(row) for row in counts.rows],
    }


def _row_data(row: _Row) -> dict[str, object]:
    said = row.said
    place: dict[str, object] = {"time_s": row.time_s, "id": row.frame_id, "message": row.message}
    if isinstance(said, Refusal):
        return place | {
            "refused": said.reason, "signal": said.signal, "why": str(said), "values": None
        }  # fmt: skip
    return place | {"refused": None, "signal": None, "why": None, "values": said.values}
