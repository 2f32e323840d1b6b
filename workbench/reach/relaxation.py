"""Kinks over one tube step: the range of what is limited, and the best line through its clip."""

from __future__ import annotations

import casadi as ca

from workbench.reach.majorants import Magnitudes, magnitude
from workbench.reach.step_symbols import StepSymbols, nonzeros, shared
from workbench.sensitivity.inclusion import lift
from workbench.sensitivity.kinks import RelaxedForm, SmoothForm


def driver_row(form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols, i: int) -> ca.Function:
    """Driver i at the nominal state and its gradient there, under the relaxations 0 .. i-1."""
    driver = relaxed.drivers[i]
    gradient = ca.densify(ca.jacobian(driver, form.ode.x))
    values = _at_nominal([driver, gradient], form, relaxed, s)
    return ca.Function(
        f"wb_driver_row_{i}", [s.x, s.p, s.w_mid, s.slope, s.offset], shared(values),
        ["x", "p", "w_mid", "slope", "offset"], ["driver", "gradient"],
    )  # fmt: skip


def _at_nominal(
    expressions: list[ca.SX], form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols
) -> list[ca.SX]:
    zero = ca.SX.zeros(relaxed.error.numel())
    symbols = [form.ode.x, form.ode.w, relaxed.error]
    return list(ca.substitute(expressions, symbols, [s.x, s.w_mid, zero]))


def relaxation(form: SmoothForm, relaxed: RelaxedForm, s: StepSymbols, i: int) -> ca.Function:
    """Range of driver i over the step, and the Chebyshev line of its clip over that range.

    The clip is clip(d, floor, ceiling); slope, offset and gap of the line come out, ok is 0 where a
    range is invalid.

    The range is the intersection of the natural one over the a priori box and of the mean-value
    form d(x_k) +- (linear radius + 1/2 r^T |D^2 d| r) + [0, h] d' +- |dd/dv| v.
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
    """Slope, offset and gap of the best line through clip(d, floor, ceiling) for low <= d <= high.

    For a slope in [0, 1] the deviation clip(d) - slope d is extreme at the range's ends and at the
    knees inside it; its half range, convex and piecewise linear in the slope, is least where two of
    these values meet: the two secants tried here. Any choice is sound.
    """

    def clip(d: ca.SX) -> ca.SX:
        return ca.fmin(ca.fmax(d, floor), ceiling)

    lower_knee = ca.fmin(ca.fmax(low, floor), high)
    upper_knee = ca.fmax(ca.fmin(high, ceiling), low)
    candidates = []
    for left, right in ((low, upper_knee), (lower_knee, high)):
        spread = right - left
        slope = ca.if_else(
            spread > 0, (clip(right) - clip(left)) / ca.if_else(spread > 0, spread, 1), 0
        )
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
    slope, offset, gap = (
        ca.if_else(linear, 1, slope),
        ca.if_else(linear, 0, offset),
        ca.if_else(linear, 0, gap),
    )
    return slope, offset, gap * (1 + 1e-12)
