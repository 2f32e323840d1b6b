"""What the enclosed kernel computes at points is never farther from the truth than it says."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator

import casadi as ca
import flint
import numpy as np
import pytest
from enclosed_cases import ODES, Array, built, called, points, ranges_of
from online_truth import BITS, Truth, doubles, inside, quotient, unit

from workbench.errors import InputError
from workbench.models import Ode, Ranged, Signal
from workbench.models.benchmarks import b1
from workbench.models.system import system_from_casadi
from workbench.reach.online.enclosed import enclosed_functions
from workbench.reach.online.functions import ORDER, OnlineFunctions
from workbench.reach.online.model import emitted
from workbench.reach.online.step import (
    advance_function,
    driver_function,
    hessians,
    second_function,
)

# Sets are some 1e-2 wide: bounds above this share of the values' sizes would be of no use.
USEFUL = 2.0**-30


@pytest.fixture(scope="module", autouse=True)
def digits() -> Iterator[None]:
    with flint.ctx.workprec(BITS):
        yield


CASES = pytest.mark.parametrize(
    ("name", "quadratic"), [(name, q) for name in ODES for q in (False, True)]
)


@pytest.mark.parametrize("name", list(ODES))
def test_advance_is_the_taylor_step(name: str) -> None:
    functions = built(name, quadratic=False)
    n = functions.model.n
    sparsity = functions.advance.sparsity_out("transition")
    for point in points(functions.model, 3):
        h = 0.0625
        found, truth = called(functions.advance, [*point, h]), Truth(functions.model, point)
        assert found["ok"] == [1.0]
        ends = truth.advanced(truth.x, h, ORDER)
        for k in range(n):
            assert inside(found["x_end"][k], ends[k], found["round_state"][k])
        exact, entries = truth.transition(h, ORDER), set()
        for k, (row, col) in enumerate(zip(*sparsity.get_triplet(), strict=True)):
            entries.add((row, col))
            value, radius = found["transition"][k], found["round_transition"][k]
            assert inside(value, exact[row][col], radius)
        zeros = [(i, j) for i in range(n) for j in range(n) if (i, j) not in entries]
        assert all(inside(0.0, exact[i][j], 0.0) for i, j in zeros)
        assert max(found["round_state"]) <= USEFUL * (1 + abs(point[0]).max())
        assert max(found["round_transition"]) <= USEFUL * (1 + abs(found["transition"]).max())


@CASES
def test_derivatives_along_the_set(name: str, quadratic: bool) -> None:
    functions = built(name, quadratic=quadratic)
    model, pairs = functions.model, functions.pairs
    n, total = model.n, model.n + model.n_v
    sparsities = [h.sparsity() for h in hessians(model)]
    rng = np.random.default_rng(3)
    for point in points(model, 2):
        columns = rng.normal(size=(n, len(functions.columns)))
        columns *= _reached(functions)
        further = [columns.ravel()] if quadratic else []
        found, truth = called(functions.second, [*point, *further]), Truth(model, point)
        assert found["ok"] == [1.0]
        first = 0
        for i, sparsity in enumerate(sparsities):
            for row, col in zip(*sparsity.get_triplet(), strict=True):
                exact = truth.second(unit(total, row), unit(total, col))[i]
                assert inside(found["hessian"][first], exact, found["round_hessian"][first])
                first += 1
        assert first == len(found["hessian"])
        if not quadratic:
            continue
        still = doubles([0.0] * model.n_v)
        missed = {"source": [flint.arb(0)] * n, "bent_source": [flint.arb(0)] * n}
        for k, (j, m) in enumerate(pairs):
            a, b = doubles(columns[:, j]), doubles(columns[:, m])
            share = flint.arb(0.5 if j == m else 1.0)
            exacts = {"source": truth.second([*a, *still], [*b, *still]),
                      "bent_source": truth.bent(a, b)}  # fmt: skip
            for output, exact in exacts.items():
                own = found[output].reshape(n, -1)[:, k]
                for i in range(n):
                    missed[output][i] += abs(flint.arb(own[i]) - share * exact[i])
        for output, bound in (("source", "round_source"), ("bent_source", "round_bent")):
            assert all(inside(0.0, missed[output][i], found[bound][i]) for i in range(n))
            assert max(found[bound]) <= USEFUL * (1 + abs(found[output]).max())


def _reached(functions: OnlineFunctions) -> Array:
    """Columns as flows make them: 0 where a state never feels an axis."""
    model = functions.model
    influence = np.array(ca.DM(ca.jacobian(model.relaxed.field, model.ode.x).sparsity(), 1))
    reached = np.eye(model.n)
    for _ in range(model.n):
        reached = np.sign(reached + influence @ reached)
    found: Array = reached[:, list(functions.columns)]
    return found


@CASES
def test_inputs_and_drivers(name: str, quadratic: bool) -> None:
    functions = built(name, quadratic=quadratic)
    model = functions.model
    n, n_v, n_k = model.n, model.n_v, model.n_k
    if functions.inputs is None or functions.drivers is None:
        assert name == "B1"
        return
    rng = np.random.default_rng(5)
    still, sparsity = doubles([0.0] * n_v), functions.inputs.sparsity_out(0)
    for point in points(model, 3):
        truth = Truth(model, point)
        here = [*truth.x, *truth.still]
        slopes = [quotient(truth.joint, here, unit(n + n_v, k)) for k in range(n + n_v)]
        found = called(functions.inputs, [*point])
        assert found["ok"] == [1.0]
        for k, (row, col) in enumerate(zip(*sparsity.get_triplet(), strict=True)):
            exact = slopes[n + col][row]
            assert inside(found["by_input"][k], exact, found["round_input"][k])
        linear, rest = rng.uniform(0.0, 0.2, n) * quadratic, rng.uniform(0.0, 0.1, n)
        columns = rng.normal(size=(n, len(functions.columns))) * _reached(functions)
        further = [columns.ravel()] if quadratic else []
        found = called(functions.drivers, [*point, linear, rest, *further])
        assert found["ok"] == [1.0]
        exact = [truth.outputs(truth.x, truth.still)[1][k] for k in range(n_k)]
        missed = [abs(flint.arb(found["driver"][k]) - exact[k]) for k in range(n_k)]
        radius = [a + b for a, b in zip(doubles(linear), doubles(rest), strict=True)]
        old = doubles(linear)
        half = [flint.arb(0)] * n_k
        for i in range(n):
            for k in range(n_k):
                own = flint.arb(found["gradient"].reshape(n_k, n)[k, i])
                missed[k] += abs(own - slopes[i][n + k]) * radius[i]
            for j in range(n):
                bend = truth.second(unit(n + n_v, i), unit(n + n_v, j))[n:]
                grown = radius[i] * radius[j] - old[i] * old[j]
                half = [s + abs(b) * grown / 2 for s, b in zip(half, bend, strict=True)]
        for k in range(n_k):
            missed[k] += abs(flint.arb(found["second"][k]) - half[k])
        for place, (j, m) in enumerate(functions.pairs):
            a, b = doubles(columns[:, j]), doubles(columns[:, m])
            both = truth.second([*a, *still], [*b, *still])[n:]
            share = flint.arb(0.5 if j == m else 1.0)
            for k in range(n_k):
                own = flint.arb(found["pairs"].reshape(n_k, -1)[k, place])
                missed[k] += abs(own - share * both[k])
        assert all(inside(0.0, missed[k], found["round_driver"][k]) for k in range(n_k))
        assert max(found["round_driver"]) <= USEFUL * (1 + abs(found["driver"]).max())


@CASES
def test_the_doubles_are_those_of_the_plain_functions(name: str, quadratic: bool) -> None:
    functions = built(name, quadratic=quadratic)
    model, columns = functions.model, functions.columns
    rng = np.random.default_rng(11)
    plain = [advance_function(model, ORDER), second_function(model, columns)]
    own = [functions.advance, functions.second]
    if functions.drivers is not None:
        plain.append(driver_function(model, columns))
        own.append(functions.drivers)
    for reference, enclosed in zip(plain, own, strict=True):
        short = emitted(reference, principal=False)
        for point in points(model, 10):
            sizes = [enclosed.numel_in(k) for k in range(5, enclosed.n_in())]
            arguments = [*point, *[rng.uniform(0.0, 0.1, size) for size in sizes]]
            expected, found = called(short, arguments), called(enclosed, arguments)
            assert all(np.array_equal(found[key], expected[key]) for key in expected)


def test_folded_literals_of_long_chains_keep_their_error() -> None:
    n, h = 6, 0.1
    x = ca.SX.sym("x", n)
    chain = ca.vertcat(*[x[k + 1] for k in range(n - 1)], -x[0])
    ode = system_from_casadi(x, chain, tuple("abcdef"))
    functions = enclosed_functions(ode, ranges_of(ode), quadratic=())
    found = called(functions.advance, [np.ones(n), *[np.zeros(0)] * 4, h])
    sparsity = functions.advance.sparsity_out("transition")
    assert found["ok"] == [1.0]
    for k, (row, col) in enumerate(zip(*sparsity.get_triplet(), strict=True)):
        power = (col - row) % n
        exact = flint.arb(h) ** power / int(np.prod(np.arange(1, power + 1)))
        exact = exact if col >= row else -exact
        assert inside(found["transition"][k], exact, found["round_transition"][k])


@CASES
def test_nothing_unreadable_is_accepted(name: str, quadratic: bool) -> None:
    functions = built(name, quadratic=quadratic)
    point = points(functions.model, 1)[0]
    checked = [functions.advance, functions.second, functions.inputs, functions.drivers]
    for function in [f for f in checked if f is not None]:
        sizes = [function.numel_in(k) for k in range(5, function.n_in())]
        arguments = [*point, *[np.full(size, 0.05) for size in sizes]]
        assert called(function, arguments)["ok"] == [1.0]
        for block in range(len(arguments)):
            for k in range(np.size(arguments[block])):
                if not function.sparsity_in(block).nnz():
                    continue
                for bad in (np.nan, np.inf, -np.inf, 1e308):
                    spoiled = [np.array(a, float) for a in arguments]
                    spoiled[block][k] = bad
                    found = called(function, spoiled)
                    finite = all(np.isfinite(v).all() for v in found.values())
                    harmless = bad == 1e308 or _unused(function, block, k)
                    assert found["ok"] == [0.0] or (finite and harmless)


def _unused(function: ca.Function, block: int, k: int) -> bool:
    """Whether no output but `ok` depends on an input."""
    symbols = [ca.SX.sym("s", function.sparsity_in(i)) for i in range(function.n_in())]
    outputs = ca.veccat(*function.call(symbols)[:-1])
    return not ca.depends_on(outputs, symbols[block][k])


def test_an_unknown_axis_and_a_computed_limit_are_refused() -> None:
    ode = b1().system.ode
    with pytest.raises(InputError, match="expected states"):
        enclosed_functions(ode, ranges_of(ode), quadratic=("nowhere",))
    for floor, fine in ((operator.neg, True), (lambda p: -2.0 * p / 3.0, False)):
        ode = _limited(floor)
        if fine:
            assert enclosed_functions(ode, ranges_of(ode), quadratic=()).limits is not None
            continue
        with pytest.raises(InputError, match="limit of a command is computed"):
            enclosed_functions(ode, ranges_of(ode), quadratic=())


def _limited(floor: Callable[[ca.SX], ca.SX]) -> Ode:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    field = ca.vertcat(ca.fmin(ca.fmax(x[1], floor(p)), p), ca.fmin(-x[0], p))
    states = tuple(Signal(name, "") for name in "ab")
    return Ode("limited", states, (Ranged.exactly("p", "", 0.7),), (), x, p, ca.SX(0, 1), field)
