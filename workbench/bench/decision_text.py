"""The board of the whole decision as plain text tables, every column with its unit."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.bench.decision_board import DecisionBoard
from workbench.bench.decision_growth import Growth
from workbench.bench.decision_latency import LIMIT_US, Latency
from workbench.bench.decision_methods import COUNTED, MethodCost
from workbench.bench.decision_scenes import PEOPLE, TUBES_PER_PERSON
from workbench.bench.text import table
from workbench.runtime.layout import TUBES

_NOTHING = "-"
# Up to here a fitted exponent counts as growth in proportion.
_LINEAR = 1.05


def decision_text(board: DecisionBoard) -> str:
    """All tables."""
    parts = [
        _latencies(board), _sweep(board), _methods(board.methods), _telling(board), _bound(board),
        _people(board), *(_growth(growth) for growth in board.growth), _memory(board),
        _agreement(board),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part)


def summary_text(board: DecisionBoard) -> str:
    """Disagreements and overspent budgets, in one line."""
    return (
        f"whole decision: {board.disagreements} disagreements, {board.overspent} budgets exceeded"
    )


_COLUMNS = [
    "kernel, form", "budget", "calls", "median us", "p99.9 us", "max us", "quicker of two",
    "both policies SAFE", *(f"{tube} SAFE" for tube in TUBES),
]  # fmt: skip
_STEPS = ["steps, median", "max"]


def _latencies(board: DecisionBoard) -> str:
    sizes, usual = board.sizes, board.latencies[0]
    title = (
        f"whole decision: {sizes['levels']:g} nested sets, three tubes (track, stop: TRACK then "
        f"BRAKE, brake) of {sizes['horizon_s']:g} s in rows of {sizes['step_s']:g} s, "
        f"{PEOPLE} people with {TUBES_PER_PERSON} tubes each; tubes: {usual.method}, where nothing "
        "else is said; random scenes; quicker of two: median, p99.9 and max when each scene is "
        "decided twice and the quicker call counts"
    )
    rows = [[*_cells(row), str(row.spent_median), str(row.spent_max)] for row in board.latencies]
    found = table([*_COLUMNS, *_STEPS], rows)
    alike = sum(row.method == usual.method for row in board.latencies)
    if alike == 1 and usual.p999_us > LIMIT_US:
        found += f"\nno budget of those below keeps p99.9 below {LIMIT_US:g} us"
    return f"{title}\n{found}"


def _cells(row: Latency) -> list[str]:
    return [
        row.method, str(row.budget), str(row.calls), f"{row.median_us:.0f}", f"{row.p999_us:.0f}",
        f"{row.max_us:.0f}", " / ".join(f"{value:.0f}" for value in row.quickest_us),
        f"{row.proved:.1%}", *(f"{row.by_tube[tube]:.1%}" for tube in TUBES),
    ]  # fmt: skip


def _kept(row: Latency) -> str:
    return _NOTHING if row.kept is None else f"{row.kept:.1%}"


def _sweep(board: DecisionBoard) -> str:
    rows = [[*_cells(row), _kept(row)] for row in board.sweep]
    title = (
        "budget against what stays proved, the same scenes for all; kept: of the decisions that "
        "the default budget proves for both policies"
    )
    return f"{title}\n{table([*_COLUMNS, 'kept'], rows)}"


def _methods(methods: Sequence[MethodCost]) -> str:
    least = methods[0]
    rows = [
        [
            *_cells(each.latency), _kept(each.latency), str(each.latency.spent_median),
            str(each.latency.spent_max), _number(each.instructions), _number(each.code),
            _number(each.static), f"{each.times(least):.2f}",
            _number(each.times_instructions(least), ".2f"),
        ]
        for each in methods
    ]  # fmt: skip
    headings = [
        *_COLUMNS, "kept", *_STEPS, "instructions", "code", "static", "time", "instructions",
    ]  # fmt: skip
    title = (
        "every kernel in every form, the scenes of the budgets above; kept: of the decisions that "
        f"{least.latency.method} proves; instructions: mean over the first {COUNTED} scenes; code, "
        f"static: bytes; last: median time (quicker of two) and instructions over those of "
        f"{least.latency.method}"
    )
    return f"{title}\n{table(headings, rows)}"


def _telling(board: DecisionBoard) -> str:
    rows = [
        [
            row.scene, str(row.spent), f"{row.us:.0f}", _number(row.instructions),
            *(f"{'SAFE' if row.safe[tube] else 'UNPROVED'} ({row.cells[tube]})" for tube in TUBES),
        ]
        for row in board.telling
    ]  # fmt: skip
    title = "telling scenes, then hostile ones; in brackets: cells of the tube that is reported"
    return f"{title}\n{table(['scene', 'steps', 'us', 'instructions', *TUBES], rows)}"


def _number(value: float | None, format_spec: str = ".0f") -> str:
    return _NOTHING if value is None else format(value, format_spec)


def _bound(board: DecisionBoard) -> str:
    bound = board.bound
    if bound is None:
        return "instructions are not bounded here, valgrind is missing"
    limits = bound.limits
    rows = [
        [
            part.scene, str(part.total), str(part.attempts), f"{part.per_attempt:.0f}",
            str(part.compared), f"{part.rows / max(1, part.compared):.0f}", str(part.boxes),
            str(part.rest),
        ]
        for part in bound.scenes
    ]  # fmt: skip
    headings = [
        "scene", "instructions", "steps", "per step", "rows", "per row", "boxes", "all else",
    ]  # fmt: skip
    title = (
        "where the instructions go (parts compiled apart from their callers)\n"
        f"by construction: at most {limits.steps} attempted steps, {limits.runs} tubes begun, "
        f"{limits.rows} rows compared, {limits.boxes} times boxes, whatever the query\n"
        f"measured: {bound.step:.0f} instructions per attempted step in the dearest of "
        f"{bound.steps_seen} rows; {bound.rest} in all else of the dearest scene"
    )
    return f"{title}\n{table(headings, rows)}"


def _people(board: DecisionBoard) -> str:
    if board.bound is None:
        return ""
    rows = [
        [
            str(each.people), str(each.tubes), str(each.pieces), str(each.row), str(each.boxes),
            f"{each.bound / 1e6:.0f}", f"{each.largest / 1e6:.0f}",
        ]
        for each in board.bound.people
    ]  # fmt: skip
    headings = [
        "people", "tubes each", "pieces at once", "dearest row", "boxes", "bound, millions",
        "largest seen, millions",
    ]  # fmt: skip
    title = (
        "bound of the instructions, nobody ever skipped: (steps + tubes begun) x dearest step + "
        "rows x dearest row + 3 x boxes + all else; the counts of times hold by construction, the "
        "costs are the largest measured"
    )
    return f"{title}\n{table(headings, rows)}"


def _growth(growth: Growth) -> str:
    rows = [
        [f"{point.value:g}", str(point.spent), f"{point.us:.0f}", _number(point.instructions)]
        for point in growth.points
    ]
    title = f"growth with {growth.over}: {growth_claim(growth)}"
    return f"{title}\n{table([growth.over, 'steps', 'us', 'instructions'], rows)}"


def growth_claim(growth: Growth) -> str:
    """The log-log slopes, and whether they are those of linear growth or better."""
    worst = max(growth.slope, growth.slope_at_end)
    verdict = "linear or better" if worst <= _LINEAR else "more than linear"
    return (
        f"log-log slope {growth.slope:.2f}, between the last two {growth.slope_at_end:.2f} "
        f"({verdict})"
    )


def _memory(board: DecisionBoard) -> str:
    m = board.memory
    values = [
        m.code, m.tables, m.static, m.stack_bound, m.stack_touched, m.query, m.result, m.work,
        m.header,
    ]  # fmt: skip
    headings = [
        "code", "tables", "static", "stack, bound", "stack, touched", "query", "result", "work",
        "header",
    ]  # fmt: skip
    return f"bytes of the decision\n{table(headings, [[_number(value) for value in values]])}"


def _agreement(board: DecisionBoard) -> str:
    rows = [
        [
            f.method,
            str(f.budget),
            str(f.inputs),
            str(f.differing),
            str(f.safe),
            str(f.unproved),
            str(f.invalid),
        ]
        for f in board.agreement
    ]
    headings = [
        "kernel, form", "budget", "inputs", "differing", "both SAFE", "UNPROVED", "INVALID",
    ]  # fmt: skip
    return f"random inputs with other bits at -O2 than at -O0\n{table(headings, rows)}"
