"""Proved growth of quadratic norms under interval matrices: pure functions, one number per matrix.

For A in [lower, upper] (one interval matrix per row of a stack) and norms |e|_k = sqrt(e^T P_k e):
    rate:      A^T P + P A <= 2 r P,             hence |e|' <= r |e| along e' = A e;
    coupling:  [[c P_l, A^T P_k], [P_k A, c P_k]] >= 0,   hence |A e|_k <= c |e|_l.
Both are matrix inequalities G(A) + G(A)^T <= r N, linear in A. Eigenvalues computed in floating
point only propose r; it is raised until outward-rounded elimination proves the inequality.
"""

from __future__ import annotations

import enum
import itertools

import numpy as np

from workbench.errors import InputError
from workbench.sensitivity.interval_arrays import (
    Flags,
    Interval,
    add,
    matrix_product,
    multiply,
    negate,
    point,
    positive_definite,
    transpose,
)
from workbench.sensitivity.vectorised import Array

# Up to this many states a program lists all sign vectors.
SIGNED_MOST = 8
_MOST_UNCERTAIN = 14
_MOST_SIGNS = 12
_ROUNDING = 2.0**-44
_FIRST_MARGIN, _MARGIN_FACTOR, _LARGEST_MARGIN = 1e-13, 8.0, 1e3


class Form(enum.Enum):
    """How all matrices of an interval matrix are covered.

    VERTICES: its extreme matrices, two to the power of the uncertain entries; exact.
    CENTRE_RADIUS: A = C + D with |D| <= E, and for any a_ij > 0, p_i = P e_i,
    D^T P + P D <= sum_ij E_ij (a_ij p_i p_i^T + e_j e_j^T / a_ij): one matrix, somewhat wider.
    """

    VERTICES = "VERTICES"
    CENTRE_RADIUS = "CENTRE_RADIUS"


def metric_rates(lower: Array, upper: Array, *, metric: Array, form: Form) -> Array:
    """r (C,) with A^T P + P A <= 2 r P for every A in [lower, upper] (C, n, n); P = metric (n, n).

    inf where nothing is proved (an infinite hull, a metric that is not positive definite). One
    state needs no metric: r = upper. Raises InputError where VERTICES would be too many.
    """
    if len(metric) == 1:
        return np.asarray(upper[:, 0, 0])
    return _bounds(lower, upper, row=metric, column=None, form=form)


def coupling_bounds(lower: Array, upper: Array, *, row: Array, column: Array, form: Form) -> Array:
    """c (C,) with |A e|_row <= c |e|_column for every A in [lower, upper] (C, n_row, n_column).

    row, column: the metrics of the two norms. 0 for a hull of zeros, otherwise as `metric_rates`.
    """
    result = np.zeros(len(lower))
    some = np.any((lower != 0.0) | (upper != 0.0), axis=(1, 2))
    if some.any():
        result[some] = _bounds(lower[some], upper[some], row=row, column=column, form=form)
    return result


def diagonal_rates(lower: Array, upper: Array, *, squared_weights: Array) -> Array:
    """r (C,) as `metric_rates` for P = diag(squared_weights), exact up to rounding.

    The matrices A^T P + P A then fill a symmetric interval matrix [S - R, S + R], whose largest
    eigenvalue is that of S + D_z R D_z for one of the sign vectors z (Rohn, SIAM J. Matrix Anal.
    Appl. 15(1), 1994); beyond 12 states R is replaced by its row sums.
    """
    size = len(squared_weights)
    metric = np.diag(squared_weights)
    with np.errstate(all="ignore"):
        hull = _symmetrised(matrix_product(point(metric), (lower, upper)))
        middle = 0.5 * hull[0] + 0.5 * hull[1]
        middle = 0.5 * (middle + np.swapaxes(middle, 1, 2))
        radius = np.maximum(
            add(point(middle), negate(hull))[1], add(hull, negate(point(middle)))[1]
        )
    weight = 2.0 * metric
    if size > _MOST_SIGNS:
        sums = np.zeros(radius.shape[:2])
        for j in range(size):
            sums = np.nextafter(sums + radius[:, :, j], np.inf)
        spread = np.zeros_like(radius)
        spread[:, np.arange(size), np.arange(size)] = sums
        return _proved_ratios(add(point(middle), point(spread)), weight)
    signs = sign_vectors(size)
    turned = radius[:, None] * (signs[:, :, None] * signs[:, None, :])
    forms = add(point(middle[:, None]), point(turned))
    flat = [end.reshape(-1, size, size) for end in forms]
    ratios = _proved_ratios((flat[0], flat[1]), weight)
    return np.asarray(ratios.reshape(len(lower), -1).max(axis=1))


def sign_vectors(size: int) -> Array:
    """All vectors of signs with first entry 1: (2^(size - 1), size)."""
    rest = itertools.product((1.0, -1.0), repeat=size - 1)
    return np.array([(1.0, *signs) for signs in rest])


def extreme_matrices(lower: Array, upper: Array) -> Interval:
    """The matrices (2^K, n, m) of ends of the K uncertain entries of one hull (n, m).

    Entries no wider than rounding stay intervals. Raises InputError for more than 14 entries.
    """
    uncertain = np.argwhere(uncertain_entries(lower, upper))
    if len(uncertain) > _MOST_UNCERTAIN:
        raise InputError(
            f"expected at most {_MOST_UNCERTAIN} uncertain entries of a Jacobian for its extreme "
            f"matrices, got {len(uncertain)}; take more cells or the form CENTRE_RADIUS"
        )
    choices = np.array(list(itertools.product((False, True), repeat=len(uncertain))))
    low, high = (np.repeat(end[None], len(choices), axis=0) for end in (lower, upper))
    for k, (i, j) in enumerate(uncertain):
        chosen = np.where(choices[:, k], upper[i, j], lower[i, j])
        low[:, i, j], high[:, i, j] = chosen, chosen
    return low, high


def uncertain_entries(lower: Array, upper: Array) -> Flags:
    """Which entries (..., n, m) are wider than a few roundings of the largest of their matrix."""
    largest = np.maximum(np.abs(lower), np.abs(upper)).max(axis=(-2, -1), keepdims=True)
    return np.asarray(upper - lower > _ROUNDING * largest)


def _bounds(lower: Array, upper: Array, *, row: Array, column: Array | None, form: Form) -> Array:
    weight = 2.0 * row if column is None else _stacked(column, row)
    if form is Form.CENTRE_RADIUS:
        return _proved_ratios(_covering(lower, upper, row=row, column=column), weight)
    result = np.full(len(lower), np.inf)
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if np.all(np.isfinite(low) & np.isfinite(high)):
            form_of_all = _form(extreme_matrices(low, high), row, column)
            result[k] = _proved_ratios(form_of_all, weight).max()
    return result


def _form(matrices: Interval, row: Array, column: Array | None) -> Interval:
    """G + G^T with G = P A, for a coupling in the lower left corner of zeros."""
    product = matrix_product(point(row), matrices)
    return _symmetrised(product if column is None else _cornered(product))


def _covering(lower: Array, upper: Array, *, row: Array, column: Array | None) -> Interval:
    """The form of the centre plus what covers the deviations; NaN for infinite hulls."""
    with np.errstate(all="ignore"):
        centre = 0.5 * lower + 0.5 * upper
        radius = np.nextafter(np.maximum(upper - centre, centre - lower), np.inf)
        total = _form(point(centre), row, column)
    inverse = np.diag(np.linalg.inv(row if column is None else column))
    shift = 0 if column is None else len(inverse)
    for i, j in np.argwhere(np.any(upper > lower, axis=0)):
        # Any positive number is sound; this one balances the two terms in the metric.
        balance = float(np.sqrt(abs(inverse[j]) / row[i, i]))
        size = total[0].shape[-1]
        vector, place = np.zeros(size), np.zeros((size, size))
        vector[shift:] = row[:, i]
        place[j, j] = np.nextafter(1.0 / balance, np.inf)
        outer = multiply(point(vector[:, None]), point(vector[None, :]))
        cover = add(multiply(point(np.array(balance)), outer), point(place))
        total = add(total, multiply(point(radius[:, i, j, None, None]), cover))
    return total


def _symmetrised(matrices: Interval) -> Interval:
    return add(matrices, transpose(matrices))


def _cornered(matrices: Interval) -> Interval:
    low, high = matrices
    count, rows, columns = low.shape
    result = np.zeros((2, count, rows + columns, rows + columns))
    result[0][:, columns:, :columns], result[1][:, columns:, :columns] = low, high
    return result[0], result[1]


def _stacked(first: Array, second: Array) -> Array:
    size = len(first)
    result = np.zeros((size + len(second),) * 2)
    result[:size, :size], result[size:, size:] = first, second
    return result


def _proved_ratios(forms: Interval, weight: Array) -> Array:
    """r (N,) with S <= r weight for every symmetric S in `forms` (N, m, m)."""
    result = np.full(len(forms[0]), np.inf)
    if not bool(positive_definite(point(weight[None]))[0]):
        return result
    known = np.isfinite(forms[0]).all(axis=(1, 2)) & np.isfinite(forms[1]).all(axis=(1, 2))
    pending = np.flatnonzero(known)
    if not len(pending):
        return result
    factor = np.linalg.inv(np.linalg.cholesky(weight))
    middle = 0.5 * (forms[0][pending] + forms[1][pending])
    values = np.linalg.eigvalsh(factor @ (0.5 * (middle + np.swapaxes(middle, 1, 2))) @ factor.T)
    guess, size = values[:, -1], np.abs(values).max(axis=1) + 1e-9
    margin = _FIRST_MARGIN
    while len(pending) and margin < _LARGEST_MARGIN:
        trial = guess + margin * size
        scaled = multiply(point(trial[:, None, None]), point(weight))
        rest = add(scaled, negate((forms[0][pending], forms[1][pending])))
        passed = positive_definite(rest)
        result[pending[passed]] = trial[passed]
        pending, guess, size = pending[~passed], guess[~passed], size[~passed]
        margin *= _MARGIN_FACTOR
    return result
