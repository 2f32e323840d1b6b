"""The board of the monitor on the vehicle as plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from workbench.bench.onboard_board import OnboardBoard
from workbench.bench.onboard_heap import Heap
from workbench.bench.onboard_period import Period
from workbench.bench.onboard_start import LISTENED_S
from workbench.bench.onboard_turns import Told, Turns, at_shares
from workbench.bench.text import table
from workbench.runtime.onboard.times import TURN_US

_THREE: Final = ("median", "p99.9", "max")
_TURN: Final = f"{TURN_US / 1e3:g} ms"


def onboard_text(board: OnboardBoard) -> str:
    """Every figure, then every claim."""
    parts = [
        f"bundle: at most {board.budget} steps of integration per decision",
        _turns(board.turns), _period(board.periods), _missed(board.periods), _heap(board.heap),
        _memory(board), *_processes(board),
        f"base install, {len(board.distributions)} distributions: "
        f"{', '.join(board.distributions)}",
    ]  # fmt: skip
    return "\n\n".join(parts)


def claims_text(board: OnboardBoard) -> str:
    """What must hold, line by line."""
    lines = [f"{'ok' if each.holds else 'FAILS'}: {each.sentence}" for each in board.claims]
    return "\n".join([*lines, f"onboard: {board.failing} claims fail"])


def _ms(values_us: Told) -> list[str]:
    return [f"{value / 1e3:.2f}" for value in values_us]


def _turns(every: tuple[Turns, ...]) -> str:
    headings = ["cores", "turns", "number", *(f"{name} ms" for name in _THREE)]
    rows = []
    for each in every:
        cores = each.cores.value
        others = 2 * each.decisions
        rows += [
            [cores, "with a decision", f"{each.decisions}", *_ms(each.decided_us)],
            [cores, "until it was decided", f"{each.decisions}", *_ms(each.ended_us)],
            [cores, "without a decision", f"about {others}", *_ms(each.others_us)],
        ]
    notes = [
        f"{each.cores.value}: {each.beyond_turn} turns took longer than {_TURN}; "
        f"states {_shares(each.states)}; verdicts {_shares(each.verdicts)}; turns with faults: "
        f"{', '.join(f'{name} {n}' for name, n in each.faults.items()) or 'none'}"
        for each in every
    ]
    title = "last frame in to commands out, the whole core, turns fed as fast as they come"
    return "\n".join([title, table(headings, rows), *notes])


def _shares(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {share:.1%}" for name, share in shares.items())


def _period(every: tuple[Period, ...]) -> str:
    headings = [
        "cores", "s", "turns", *(f"jitter {name} ms" for name in _THREE),
        "longest between two sets ms", "from a turn's begin to the next set ms", "missed",
        "unanswered", "stale frames", "commanding",
    ]  # fmt: skip
    rows = [
        [
            each.cores.value, f"{each.seconds:g}", f"{each.turns}", *_ms(each.jitter_us),
            _gap(each.gap_us), _gap(each.from_begin_us),
            f"{sum(missed.times for missed in each.missed)}", f"{each.unanswered}",
            f"{each.stale}", f"{_commanding(each.states):.0%}",
        ]
        for each in every
    ]  # fmt: skip
    title = f"the loop in real time on the virtual bus; jitter: |time between two turns - {_TURN}|"
    return f"{title}\n{table(headings, rows)}"


def _commanding(states: Mapping[str, float]) -> float:
    return sum(states.get(name, 0.0) for name in ("TRACKING", "BRAKING", "FAULT"))


def _gap(value_us: int | None) -> str:
    return "-" if value_us is None else f"{value_us / 1e3:.2f}"


def _missed(every: tuple[Period, ...]) -> str:
    rows = [
        [each.cores.value, missed.kind, missed.answer, f"{missed.times}",
         "yes" if missed.answered else "NO"]
        for each in every
        for missed in each.missed
    ]  # fmt: skip
    title = "deadlines missed, and what answered each (faults of that turn or the next; the state)"
    if not rows:
        return f"{title}\nnone"
    return f"{title}\n{table(['cores', 'deadline', 'answer', 'times', 'answered'], rows)}"


def _heap(found: Heap) -> str:
    counted = ", ".join(f"{name} {count}" for name, count in found.by_kind.items())
    imports = "not looked at, nm is missing" if found.imports is None else ", ".join(found.imports)
    return (
        f"heap calls inside the compiled decision, {found.calls} calls of {found.queries} queries "
        f"in turns: {counted}; it imports: {imports or 'nothing'}"
    )


def _memory(board: OnboardBoard) -> str:
    rows = []
    for what, marks, cores in (
        ("the compiled decision", board.heap.marks, 0),
        *((f"the whole core, {each.cores.value}", each.marks, each.laps) for each in board.turns),
    ):
        at = at_shares(marks)
        rows.append([what, f"{marks[-1][0]}", *(f"{mib:.2f}" for mib in at.values()),
                     f"{cores or '-'}"])  # fmt: skip
    headings = ["resident MiB", "decisions", "start", "10 %", "50 %", "100 %", "cores begun"]
    return table(headings, rows)


def _processes(board: OnboardBoard) -> list[str]:
    if board.cold_starts is None or board.resident is None:
        return ["cold start and memory of the program: not measured, pyserial is missing"]
    rows = [
        [each.kind, f"{each.first_s:.3f}", f"{each.slowest_s:.3f}", f"{each.opened_s:.3f}",
         f"{each.processor_s:.2f}"]
        for each in board.cold_starts
    ]  # fmt: skip
    title = (
        f"workbench-monitor, {board.cold_starts[0].processes} fresh processes each: s from its "
        f"start to its first turn or heartbeat, without the {LISTENED_S:g} s for which it listens"
    )
    headings = ["started", "median", "slowest", "bus opened", "processor time until then"]
    held = board.resident
    return [
        f"{title}\n{table(headings, rows)}",
        f"resident {held.after_s:g} s after its first turn: {held.now_mb:.1f} MB, at most "
        f"{held.peak_mb:.1f} MB before; no library of an analysis package in it",
    ]
