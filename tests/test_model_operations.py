"""Claim: a model with an operation that nothing proves is refused by name when it is made."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import casadi as ca
import pytest
from inclusion_models import lifted

from workbench.errors import InputError
from workbench.models import Ode, system_from_casadi
from workbench.models.operations import BRANCHES, KINKS, SMOOTH
from workbench.models.signals import Signal
from workbench.sensitivity.kinks import smooth_form

REFUSED: dict[str, Callable[[ca.SX], ca.SX]] = {
    **{
        name: getattr(ca, name)
        for name in ("floor", "ceil", "sign", "erf", "asinh", "acosh", "atanh", "log1p", "expm1")
    },
    "hypot": lambda x: ca.hypot(x, 2),
    "fmod": lambda x: ca.fmod(x, 2),
    "remainder": lambda x: ca.remainder(x, 2),
    "copysign": lambda x: ca.copysign(x, x - 1),
    "eq": lambda x: ca.eq(x, 1),
    "ne": lambda x: ca.ne(x, 1),
}
SUPPORTED: dict[str, Callable[[ca.SX], ca.SX]] = {
    **{
        name: getattr(ca, name)
        for name in ("sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "exp", "fabs")
    },
    "arithmetic": lambda x: 2 * x - x / 3 + 1 / (1 + x**2),
    "asin": lambda x: ca.asin(ca.sin(x)),
    "acos": lambda x: ca.acos(ca.cos(x)),
    "atan2": lambda x: ca.atan2(x, 2),
    "log": lambda x: ca.log(1 + x**2),
    "sqrt": lambda x: ca.sqrt(1 + x**2),
    "powers": lambda x: x**-3 + x**200 + (1 + x**2) ** 2.5 + (2 + x) ** x + 2**x,
    "minimum": lambda x: ca.fmin(x, ca.fmax(-x, 3)),
}


def of(expression: ca.SX, x: ca.SX, output: ca.SX | None = None) -> Ode:
    empty = ca.SX(0, 1)
    outputs = () if output is None else (("command", output),)
    return Ode("loop", (Signal("x", ""),), (), (), x, empty, empty, expression, outputs)


@pytest.mark.parametrize("name", REFUSED)
def test_an_unsupported_operation_is_named_with_those_supported(name: str) -> None:
    x = ca.SX.sym("x")
    bad = REFUSED[name](x)
    with pytest.raises(InputError, match=f"'{name}' has no proved bounds; supported are .*atan2"):
        system_from_casadi(x, -x + bad, ("x",))
    with pytest.raises(InputError, match=f"loop: the output 'command': .*'{name}'"):
        of(-x, x, output=bad)


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_constant_that_is_not_finite_is_named(value: float) -> None:
    x = ca.SX.sym("x")
    bad = x + ca.SX(value)
    with pytest.raises(InputError, match=f"finite constants, got {value}"):
        system_from_casadi(x, bad, ("x",))
    with pytest.raises(InputError, match="output 'command': expected finite constants"):
        of(x, x, output=bad)


@pytest.mark.parametrize("name", SUPPORTED)
def test_a_supported_operation_passes_and_is_differentiated(name: str) -> None:
    x = ca.SX.sym("x")
    form = smooth_form(of(SUPPORTED[name](x), x))
    assert form.field.numel() == 1


def test_an_output_may_jump_because_it_is_not_integrated() -> None:
    x = ca.SX.sym("x")
    assert of(-x, x, output=ca.if_else(x > 0, 1, -1)).outputs


def test_every_supported_operation_has_an_interval_rule() -> None:
    for name in SMOOTH | KINKS | BRANCHES:
        operation = getattr(ca, f"OP_{name.upper()}")
        if operation in (ca.OP_NEG, ca.OP_INV, ca.OP_SQ, ca.OP_TWICE, ca.OP_NOT, ca.OP_FABS) or (
            hasattr(ca, name) and name not in ("atan2", "fmin", "fmax")
        ):
            assert lifted(lambda x, k=operation: ca.SX.unary(k, x), 1)
        else:
            assert lifted(lambda x, y, k=operation: ca.SX.binary(k, x, y), 2)


def test_calls_and_other_symbols_are_refused() -> None:
    x, m = ca.SX.sym("x"), ca.MX.sym("m")
    pair = ca.Function("pair", [x], [ca.sin(x), ca.cos(x)], {"never_inline": True})
    first, second = pair(x)
    with pytest.raises(InputError, match="never_inline"):
        system_from_casadi(x, first + second, ("x",))
    with pytest.raises(InputError, match="expected SX symbols and an SX field, got MX and MX"):
        system_from_casadi(m, -m, ("m",))


def test_deep_graphs_and_nested_branches_are_decided_in_bounded_time() -> None:
    """What many share is looked at once; a search for a proof is given up."""
    x = ca.SX.sym("x")
    deep = nested = x
    for _ in range(24):
        deep = ca.sin(deep) + ca.cos(deep)
    for _ in range(4):
        nested = ca.if_else(nested < 1, nested, 0.5 * nested + 0.5)
    start = time.monotonic()
    for field in (ca.if_else(x < 1, deep * x, deep), nested):
        assert system_from_casadi(x, field, ("x",)).branchless_field() is not None
    assert time.monotonic() - start < 60.0
