"""Claim: trouble anywhere in an inclusion function ends in valid = 0, misuse in an InputError."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from inclusion_models import lifted, planar_field

from workbench.errors import InputError
from workbench.sensitivity.inclusion import inclusion, lift
from workbench.sensitivity.intervals import SymbolicInterval
from workbench.sensitivity.validity import Validity

BROKEN: list[tuple[Callable[..., ca.SX], list[tuple[float, float]]]] = [
    (lambda a, b: a / b, [(1.0, 2.0), (-1.0, 1.0)]),
    (lambda a, b: a / b, [(1.0, 2.0), (0.0, 1.0)]),
    (lambda a, b: a / b, [(0.0, 0.0), (0.0, 0.0)]),
    (lambda a, b: ca.fmin(a / b, 3), [(1.0, 2.0), (-1.0, 0.0)]),
    (lambda a, b: ca.fmin(a * b, 3), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.fmax(a - b * b, 3), [(1.0, 1.0), (1e200, 1e200)]),
    (lambda a, b: 1 / (a * b), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.fmin(a * b - a * b * 2, 3), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: a * b < 1, [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.if_else(a < 2, b, b / (a - 1)), [(1.0, 1.0), (1.0, 1.0)]),
    (lambda a, b: ca.sqrt(a) + b, [(-1e-300, 1.0), (0.0, 1.0)]),
    (lambda a, b: ca.fmin(ca.sqrt(a), b), [(-1.0, 1.0), (0.0, 1.0)]),
    (lambda a, b: ca.fmax(ca.sin(a * b), 0), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.atan(a * b), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.fabs(a + b), [(1.7e308, 1.7e308), (1.7e308, 1.7e308)]),
    (ca.atan2, [(0.0, 0.0), (0.0, 0.0)]),
    (ca.atan2, [(0.0, 0.0), (-2.0, -1.0)]),
    (ca.atan2, [(-1.0, 0.0), (-1.0, 2.0)]),
    (ca.atan2, [(0.0, 1.0), (0.0, 2.0)]),
    (lambda a, b: ca.atan2(a * b, b), [(1e200, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.fmax(ca.atan2(1 / a, b), 0), [(0.0, 1.0), (1.0, 1.0)]),
    (lambda a, b: ca.atan2(a * b, b), [(1.0, 1e200), (1e200, 1e200)]),
    (lambda a, b: ca.atan2(b, -a * b), [(1.0, 1e200), (1e200, 1e200)]),
    (lambda a, b: a**b, [(0.0, 1.0), (1.0, 2.0)]),
    (lambda a, b: a**b, [(2.0, 2.0), (500.0, 500.0)]),
    (lambda a, b: a**0.3 + b, [(-1e-300, 1.0), (0.0, 1.0)]),
    (lambda a, b: a**2.5 + b, [(-1e-300, 1.0), (0.0, 1.0)]),
    (lambda a, b: a**-0.3 + b, [(0.0, 1.0), (0.0, 1.0)]),
    (lambda a, b: a**-2.5 + b, [(0.0, 1.0), (0.0, 1.0)]),
    (lambda a, b: ca.fmin((a * b) ** 0.3, 3), [(1e200, 1e200), (1e200, 1e200)]),
]


@pytest.mark.parametrize("case", range(len(BROKEN)))
def test_trouble_inside_ends_in_valid_zero(case: int) -> None:
    operation, ends = BROKEN[case]
    assert float(lifted(operation, 2)(*itertools.chain(*ends))[-1]) == 0.0


OPERATIONS: dict[str, Callable[[ca.SX], ca.SX]] = {
    "clip": lambda x: ca.fmin(ca.fmax(x, -1), 1),
    "square": lambda x: x * x,
    "power": lambda x: ca.SX.binary(ca.OP_CONSTPOW, x, 4),
    "absolute": ca.fabs,
    "branch": lambda x: ca.if_else(x < 0, 1, 2),
    "constant": lambda x: 0 * x + 3,
    "unused": lambda x: ca.SX(2),
    "not": ca.logic_not,
    **{name: getattr(ca, name) for name in ("sin", "cos", "tan", "atan", "exp", "tanh", "cosh")},
    "asin": lambda x: ca.asin(ca.fmin(ca.fmax(x, -1), 1)),
    "acos": lambda x: ca.acos(ca.fmin(ca.fmax(x, -1), 1)),
    "log": lambda x: ca.log(ca.fmax(x, 1)),
    "inverse": lambda x: 1 / ca.fmax(x, 1),
    "sqrt": lambda x: ca.sqrt(ca.fmax(x, 0)),
    "angle": lambda x: ca.atan2(x, 2),
    "angle of a base": lambda x: ca.atan2(2, x),
    "root power": lambda x: ca.fmax(x, 1) ** 2.5,
    "real power": lambda x: ca.fmax(x, 1) ** 0.3,
    "real power of the input": lambda x: x**0.3,
    "exponent": lambda x: 2**x,
}


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", OPERATIONS)
def test_a_bad_end_point_is_never_forgotten(name: str, bad: float) -> None:
    function = lifted(OPERATIONS[name], 1)
    assert float(function(0.25, 0.5)[-1]) == 1.0
    for ends in ((bad, 0.5), (0.25, bad), (bad, bad), (0.5, 0.25)):
        assert float(function(*ends)[-1]) == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_bad_end_point_anywhere_in_a_model_is_never_forgotten(bad: float) -> None:
    x, field = planar_field()
    function = inclusion(ca.Function("f", [x], [field, ca.jacobian(field, x)]))
    low, high = np.full(7, -0.1), np.full(7, 0.1)
    assert float(function(low, high)[-1]) == 1.0
    for which, position in itertools.product((0, 1), range(7)):
        ends = [low.copy(), high.copy()]
        ends[which][position] = bad
        assert float(function(*ends)[-1]) == 0.0


@pytest.mark.parametrize(
    ("name", "operation"),
    [
        ("erf", ca.erf),
        ("floor", ca.floor),
        ("sign", ca.sign),
        ("ceil", ca.ceil),
        ("hypot", lambda x: ca.hypot(x, 2)),
        ("fmod", lambda x: ca.fmod(x, 2)),
        ("copysign", lambda x: ca.copysign(x, 2)),
        ("asinh", ca.asinh),
        ("log1p", ca.log1p),
    ],
)
def test_operations_without_a_rule_are_refused_by_name(name: str, operation) -> None:
    with pytest.raises(InputError, match=f"'{name}'"):
        lifted(operation, 1)


def test_other_misuse_is_refused() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y", 2)
    m = ca.MX.sym("m")
    with pytest.raises(InputError, match="SX"):
        inclusion(ca.Function("f", [m], [m]))
    with pytest.raises(InputError, match="y_0"):
        lift([x + y[0]], [x], [ca.SX(0)], [ca.SX(1)])
    with pytest.raises(InputError, match="shape"):
        lift([x], [x], [y], [ca.SX(1)])
    with pytest.raises(InputError, match="one lower and one upper"):
        lift([x], [x], [], [ca.SX(1)])
    with pytest.raises(InputError, match="common Validity"):
        SymbolicInterval.between(0, 1, Validity()) + SymbolicInterval.between(0, 1, Validity())
    with pytest.raises(InputError, match="exponent"):
        SymbolicInterval.between(0, 1, Validity()).power(1001)
