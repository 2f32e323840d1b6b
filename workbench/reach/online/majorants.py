"""Bounds of everything small in one step, from one evaluation of the graph in magnitudes.

All solutions meant here stay in one box for the whole step. With series in t along any of them and
in a direction epsilon (|w| for the states, |v| for the exogenous inputs) the coefficient of
t^i epsilon^j bounds the one of every exact series, because the recurrences are the same with
absolute values.
"""

from __future__ import annotations

import casadi as ca

from workbench.reach.online.algebras import Dual, Duals, Magnitudes
from workbench.reach.online.majorant_inputs import (
    INPUTS,
    MajorantInputs,
    elements,
    least_magnitude,
    majorant_inputs,
    seeds_of,
    series_of,
)
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.series import GraphSeries, Terms

_RULE = 4
"""The quadrature of the quadratic term uses values and slopes: its error is of order _RULE + 1."""


_OUTPUTS = (
    "curvature", "cubic", "quartic", "quintic", "taylor_x", "taylor_w", "bend_linear", "bend_rest",
    "second", "third", "second_bend", "response", "source_bend", "source_turn", "source_slip",
    "input_slip", "input_rate",
    "input_response", "jump_rate", "grown", "grown_bend", "grown_small", "driver_curvature",
    "driver_third", "driver_input", "driver_jump",
)  # fmt: skip
"""What the majorant returns before `ok`, in the order in which the C loop reads it."""


def majorant_function(
    model: OnlineModel, *, order: int, upward: bool, quadratic: bool
) -> ca.Function:
    """Function `wb_majorant`: magnitudes over one step.

    In: below, above (n): the box [-below, above]; linear, rest (n): radii of the set about the
    nominal, w = linear + rest; in the quadratic form `linear` is the part that is linear in the
    initial state, in the linear form it is 0; v (n_v): radii of the exogenous inputs; guess, small
    (n): bounds of what the step adds to the radius, and of its small terms; extra (n): bound of the
    rate at which w changes beyond the linear flow; jump (n): how far computed ends of a step can be
    off; p, w_mid; slope, offset: magnitudes, slope 1 where a kink is undecided, so that true
    solutions are covered too.
    Out, (n) each unless noted: curvature |x''| / 2 of solutions; cubic, quartic, quintic: their
    coefficients of t^3, t^4, t^5; taylor_x, taylor_w: coefficients of t^(order + 1) of a solution
    and of the linear flow of w; bend_linear, bend_rest: |d2/dt2| of the flows of `linear` and of
    the rest of w; second, third: coefficients of epsilon^2 and epsilon^3 of the field; second_bend:
    of t^2 epsilon^2 (quadratic form: without what is quadratic in `linear` alone); response: of t^5
    of V' = A V + 1/2 D2f[u, u] with u the flow of `linear`, source_bend its |V''| and source_turn
    what |V''| changes by if states and linear part change by `jump`, source_slip what |V'| does
    (quadratic form, else 0); input_slip: what |B| v changes by if states do;
    input_rate: |B| v; jump_rate: |B| w for the disturbances alone; input_response: t^3 of
    r' = A r + B v; grown, grown_bend: |A| guess and |d2/dt2| of its flow; grown_small: |A| small;
    driver_curvature |d''| / 2, driver_third (epsilon^3), driver_input |dd/dv| v, driver_jump: rate
    of a driver due to disturbances (n_k each); ok: 1 if all of this holds.
    """
    s = majorant_inputs(model)
    numbers = Magnitudes(upward=upward)
    outputs = _flow(model, s, numbers, order)
    outputs |= _quadratic_flow(model, s, numbers) if quadratic else _none(model)
    if quadratic:
        outputs |= _source_turn(model, s, numbers)
        for name, part in (("second_bend", outputs.pop("linear_second_bend")),
                           ("bend_rest", outputs["bend_linear"])):  # fmt: skip
            whole = outputs[name]
            outputs[name] = [
                _difference(a, b, upward=upward) for a, b in zip(whole, part, strict=True)
            ]
    outputs |= _input_response(model, s, numbers) | _growth(model, s, numbers)
    outputs |= _input_slip(model, s, numbers)
    ok = ca.SX(1)
    for condition in numbers.conditions:
        ok = ok * condition
    names = list(_OUTPUTS)
    packed = [_column(outputs[name]) for name in names]
    ok = ok * (ca.sum1(ca.vertcat(*packed)) <= 1e300)
    inputs = [getattr(s, name) for name in INPUTS]
    return ca.Function(
        "wb_majorant", inputs, list(ca.cse([*packed, ok])), list(INPUTS), [*names, "ok"]
    )


_SOURCE = ("source_bend", "source_turn", "source_slip")


def _none(model: OnlineModel) -> dict[str, list[ca.SX | None]]:
    return {name: [None] * model.n for name in ("bend_linear", "response", *_SOURCE)}


def _difference(whole: ca.SX | None, part: ca.SX | None, *, upward: bool) -> ca.SX | None:
    """whole - part >= 0 where all terms of `part` are in `whole`, with a margin for rounding.

    Upward, `part` may itself be too large: by 2^-51 for each of fewer than 2^13 operations on a
    path. The floors that its inputs got are in `whole` as well, where nothing is subtracted that
    was not added: the difference only grows with them.
    """
    if whole is None or part is None:
        return whole
    return (whole - part) + (2.0**-36 * whole + 2.0**-44 if upward else 2.0**-40 * whole)


def _column(values: list[ca.SX | None]) -> ca.SX:
    return ca.vertcat(*[ca.SX(0) if v is None else v for v in values]) if values else ca.SX(0, 1)


def _extend(
    series: GraphSeries[ca.SX],
    seeds: dict[tuple[int, int], Terms[ca.SX]],
    numbers: Magnitudes,
    monomial: tuple[int, int],
    n: int,
) -> None:
    """Compute one monomial of the field and continue the states' series by it."""
    series.advance(monomial)
    i, j = monomial
    for k in range(n):
        value = series.output(0, k).get(monomial)
        if value is not None:
            seeds[0, k][i + 1, j] = numbers.over(value, i + 1)


def _flow(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes, order: int
) -> dict[str, list[ca.SX | None]]:
    n = model.n
    w = [numbers.add(*parts) for parts in zip(elements(s.linear), elements(s.rest), strict=True)]
    seeds = seeds_of(model, s, numbers, w, elements(s.v))
    series = series_of(model, s, numbers, seeds)
    for j in range(4):
        if j < 2:
            _extend(series, seeds, numbers, (0, j), n)
        else:
            series.advance((0, j))
    for k in range(n):
        before = seeds[0, k].get((1, 1))
        seeds[0, k][1, 1] = s.extra[k] if before is None else numbers.add(before, s.extra[k])
    for i in range(1, order + 1):
        for j in range(2):
            _extend(series, seeds, numbers, (i, j), n)
        if i <= 2:
            series.advance((i, 2))
    return {
        "curvature": [seeds[0, k].get((2, 0)) for k in range(n)],
        **{
            name: [seeds[0, k].get((i, 0)) for k in range(n)]
            for i, name in enumerate(("cubic", "quartic", "quintic"), start=3)
        },
        "taylor_x": [seeds[0, k].get((order + 1, 0)) for k in range(n)],
        "taylor_w": [seeds[0, k].get((order + 1, 1)) for k in range(n)],
        "bend_rest": _doubled([seeds[0, k].get((2, 1)) for k in range(n)], numbers),
        "second": [series.output(0, k).get((0, 2)) for k in range(n)],
        "third": [series.output(0, k).get((0, 3)) for k in range(n)],
        "second_bend": [series.output(0, k).get((2, 2)) for k in range(n)],
        "driver_curvature": [series.output(1, k).get((2, 0)) for k in range(model.n_k)],
        "driver_third": [series.output(1, k).get((0, 3)) for k in range(model.n_k)],
    }


def _doubled(values: list[ca.SX | None], numbers: Magnitudes) -> list[ca.SX | None]:
    return [None if value is None else numbers.times(value, 2) for value in values]


def _quadratic_flow(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes
) -> dict[str, list[ca.SX | None]]:
    """What belongs to `linear` alone; `linear_second_bend`: t^2 epsilon^2 of the field along it."""
    n = model.n
    seeds = seeds_of(model, s, numbers, elements(s.linear), None)
    series = series_of(model, s, numbers, seeds)
    plain = seeds_of(model, s, numbers, elements(s.linear), None)
    alone = series_of(model, s, numbers, plain)
    for i in range(_RULE + 1):
        for j in range(3):
            _extend(series, seeds, numbers, (i, j), n)
            if i <= 2 and j < 2:
                _extend(alone, plain, numbers, (i, j), n)
            elif i <= 2:
                alone.advance((i, j))
    return {
        "response": [seeds[0, k].get((_RULE + 1, 2)) for k in range(n)],
        "source_bend": _doubled([seeds[0, k].get((2, 2)) for k in range(n)], numbers),
        "bend_linear": _doubled([seeds[0, k].get((2, 1)) for k in range(n)], numbers),
        "linear_second_bend": [alone.output(0, k).get((2, 2)) for k in range(n)],
    }


def _source_turn(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes
) -> dict[str, list[ca.SX | None]]:
    """Derivatives of V' and V'' of the quadratic flow by (x, linear), along (jump, jump)."""
    n, duals = model.n, Duals(numbers)
    seeds = _duals(seeds_of(model, s, numbers, elements(s.linear), None), elements(s.jump))
    for k, jump in enumerate(elements(s.jump)):
        seeds[0, k][0, 1] = Dual(s.linear[k], jump)
    series = _dual_series(model, s, duals, seeds)
    for i in range(2):
        for j in range(3):
            series.advance((i, j))
            for k in range(n):
                value = series.output(0, k).get((i, j))
                if value is not None:
                    seeds[0, k][i + 1, j] = duals.over(value, i + 1)
    turns, slips = (_along([seeds[0, k].get((i, 2)) for k in range(n)]) for i in (2, 1))
    return {"source_turn": _doubled(turns, numbers), "source_slip": slips}


def _input_slip(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes
) -> dict[str, list[ca.SX | None]]:
    """Derivative of B v by the states, along `jump`."""
    n = model.n
    if not model.n_v:
        return {"input_slip": [None] * n}
    seeds = _duals(seeds_of(model, s, numbers, None, elements(s.v)), elements(s.jump))
    series = _dual_series(model, s, Duals(numbers), seeds)
    series.advance((0, 0))
    series.advance((0, 1))
    return {"input_slip": _along([series.output(0, k).get((0, 1)) for k in range(n)])}


def _duals(
    plain: dict[tuple[int, int], Terms[ca.SX]], jumps: list[ca.SX]
) -> dict[tuple[int, int], Terms[Dual]]:
    """The same seeds; the states' values have `jumps` as their derivative."""
    return {
        key: {
            m: Dual(value, jumps[key[1]] if key[0] == 0 and m == (0, 0) else ca.SX(0))
            for m, value in terms.items()
        }
        for key, terms in plain.items()
    }


def _dual_series(
    model: OnlineModel,
    s: MajorantInputs,
    duals: Duals,
    seeds: dict[tuple[int, int], Terms[Dual]],
) -> GraphSeries[Dual]:
    def lower_bound(index: int, value: Dual) -> Dual:
        return Dual(least_magnitude(model, s, index), value.along)

    return GraphSeries(model.graph, duals, seeds, lower_bound=lower_bound)


def _along(values: list[Dual | None]) -> list[ca.SX | None]:
    return [None if value is None else value.along for value in values]


def _input_response(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes
) -> dict[str, list[ca.SX | None]]:
    n, n_w, n_k = model.n, model.n_w, model.n_k
    outputs: dict[str, list[ca.SX | None]] = {
        "input_rate": [None] * n, "input_response": [None] * n, "jump_rate": [None] * n,
        "driver_input": [None] * n_k, "driver_jump": [None] * n_k,
    }  # fmt: skip
    if model.n_v:
        seeds = seeds_of(model, s, numbers, None, elements(s.v))
        series = series_of(model, s, numbers, seeds)
        for i in range(3):
            for j in range(2):
                _extend(series, seeds, numbers, (i, j), n)
        outputs["input_rate"] = [series.output(0, k).get((0, 1)) for k in range(n)]
        outputs["input_response"] = [seeds[0, k].get((3, 1)) for k in range(n)]
        outputs["driver_input"] = [series.output(1, k).get((0, 1)) for k in range(n_k)]
    if n_w:
        seeds = seeds_of(model, s, numbers, None, elements(s.v)[:n_w] + [ca.SX(0)] * n_k)
        series = series_of(model, s, numbers, seeds)
        for m in ((0, 0), (0, 1), (1, 0), (1, 1)):
            _extend(series, seeds, numbers, m, n)
        outputs["jump_rate"] = [series.output(0, k).get((0, 1)) for k in range(n)]
        outputs["driver_jump"] = [series.output(1, k).get((1, 1)) for k in range(n_k)]
    return outputs


def _growth(
    model: OnlineModel, s: MajorantInputs, numbers: Magnitudes
) -> dict[str, list[ca.SX | None]]:
    n = model.n
    seeds = seeds_of(model, s, numbers, elements(s.guess), None)
    series = series_of(model, s, numbers, seeds)
    for m in ((0, 0), (0, 1), (1, 0), (1, 1)):
        _extend(series, seeds, numbers, m, n)
    small = series_of(model, s, numbers, seeds_of(model, s, numbers, elements(s.small), None))
    small.advance((0, 0))
    small.advance((0, 1))
    return {
        "grown": [series.output(0, k).get((0, 1)) for k in range(n)],
        "grown_bend": _doubled([seeds[0, k].get((2, 1)) for k in range(n)], numbers),
        "grown_small": [small.output(0, k).get((0, 1)) for k in range(n)],
    }
