"""Faults to plant in the online kernel: in its C text by pattern, in its Functions by output."""

from __future__ import annotations

import re
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class TextFault:
    """`pattern` becomes `replacement` (regular expressions, every place; at least one).

    The case and form in which the fault lets a run escape.
    """

    pattern: str
    replacement: str
    case: str
    quadratic: bool

    def plant(self, source: str) -> str:
        planted, count = re.subn(self.pattern, self.replacement, source)
        if not count:
            raise LookupError(f"the kernel has no {self.pattern!r} any more; adapt the table")
        return planted


# What a statement assigns, whatever it is computed from.
def _assigned(target: str) -> str:
    return rf"({re.escape(target)} =)[^;]*;"


TEXT_FAULTS = {
    "sources at the start": TextFault(
        _assigned("m->from_start[i]"), r"\1 0.0;", "riccati", False),
    "sources at the end": TextFault(_assigned("m->from_end[i]"), r"\1 0.0;", "riccati", False),
    "small terms and jump": TextFault(_assigned("m->added[i]"), r"\1 0.0;", "turning", False),
    "chord between instants": TextFault(_assigned("s->chord[i]"), r"\1 0.0;", "turning", False),
    "gap of a line": TextFault(r"= s->gap\[j\];", "= 0.0;", "saturated", False),
    "guess not verified": TextFault(
        r"if \(bad == 0\.0\) return WB_COMPLETE;", "return WB_COMPLETE;", "riccati", False),
    "bounds of an older premise": TextFault(
        r"wb_missing\(need, have\) == 0\.0", "1", "turning", False),
    "box at the start": TextFault(
        r"s->now->pending\[i\] \+ m->from_start\[i\]", "m->from_start[i]", "pendulum", False),
    "columns of the start": TextFault(
        r"WB_MS, s->now->columns, t->spread", "WB_MS, WB_MS, t->spread", "pendulum", False),
    "source of the quadratic term at the end": TextFault(
        r"half \* b1\[(\d+) \+ k\]", r"0.0 * b1[\1 + k]", "riccati", True),
    "source of the quadratic term at the start": TextFault(
        r"half \* b0\[(\d+) \+ k\]", r"0.0 * b0[\1 + k]", "riccati", True),
    "slope of the source, sign": TextFault(
        r"- twelfth \* c1\[", "+ twelfth * c1[", "swinging", True),
    "slope of the source at the start": TextFault(
        r"twelfth \* c0\[", "0.0 * c0[", "swinging", True),
    "squares": TextFault(r"above \+= [^;]*;", "above += 0.0;", "triangular", True),
    "pairs": TextFault(r"total \+= [^;]*;", "total += 0.0;", "pendulum", True),
    "inputs at the start": TextFault(
        r"(m->inputs\[0\]\[k\]) \* radius", r"\1 * 0.0", "saturated", False),
    "inputs at the end": TextFault(
        r"(m->inputs\[1\]\[k\]) \* radius", r"\1 * 0.0", "saturated", False),
    "radius of a disturbance": TextFault(
        r"s->w_rad\[i\] = radius;", "s->w_rad[i] = 0.0;", "pendulum", False),
    "last, shorter step": TextFault(
        r": horizon - k \* step;", ": 0.5 * step;", "fabs", False),
}  # fmt: skip

UNSEEN = (
    "jumps between instants: the hull of two instants already covers every switch of these loops",
    "ranges of drivers (their verification, and what they gain between instants): the guess before "
    "it carries more room than a driver moves beyond it",
    "roundings of the loop's own sums: bits below the budget of the Functions",
)
"""Terms whose loss lets no run of ours escape; where they are Functions' outputs, the laws of
test_online_parts hold them against exact quantities instead."""


def without(function: ca.Function, output: str) -> ca.Function:
    """`function` with one output 0."""
    symbols = [ca.SX.sym(function.name_in(i), function.size_in(i)) for i in range(function.n_in())]
    values = list(function.call(symbols))
    place = function.name_out().index(output)
    values[place] = ca.SX(values[place].sparsity(), ca.SX.zeros(values[place].nnz()))
    return ca.Function(function.name(), symbols, values, function.name_in(), function.name_out())


def negated(function: ca.Function, output: str) -> ca.Function:
    """`function` with the sign of one output changed."""
    symbols = [ca.SX.sym(function.name_in(i), function.size_in(i)) for i in range(function.n_in())]
    values = list(function.call(symbols))
    place = function.name_out().index(output)
    values[place] = -values[place]
    return ca.Function(function.name(), symbols, values, function.name_in(), function.name_out())
