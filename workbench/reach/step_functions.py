"""The CasADi Functions of one tube step; they evaluate in Python and compile to C unchanged.

Notation of every Function: x (n) nominal state at t_k; r (n) radius of the set there; p parameters then
constants; w_mid, w_rad (n_w) disturbance centre and radius; slope, offset, gap (n_kinks) the affine
relaxation kappa = slope d + offset +- gap of every kink; h the step in s.

With e = x - nominal, A the Jacobian of the relaxed field g along the nominal and v = (w, error) the
exogenous inputs, the step rests on
    e' = A e + B v + rho,   |rho_i| <= 1/2 (w, v)^T |D^2 g_i| (w, v)        (Taylor's theorem)
with |D^2 g| over a box that contains nominal and tube for the whole step.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.models.system import Ode
from workbench.reach.majorants import Magnitudes, magnitude, step_terms
from workbench.sensitivity.inclusion import lift
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm, relax, smooth_form
from workbench.sensitivity.validity import verbatim

# The guessed range of the field is widened by this share of its size before it is verified; the driver
# starts from the previous step's range and repeats with the range found when a trial fails.
_INFLATION = 0.3
_LEAST_SLACK = 1e-9
PICARD_TRIALS = 8


@final
@dataclass(frozen=True, slots=True)
class StepFunctions:
    """The Functions of one step: enclose, driver_rows and relaxations (for kinks), bounds, advance,
    remainder; see `step_functions`."""

    form: SmoothForm
    relaxed: RelaxedForm
    enclose: ca.Function
    driver_rows: tuple[ca.Function, ...]
    relaxations: tuple[ca.Function, ...]
    bounds: ca.Function
    advance: ca.Function
    remainder: ca.Function

    @property
    def n_exogenous(self) -> int:
        """Number of disturbances and kink errors."""
        return self.form.ode.w.numel() + self.form.kappa.numel()


@final
@dataclass(frozen=True, slots=True)
class _Symbols:
    x: ca.SX
    r: ca.SX
    p: ca.SX
    w_mid: ca.SX
    w_rad: ca.SX
    slope: ca.SX
    offset: ca.SX
    gap: ca.SX
    h: ca.SX


def shared(outputs: list[ca.SX]) -> list[ca.SX]:
    """Common subexpressions merged, without the simplifications that hold for reals only."""
    with verbatim():
        return list(ca.cse(outputs))


def rk4(field: ca.Function, x: ca.SX, h: ca.SX, others: list[ca.SX]) -> ca.SX:
    """One classical Runge-Kutta step of length h (s) of x' = field(x, *others)."""
    return rk4_stages(field, x, h, others)[0]


def rk4_stages(
    field: ca.Function, x: ca.SX, h: ca.SX, others: list[ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """As `rk4`, with the last stage beside it."""
    k1 = field(x, *others)
    k2 = field(x + h / 2 * k1, *others)
    k3 = field(x + h / 2 * k2, *others)
    k4 = field(x + h * k3, *others)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), k4


def step_functions(ode: Ode) -> StepFunctions:
    """Build the Functions of one step of the sensitivity-plus-remainder tube for `ode`."""
    form = smooth_form(ode)
    relaxed = relax(form)
    n, n_w, n_k = ode.x.numel(), ode.w.numel(), form.kappa.numel()
    s = _Symbols(
        x=ca.SX.sym("x", n), r=ca.SX.sym("r", n), p=form.p,
        w_mid=ca.SX.sym("w_mid", n_w), w_rad=ca.SX.sym("w_rad", n_w),
        slope=relaxed.slope, offset=relaxed.offset, gap=ca.SX.sym("gap", n_k),
        h=ca.SX.sym("h"),
    )  # fmt: skip
    return StepFunctions(
        form=form,
        relaxed=relaxed,
        enclose=_enclose(form, s),
        driver_rows=tuple(_driver_row(form, relaxed, s, i) for i in range(n_k)),
        relaxations=tuple(_relaxation(form, relaxed, s, i) for i in range(n_k)),
        bounds=_bounds(form, relaxed, s),
        advance=_advance(form, relaxed, s),
        remainder=_remainder(form, relaxed, s),
    )


def _picard(field, s: _Symbols, guess: tuple[ca.SX, ca.SX]) -> list[ca.SX]:  # type: ignore[no-untyped-def]
    """A box B with X + [0, h] F(B) inside B from a guess of F: box ends, F ends, ok."""
    start_lower, start_upper = s.x - s.r, s.x + s.r
    slack = _INFLATION * s.h * ca.fmax(ca.fabs(guess[0]), ca.fabs(guess[1])) + _LEAST_SLACK
    box_lower, box_upper = _sweep(start_lower, start_upper, *guess, s.h)
    box_lower, box_upper = box_lower - slack, box_upper + slack
    f_lower, f_upper, ok = field(box_lower, box_upper)
    lower, upper = _sweep(start_lower, start_upper, f_lower, f_upper, s.h)
    # The strict comparison is false for NaN, so an invalid range can never pass as an enclosure.
    for i in range(s.x.numel()):
        ok = ok * (lower[i] > box_lower[i]) * (upper[i] < box_upper[i])
    return [lower, upper, f_lower, f_upper, ok]


def _sweep(
    lower: ca.SX, upper: ca.SX, f_lower: ca.SX, f_upper: ca.SX, h: ca.SX
) -> tuple[ca.SX, ca.SX]:
    return lower + ca.fmin(h * f_lower, 0), upper + ca.fmax(h * f_upper, 0)


def _enclose(form: SmoothForm, s: _Symbols) -> ca.Function:
    ode = form.ode
    n_p = ode.p.numel()

    def field(lower: ca.SX, upper: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        result = lift(
            [ode.field],
            [ode.x, ode.p, ode.w],
            [lower, s.p[:n_p], s.w_mid - s.w_rad],
            [upper, s.p[:n_p], s.w_mid + s.w_rad],
            outward=False,
        )
        return result.lower[0], result.upper[0], result.valid

    guess = ca.SX.sym("guess_lower", s.x.numel()), ca.SX.sym("guess_upper", s.x.numel())
    return ca.Function(
        "wb_enclose", [s.x, s.r, s.p, s.w_mid, s.w_rad, s.h, *guess],
        shared(_picard(field, s, guess)),
        ["x", "r", "p", "w_mid", "w_rad", "h", "guess_lower", "guess_upper"],
        ["box_lower", "box_upper", "f_lower", "f_upper", "ok"],
    )  # fmt: skip


def _bounds(form: SmoothForm, relaxed: RelaxedForm, s: _Symbols) -> ca.Function:
    """Picard trial for the relaxed field, with the magnitudes of its derivatives over the same box."""
    x = form.ode.x
    derivatives = _derivatives(form, relaxed)
    sizes: list[ca.SX] = []

    def field(lower: ca.SX, upper: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        result = lift(
            [relaxed.field, *[nonzeros(m) for m in derivatives]],
            [x, s.p, form.ode.w, s.slope, s.offset, relaxed.error],
            [lower, s.p, s.w_mid - s.w_rad, s.slope, s.offset, -s.gap],
            [upper, s.p, s.w_mid + s.w_rad, s.slope, s.offset, s.gap],
            outward=False,
        )
        sizes.extend(map(magnitude, result.lower[1:], result.upper[1:]))
        return result.lower[0], result.upper[0], result.valid

    guess = ca.SX.sym("guess_lower", x.numel()), ca.SX.sym("guess_upper", x.numel())
    picard = _picard(field, s, guess)
    return ca.Function(
        "wb_bounds",
        [s.x, s.r, s.p, s.w_mid, s.w_rad, s.slope, s.offset, s.gap, s.h, *guess],
        shared([*picard, ca.vertcat(*sizes)]),
        ["x", "r", "p", "w_mid", "w_rad", "slope", "offset", "gap", "h", "guess_lower",
         "guess_upper"],
        ["box_lower", "box_upper", "f_lower", "f_upper", "ok", "sizes"],
    )  # fmt: skip


def _derivatives(form: SmoothForm, relaxed: RelaxedForm) -> list[ca.SX]:
    """dg/dx, dg/dv and the upper triangles of D^2 g_i over (x, v)."""
    x, v = form.ode.x, ca.vertcat(form.ode.w, relaxed.error)
    z = ca.vertcat(x, v)
    hessians = [ca.triu(ca.hessian(relaxed.field[i], z)[0]) for i in range(x.numel())]
    return [ca.jacobian(relaxed.field, x), ca.jacobian(relaxed.field, v), *hessians]


def _driver_row(form: SmoothForm, relaxed: RelaxedForm, s: _Symbols, i: int) -> ca.Function:
    """Driver i at the nominal state and its gradient there, under the relaxations 0 .. i-1."""
    driver = relaxed.drivers[i]
    gradient = ca.densify(ca.jacobian(driver, form.ode.x))
    values = _at_nominal([driver, gradient], form, relaxed, s)
    return ca.Function(
        f"wb_driver_row_{i}", [s.x, s.p, s.w_mid, s.slope, s.offset], shared(values),
        ["x", "p", "w_mid", "slope", "offset"], ["driver", "gradient"],
    )  # fmt: skip


def _at_nominal(
    expressions: list[ca.SX], form: SmoothForm, relaxed: RelaxedForm, s: _Symbols
) -> list[ca.SX]:
    zero = ca.SX.zeros(relaxed.error.numel())
    symbols = [form.ode.x, form.ode.w, relaxed.error]
    return list(ca.substitute(expressions, symbols, [s.x, s.w_mid, zero]))


def _relaxation(form: SmoothForm, relaxed: RelaxedForm, s: _Symbols, i: int) -> ca.Function:
    """Range of driver i over the step, and the Chebyshev line of min(d, 0) over that range.

    The range is the intersection of the natural one over the a priori box and of the mean-value form
    d(x_k) +- (linear radius + 1/2 r^T |D^2 d| r) + [0, h] d' +- |dd/dv| v.
    """
    box_lower, box_upper = ca.SX.sym("box_lower", s.x.numel()), ca.SX.sym("box_upper", s.x.numel())
    f_lower, f_upper = ca.SX.sym("f_lower", s.x.numel()), ca.SX.sym("f_upper", s.x.numel())
    nominal, linear_radius = ca.SX.sym("driver"), ca.SX.sym("linear_radius")
    driver, x = relaxed.drivers[i], form.ode.x
    exogenous = ca.vertcat(form.ode.w, relaxed.error)
    f = ca.SX.sym("f", x.numel())
    rate = ca.jtimes(driver, x, f)
    hessian = ca.triu(ca.hessian(driver, x)[0])
    by_v = ca.jacobian(driver, exogenous)
    lifted = lift(
        [driver, rate, nonzeros(hessian), nonzeros(by_v)],
        [x, s.p, form.ode.w, s.slope, s.offset, relaxed.error, f],
        [box_lower, s.p, s.w_mid - s.w_rad, s.slope, s.offset, -s.gap, f_lower],
        [box_upper, s.p, s.w_mid + s.w_rad, s.slope, s.offset, s.gap, f_upper],
        outward=False,
    )
    sizes = [magnitude(low, high) for low, high in zip(lifted.lower, lifted.upper, strict=True)]
    second = Magnitudes.quadratic(hessian.sparsity(), sizes[2], s.r, s.r)
    radius_v = ca.vertcat(s.w_rad, s.gap)
    by_v_sum = ca.SX(0)
    for k, j in enumerate(by_v.sparsity().get_col()):
        by_v_sum = by_v_sum + sizes[3][k] * radius_v[j]
    radius = linear_radius + second / 2 + by_v_sum
    low = ca.fmax(nominal - radius + ca.fmin(s.h * lifted.lower[1], 0), lifted.lower[0])
    high = ca.fmin(nominal + radius + ca.fmax(s.h * lifted.upper[1], 0), lifted.upper[0])
    slope, offset, gap = _chebyshev_line(low, high, form.floor[i], form.ceiling[i])
    return ca.Function(
        f"wb_relaxation_{i}",
        [s.x, s.r, s.p, s.w_mid, s.w_rad, s.slope, s.offset, s.gap, s.h,
         box_lower, box_upper, f_lower, f_upper, nominal, linear_radius],
        shared([slope, offset, gap, lifted.valid]),
        ["x", "r", "p", "w_mid", "w_rad", "slope", "offset", "gap", "h",
         "box_lower", "box_upper", "f_lower", "f_upper", "driver", "linear_radius"],
        ["slope_i", "offset_i", "gap_i", "ok"],
    )  # fmt: skip


def _chebyshev_line(
    low: ca.SX, high: ca.SX, floor: ca.SX, ceiling: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Best affine approximation of clip(d, floor, ceiling) over low <= d <= high: slope, offset, gap.

    For a slope in [0, 1] the deviation clip(d) - slope d is extreme at the range's ends and at the knees
    inside it; its half range, convex and piecewise linear in the slope, is least where two of these
    values meet: the two secants tried here. Any choice is sound.
    """

    def clip(d: ca.SX) -> ca.SX:
        return ca.fmin(ca.fmax(d, floor), ceiling)

    lower_knee = ca.fmin(ca.fmax(low, floor), high)
    upper_knee = ca.fmax(ca.fmin(high, ceiling), low)
    candidates = []
    for left, right in ((low, upper_knee), (lower_knee, high)):
        spread = right - left
        slope = ca.if_else(spread > 0, (clip(right) - clip(left)) / ca.if_else(spread > 0, spread, 1), 0)
        slope = ca.fmin(ca.fmax(slope, 0), 1)
        deviations = [clip(d) - slope * d for d in (low, lower_knee, upper_knee, high)]
        top, bottom = deviations[0], deviations[0]
        for deviation in deviations[1:]:
            top, bottom = ca.fmax(top, deviation), ca.fmin(bottom, deviation)
        candidates.append((slope, (top + bottom) / 2, (top - bottom) / 2))
    better = candidates[0][2] <= candidates[1][2]
    slope, offset, gap = (
        ca.if_else(better, first, second) for first, second in zip(*candidates, strict=True)
    )
    # Where the range is decided the line is exact and the gap is rounding alone.
    linear = ca.logic_and(low >= floor, high <= ceiling)
    slope, offset, gap = ca.if_else(linear, 1, slope), ca.if_else(linear, 0, offset), ca.if_else(linear, 0, gap)
    return slope, offset, gap * (1 + 1e-12)


def _advance(form: SmoothForm, relaxed: RelaxedForm, s: _Symbols) -> ca.Function:
    """Nominal after the step, its derivatives by x (n x n) and by constant v (n x n_v), and cut.

    cut (n) = h/6 |k4 - g(x_end)|, the distance to the embedded third-order formula: an estimate, far
    above the error of the fourth-order one, of what the step leaves out of the nominal.
    """
    field = ca.Function(
        "g", [form.ode.x, s.p, form.ode.w, s.slope, s.offset, relaxed.error], [relaxed.field]
    )
    error = relaxed.error
    others = [s.p, s.w_mid, s.slope, s.offset, error]
    end, last_stage = rk4_stages(field, s.x, s.h, others)
    transition = ca.jacobian(end, s.x)
    by_v = ca.jacobian(end, ca.vertcat(s.w_mid, error))
    cut = s.h / 6 * ca.fabs(last_stage - field(end, *others))
    outputs = ca.substitute(
        [end, transition, by_v, cut], [error], [ca.SX.zeros(error.numel())]
    )
    return ca.Function(
        "wb_advance", [s.x, s.p, s.w_mid, s.slope, s.offset, s.h], shared(list(outputs)),
        ["x", "p", "w_mid", "slope", "offset", "h"],
        ["x_end", "transition", "by_exogenous", "cut"],
    )  # fmt: skip


def _remainder(form: SmoothForm, relaxed: RelaxedForm, s: _Symbols) -> ca.Function:
    """Everything second order over the step; see `majorants.step_terms` for the formulas."""
    derivatives = _derivatives(form, relaxed)
    counts = [m.nnz() for m in derivatives]
    sizes = ca.SX.sym("sizes", sum(counts))
    parts = ca.vertsplit(sizes, [0, *itertools.accumulate(counts)])
    matrices = [ca.SX(m.sparsity(), part) for m, part in zip(derivatives, parts, strict=True)]
    n = s.x.numel()
    f_lower, f_upper = ca.SX.sym("f_lower", n), ca.SX.sym("f_upper", n)
    r_end = ca.SX.sym("r_end", n)
    majorants = Magnitudes(
        jacobian=matrices[0], by_exogenous=matrices[1], hessians=tuple(matrices[2:]),
        field=magnitude(f_lower, f_upper),
    )  # fmt: skip
    terms = step_terms(majorants, s.r, r_end, ca.vertcat(s.w_rad, s.gap), s.h)
    return ca.Function(
        "wb_remainder",
        [s.r, r_end, s.w_rad, s.gap, s.h, f_lower, f_upper, sizes],
        shared([terms.box, terms.chord, terms.radius, terms.cut, terms.ok]),
        ["r", "r_end", "w_rad", "gap", "h", "f_lower", "f_upper", "sizes"],
        ["box", "chord", "radius", "cut", "ok"],
    )  # fmt: skip


def nonzeros(matrix: ca.SX) -> ca.SX:
    """The structural nonzeros as a column."""
    return ca.vertcat(*matrix.nonzeros()) if matrix.nnz() else ca.SX(0, 1)
