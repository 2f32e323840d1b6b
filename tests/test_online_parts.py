"""Each bound of one step dominates the exact quantity it stands for, on sampled points."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np
import pytest
from online_cases import Case, clip, derived, functions_of, pushes
from tube_cases import Array, box, disturbed, system_of

from workbench.reach.online.functions import OnlineFunctions
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.step import advance_function, second_function

LAWS = (
    "pendulum",
    "saturated",
    "pushed limit",
    "nested",
    "bilinear",
    "forgetting",
    "forced",
    "curved limit",
)
_EXTRA = {
    "forced": Case(
        disturbed(
            lambda x, _p, w: [ca.sin(3 * x[1]) * x[0] + w[0] * x[1] ** 3, 1 + 0.2 * x[0] ** 2],
            ("a", "b"), disturbances=pushes(0.3),
        ),
        box(a=(0.0, 1.0), b=(0.0, 1.0)), 1.0,
    ),
    "curved limit": Case(
        disturbed(
            lambda x, _p, w: [x[1], -clip(x[0] ** 3 + x[0] * x[1] + w[0] * x[1], -0.5, 0.7)],
            ("a", "b"), disturbances=pushes(0.3),
        ),
        box(a=(0.0, 1.0), b=(0.0, 1.0)), 1.0, region=2.0,
    ),
}  # fmt: skip


@functools.cache
def functions(name: str, *, quadratic: bool) -> OnlineFunctions:
    if name not in _EXTRA:
        return functions_of(name, quadratic=quadratic)
    case = _EXTRA[name]
    return derived(case.system, case.initial_set, case.step_s, quadratic, case.region)


@functools.cache
def exact(name: str) -> ca.Function:
    """Every quantity that a majorant bounds, at one point, by repeated total derivatives of the
    enlarged equation xi' = g, u' = A u + e, V' = A V + 1/2 D2g[u, u], r' = A r + B v."""
    model = functions(name, quadratic=False).model
    n, x = model.n, model.ode.x
    u, e, big, r, v = (ca.SX.sym(k, m) for k, m in
                       (("u", n), ("e", n), ("V", n), ("r", n), ("v", model.n_v)))  # fmt: skip
    of_x, of_u = ca.SX.sym("of_x", n), ca.SX.sym("of_u", n)
    by = ca.vertcat(model.ode.w, model.relaxed.error)
    field, drivers = model.relaxed.field, model.relaxed.drivers
    z, dz, d0 = ca.vertcat(x, by), ca.vertcat(u, v), ca.vertcat(u, 0 * v)

    def along(g: ca.SX, direction: ca.SX) -> ca.SX:
        return ca.jtimes(g, z, direction)

    second = along(along(field, d0), d0) / 2
    mixed = along(along(field, dz), dz) / 2
    y = ca.vertcat(x, u, big, r)
    rates = ca.vertcat(
        field, along(field, d0) + e, ca.jtimes(field, x, big) + second,
        ca.jtimes(field, x, r) + along(field, ca.vertcat(0 * u, v)),
    )  # fmt: skip

    def taylor(start: ca.SX, count: int) -> ca.SX:
        for k in range(count):
            start = ca.jtimes(start, y, rates) / (k + 1)
        return start

    jump = ca.vertcat(v[: model.n_w, 0], 0 * v[model.n_w :, 0]) if model.n_v else v
    pushed = along(field, ca.vertcat(0 * u, jump))
    outputs = {
        "curvature": taylor(x, 2), "cubic": taylor(x, 3), "quartic": taylor(x, 4),
        "quintic": taylor(x, 5), "taylor_x": taylor(x, 6), "taylor_w": taylor(u, 6),
        "bend": 2 * taylor(u, 2), "second": mixed, "third": along(mixed, dz) / 3,
        "second_bend": taylor(mixed, 2), "response": taylor(big, 5),
        "source_bend": 2 * taylor(big, 2),
        "source_turn": ca.jtimes(2 * taylor(big, 2), ca.vertcat(x, u), ca.vertcat(of_x, of_u)),
        "input_rate": along(field, ca.vertcat(0 * u, v)), "input_response": taylor(r, 3),
        "jump_rate": pushed, "grown": along(field, d0),
        "driver_curvature": taylor(drivers, 2),
        "driver_third": along(along(along(drivers, dz), dz), dz) / 6,
        "driver_input": along(drivers, ca.vertcat(0 * u, v)),
        "driver_jump": ca.jtimes(drivers, x, pushed),
    }  # fmt: skip
    inputs = [*model.inputs, u, e, big, r, v, of_x, of_u]
    return ca.Function("exact", inputs, list(outputs.values()), [f"i{k}" for k in range(13)],
                       list(outputs))  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Premise:
    """A box and radii, and the majorant's answer for them."""

    low: Array
    high: Array
    sizes: Mapping[str, Array]
    bounds: Mapping[str, Array]


def premise(name: str, rng: np.random.Generator, *, quadratic: bool) -> Premise:
    found = functions(name, quadratic=quadratic)
    model = found.model
    middle, half = rng.uniform(-1, 1, model.n), rng.uniform(0, 0.8, model.n)
    sizes = {key: rng.uniform(0, 0.5, model.n) for key in ("w", "guess", "small", "extra")}
    sizes["jump"] = rng.uniform(0, 0.1, model.n)
    sizes["linear"] = sizes["w"] * rng.uniform(0, 1, model.n) if quadratic else 0 * sizes["w"]
    w = np.array([d.upper for d in model.ode.disturbances])
    sizes["v"] = np.concatenate([w, rng.uniform(0, 0.2, model.n_k)])
    values = {
        **sizes, "rest": sizes["w"] - sizes["linear"],
        "below": half - middle, "above": half + middle, "w_mid": 0 * w,
        "p": found.ranges.parameters[0],
        "slope": np.ones(model.n_k), "offset": rng.uniform(0, 0.4, model.n_k),
    }  # fmt: skip
    sizes["offset"] = values["offset"]
    answer = found.majorant.call([values[key] for key in found.majorant.name_in()])
    bounds = {
        key: np.array(value).ravel()
        for key, value in zip(found.majorant.name_out(), answer, strict=True)
    }
    return Premise(middle - half, middle + half, sizes, bounds)


def _is_a_line(name: str, point: Sequence[Array], gap: Array) -> bool:
    """Whether all lines lie within their gaps of what their limits allow, as verified ones do."""
    model = functions(name, quadratic=False).model
    form, relaxed = model.form, model.relaxed
    lines = relaxed.slope * relaxed.drivers + relaxed.offset
    found = ca.Function("lines", list(model.inputs), [lines, form.floor, form.ceiling])(*point)
    value, low, high = (np.array(v).ravel() for v in found)
    return bool(np.all((low - gap <= value) & (value <= high + gap)))


def sampled(name: str, at: Premise, rng: np.random.Generator, count: int) -> dict[str, Array]:
    """Largest sizes of the exact quantities over points that the premise allows."""
    model = functions(name, quadratic=False).model
    low_p = functions(name, quadratic=False).ranges.parameters[0]
    n_w = model.n_w
    function = exact(name)
    worst: dict[tuple[str, str], Array] = {}
    for _ in range(count):
        x = np.where(rng.random(model.n) < 0.6, rng.choice([at.low, at.high]),
                     rng.uniform(at.low, at.high))  # fmt: skip
        signs = rng.choice([-1.0, 1.0], model.n)
        v = at.sizes["v"] * rng.choice([-1.0, 1.0, 0.3], model.n_v)
        exogenous = at.sizes["v"] * rng.uniform(-1, 1, model.n_v)
        slope = rng.choice([0.0, 1.0, 0.4], model.n_k)
        offset = at.sizes["offset"] * rng.uniform(-1, 1, model.n_k)
        point = [x, low_p, exogenous[:n_w], slope, offset, exogenous[n_w:]]
        if not _is_a_line(name, point, at.sizes["v"][n_w:]):
            continue
        zero = np.zeros(model.n)
        for kind in ("w", "linear", "guess", "small"):
            u = signs * at.sizes[kind]
            e = signs * at.sizes["extra"] if kind == "w" else zero
            held = v if kind == "w" else 0 * v
            off = [at.sizes["jump"] * rng.choice([-1.0, 1.0], model.n) for _ in range(2)]
            found = function(*point, u, e, zero, zero, held, *off)
            for key, value in zip(function.name_out(), found, strict=True):
                size = np.abs(np.array(value)).ravel()
                worst[kind, key] = np.maximum(worst.get((kind, key), 0 * size), size)
    return {f"{kind} {key}": size for (kind, key), size in worst.items()}


WHICH = {
    "curvature": "w curvature", "cubic": "w cubic", "quartic": "w quartic",
    "quintic": "w quintic", "taylor_x": "w taylor_x", "taylor_w": "w taylor_w",
    "second": "w second", "third": "w third", "input_rate": "w input_rate",
    "input_response": "w input_response", "jump_rate": "w jump_rate", "grown": "guess grown",
    "grown_bend": "guess bend", "grown_small": "small grown",
    "driver_curvature": "w driver_curvature", "driver_third": "w driver_third",
    "driver_input": "w driver_input", "driver_jump": "w driver_jump",
}  # fmt: skip


def dominated(name: str, seed: int, *, quadratic: bool) -> list[str]:
    """Names of the majorants that an exact quantity exceeds."""
    rng = np.random.default_rng(seed)
    at = premise(name, rng, quadratic=quadratic)
    if not at.bounds["ok"][0]:
        return []
    found = sampled(name, at, rng, 30)
    needed = {key: found[place] for key, place in WHICH.items()}
    bounds = dict(at.bounds)
    if quadratic:
        needed |= {"bend_linear": found["linear bend"], "response": found["linear response"],
                   "source_bend": found["linear source_bend"],
                   "source_turn": found["linear source_turn"]}  # fmt: skip
        # The rest: what differs between the whole and the linear part is bounded by the difference.
        bounds["bend"] = at.bounds["bend_rest"] + at.bounds["bend_linear"]
        needed["bend"] = found["w bend"]
    else:
        needed |= {"bend_rest": found["w bend"], "second_bend": found["w second_bend"]}
    return [
        key for key, need in needed.items() if np.any(need > bounds[key] * (1 + 2.0**-30) + 1e-250)
    ]


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("name", LAWS)
def test_majorants_exceed_what_they_bound(name: str, quadratic: bool) -> None:
    for seed in range(12):
        assert dominated(name, seed, quadratic=quadratic) == []


def test_both_forms_list_the_bounds_in_one_order() -> None:
    """The C text takes them by place."""
    linear, quadratic = (
        functions("pendulum", quadratic=q).majorant.name_out() for q in (False, True)
    )
    assert linear == quadratic


def test_bounds_grow_with_every_entry_of_the_premise() -> None:
    """Bounds made for a larger premise serve a smaller one; a difference of bounds may not shrink
    where the part that is taken away grows."""
    for name in ("forgetting", "triangular", "pendulum"):
        found = functions(name, quadratic=True)
        majorant = found.majorant
        rng = np.random.default_rng(1)
        for _ in range(30):
            small = {k: rng.uniform(0, 0.5, majorant.size1_in(k)) for k in majorant.name_in()}
            small["p"] = np.array(found.ranges.parameters[0])
            large = small | {
                key: small[key] * rng.uniform(1, 1.5, len(small[key]))
                for key in ("rest", "linear", "v", "guess", "small", "extra", "below", "above")
            }
            before, after = majorant(**small), majorant(**large)
            for key in majorant.name_out()[:-1]:
                first, second = np.array(before[key]), np.array(after[key])
                assert np.all(first <= second * (1 + 1e-9) + 1e-250), (name, key)


def test_coefficients_of_one_step_match_closed_forms() -> None:
    """x' = x^2 from 1/2: x = 1 / (2 - t), dx/dx0 = 4 / (2 - t)^2, all coefficients known."""
    model = OnlineModel.of(system_of(lambda x: [x * x], "x"))
    for order in (3, 5):
        advance = advance_function(model, order)
        end, transition = advance(0.5, [], [], [], [], 0.25)
        powers = [0.25**k / 2 ** (k + 1) for k in range(order + 1)]
        slopes = [(k + 1) * 0.25**k / 2**k for k in range(order + 1)]
        assert float(end) == pytest.approx(math.fsum(powers), rel=1e-15)
        assert float(transition) == pytest.approx(math.fsum(slopes), rel=1e-15)


@pytest.mark.parametrize("name", LAWS)
def test_coefficients_of_one_step_match_repeated_derivatives(name: str) -> None:
    model = functions(name, quadratic=False).model
    advance, rng = advance_function(model, 5), np.random.default_rng(4)
    x, field = model.ode.x, model.relaxed.field
    total, power, sums = x, 1.0, x
    h = 0.3
    for k in range(5):
        total = ca.jtimes(total, x, field) if k else field
        power *= h / (k + 1)
        sums = sums + power * total
    expected = ca.Function("expected", list(model.inputs), [sums, ca.jacobian(sums, x)])
    for _ in range(5):
        point = [rng.uniform(-0.8, 0.8, size) for size in (model.n, *map(int, (
            model.form.p.numel(), model.n_w, model.n_k, model.n_k)))]  # fmt: skip
        point[1] = np.array(functions(name, quadratic=False).ranges.parameters[0])
        ends = expected(*point, np.zeros(model.n_k))
        for got, want in zip(advance(*point, h), ends, strict=True):
            np.testing.assert_allclose(np.array(got), np.array(want), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("h", [0.1, 0.05, 0.025])
def test_the_quadrature_of_the_quadratic_term(h: float) -> None:
    """x' = y^2, y' = a y: Q(h) is known; the rule's error is below its bound and of order h^5."""
    a, y, s = -3.0, 0.4, 0.2
    model = OnlineModel.of(system_of(lambda _x, v: [v * v, -3 * v], "x", "y"))
    second = second_function(model, (1,))
    constants = model.form.parameter_values()
    total = 0.0
    for share, (at, column) in zip(
        (1.0, -1.0), ((y, s), (y * math.exp(a * h), s * math.exp(a * h))), strict=True
    ):
        _, source, bent = second([0.0, at], constants, [], [], [], [0.0, column])
        total += h / 2 * float(source[0]) + share * h * h / 12 * float(bent[0])
    exact_q = s * s * (math.exp(2 * a * h) - 1) / (2 * a)
    response = h**5 * s * s * (2 * a) ** 4 / 120
    assert abs(total - exact_q) <= response
    assert abs(total - exact_q) >= response / 30
