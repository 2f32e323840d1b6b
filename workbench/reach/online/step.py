"""The Functions of one online step at points: advance, derivatives along the set, drivers."""

from __future__ import annotations

import casadi as ca

from workbench.reach.online.flow import direction, horner, state_series
from workbench.reach.online.model import OnlineModel
from workbench.reach.online.transition import transition_of
from workbench.sensitivity.derivatives import derivatives
from workbench.sensitivity.validity import verbatim

_POINT = ("x", "p", "w_mid", "slope", "offset")
_LEAST_RADIUS = 2.0**-100


def point_symbols(model: OnlineModel) -> tuple[ca.SX, ...]:
    """x, p, w_mid, slope, offset: where point Functions are evaluated; kink errors are 0."""
    sizes = (model.n, model.form.p.numel(), model.n_w, model.n_k, model.n_k)
    return tuple(ca.SX.sym(name, size) for name, size in zip(_POINT, sizes, strict=True))


def advance_function(model: OnlineModel, order: int) -> ca.Function:
    """Function `wb_advance`: (x, p, w_mid, slope, offset, h) -> one Taylor step of this order.

    x_end (n): sum of h^i x_i; transition (n x n, sparse): its derivative by x, sum of h^i Phi_i,
    (i + 1) Phi_(i+1) = sum_j A_j Phi_(i-j), A_j the coefficients of the Jacobian along the flow.
    """
    point, h = point_symbols(model), ca.SX.sym("h")
    x_end, scaled, shares = _series(model, point, h, order)
    with verbatim():
        outputs = list(ca.cse([x_end, transition_of(scaled, shares)]))
    return ca.Function("wb_advance", [*point, h], outputs, [*_POINT, "h"], ["x_end", "transition"])


def rates_function(model: OnlineModel, order: int) -> tuple[ca.Function, tuple[ca.Sparsity, ...]]:
    """`wb_advance` with what the transition is made of in its place, and its structure.

    rates: h, h / 2, ..., h / order, then the nonzeros of A_0, h A_1, h^2 A_2, ..., one matrix after
    the other. `transition_rows` makes of them what `advance_function` returns, operation by
    operation.
    """
    point, h = point_symbols(model), ca.SX.sym("h")
    x_end, scaled, shares = _series(model, point, h, order)
    packed = ca.vertcat(*shares, *[nonzeros(a) for a in scaled])
    with verbatim():
        outputs = list(ca.cse([x_end, packed]))
    function = ca.Function("wb_advance", [*point, h], outputs, [*_POINT, "h"], ["x_end", "rates"])
    return function, tuple(a.sparsity() for a in scaled)


def _series(
    model: OnlineModel, point: tuple[ca.SX, ...], h: ca.SX, order: int
) -> tuple[ca.SX, list[ca.SX], list[ca.SX]]:
    """The state's Taylor step, the Jacobian's coefficients h^j A_j along the flow, h / (i + 1)."""
    n = model.n
    states = state_series(model, point, order)
    x_end = ca.vertcat(*[horner([s.get(i) for i in range(order + 1)], h) for s in states])
    jacobians = [ca.SX(n, n) for _ in range(order)]
    for j in range(n):
        for (row, i), value in direction(model, point, states, (0, j), order).items():
            jacobians[i][row, j] = value
    powers = [ca.SX(1), h]
    while len(powers) < order:
        powers.append(powers[-1] * h)
    scaled = [ca.sparsify(a * power) for a, power in zip(jacobians, powers, strict=True)]
    return x_end, scaled, [h / (i + 1) for i in range(order)]


def input_function(model: OnlineModel) -> ca.Function:
    """Function `wb_inputs`: B = dg/dv at a point (n x n_v, sparse)."""
    point = point_symbols(model)
    matrix = ca.SX(model.n, model.n_v)
    states = [{0: ca.vec(point[0])[k]} for k in range(model.n)]
    for column in range(model.n_v):
        element = (2, column) if column < model.n_w else (5, column - model.n_w)
        for (row, _), value in direction(model, point, states, element, 1).items():
            matrix[row, column] = value
    return ca.Function(
        "wb_inputs", list(point), [ca.cse(ca.sparsify(matrix))], list(_POINT), ["by_input"]
    )


def driver_function(model: OnlineModel, columns: tuple[int, ...]) -> ca.Function:
    """Function `wb_drivers`: what limits act on, at a point, and how it varies over a set.

    In: the point; linear, rest (n): radii of the set's linear part and of the rest; columns as in
    `second_function`. Out: driver (n_k), gradient (n_k x n, row by row), second (n_k):
    1/2 |D2d| ((linear + rest)^2 - linear^2), pairs (n_k x pairs): what D2d makes of the columns.
    In the linear form linear is 0 and there are no pairs.
    """
    point, n, x = point_symbols(model), model.n, model.ode.x
    drivers = model.relaxed.drivers
    curvatures = [ca.triu(ca.hessian(drivers[k], x)[0]) for k in range(model.n_k)]
    values = [drivers, ca.densify(ca.jacobian(drivers, x)), *map(ca.densify, curvatures)]
    values = at_point(model, values, point)
    curvatures = [ca.sparsify(value) for value in values[2:]]
    linear, rest = ca.SX.sym("linear", n), ca.SX.sym("rest", n)
    second = [_mixed(c.sparsity(), [ca.fabs(v) for v in c.nonzeros()], linear, rest)
              for c in curvatures]  # fmt: skip
    outputs = [values[0], values[1].T, ca.vertcat(*second)]
    inputs, names = [*point, linear, rest], ["driver", "gradient", "second"]
    input_names = [*_POINT, "linear", "rest"]
    if columns:
        flat, matrix = _set_columns(model, columns)
        pairs = [
            (0.5 if j == k else 1.0) * (matrix[:, j].T @ _symmetric(c) @ matrix[:, k])
            for c in curvatures
            for j, k in pairs_of(model, columns)
        ]
        outputs.append(ca.densify(ca.vertcat(*pairs)))
        names.append("pairs")
        inputs.append(flat)
        input_names.append("columns")
    return ca.Function("wb_drivers", inputs, list(ca.cse(outputs)), input_names, names)


def _symmetric(upper: ca.SX) -> ca.SX:
    return ca.sparsify(upper + ca.triu(upper, False).T)


def _mixed(sparsity: ca.Sparsity, sizes: list[ca.SX], linear: ca.SX, rest: ca.SX) -> ca.SX:
    """1/2 H ((linear + rest)^2 - linear^2) of a symmetric H >= 0 given by its upper triangle."""
    total = ca.SX(0)
    for size, j, k in zip(sizes, *sparsity.get_triplet(), strict=True):
        product = linear[j] * rest[k] + rest[j] * linear[k] + rest[j] * rest[k]
        total = total + (0.5 * size if j == k else size) * product
    return total


def at_point(model: OnlineModel, expressions: list[ca.SX], point: tuple[ca.SX, ...]) -> list[ca.SX]:
    """Expressions of the model's inputs with kink errors 0."""
    zero = ca.SX.zeros(model.n_k)
    return list(ca.substitute(expressions, list(model.inputs), [*point, zero]))


def hessians(model: OnlineModel) -> list[ca.SX]:
    """Upper triangles of D^2 g_i over (x, v), sparse, in the model's inputs."""
    return list(derivatives(model.form, model.relaxed).hessians)


def second_function(model: OnlineModel, columns: tuple[int, ...]) -> ca.Function:
    """Function `wb_second`: second derivatives at a point, and what they make of the set's columns.

    columns: the states whose initial deviations d span the set's linear part S d (none: the linear
    form). In: the point, then with columns S scaled by the initial radii (n x columns, row by row).
    Out: hessian: nonzeros of all upper triangles over (x, v), one after the other; with columns
    also source B and bent source C = dB/dt - A B (n x pairs each, dense, row by row), pairs as in
    `pairs_of`: B_jl = D2f[s_j, s_l], halved for j = l, so that sum B_jl d_j d_l =
    1/2 D2f[S d, S d].
    """
    point = point_symbols(model)
    values = [nonzeros(h) for h in hessians(model)]
    outputs = at_point(model, [ca.vertcat(*values)], point)
    names, inputs, input_names = ["hessian"], list(point), list(_POINT)
    if columns:
        flat, matrix = _set_columns(model, columns)
        source, bent = _pair_sources(model, point, matrix, pairs_of(model, columns))
        outputs += [ca.densify(source), ca.densify(bent)]
        names += ["source", "bent_source"]
        inputs.append(flat)
        input_names.append("columns")
    return ca.Function("wb_second", inputs, list(ca.cse(outputs)), input_names, names)


def _set_columns(model: OnlineModel, columns: tuple[int, ...]) -> tuple[ca.SX, ca.SX]:
    """Symbols of the columns, row by row, and the matrix they make, without structural zeros."""
    flat = ca.SX.sym("columns", model.n * len(columns))
    matrix = ca.reshape(flat, len(columns), model.n).T
    return flat, ca.sparsify(matrix * _reached(model, columns))


def _reached(model: OnlineModel, columns: tuple[int, ...]) -> ca.DM:
    """1 where a state can ever depend on the initial value of a column's state, else 0."""
    reached = ca.DM.zeros(model.n, len(columns))
    influence = ca.DM(ca.jacobian(model.relaxed.field, model.ode.x).sparsity(), 1)
    for k, column in enumerate(columns):
        reached[column, k] = 1
    for _ in range(model.n):
        reached = ca.sign(reached + influence @ reached)
    return reached


def pairs_of(model: OnlineModel, columns: tuple[int, ...]) -> list[tuple[int, int]]:
    """Pairs (j, l), j <= l, of columns that the second derivatives can ever bring together."""
    reached = _reached(model, columns)
    found = []
    for j in range(len(columns)):
        for k in range(j, len(columns)):
            hits = [
                reached[r, j] * reached[c, k] + reached[c, j] * reached[r, k]
                for h in hessians(model)
                for r, c in zip(*h[: model.n, : model.n].sparsity().get_triplet(), strict=True)
            ]
            if any(float(hit) for hit in hits):
                found.append((j, k))
    return found


def nonzeros(matrix: ca.SX) -> ca.SX:
    """The structural nonzeros as a column."""
    return ca.vertcat(*matrix.nonzeros()) if matrix.nnz() else ca.SX(0, 1)


def _pair_sources(
    model: OnlineModel,
    point: tuple[ca.SX, ...],
    matrix: ca.SX,
    pairs: list[tuple[int, int]],
) -> tuple[ca.SX, ca.SX]:
    """B and C, flattened row by row over the pairs."""
    n, x = model.n, model.ode.x
    full = [_symmetric(h[:n, :n]) for h in hessians(model)]
    field = model.relaxed.field
    jacobian = ca.jacobian(field, x)
    rates = [ca.sparsify(ca.jtimes(ca.densify(h), x, field)) if h.nnz() else h for h in full]
    values = at_point(model, [ca.densify(jacobian), *map(ca.densify, full + rates)], point)
    values = [ca.sparsify(v) for v in values]
    jacobian, full, rates = values[0], values[1 : n + 1], values[n + 1 :]
    moved = jacobian @ matrix
    sources, bents = [], []
    for j, k in pairs:
        s_j, s_k, m_j, m_k = matrix[:, j], matrix[:, k], moved[:, j], moved[:, k]
        b = ca.vertcat(*[s_j.T @ h @ s_k for h in full])
        rate = ca.vertcat(*[
            s_j.T @ r @ s_k + m_j.T @ h @ s_k + s_j.T @ h @ m_k
            for h, r in zip(full, rates, strict=True)
        ])  # fmt: skip
        share = 0.5 if j == k else 1.0
        sources.append(share * b)
        bents.append(share * (rate - jacobian @ b))
    return ca.vec(ca.horzcat(*sources).T), ca.vec(ca.horzcat(*bents).T)


def source_function(
    model: OnlineModel, *, upward: bool = False, quadratic: bool = True
) -> ca.Function:
    """Function `wb_source`: (sizes, linear, rest, v) -> 1/2 |D2g| ((w, v)^2 - (linear, 0)^2).

    sizes: |hessian| of `wb_second`; w = linear + rest, radii of the set (n each); v (n_v). The term
    1/2 D2f[S d, S d] is carried exactly by the quadratic form; without it `linear` is taken as 0.
    upward: an upper bound of that, even where every input is up to three roundings too small;
    without it the roundings of a row, relative, are the caller's.
    """
    n = model.n
    matrices = hessians(model)
    sizes = ca.SX.sym("sizes", sum(h.nnz() for h in matrices))
    linear, rest, v = ca.SX.sym("linear", n), ca.SX.sym("rest", n), ca.SX.sym("v", model.n_v)
    known = ca.vertcat(linear if quadratic else ca.SX.zeros(n), ca.SX.zeros(model.n_v))
    more = ca.vertcat(rest, v)
    if upward:
        # Products of two then stay far above where they underflow.
        more = more + _LEAST_RADIUS
    rows, left = [], ca.vertsplit(sizes) if sizes.numel() else []
    for h in matrices:
        found, left = left[: h.nnz()], left[h.nnz() :]
        row = _mixed(h.sparsity(), found, known, more)
        rows.append(_raised(row, h.nnz()) if upward else row)
    return ca.Function(
        "wb_source", [sizes, linear, rest, v], [ca.cse(ca.densify(ca.vertcat(*rows)))],
        ["sizes", "linear", "rest", "v"], ["rate"],
    )  # fmt: skip


def _raised(row: ca.SX, count: int) -> ca.SX:
    """Upper bound of the exact sum of `count` terms, computed as `row` from numbers >= 0.

    Three numbers in a term, each three roundings short, its six operations, the sum: at most
    count + 15 factors 1 - 2^-53. Underflow takes 2^-870 of a product of radii, or 2^-1074 at last.
    """
    return row * (1 + (count + 16) * 2.0**-52) + 2.0**-1000 if count else row
