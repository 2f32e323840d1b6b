"""Strict reading of a file, and its model as a graph that is differentiated here."""

import itertools
import json
import math
import operator
import re
from collections.abc import Callable, Sequence
from typing import Any

from workbench.checker.arithmetic import ZERO, Interval, UnprovedError

UNKNOWN = Interval(math.nan)  # every operation but the product with 0, or `inside`, refuses it
_WORDS = {str: "text", float: "a number", int: "an index", Interval: "two numbers"}
_BINARY: dict[str, Callable[[Interval, Interval], Interval]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "fmin": lambda a, b: Interval(min(a.low, b.low), min(a.high, b.high)),
    "fmax": lambda a, b: Interval(max(a.low, b.low), max(a.high, b.high)),
}  # fmt: skip
_SLOPES: dict[str, Callable[[Interval, Interval], Interval]] = {  # phi'(a), from a and phi(a)
    "sin": lambda a, _g: a.function("cos"), "cos": lambda a, _g: -a.function("sin"),
    "tan": lambda _a, g: Interval(1) + g**2, "exp": lambda _a, g: g,
    "log": lambda a, _g: Interval(1) / a, "sqrt": lambda _a, g: Interval(0.5) / g,
    "atan": lambda a, _g: Interval(1) / (Interval(1) + a**2),
}  # fmt: skip


def expect(holds: bool, sentence: str) -> None:
    """Refuse the file as no certificate, with this sentence, unless the condition holds."""
    if not holds:
        raise ValueError(sentence)


def parse(data: bytes) -> Any:
    """The JSON value of a file; size and nesting are limited before the recursive parser runs."""
    expect(len(data) <= 2**24, "the file is larger than 16 MiB")
    outside_strings = data.replace(b"\\\\", b"").replace(b'\\"', b"").split(b'"')[::2]
    marks = re.findall(rb"[\[\]{}]", b"".join(outside_strings))
    depths = itertools.accumulate(1 if mark in b"[{" else -1 for mark in marks)
    expect(max(depths, default=0) <= 8, "the file nests deeper than 8 levels")
    return json.loads(data.decode(), object_pairs_hook=_distinct, parse_int=float)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    expect(len({key for key, _ in pairs}) == len(pairs), "a key occurs twice in one object")
    return dict(pairs)


def read(value: Any, form: Any, where: str) -> Any:
    """`value` by its form: object (any), str, int (0 .. 2^30), float (a point), Interval (a pair,
    null for UNKNOWN), [form, count], {key: form} or {"?": form} for a form or null; a count of None
    means any. Recursion follows the form. A JSON number stands for the double nearest to it."""
    if form is object or (form is str and isinstance(value, str)):
        return value
    if form in (float, int) and isinstance(value, float) and math.isfinite(value):
        expect(form is float or int(value) % 2**30 == value, f"{where}: expected an index")
        return Interval(value) if form is float else int(value)
    if form is Interval and value is not None:
        low, high = (end.low for end in read(value, [float, 2], where))
        expect(low <= high, f"{where}: expected lower <= upper")
        return Interval(low, high)
    if isinstance(form, list) and isinstance(value, list) and form[1] in (None, len(value)):
        return [read(item, form[0], f"{where}[{i}]") for i, item in enumerate(value)]
    if value is None and (form is Interval or (isinstance(form, dict) and "?" in form)):
        return UNKNOWN if form is Interval else None
    form = form["?"] if isinstance(form, dict) and "?" in form else form
    if isinstance(form, dict) and isinstance(value, dict) and set(value) == set(form):
        return {key: read(value[key], form[key], f"{where}.{key}") for key in form}
    keys = isinstance(form, dict) and f"an object of {', '.join(form)}"
    items = isinstance(form, list) and f"a list of {form[1] or 'items'}"
    raise ValueError(f"{where}: expected {keys or items or _WORDS[form]}, got {value!r:.60}")


class Graph:
    """x' = field(x, u): first n states and m inputs, then nodes (operation, operand, operand)."""

    def __init__(self, nodes: Any, field: Any, n: int, m: int) -> None:
        self.n, self.m, self.field = n, m, read(field, [int, n], "model.field")
        self.units = [[Interval(i == j) for i in range(n + m)] for j in range(n + m)]
        self.nodes: list[tuple[str, int, Any]] = [("variable", k, 0) for k in range(n + m)]
        for i, item in enumerate(nodes):
            where = f"model.nodes[{i}]"
            name, *rest = read(item, [object, None], where)
            if read(name, str, where) == "constant":
                self.nodes.append((name, 0, read(rest, [float, 1], where)[0]))
                continue
            a, b = (*read(rest, [int, len(rest)], where), 0)[:2]
            count = 1 if name in _SLOPES else 2 * (name in _BINARY or name == "pow")
            expect(len(rest) == count > 0, f"{where}: no operation {name!r:.40} of {len(rest)}")
            expect(name != "pow" or 2 <= b <= 32, f"{where}: expected a power from 2 to 32")
            expect(max(a, b * (name != "pow")) < len(self.nodes), f"{where}: no earlier node")
            self.nodes.append((name, a, b))
        self.cost = sum({"pow": 120}.get(k, 300 if k in _SLOPES else 4) for k, _, _ in self.nodes)

    def values(self, variables: Sequence[Interval]) -> list[Interval]:
        """A bound of every node where states and inputs have these bounds."""
        values = list(variables)
        for name, a, b in self.nodes[len(values) :]:
            try:
                x = b if name == "constant" else values[a].inside()
                if name in _BINARY:
                    x = _BINARY[name](x, values[b].inside())
                elif name != "constant":
                    x = x**b if name == "pow" else x.function(name)
            except UnprovedError:
                x = UNKNOWN
            values.append(x)
        return values

    def rates(self, variables: Sequence[Interval]) -> list[Interval]:
        """Bounds of the field."""
        values = self.values(variables)
        return [values[k].inside() for k in self.field]

    def tangent(self, values: Sequence[Interval], change: Sequence[Interval]) -> list[Interval]:
        """The field's derivative along a change of its variables, from the values of the nodes.

        An undecided minimum takes every slope between its operands': along a line or a trajectory
        its derivative is almost everywhere one of them."""
        moved = list(change)
        for k, (name, a, b) in enumerate(self.nodes[len(change) :], len(change)):
            da, db = moved[a] if name != "constant" else ZERO, moved[b] if name in _BINARY else ZERO
            x, y, g = values[a], values[b if name in _BINARY else a], values[k]
            if not (da or db):
                change_k = ZERO
            elif name in ("add", "sub"):
                change_k = _BINARY[name](da, db)
            elif name == "mul":
                change_k = da * y + db * x
            elif name == "div":
                change_k = (da - db * g) / y
            elif name in ("fmin", "fmax"):
                first, second = (x, y) if name == "fmin" else (y, x)  # fmax is a where b <= a
                only_a, only_b = first.high <= second.low, second.high <= first.low
                change_k = da if only_a else db if only_b else da.hull(db)
            elif name == "pow":
                change_k = Interval(b) * x.inside() ** (b - 1) * da
            else:
                change_k = _SLOPES[name](x.inside(), g.inside()) * da
            moved.append(change_k)
        return [moved[k] for k in self.field]
