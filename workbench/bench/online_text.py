"""The board of the online kernels as plain text tables, every column with its unit."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.bench.online_board import OnlineBoard, OnlineRow, ValidatedRow
from workbench.bench.online_cost import OnlineCost
from workbench.bench.text import table

# Position, steering and heading, or what stands for them along a path.
_SHOWN = (0, 1, 2, 4)
_NOTHING = "-"


def online_text(board: OnlineBoard) -> str:
    """All tables of one loop."""
    parts = [_widths(board), _excess(board), _growth(board), _memory(board), _agreement(board)]
    return "\n\n".join(parts)


def _names(board: OnlineBoard) -> list[str]:
    names = list(board.validated[0].score.width_ratio)
    return [names[i] for i in _SHOWN]


def _told(board: OnlineBoard) -> list[tuple[list[str], OnlineRow | ValidatedRow]]:
    """Every row behind the cells that name it."""
    told: list[tuple[list[str], OnlineRow | ValidatedRow]] = [
        ([s.kernel, s.form.value, f"{s.step_s:g}", str(s.cells)], row)
        for row in board.rows
        for s in [row.setting]
    ]
    told += [(["validated", _NOTHING, "0.05", str(row.cells)], row) for row in board.validated]
    return told


_WHICH = ["tube", "form", "step s", "cells"]


def _widths(board: OnlineBoard) -> str:
    names = _names(board)
    rows = []
    for which, row in _told(board):
        # A mean that stops where the proof stops is not one over 3 s.
        found = row.score.width_ratio if row.score.covered else dict.fromkeys(names)
        ratios = [_number(found[name], "{:.3f}") for name in names]
        rows.append([*which, *ratios, _end(row), str(row.score.escapes), *_cost(row)])
    headings = [
        *_WHICH, *(f"{name} ratio" for name in names), "proved", "escapes", "us", "trajectories",
        "instructions", "trajectories",
    ]  # fmt: skip
    title = (
        f"{board.loop}: {board.trajectories} trajectories over 3 s; ratio: mean over the instants "
        "0.05 k s (0.1 k s for steps of 0.1 s) of tube width / sampled width; us: all cells, one "
        "core, in C (validated: in Python); trajectories: the same in compiled trajectories of 60 "
        "Runge-Kutta steps, by time and by instructions"
    )
    return f"{title}\n{table(headings, rows)}"


def _end(row: OnlineRow | ValidatedRow) -> str:
    if row.status == "COMPLETE":
        return row.rigor
    return f"to {row.proved_until_s:.2f} s ({row.status})"


def _cost(row: OnlineRow | ValidatedRow) -> list[str]:
    if isinstance(row, ValidatedRow):
        return [f"{1e6 * row.elapsed_s:.0f}", _NOTHING, _NOTHING, _NOTHING]
    if row.cost is None:
        return [_NOTHING] * 4
    return _told_cost(row.cost)


def _told_cost(cost: OnlineCost) -> list[str]:
    return [
        f"{cost.tube_us:.1f}",
        f"{cost.ratio:.1f}",
        _number(cost.tube_instructions, "{:d}"),
        _number(cost.instruction_ratio, "{:.1f}"),
    ]


def _number(value: float | None, form: str) -> str:
    return _NOTHING if value is None else form.format(value)


def _excess(board: OnlineBoard) -> str:
    names = _names(board)
    rows = [
        [
            *which,
            *(
                f"{row.score.excess_mean[name]:.1e} ({row.score.excess_worst[name]:.1e})"
                for name in names
            ),
        ]
        for which, row in _told(board)
        if row.score.covered
    ]
    title = (
        f"{board.loop}: excess of segments over the sampled hull of the same segment (0.05 s, or "
        "the step where it is longer), mean (worst), in m and rad"
    )
    return f"{title}\n{table([*_WHICH, *names], rows)}"


def _growth(board: OnlineBoard) -> str:
    rows = [
        [facts.kernel, facts.form.value, f"{cost.horizon_s:g}", *_told_cost(cost)]
        for facts in board.kernels
        for cost in facts.growth
    ]
    headings = ["kernel", "form", "T s", "us", "trajectories", "instructions", "trajectories"]
    title = (
        f"{board.loop}: growth with the horizon, one set, steps of 0.05 s; trajectories: over the "
        "same horizon"
    )
    return f"{title}\n{table(headings, rows)}"


def _memory(board: OnlineBoard) -> str:
    rows = [
        [
            facts.kernel, facts.form.value, _number(m.code, "{:d}"), _number(m.tables, "{:d}"),
            _number(m.static, "{:d}"), _number(m.stack_bound, "{:d}"), str(m.stack_touched),
            str(m.caller),
        ]
        for facts in board.kernels
        for m in [facts.memory]
    ]  # fmt: skip
    headings = [
        "kernel", "form", "code", "tables", "static", "stack, bound", "stack, touched",
        "caller's buffers",
    ]  # fmt: skip
    return f"{board.loop}: bytes of the kernel for 60 steps\n{table(headings, rows)}"


def _agreement(board: OnlineBoard) -> str:
    rows = [
        [
            facts.kernel, facts.form.value, found.function, str(found.inputs),
            *(str(count) for count in found.differing.values()), str(found.undefined),
        ]
        for facts in board.kernels
        for found in facts.agreement
    ]  # fmt: skip
    levels = [f"differing at {level}" for level in _levels(board)]
    headings = ["kernel", "form", "function", "inputs", *levels, "undefined"]
    title = (
        f"{board.loop}: random inputs for which the C gives other bits than CasADi's evaluation "
        "(wb_tube: than itself unoptimised; undefined: tubes that end early)"
    )
    return f"{title}\n{table(headings, rows)}"


def _levels(board: OnlineBoard) -> Sequence[str]:
    found = [each for facts in board.kernels for each in facts.agreement]
    return list(found[0].differing) if found else []


def summary_text(boards: Sequence[OnlineBoard], seed: int) -> str:
    """Escapes and disagreements over all loops, in one line."""
    escapes = sum(board.escapes for board in boards)
    disagreements = sum(board.disagreements for board in boards)
    return f"online kernels: {escapes} escapes, {disagreements} disagreements in all (seed {seed})"
