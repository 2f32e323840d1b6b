"""The CasADi Functions of one tube step; they evaluate in Python and compile to C unchanged.

Notation of every Function: x (n) nominal state at t_k; r (n) radius of the set there; p parameters,
then constants; w_mid, w_rad (n_w) disturbance centre and radius; slope, offset, gap (n_kinks) the
affine relaxation kappa = slope d + offset +- gap of every kink; h the step in s.

With e = x - nominal, A the Jacobian of the relaxed field g along the nominal and v = (w, error) the
exogenous inputs, the step rests on
    e' = A e + B v + rho,   |rho_i| <= 1/2 (w, v)^T |D^2 g_i| (w, v)        (Taylor's theorem)
with |D^2 g| over a box that contains nominal and tube for the whole step.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import casadi as ca

from workbench.models.system import Ode
from workbench.reach.derivatives import derivatives
from workbench.reach.majorants import Magnitudes, magnitude, step_terms
from workbench.reach.relaxation import driver_row, relaxation
from workbench.reach.step_symbols import StepSymbols, nonzeros, shared
from workbench.sensitivity.inclusion import lift
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm, relax, smooth_form

# The guessed range of the field is widened by this share of its size before it is verified; the
# driver starts from the previous step's range and repeats with the range found when a trial fails.
_INFLATION = 0.2
_LEAST_SLACK = 1e-9
PICARD_TRIALS = 8

# From a box (lower, upper) to the range of the field over it and whether that range is valid.
_Range = Callable[[ca.SX, ca.SX], tuple[ca.SX, ca.SX, ca.SX]]


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


def step_functions(ode: Ode) -> StepFunctions:
    """Build the Functions of one step of the sensitivity-plus-remainder tube for `ode`."""
    form = smooth_form(ode)
    relaxed = relax(form)
    n, n_w, n_k = ode.x.numel(), ode.w.numel(), form.kappa.numel()
    s = StepSymbols(
        x=ca.SX.sym("x", n), r=ca.SX.sym("r", n), p=form.p,
        w_mid=ca.SX.sym("w_mid", n_w), w_rad=ca.SX.sym("w_rad", n_w),
        slope=relaxed.slope, offset=relaxed.offset, gap=ca.SX.sym("gap", n_k),
        h=ca.SX.sym("h"),
    )  # fmt: skip
    return StepFunctions(
        form=form,
        relaxed=relaxed,
        enclose=_enclose(form, s),
        driver_rows=tuple(driver_row(form, relaxed, s, i) for i in range(n_k)),
        relaxations=tuple(relaxation(form, relaxed, s, i) for i in range(n_k)),
        bounds=_bounds(form, relaxed, s),
        advance=_advance(form, relaxed, s),
        remainder=_remainder(form, relaxed, s),
    )


def _picard(field: _Range, s: StepSymbols, guess: tuple[ca.SX, ca.SX]) -> list[ca.SX]:
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


def _enclose(form: SmoothForm, s: StepSymbols) -> ca.Function:
    ode = form.ode
    n_p = ode.p.numel()

    def field(lower: ca.SX, upper: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        result = lift(
            [ode.field],
            [ode.x, ode.p, ode.w],
            [lower, s.p[:n_p, :], s.w_mid - s.w_rad],
            [upper, s.p[:n_p, :], s.w_mid + s.w_rad],
            outward=False,
        )
        return result.lower[0], result.upper[0], result.valid

    guess = ca.SX.sym("guess_lower", s.x.numel()), ca.SX.sym("guess_upper", s.x.numel())
    return ca.Function(
        "wb_enclose", [s.x, s.r, s.p, s.w_mid, s.w_rad, s.h, *guess],
        shared([ca.densify(part) for part in _picard(field, s, guess)]),
        ["x", "r", "p", "w_mid", "w_rad", "h", "guess_lower", "guess_upper"],
        ["box_lower", "box_upper", "f_lower", "f_upper", "ok"],
    )  # fmt: skip


def _bounds(form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols) -> ca.Function:
    """Picard trial for the relaxed field, with its derivatives' magnitudes over the same box."""
    x = form.ode.x
    matrices = derivatives(form, relaxed).all()
    sizes: list[ca.SX] = []

    def field(lower: ca.SX, upper: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        result = lift(
            [relaxed.field, *[nonzeros(m) for m in matrices]],
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
        shared([*map(ca.densify, picard), ca.vertcat(*sizes)]),
        ["x", "r", "p", "w_mid", "w_rad", "slope", "offset", "gap", "h", "guess_lower",
         "guess_upper"],
        ["box_lower", "box_upper", "f_lower", "f_upper", "ok", "sizes"],
    )  # fmt: skip


def _advance(form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols) -> ca.Function:
    """Nominal after the step, its derivatives by x (n x n) and by constant v (n x n_v), and cut.

    cut (n) = h/6 |k4 - g(x_end)|, the distance to the embedded third-order formula: an estimate,
    far above the error of the fourth-order one, of what the step leaves out of the nominal.
    """
    first = derivatives(form, relaxed)
    inputs = [form.ode.x, s.p, form.ode.w, s.slope, s.offset, relaxed.error]
    stage = ca.Function("g", inputs, [relaxed.field, first.jacobian, first.by_exogenous])
    plain = ca.Function("g", inputs, [relaxed.field])
    others = [s.p, s.w_mid, s.slope, s.offset, ca.SX.zeros(relaxed.error.numel())]
    # The Runge-Kutta step of the variational equations: each stage's k with its derivatives.
    k: list[ca.SX] = []
    by_x: list[ca.SX] = []
    by_v: list[ca.SX] = []
    for share in (0.0, 0.5, 0.5, 1.0):
        ahead = share * s.h
        f, a, b = stage(s.x + ahead * k[-1] if k else s.x, *others)
        k.append(f)
        by_x.append(a + ahead * (a @ by_x[-1]) if by_x else a)
        by_v.append(b + ahead * (a @ by_v[-1]) if by_v else b)
    end, transition, by_exogenous = (
        s.h / 6 * (q[0] + 2 * q[1] + 2 * q[2] + q[3]) for q in (k, by_x, by_v)
    )
    end = s.x + end
    cut = s.h / 6 * ca.fabs(k[3] - plain(end, *others))
    moved = ca.SX.eye(s.x.numel()) + transition
    outputs = [ca.densify(end), moved, by_exogenous, ca.densify(cut)]
    return ca.Function(
        "wb_advance", [s.x, s.p, s.w_mid, s.slope, s.offset, s.h], shared(outputs),
        ["x", "p", "w_mid", "slope", "offset", "h"],
        ["x_end", "transition", "by_exogenous", "cut"],
    )  # fmt: skip


def _remainder(form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols) -> ca.Function:
    """Everything second order over the step; see `majorants.step_terms` for the formulas."""
    matrices = derivatives(form, relaxed).all()
    counts = [m.nnz() for m in matrices]
    sizes = ca.SX.sym("sizes", sum(counts))
    parts = ca.vertsplit(sizes, [0, *itertools.accumulate(counts)])
    bounds = [ca.SX(m.sparsity(), part) for m, part in zip(matrices, parts, strict=True)]
    n = s.x.numel()
    f_lower, f_upper = ca.SX.sym("f_lower", n), ca.SX.sym("f_upper", n)
    r_end = ca.SX.sym("r_end", n)
    majorants = Magnitudes(
        jacobian=bounds[0], by_exogenous=bounds[1], hessians=tuple(bounds[2:]),
        field=magnitude(f_lower, f_upper),
    )  # fmt: skip
    terms = step_terms(majorants, s.r, r_end, ca.vertcat(s.w_rad, s.gap), s.h)
    vectors = (terms.box, terms.chord, terms.radius, terms.cut)
    return ca.Function(
        "wb_remainder",
        [s.r, r_end, s.w_rad, s.gap, s.h, f_lower, f_upper, sizes],
        shared([*map(ca.densify, vectors), terms.ok]),
        ["r", "r_end", "w_rad", "gap", "h", "f_lower", "f_upper", "sizes"],
        ["box", "chord", "radius", "cut", "ok"],
    )  # fmt: skip
