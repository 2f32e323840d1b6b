"""All decisions over time: what was concluded, said and sent, as a picture and as tables."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from workbench.claims import Verdict
from workbench.errors import InputError
from workbench.report.drawing import (
    INK,
    VERDICT_COLOURS,
    VERDICT_MARKS,
    VERMILLION,
    Figure,
    Key,
    svg_panel,
    thinned,
)
from workbench.report.tables import Cell, Table
from workbench.simulation.frames import Frame

_TABLE_ROWS = 1000
_LONGEST_NAME = 12
_NO_DECISION = "no decision"
_LEVELS = {Verdict.INVALID: 0.0, Verdict.UNPROVED: 1.0, Verdict.SAFE: 2.0}


def require_frames(frames: Sequence[Frame]) -> None:
    """Raise InputError unless there is at least one frame and time does not run backwards."""
    if not frames:
        raise InputError("expected at least one decision, got none; widen the time window")
    for before, after in itertools.pairwise(frames):
        if not after.t_s >= before.t_s:
            raise InputError(
                f"expected decisions in time order, got {after.t_s!r} s after {before.t_s!r} s; "
                "sort them"
            )


def verdict_timeline(frames: Sequence[Frame]) -> Figure:
    """Verdict, each policy's verdict, proved clearance and speed of every decision over time.

    frames: the decisions in time order, turns without one among them. Raises InputError when there
    are none.
    """
    require_frames(frames)
    silent: tuple[Key, ...] = ()
    if not all(frame.decided for frame in frames):
        silent = (Key(_NO_DECISION, INK, mark="+"),)
    panel = svg_panel(
        partial(_paint_timeline, frames=frames),
        label="Verdict, clearance and speed over time",
        width_in=4.6,
        height_in=5.4,
    )
    legend = (
        *(
            Key(verdict.value, VERDICT_COLOURS[verdict], mark=VERDICT_MARKS[verdict])
            for verdict in Verdict
        ),
        Key("BRAKE is sent", VERMILLION, mark="."),
        Key("violation or alert", VERMILLION, mark="|"),
        *silent,
    )
    caption = (
        "One mark per decision. Only SAFE permits tracking; UNPROVED does not mean unsafe. "
        "Where no clearance is drawn, none was proved or nobody was there. The clearance is that "
        "of TRACK to where people are expected to go."
    )
    return Figure((panel,), legend, caption, decision_table(frames), wide=True)


def _paint_timeline(canvas: Canvas, *, frames: Sequence[Frame]) -> None:
    verdict_axes, said_axes, clearance_axes, speed_axes = canvas.subplots(
        4, 1, sharex=True, height_ratios=(1.0, 1.1, 1.2, 1.0)
    )
    _paint_said(said_axes, frames)
    for verdict, mark in VERDICT_MARKS.items():
        chosen = [frame for frame in frames if frame.decided and frame.verdict is verdict]
        times = [frame.t_s for frame in chosen]
        clearances = [math.nan if f.clearance_m is None else f.clearance_m for f in chosen]
        style = {"color": VERDICT_COLOURS[verdict], "linestyle": "none", "marker": mark}
        verdict_axes.plot(times, [_LEVELS[verdict]] * len(times), markersize=4, **style)
        clearance_axes.plot(times, clearances, markersize=3.5, **style)
    levels = {level.value: at for level, at in _LEVELS.items()}
    silent = [frame.t_s for frame in frames if not frame.decided]
    if silent:
        levels["none"] = -1.0
        verdict_axes.plot(silent, [-1.0] * len(silent), "+", color=INK, markersize=5)
    verdict_axes.set_yticks(list(levels.values()), list(levels))
    verdict_axes.set_ylim(min(levels.values()) - 0.5, 2.5)
    verdict_axes.set_ylabel("verdict")
    if all(frame.clearance_m is None for frame in frames):
        clearance_axes.set_ylim(0.0, 1.0)
        clearance_axes.text(
            0.5, 0.5, "none proved, or nobody there", transform=clearance_axes.transAxes,
            ha="center", va="center",
        )  # fmt: skip
        clearance_axes.set_yticks([])
    clearance_axes.set_ylabel("proved\nclearance (m)")
    speed_axes.plot(
        [f.t_s for f in frames], [f.speed_mps for f in frames], color=INK, linewidth=1.3
    )
    braking = [f for f in frames if f.sent == "BRAKE"]
    speed_axes.plot(
        [f.t_s for f in braking], [f.speed_mps for f in braking], color=VERMILLION,
        linestyle="none", marker=".", markersize=4,
    )  # fmt: skip
    speed_axes.set_ylim(bottom=0.0)
    speed_axes.set_ylabel("speed (m/s)")
    speed_axes.set_xlabel("time (s)")
    canvas.align_ylabels()


def _paint_said(axes: Axes, frames: Sequence[Frame]) -> None:
    """A line of marks for each policy, one for violations, one for alerts."""
    names = dict.fromkeys(answer.policy for frame in frames for answer in frame.policies)
    lines = ["alert", "violation", *reversed(names)]
    for name, (verdict, mark) in itertools.product(names, VERDICT_MARKS.items()):
        times = [
            f.t_s for f in frames for a in f.policies if (a.policy, a.verdict) == (name, verdict)
        ]
        style = {"color": VERDICT_COLOURS[verdict], "linestyle": "none", "marker": mark}
        axes.plot(times, [lines.index(name)] * len(times), markersize=4, **style)
    for line, named in (
        ("alert", [frame.t_s for frame in frames if frame.alert is not None]),
        ("violation", [frame.t_s for frame in frames if frame.violations]),
    ):
        axes.plot(named, [lines.index(line)] * len(named), "|", color=VERMILLION, markersize=8)
    # A long name must not squeeze the picture to make room for itself.
    axes.set_yticks(range(len(lines)), [line[:_LONGEST_NAME] for line in lines])
    axes.set_ylim(-0.6, len(lines) - 0.4)


def decision_table(frames: Sequence[Frame]) -> Table:
    """The decisions, one row each; evenly spread ones where there are very many."""
    chosen = [frames[index] for index in thinned(len(frames), _TABLE_ROWS)]
    tubes = list(dict.fromkeys(level.tube for frame in frames for level in frame.levels))
    rows: list[list[Cell]] = [
        [
            f.t_s, f.verdict.value if f.decided else _NO_DECISION, f.action, f.sent or None,
            f.clearance_m, f.speed_mps,
            len(f.people), f.reason, *_said(f, tubes), "; ".join(f.violations), f.alert or "",
        ]
        for f in chosen
    ]  # fmt: skip
    headings = [
        "time (s)", "verdict", "action", "sent", "clearance (m)", "speed (m/s)", "people", "reason",
        "each policy", *(f"{tube}: nested sets, the largest first" for tube in tubes),
        "violations", "alert",
    ]  # fmt: skip
    return Table("decisions", headings, rows, folded=True)


def _said(frame: Frame, tubes: Sequence[str]) -> list[Cell]:
    verdicts = {level.tube: level.verdicts for level in frame.levels}
    policies = ", ".join(f"{each.policy} {each.verdict.value}" for each in frame.policies)
    levels = (" ".join(verdict.value for verdict in verdicts.get(tube, ())) for tube in tubes)
    return [policies, *levels]


def summary_table(frames: Sequence[Frame]) -> Table:
    """Counts and shares of verdicts, actions, each policy's verdicts, violations and alerts.

    Turns without a decision do not count. Raises InputError when there are no decisions.
    """
    frames = [frame for frame in frames if frame.decided]
    require_frames(frames)
    total = len(frames)

    def row(what: str, count: int) -> list[Cell]:
        return [what, count, 100.0 * count / total]

    rows: list[list[Cell]] = [row("decisions", total)]
    rows += [
        row(f"verdict {verdict.value}", sum(frame.verdict is verdict for frame in frames))
        for verdict in Verdict
    ]
    rows += [
        row(f"action {action}", sum(frame.action == action for frame in frames))
        for action in sorted({frame.action for frame in frames})
    ]
    said = Counter(
        f"{answer.policy} {answer.verdict.value}" for frame in frames for answer in frame.policies
    )
    violated = Counter(
        name for frame in frames for name in {text.partition(":")[0] for text in frame.violations}
    )
    rows += [row(f"policy {name}", count) for name, count in sorted(said.items())]
    rows += [row(f"sent {name}", sum(frame.sent == name for frame in frames))
             for name in sorted({frame.sent for frame in frames} - {""})]  # fmt: skip
    rows += [row(f"violation {name}", count) for name, count in sorted(violated.items())]
    rows.append(row("alert to a person", sum(frame.alert is not None for frame in frames)))
    return Table("decisions counted", ["what", "count", "share (%)"], rows)
