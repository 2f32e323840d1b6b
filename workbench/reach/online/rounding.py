"""How far floats can be from real numbers in straight-line code, over all inputs in given ranges.

Running error analysis: every value carries a range and a bound of its absolute error. With
u = 2^-53 each operation adds u |result|, and passes its operands' errors on by the mean value
theorem. Source: N. Higham, Accuracy and Stability of Numerical Algorithms, section 3.3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.graph import Node, graph_of
from workbench.reach.online.point_trig import SINE_ERROR, TANGENT_ERROR

Ends = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Lower and upper ends of the entries of one input."""
_UNIT = 2.0**-53
_TINY = 2.0**-1070
# This analysis computes in floats itself; every range and error is widened by far more than that.
_WIDER = 1.0 + 1e-9
_LARGEST_ARGUMENT = 1e4


@final
@dataclass(frozen=True, slots=True)
class Erring:
    """Exact values in [low, high], computed ones at most `error` away."""

    low: float
    high: float
    error: float

    @property
    def size(self) -> float:
        """Largest magnitude of an exact value."""
        return max(abs(self.low), abs(self.high))

    @property
    def least(self) -> float:
        """Smallest magnitude of a computed value."""
        return max(self.low, -self.high, 0.0) - self.error


def rounding_bounds(
    function: ca.Function,
    ranges: Sequence[Ends],
    *,
    sums: Mapping[tuple[int, int], tuple[float, float]],
) -> list[NDArray[np.float64]]:
    """Largest absolute rounding error of each nonzero of each output.

    function: an SX function of + - * /, squares, sin, cos, tan, the last three computed by
    `point_trig`; ranges: for each input the lower and upper ends of its entries, which are exact;
    sums: ranges that the caller knows of every sum with one input entry (input, entry) in it. The
    generated code must do the function's operations one by one (no contraction, no reassociation).
    InputError where the ranges allow a division by 0, a pole or an overflow.
    """
    return _analysed(function, ranges, sums)[0]


def largest_angle(
    function: ca.Function,
    ranges: Sequence[Ends],
    *,
    sums: Mapping[tuple[int, int], tuple[float, float]],
) -> float:
    """Largest magnitude of a computed argument of sin, cos and tan; arguments as above."""
    return _analysed(function, ranges, sums)[1]


def _analysed(
    function: ca.Function,
    ranges: Sequence[Ends],
    sums: Mapping[tuple[int, int], tuple[float, float]],
) -> tuple[list[NDArray[np.float64]], float]:
    graph = graph_of(function)
    values: list[Erring] = []
    angle = 0.0
    for node in graph.nodes:
        if node.element is not None:
            low, high = (ends[node.element[1]] for ends in ranges[node.element[0]])
            value = Erring(float(low), float(high), 0.0)
        elif node.constant is not None:
            # Whole numbers and powers of two are meant; 1/6 stands for what it was folded from.
            exact = (node.constant * 2.0**20).is_integer()
            error = 0.0 if exact else _UNIT * abs(node.constant)
            value = Erring(node.constant, node.constant, error)
        else:
            operands = [values[k] for k in node.operands]
            if node.name in ("sin", "cos", "tan"):
                angle = max(angle, operands[0].size + operands[0].error)
            value = _operated(node, operands)
            elements = [graph.nodes[k].element for k in node.operands]
            bounds = [sums[e] for e in elements if e is not None and e in sums]
            bounds = bounds if node.name == "add" else []
            for low, high in bounds:
                value = Erring(max(value.low, low), min(value.high, high), value.error)
        if not math.isfinite(value.size + value.error):
            raise InputError(
                f"{function.name()}: {node.name} can overflow in the operating region; narrow it"
            )
        values.append(value)
    return [np.array([values[k].error for k in row]) for row in graph.outputs], angle


def _operated(node: Node, operands: list[Erring]) -> Erring:
    if node.name not in _RULES:
        raise InputError(f"the rounding of {node.name} is not known; use + - * / sin cos tan")
    value, exact = _RULES[node.name](*operands)
    rounding = 0.0 if exact else _UNIT * (value.size + value.error) + _TINY
    low = value.low - 1e-12 * abs(value.low) - 1e-300
    high = value.high + 1e-12 * abs(value.high) + 1e-300
    return Erring(low, high, (value.error + rounding) * _WIDER)


def _add(a: Erring, b: Erring) -> tuple[Erring, bool]:
    return Erring(a.low + b.low, a.high + b.high, a.error + b.error), False


def _sub(a: Erring, b: Erring) -> tuple[Erring, bool]:
    return Erring(a.low - b.high, a.high - b.low, a.error + b.error), False


def _mul(a: Erring, b: Erring) -> tuple[Erring, bool]:
    ends = [x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    error = a.size * b.error + b.size * a.error + a.error * b.error
    return Erring(min(ends), max(ends), error), False


def _square(a: Erring) -> tuple[Erring, bool]:
    product, _ = _mul(a, a)
    low = 0.0 if a.low <= 0.0 <= a.high else min(a.low**2, a.high**2)
    return Erring(low, max(a.low**2, a.high**2), product.error), False


def _div(a: Erring, b: Erring) -> tuple[Erring, bool]:
    if not b.least > 0.0:
        raise InputError(
            f"a denominator ranges over [{b.low:g}, {b.high:g}] in the operating region; narrow it"
        )
    ends = [x / y for x in (a.low, a.high) for y in (b.low, b.high)]
    quotient = max(abs(end) for end in ends)
    return Erring(min(ends), max(ends), (a.error + quotient * b.error) / b.least), False


def _sine(a: Erring) -> tuple[Erring, bool]:
    _require_argument(a)
    rising = a.size < 1.57
    low, high = (math.sin(a.low), math.sin(a.high)) if rising else (-1.0, 1.0)
    return Erring(low, high, a.error + SINE_ERROR), True


def _cosine(a: Erring) -> tuple[Erring, bool]:
    _require_argument(a)
    low = math.cos(a.size) if a.size < 1.57 else -1.0
    high = max(math.cos(a.low), math.cos(a.high)) if a.low * a.high > 0.0 and low > 0 else 1.0
    return Erring(low, high, a.error + SINE_ERROR), True


def _tangent(a: Erring) -> tuple[Erring, bool]:
    _require_argument(a)
    widest = a.size + a.error
    if not widest < 1.55:
        raise InputError(f"tan of up to {widest:g} rad in the operating region; narrow the region")
    slope = 1.0 + math.tan(widest) ** 2
    error = slope * a.error + TANGENT_ERROR * (1.0 + math.tan(widest)) / math.cos(widest)
    return Erring(math.tan(a.low), math.tan(a.high), error), True


def _least(a: Erring) -> float:
    return max(a.low, -a.high, 0.0)


def _require_argument(a: Erring) -> None:
    if not a.size + a.error <= _LARGEST_ARGUMENT:
        raise InputError(
            f"an angle of up to {a.size:g} rad in the operating region; the kernel's trigonometry "
            f"ends at {_LARGEST_ARGUMENT:g}"
        )


_RULES: dict[str, Callable[..., tuple[Erring, bool]]] = {
    "add": _add, "sub": _sub, "mul": _mul, "div": _div, "sq": _square,
    "inv": lambda a: _div(Erring(1.0, 1.0, 0.0), a),
    "neg": lambda a: (Erring(-a.high, -a.low, a.error), True),
    "twice": lambda a: (Erring(2 * a.low, 2 * a.high, 2 * a.error), True),
    "fabs": lambda a: (Erring(_least(a), a.size, a.error), True),
    "sin": _sine, "cos": _cosine, "tan": _tangent,
}  # fmt: skip
