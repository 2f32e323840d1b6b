"""Verdicts of every nested set over time, and the assumptions that failed meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.claims import Verdict
from workbench.report.drawing import (
    HATCHES,
    INK,
    VERDICT_COLOURS,
    VERDICT_HATCHES,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
)
from workbench.report.tables import Cell, Table
from workbench.simulation.frames import Frame, LevelVerdicts

_LONGEST_S: Final = 0.5
"""A decision's verdict is drawn until the next one, but no longer than this."""
_APART_S: Final = 0.35
"""What is named again after less than this went on meanwhile."""
_NAMES: Final = 8
_SEAM_S: Final = 1e-6
Row = tuple[str, int]
Span = tuple[float, float]


def level_timeline(frames: Sequence[Frame], levels: Sequence[str]) -> Figure:
    """A coloured bar per tube and nested set, below it what failed and when somebody was alerted.

    levels: names of the nested sets, the largest first.
    """
    rows = [(each.tube, k) for each in _tubes(frames) for k in range(len(each.verdicts))]
    labels = [f"{tube}: {levels[k] if k < len(levels) else k + 1}" for tube, k in rows]
    failed = dict(list(_spans(frames).items())[:_NAMES])
    panel = svg_panel(
        partial(_paint, frames=frames, rows=rows, labels=labels, failed=failed),
        label="Verdicts of every nested set over time, and what failed",
        width_in=4.6,
        height_in=0.9 + 0.24 * (len(rows) + len(failed) + 1),
    )
    legend = (
        *(
            Key(
                verdict.value,
                VERDICT_COLOURS[verdict],
                filled=True,
                hatch=VERDICT_HATCHES[verdict],
            )
            for verdict in Verdict
        ),
        Key(
            "an assumption failed, or somebody was alerted",
            VERMILLION,
            filled=True,
            hatch=HATCHES[-1],
        ),
    )
    caption = (
        "One bar per tube and nested set, the largest set first; a gap means that nothing was "
        "decided. Below: which assumption, limit or fault the monitor named, and alerts."
    )
    return Figure((panel,), legend, caption, wide=True)


def failures_table(frames: Sequence[Frame]) -> Table:
    """Every time that an assumption failed or somebody was alerted: since, until, what, words."""
    rows: list[list[Cell]] = []
    for name, spans in _spans(frames).items():
        for since, until in spans:
            rows.append([since, until, name, _words(frames, name, since)])
    rows.sort(key=lambda row: (row[0], row[2]))
    if not rows:
        rows = [[None, None, "nothing failed, and nobody was alerted", ""]]
    return Table(
        "what failed, and alerts", ["since (s)", "until (s)", "what", "in words at first"], rows
    )


def _tubes(frames: Sequence[Frame]) -> tuple[LevelVerdicts, ...]:
    found = {level.tube: level for frame in frames for level in frame.levels}
    return tuple(found.values())


def _named(frame: Frame) -> dict[str, str]:
    """What this decision named, and its words."""
    said = {text.partition(":")[0]: text for text in reversed(frame.violations)}
    if frame.alert is not None:
        said["alert"] = frame.alert
    return said


def _words(frames: Sequence[Frame], name: str, since_s: float) -> str:
    first = next(frame for frame in frames if frame.t_s >= since_s and name in _named(frame))
    return _named(first)[name].removeprefix(f"{name}:").strip()


def _spans(frames: Sequence[Frame]) -> dict[str, list[Span]]:
    """When each thing was named, in order of first appearance, the alert last."""
    found: dict[str, list[Span]] = {}
    for frame in frames:
        for name in _named(frame):
            spans = found.setdefault(name, [])
            if spans and frame.t_s - spans[-1][1] <= _APART_S:
                spans[-1] = (spans[-1][0], frame.t_s)
            else:
                spans.append((frame.t_s, frame.t_s))
    alerts = found.pop("alert", None)
    return found if alerts is None else {**found, "alert": alerts}


def _paint(
    canvas: Canvas,
    *,
    frames: Sequence[Frame],
    rows: Sequence[Row],
    labels: Sequence[str],
    failed: dict[str, list[Span]],
) -> None:
    axes: Axes = canvas.add_subplot()
    lengths = _lengths(frames)
    for at, row in enumerate(rows):
        for verdict in Verdict:
            bars = _bars(frames, lengths, row, verdict)
            axes.broken_barh(
                bars, (at - 0.38, 0.76), facecolor=VERDICT_COLOURS[verdict], edgecolor=INK,
                hatch=VERDICT_HATCHES[verdict], lw=0,
            )  # fmt: skip
    for at, spans in enumerate(failed.values(), start=len(rows)):
        bars = [(since, until - since + 0.1) for since, until in spans]
        axes.broken_barh(
            bars, (at - 0.38, 0.76), facecolor=VERMILLION, edgecolor=INK, hatch=HATCHES[-1], lw=0
        )
    if failed and rows:
        axes.axhline(len(rows) - 0.5, color=INK, lw=0.8, alpha=0.5)
    names = [*labels, *(name.lower().replace("_", " ")[:18] for name in failed)]
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_ylim(max(len(names), 1) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlim(left=min(frames[0].t_s, 0.0))
    axes.set_xlabel("time (s)")


def _bars(
    frames: Sequence[Frame], lengths: Sequence[float], row: Row, verdict: Verdict
) -> list[Span]:
    """(begin, length) of every time in which a nested set had this verdict, without seams."""
    found: list[Span] = []
    for frame, length in zip(frames, lengths, strict=True):
        said = {level.tube: level.verdicts for level in frame.levels}.get(row[0], ())
        if row[1] >= len(said) or said[row[1]] is not verdict:
            continue
        if found and frame.t_s - sum(found[-1]) < _SEAM_S:
            found[-1] = (found[-1][0], frame.t_s + length - found[-1][0])
        else:
            found.append((frame.t_s, length))
    return found


def _lengths(frames: Sequence[Frame]) -> list[float]:
    after = [frame.t_s for frame in frames[1:]]
    return [*(min(b - a.t_s, _LONGEST_S) for a, b in zip(frames, after, strict=False)), 0.1]
