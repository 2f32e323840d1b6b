"""The paper's two tables beside ours: as rows, CSV and Markdown."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from workbench.bench.paper_times import PaperTimes
    from workbench.cli.reproduce_work import Found
    from workbench.report.tables import Cell, Table
    from workbench.simulation.conformance.counting import Share
    from workbench.simulation.paper.accuracy import AccuracyRow

PAPER: Final = "the paper"
_MS: Final = 1e3


def time_table(times: PaperTimes) -> Table:
    """Table I: ours and the paper's, in ms, and the growth from the shortest T to the longest."""
    from workbench.bench.paper_times import PUBLISHED_S
    from workbench.report.tables import Table

    rows: list[list[Cell]] = []
    for row in times.rows:
        rows.append([f"{row.what}, median", *(_MS * t for t in row.median_s), row.growth])
        rows.append([f"{row.what}, 99 %", *(_MS * t for t in row.p99_s), None])
        if any(row.incomplete):
            left_out = f"{row.what}, left out of {row.calls} because a tube ended early"
            rows.append([left_out, *row.incomplete, None])
    paper = [_MS * t for t in PUBLISHED_S]
    rows.append([PAPER, *paper, paper[-1] / paper[0]])
    horizons = times.rows[0].horizons_s
    headings = ["three nested sets, ms", *(f"T = {t:g} s" for t in horizons),
                f"{horizons[-1]:g} s / {horizons[0]:g} s"]  # fmt: skip
    return Table("Table I: time for three nested reach sets, one core", headings, rows)


def accuracy_tables(found: Found, *, starts: str) -> tuple[Table, ...]:
    """Table II and what it does not say: per step, per whole trajectory, and area."""
    from workbench.report.tables import Table
    from workbench.simulation.paper.accuracy import HORIZONS_S

    rows = [row for row in found.accuracy if row.starts == starts]
    headings = ["plant", "tubes", "confidence", *(f"T = {t:g} s" for t in HORIZONS_S)]
    about = f"decisions {starts}"
    counted = "and how many were outside of a tube that had not ended"
    return (
        Table(f"Table II: steps contained (%), {counted}, {about}", headings,
              [_line(row, _steps) for row in rows] + _published()),
        Table(f"whole trajectories contained (%), with 95 % intervals, {about}", headings,
              [_line(row, _windows) for row in rows] + _published()),
        Table(f"mean area of the tubes (m2), {about}", headings,
              [_line(row, _area) for row in rows]),
    )  # fmt: skip


def _published() -> list[list[Cell]]:
    from workbench.simulation.paper.accuracy import CONFIDENCES, PUBLISHED

    return [
        [PAPER, "learned beta", name, *(f"{100.0 * share:.3f}" for share in shares)]
        for name, shares in zip(CONFIDENCES, PUBLISHED, strict=True)
    ]


def _line(row: AccuracyRow, kind: int) -> list[Cell]:
    from workbench.simulation.paper.accuracy import CONFIDENCES

    return [row.plant, row.method, CONFIDENCES[row.confidence],
            *(_shown(cell, kind) for cell in row.cells)]  # fmt: skip


_steps, _windows, _area = range(3)


def _shown(cell: object, kind: int) -> Cell:
    from workbench.simulation.paper.accuracy import Cell as Counted

    if not isinstance(cell, Counted):
        return None
    if kind == _steps:
        # Rounded down: what is not all must not look like it.
        return f"{math.floor(1e5 * cell.steps.value) / 1e3:.3f} ({cell.outside})"
    if kind == _area:
        return f"{cell.mean_area_m2:.2f}{_missing(cell.area_rows)}"
    if cell.windows is None:
        return None
    return f"{_percent(cell.windows)} drawn [{_ends(cell.windows_drawn)}]"


def _missing(area_rows: float) -> str:
    """How much of the tubes a mean is of, where it is not all of them."""
    # Rounded down: what is not all must not look like it.
    share = math.floor(1000.0 * area_rows) / 10.0
    return "" if area_rows == 1.0 else f" (of {share:.1f} % of the rows)"


def _percent(share: Share) -> str:
    return f"{100.0 * share.value:.1f} [{_ends((share.low, share.high))}]"


def _ends(interval: tuple[float, float]) -> str:
    return f"{100.0 * interval[0]:.1f}, {100.0 * interval[1]:.1f}"


def count_table(found: Found, *, starts: str) -> Table:
    """How many windows there are, and what was counted against the tubes."""
    from workbench.report.tables import Table
    from workbench.simulation.paper.accuracy import CONFIDENCES, HORIZONS_S

    rows: list[list[Cell]] = []
    for row in found.accuracy:
        if row.starts != starts:
            continue
        for t, cell in zip(HORIZONS_S, row.cells, strict=True):
            if cell is not None and t in (HORIZONS_S[0], HORIZONS_S[-1]):
                rows.append([row.plant, row.method, CONFIDENCES[row.confidence], t, cell.runs,
                             cell.all_windows, cell.censored, cell.proof_ended, cell.steps.of,
                             f"{100.0 * cell.begins:.1f}"])  # fmt: skip
    return Table(
        f"what was counted, decisions {starts}",
        ["plant", "tubes", "confidence", "T (s)", "runs", "windows", "cut short", "ended early",
         "steps", "sets that hold the car (%)"],
        rows, folded=True,
    )  # fmt: skip


def times_csv(times: PaperTimes) -> str:
    """One line per row and T, every digit."""
    lines = [["what", "horizon_s", "median_s", "p99_s", "calls", "incomplete"]]
    for row in times.rows:
        for t, median, tail, incomplete in zip(
            row.horizons_s, row.median_s, row.p99_s, row.incomplete, strict=True
        ):
            lines.append([row.what, *map(repr, (t, median, tail, row.calls, incomplete))])
    return _csv(lines)


def accuracy_csv(found: Found) -> str:
    """One line per cell, every digit."""
    from workbench.simulation.paper.accuracy import CONFIDENCES, HORIZONS_S

    heads = ["plant", "tubes", "confidence", "starts", "horizon_s", "runs", "steps_inside", "steps",
             "steps_low", "steps_high", "steps_drawn_low", "steps_drawn_high", "outside",
             "windows_inside", "windows_whole", "windows_low", "windows_high", "windows_drawn_low",
             "windows_drawn_high", "windows", "cut_short", "proof_ended", "sets_hold_car",
             "mean_area_m2", "area_rows"]  # fmt: skip
    lines = [heads]
    for row in found.accuracy:
        for t, cell in zip(HORIZONS_S, row.cells, strict=True):
            if cell is None:
                continue
            steps, whole = cell.steps, cell.windows
            numbers: tuple[float | str, ...] = (
                t, cell.runs, steps.inside, steps.of, steps.low, steps.high, *cell.steps_drawn,
                cell.outside,
                *((whole.inside, whole.of, whole.low, whole.high) if whole else ("", "", "", "")),
                *cell.windows_drawn, cell.all_windows, cell.censored, cell.proof_ended, cell.begins,
                cell.mean_area_m2, cell.area_rows,
            )  # fmt: skip
            shown = [each if isinstance(each, str) else repr(each) for each in numbers]
            lines.append([row.plant, row.method, CONFIDENCES[row.confidence], row.starts, *shown])
    return _csv(lines)


def _csv(lines: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def markdown(table: Table) -> str:
    """A table as Markdown, its caption above."""
    from workbench.report.tables import shown

    lines = [list(table.headings), ["---"] * len(table.headings)]
    lines += [[shown(cell) for cell in row] for row in table.rows]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"**{table.caption}**\n\n{body}"
