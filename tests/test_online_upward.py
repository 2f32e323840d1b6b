"""Upward rounding: the bounds of the enclosed kernel are never below exact arithmetic's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import flint
import numpy as np
import pytest
from online_truth import OPERATIONS

from workbench.models.benchmarks import b1, b2, b2_noise, b2_path
from workbench.models.graph import graph_of
from workbench.reach.online.majorants import majorant_function
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.step import source_function

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
BENCHES = {"B1": b1, "B2": b2, "B2-path": b2_path, "B2-noise": b2_noise}
_OPERATIONS: dict[str, Callable[..., Any]] = {
    **OPERATIONS,
    "floor": lambda a: a.floor(),
    "fmin": lambda a, b: a.min(b),
    "fmax": lambda a, b: a.max(b),
    "lt": lambda a, b: flint.arb(int(a < b)),
    "le": lambda a, b: flint.arb(int(a <= b)),
    "and": lambda a, b: a * b,
}


@pytest.fixture(scope="module", autouse=True)
def digits() -> Iterator[None]:
    with flint.ctx.workprec(3000):
        yield


def exact(function: ca.Function, arguments: list[Array]) -> list[list[Any]]:
    """Every nonzero of every output in numbers of 3000 bits, operation by operation."""
    graph = graph_of(function)
    values: list[Any] = []
    for node in graph.nodes:
        if node.element is not None:
            values.append(flint.arb(float(arguments[node.element[0]][node.element[1]])))
        elif node.constant is not None:
            values.append(flint.arb(node.constant))
        else:
            values.append(_OPERATIONS[node.name](*[values[k] for k in node.operands]))
    return [[values[k] for k in row] for row in graph.outputs]


def floats(function: ca.Function, arguments: list[Array]) -> list[list[float]]:
    outputs = function.call([ca.DM(a) for a in arguments])
    return [[float(v) for v in value.nonzeros()] for value in outputs]


def below(found: list[list[float]], truth: list[list[Any]]) -> int:
    pairs = [p for a, b in zip(found, truth, strict=True) for p in zip(a, b, strict=True)]
    return sum(not flint.arb(value) >= number for value, number in pairs)


def sizes(rng: np.random.Generator, count: int) -> Array:
    """Radii of every order, zeros and the smallest doubles among them."""
    usual = rng.uniform(0.0, 1.0, count) * 10.0 ** rng.integers(-12, 1, count)
    odd = rng.choice([0.0, 5e-324, 1e-300, 1e-160], count)
    return np.where(rng.random(count) < 0.3, odd, usual)


@pytest.mark.parametrize("name", list(BENCHES))
def test_the_source_is_not_below(name: str) -> None:
    model = OnlineModel.of(BENCHES[name]().system.ode)
    plain, upward = source_function(model), source_function(model, upward=True)
    rng, short = np.random.default_rng(1), 0
    for _ in range(20):
        arguments = [sizes(rng, plain.numel_in(k)) for k in range(4)]
        truth, found = exact(plain, arguments), floats(upward, arguments)
        assert below(found, truth) == 0
        short += below(floats(plain, arguments), truth)
        for value, number in zip(found[0], truth[0], strict=True):
            assert flint.arb(value) <= number * (1 + 2**-40) + 1e-28
    assert short > 0


def test_the_source_outweighs_three_roundings_of_every_input() -> None:
    model = OnlineModel.of(b2().system.ode)
    plain, upward = source_function(model), source_function(model, upward=True)
    rng = np.random.default_rng(2)
    arguments = [rng.uniform(0.5, 1.0, plain.numel_in(k)) for k in range(4)]
    lower = [a * (1 - 3 * 2.0**-53) for a in arguments]
    assert below(floats(upward, lower), exact(plain, arguments)) == 0


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("name", list(BENCHES))
def test_the_majorant_is_not_below(name: str, quadratic: bool) -> None:
    model = OnlineModel.of(BENCHES[name]().system.ode)
    plain, upward = (
        majorant_function(model, order=5, upward=up, quadratic=quadratic) for up in (False, True)
    )
    whole = majorant_function(model, order=5, upward=False, quadratic=False)
    p = np.array(model.form.parameter_values())
    rng, n, n_k, short = np.random.default_rng(3), model.n, model.n_k, 0
    for _ in range(6):
        center, w = rng.normal(size=n) * 0.3, sizes(rng, n) * 0.3
        center = np.where([s == "speed" for s in model.ode.names], 2.0, center)
        linear = w * rng.uniform(0.0, 1.0, n) * quadratic
        named = {
            "below": w - center, "above": center + w, "rest": w - linear, "linear": linear, "p": p,
            "slope": rng.choice([0.0, 0.4, 1.0], n_k), "offset": sizes(rng, n_k),
        }  # fmt: skip
        names = {plain.name_in(k): plain.numel_in(k) for k in range(plain.n_in())}
        arguments = [
            named[key] if key in named else 1e-3 * sizes(rng, size) for key, size in names.items()
        ]
        truth, found = exact(plain, arguments), floats(upward, arguments)
        # Where one bound is taken off another, the formula adds 2^-40 of the whole as its margin.
        for key in ("bend_rest", "second_bend") if quadratic else ():
            k = plain.index_out(key)
            margins = exact(whole, arguments)[whole.index_out(key)]
            truth[k] = [a - b / flint.arb(2) ** 40 for a, b in zip(truth[k], margins, strict=True)]
        assert found[-1] == [1.0]
        assert below(found[:-1], truth[:-1]) == 0
        short += below(floats(plain, arguments)[:-1], truth[:-1])
        for own, other in zip(found[:-1], truth[:-1], strict=True):
            for value, number in zip(own, other, strict=True):
                assert flint.arb(value) <= number * (1 + 2**-30) + 1e-9
    assert short > 0
