"""Every rule of the balls keeps the exact value inside, and a rule that forgets a term does not."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_truth import BITS, inside

from workbench.errors import InputError
from workbench.reach.online import balls
from workbench.reach.online.balls import Ball, Balls
from workbench.sensitivity.validity import verbatim

Program = Callable[[Any, list[Any]], Any]


class Exact:
    """The same rules on numbers of 2000 bits."""

    def constant(self, value: float) -> Any:
        return flint.arb(value)

    def add(self, left: Any, right: Any) -> Any:
        return left + right

    def sub(self, left: Any, right: Any) -> Any:
        return left - right

    def mul(self, left: Any, right: Any) -> Any:
        return left * right

    def neg(self, value: Any) -> Any:
        return -value

    def times(self, value: Any, factor: int) -> Any:
        return value * factor

    def over(self, value: Any, divisor: int) -> Any:
        return value / divisor

    def inverse(self, value: Any) -> Any:
        return 1 / value

    def function(self, name: str, value: Any) -> Any:
        return abs(value) if name == "fabs" else getattr(value, name)()


@pytest.fixture(scope="module", autouse=True)
def digits() -> Iterator[None]:
    with flint.ctx.workprec(BITS):
        yield


def run(program: Program, count: int, *, principal: bool = False) -> ca.Function:
    """inputs -> value, radius, ok."""
    symbols = ca.SX.sym("s", count)
    with verbatim():
        algebra = Balls(principal=principal)
        found: Ball = program(algebra, [algebra.known(s) for s in ca.vertsplit(symbols)])
        ok = ca.fabs(found.value) + found.radius() <= 1e300
        for condition in algebra.conditions:
            ok = ca.logic_and(ok, condition)
        return ca.Function("program", [symbols], [found.value, found.radius(), ok])


def escapes(program: Program, inputs: np.ndarray[Any, Any], *, principal: bool = False) -> int:
    """How many of the inputs (rows) give a ball without the exact value; some must be accepted."""
    function = run(program, inputs.shape[1], principal=principal)
    missed, accepted = 0, 0
    for row in inputs:
        value, radius, ok = (float(v) for v in function(row))
        if ok == 1.0:
            accepted += 1
            exact = program(Exact(), [flint.arb(float(v)) for v in row])
            missed += not inside(value, exact, radius)
    assert accepted
    return missed


def draw(low: float, high: float, shape: tuple[int, int]) -> np.ndarray[Any, Any]:
    return np.random.default_rng(4).uniform(low, high, shape)


def _long(a: Any, v: list[Any]) -> Any:
    """A product of twenty: several roundings in one number."""
    total = v[0]
    for k in range(20):
        total = a.mul(total, v[1 + k % 3])
    return total


def _cancelled(a: Any, v: list[Any]) -> Any:
    """v0 with an error of 1e4 roundings of it."""
    return a.sub(a.add(a.mul(v[0], v[1]), v[2]), v[2])


PROGRAMS: dict[str, tuple[Program, np.ndarray[Any, Any]]] = {
    "sum": (lambda a, v: a.add(v[0], v[1]), draw(0.5, 3.0, (50, 2))),
    "difference": (lambda a, v: a.sub(v[0], v[1]), draw(-3.0, 3.0, (50, 2))),
    "product": (lambda a, v: a.mul(v[0], v[1]), draw(0.5, 3.0, (50, 2))),
    "left": (lambda a, v: a.mul(_long(a, v), v[0]), draw(0.9, 1.1, (200, 4))),
    "right": (lambda a, v: a.mul(v[0], _long(a, v)), draw(0.9, 1.1, (200, 4))),
    "left of a sum": (lambda a, v: a.add(_long(a, v), v[0]), draw(0.9, 1.1, (200, 4))),
    "inverse": (lambda a, v: a.inverse(v[0]), draw(0.5, 3.0, (50, 1))),
    "inverse of an error": (lambda a, v: a.inverse(_long(a, v)), draw(0.9, 1.1, (200, 4))),
    "division": (lambda a, v: a.over(v[0], 3), draw(0.5, 3.0, (50, 1))),
    "thrice": (lambda a, v: a.times(v[0], 3), draw(0.5, 3.0, (50, 1))),
    "sine": (lambda a, v: a.function("sin", v[0]), draw(-9.0, 9.0, (50, 1))),
    "sine of an error": (
        lambda a, v: a.function("sin", _long(a, v)),
        draw(0.9, 1.1, (200, 4)) * [5e3, 1, 1, 1],
    ),
    "cosine": (lambda a, v: a.function("cos", v[0]), draw(-9e3, 9e3, (50, 1))),
    "tangent": (lambda a, v: a.function("tan", v[0]), draw(-9.0, 9.0, (50, 1))),
    "tangent of an error": (
        lambda a, v: a.function("tan", _cancelled(a, v)),
        draw(0.9, 1.1, (50, 3)) * [1.2, 1, 1e5],
    ),
    "folded third": (lambda a, v: a.mul(a.constant(1 / 3), v[0]), draw(0.5, 3.0, (50, 1))),
    "power of two": (
        lambda a, v: a.mul(a.constant(0.25), v[0]), np.array([[5e-324], [1.5e-323], [1.0], [3.0]]),
    ),
    "underflow": (lambda a, v: a.mul(v[0], v[1]), draw(0.5, 1.0, (50, 2)) * 1e-160),
    "many small": (
        lambda a, v: a.mul(_long(a, v), _long(a, v)), draw(0.5, 1.0, (50, 4)) * 1e-14,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", list(PROGRAMS))
def test_the_exact_value_is_inside(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    program, inputs = PROGRAMS[name]
    monkeypatch.setattr(Exact, "constant", _unfolded)
    assert escapes(program, inputs) == 0


def _unfolded(_: Exact, value: float) -> Any:
    return flint.arb(1) / 3 if value == 1 / 3 else flint.arb(value)


def _count(change: Callable[[Any, float], float], name: str) -> Callable[..., Any]:
    """The rule `name` of Balls with another count in its result."""
    rule = getattr(Balls, name)

    def changed(self: Balls, *operands: Any) -> Ball:
        result: Ball = rule(self, *operands)
        return dataclasses.replace(result, count=max(change(operands, result.count), 1e-9))

    return changed


FAULTS: dict[str, tuple[str, Any, str]] = {
    "a sum does not round": ("add", lambda o, c: c - 1, "sum"),
    "a difference does not round": ("sub", lambda o, c: c - 1, "difference"),
    "a product does not round": ("mul", lambda o, c: c - 1, "product"),
    "a product forgets its left error": ("mul", lambda o, c: o[1].count + 1, "left"),
    "a product forgets its right error": ("mul", lambda o, c: o[0].count + 1, "right"),
    "a sum forgets an error": ("add", lambda o, c: 1.0, "left of a sum"),
    "an inverse does not round": ("inverse", lambda o, c: c - 1, "inverse"),
    "an inverse forgets the error": ("inverse", lambda o, c: 1.0, "inverse of an error"),
    "a quotient does not round": ("over", lambda o, c: c - 1, "division"),
    "three times does not round": ("times", lambda o, c: c - 1, "thrice"),
    "a sine is exact": ("function", lambda o, c: c - 32, "sine"),
    "a sine forgets the error": ("function", lambda o, c: 32 / 4e3, "sine of an error"),
    "a cosine is exact": ("function", lambda o, c: c - 32, "cosine"),
    "a tangent is exact": ("function", lambda o, c: c - 33, "tangent"),
    "a literal is exact": ("constant", lambda o, c: 0.0, "folded third"),
}


@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_forgotten_term_is_noticed(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, change, program = FAULTS[fault]
    if name == "constant":
        # With one rounding of the product left, the literal's own error must show.
        monkeypatch.setattr(balls, "UNIT", balls.UNIT / 2)
    monkeypatch.setattr(Balls, name, _count(change, name))
    monkeypatch.setattr(Exact, "constant", _unfolded)
    assert escapes(*PROGRAMS[program]) > 0


def test_a_tangent_that_forgets_its_argument_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    rule = Balls._tangent

    def forgetful(self: Balls, argument: Ball, tangent: ca.SX) -> Ball:
        return rule(self, dataclasses.replace(argument, count=0.0), tangent)

    monkeypatch.setattr(Balls, "_tangent", forgetful)
    assert escapes(*PROGRAMS["tangent of an error"]) > 0


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1e-320, 1e-150, 1e-3, 1.0, 1e3, 1e90])
)
def test_random_programs_contain_or_refuse(seed: int, scale: float) -> None:
    def program(a: Any, v: list[Any]) -> Any:
        rng = np.random.default_rng(seed)
        numbers = list(v)
        for _ in range(12):
            left, right = (numbers[int(rng.integers(len(numbers)))] for _ in range(2))
            kind = rng.integers(9)
            if kind < 3:
                numbers.append([a.add, a.sub, a.mul][kind](left, right))
            elif kind == 3:
                numbers.append(a.mul(left, a.inverse(right)))
            elif kind == 4:
                numbers.append(a.function(str(rng.choice(["sin", "cos", "tan"])), left))
            elif kind == 5:
                numbers.append(a.over(left, int(rng.integers(1, 7))))
            elif kind == 6:
                numbers.append(a.times(left, int(rng.integers(1, 4))))
            elif kind == 7:
                numbers.append(a.function("fabs", left))
            else:
                numbers.append(a.add(left, a.constant(0.75)))
        return numbers[-1]

    rng = np.random.default_rng(seed + 1)
    function = run(program, 3)
    for row in rng.normal(size=(3, 3)) * scale:
        value, radius, ok = (float(v) for v in function(row))
        if ok == 1.0:
            exact = program(Exact(), [flint.arb(float(v)) for v in row])
            assert inside(value, exact, radius)


def _called(name: str) -> Program:
    return lambda a, v: a.function(name, v[0])


def test_what_leaves_the_rules_is_refused() -> None:
    for name, value in (("tan", np.pi / 2), ("sin", 1e5), ("cos", np.nan), ("tan", np.inf)):
        function = run(_called(name), 1)
        assert float(function(value)[2]) == 0.0
    beyond = run(lambda a, v: a.function("sin", v[0]), 1, principal=True)
    assert float(beyond(1.6)[2]) == 0.0
    divided = run(lambda a, v: a.inverse(a.sub(v[0], v[1])), 2)
    assert float(divided([1.0, 1.0])[2]) == 0.0
    assert float(divided([1.0, 1.0 - 2**-52])[2]) == 0.0
    assert float(divided([1.0, 0.5])[2]) == 1.0
    with pytest.raises(InputError, match="use sin, cos or tan"):
        run(lambda a, v: a.function("exp", v[0]), 1)
    with pytest.raises(InputError, match="no quotient of small"):
        run(lambda a, v: a.mul(a.constant(0.123456789), v[0]), 1)
    with pytest.raises(InputError, match="too deep"):
        run(lambda a, v: _squared(a, v[0], 21), 1)


def _squared(a: Any, value: Any, times: int) -> Any:
    for _ in range(times):
        value = a.mul(value, value)
    return value
