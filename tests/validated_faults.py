"""Faults to plant in the validated integrator, each with the check that must notice it."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
import validated_catchers as parts
import validated_tube_catchers as tubes

from workbench.reach import ranged_parameters
from workbench.reach.validated import (
    algebra,
    angle,
    composition,
    forcing,
    lines,
    operations,
    picard,
    run,
    series,
    sets,
    step,
    tape,
)


@dataclass(frozen=True)
class Fault:
    """`function` with the text `old` replaced by `new`, noticed by a positive count of `catch`."""

    name: str
    function: Callable[..., Any]
    old: str
    new: str
    catch: Callable[[], int]

    def plant(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Replace the function's code everywhere it is used."""
        function = getattr(self.function, "__func__", self.function)
        source = textwrap.dedent(inspect.getsource(function))
        assert self.old in source, f"{self.name}: {self.old!r} is no longer in the source"
        space: dict[str, Any] = {}
        mutant = compile(source.replace(self.old, self.new), f"<{self.name}>", "exec")
        exec(mutant, dict(function.__globals__), space)
        made = space[function.__name__]
        made = getattr(made, "__func__", made)
        monkeypatch.setattr(function, "__code__", made.__code__)


def _tube(name: str, step_s: float = 0.05, degree: int = 2) -> Callable[[], int]:
    return lambda: tubes.outside_box_tube(name, step_s=step_s, degree=degree)


def _point(name: str, step_s: float = 0.05) -> Callable[[], int]:
    return lambda: tubes.outside_point_tube(name, step_s=step_s)


def _operation(name: str, size: float = 0.2) -> Callable[[], int]:
    return lambda: tubes.outside_operation(name, size)


def _step(name: str, h: float = 0.4, order: int = 2) -> Callable[[], int]:
    return lambda: tubes.outside_step(name, h=h, order=order)


def _lines() -> int:
    return parts.line_violations(5, 1.0)


ROUNDING = (
    Fault("products are not rounded", series.convolution, "rounding = (", "rounding = 0.0 * (",
          lambda: parts.points_escape("product")),
    Fault("sums are not rounded", series.linear, "len(present) * UNIT", "0.0",
          lambda: parts.points_escape("sum")),
    Fault("radii are not rounded up", algebra.upward, "radius * _UP + _TINY", "radius",
          parts.rounded_radii),
    Fault("underflow is lost", algebra.upward, " + _TINY", "", parts.underflowing),
    Fault("the sum over the orders is not rounded", step._summed,
          "UNIT * (2.0 * size + after)", "0.0",
          lambda: tubes.outside_step("decay", h=0.01, order=6, point=True)),
    Fault("bounds are not rounded", algebra.Algebra.bounds, "UNIT * total", "0.0 * total",
          parts.bounds_missed),
    Fault("squares of coefficients underflow", algebra.Algebra.bounds,
          "-0.25 * (first * (first / square))", "-(first * first) / (4.0 * square)",
          parts.tiny_bounds_missed),
    Fault("lines are not rounded", lines.chebyshev_line, "8.0 * UNIT * size", "0.0 * size", _lines),
    Fault("the radius of a box is not rounded up", sets.PolynomialSet.of_boxes,
          "np.nextafter(np.maximum(upper - center, center - lower), np.inf)",
          "np.maximum(upper - center, center - lower)", tubes.box_ends_lost),
)  # fmt: skip

TRUNCATION = (
    Fault("the series ends without its last term", step._summed,
          "h * series.coef[order + 1, batch:]", "0.0 * series.coef[order + 1, batch:]",
          _step("oscillator")),
    Fault("the last term is taken at the start", step._summed,
          "[order + 1, batch:]", "[order + 1, :batch]", _step("sine")),
    Fault("the state does not move within a step", step.Stepper._series,
          "np.minimum(h * rates[0], 0.0), np.maximum(h * rates[1], 0.0)",
          "0.0 * rates[0], 0.0 * rates[1]", _step("sine")),
    Fault("the enclosure has no length in time", picard._swept, "h * rates", "0.0 * rates",
          _tube("square", 0.7)),
    Fault("the enclosure is not checked", picard.enclosure, "if trial and np.all(",
          "if not trial or np.all(", _tube("square", 0.7)),
)  # fmt: skip

REMAINDER = (
    Fault("dropped products are forgotten", series.convolution, "lost + spread.sum", "spread.sum",
          _tube("square")),
    Fault("radii are not multiplied", series.convolution, "a.radius[left] * (", "0.0 * (",
          _tube("square")),
    Fault("Lagrange's remainder is forgotten", composition._remainders, "upward(over_set * powers)",
          "0.0 * powers", _operation("inverse", 0.6)),
    Fault("the last derivative has no middle", composition.compose,
          "derivatives.coef[i, batch:, 0]", "derivatives.coef[i, :batch, 0]",
          _operation("sin", 3.0)),
    Fault("a square's range is too small", operations.square, "np.abs(a.coef[0][:, 0])",
          "0.5 * np.abs(a.coef[0][:, 0])", _operation("atan", 0.6)),
    Fault("the remainder is taken at the centre", composition._derivatives,
          "[np.zeros(batch), size]", "[np.zeros(batch), 0.0 * size]", _operation("log", 0.35)),
    Fault("the polynomial is one degree short", composition.compose,
          "range(alg.degree, -1, -1)", "range(alg.degree - 1, -1, -1)", _operation("sqrt")),
    Fault("the zonotope is dropped", sets.PolynomialSet.mapped, "[moved, more, diagonal]",
          "[0.0 * moved, more, diagonal]", tubes.outside_bang_bang),
    Fault("new remainders are dropped", sets.PolynomialSet.mapped, "[moved, more, diagonal]",
          "[moved, more]", _tube("square")),
)  # fmt: skip

SIGNS = (
    Fault("the cosine grows", operations.Pair.extend, "else -coef", "else coef",
          tubes.runs_outside_the_loop),
    Fault("a difference is a sum", tape._Builder._binary, "(-1.0, b)", "(1.0, b)",
          tubes.runs_outside_the_loop),
    Fault("a negation is lost", tape._Builder._unary, "Linear((-1.0, a))", "Linear((1.0, a))",
          _tube("decay")),
    Fault("tan' = 1 - tan^2", operations.Tangent.extend, "slope = -squared if self._hyperbolic",
          "slope = -squared if not self._hyperbolic", _operation("tan")),
    Fault("the root's recurrence loses its two", operations.Root.extend, "self.series, 2.0",
          "self.series, 1.0", _operation("sqrt")),
    Fault("a sign in the real power", operations.Power.extend, "c * j - (k - j)",
          "c * j + (k - j)", _operation("real power")),
    Fault("the angle turns the other way", angle.Angle.extend, "forward - back",
          "back - forward", _operation("atan2, second quadrant")),
    Fault("1 / b with the wrong sign", operations.Inverse.extend, "rest.fill(k, -coef",
          "rest.fill(k, coef", _operation("quotient")),
)  # fmt: skip

SEGMENTS = (
    Fault("a row holds its instants only", step.Stepper._step, "0.25 * h * (h * bend)",
          "0.0 * bend", _tube("many turns per step")),
    Fault("a row holds its last step only", run._interval, "np.min([r.lower for r in results]",
          "np.min([r.lower for r in results[-1:]]", _tube("sine", 1.9)),
    Fault("inputs do not leave the chord", forcing.forced, "0.5 * h * push + 2.0 * h *", "0.0 *",
          tubes.forced_shortfall),
)  # fmt: skip

INPUTS = (
    Fault("the inputs' moment is forgotten", forcing.forced, "0.25 * h * (h * ab)", "0.0 * ab",
          tubes.forced_shortfall),
    Fault("a sign in the inputs' mean", forcing.forced, "h * b_mid + 0.5", "h * b_mid - 0.5",
          tubes.forced_shortfall),
    Fault("the Jacobian's radius is forgotten", forcing.forced, "_times(a_rad, reach)",
          "0.0 * reach", tubes.forced_shortfall),
    Fault("inputs rest while the set moves", step.Stepper._ranges, "_repeated(*self._w_ends",
          "_repeated(self._w, self._w", tubes.outside_bang_bang),
    Fault("a parameter's range is forgotten", ranged_parameters.initial_box,
          "else (lower, upper)", "else (lower, lower)",
          tubes.outside_ranged_parameter),
)  # fmt: skip

KINKS = (
    Fault("a gap of 0", lines.chebyshev_line, "gap = np.where(better, half, gap)",
          "gap = np.where(better, 0.0, gap)", _tube("two rates")),
    Fault("a kink's slope is 1 below its floor", lines.chebyshev_line,
          "linear = (low >= floor) & (high <= ceiling)", "linear = high <= ceiling", _tube("clip")),
    Fault("a wrong slope where decided", lines.chebyshev_line, "(1.0, 0.0, 0.0)",
          "(0.5, 0.0, 0.0)", _tube("clip")),
    Fault("a kink's error has no derivative", step.Stepper._forced, "_matrices(by_input, n)",
          "_matrices((0.0 * by_input[0], 0.0 * by_input[1]), n)", _tube("two rates")),
    Fault("the slope is not the one its gap is of", lines.chebyshev_line,
          "slope = np.where(better, tried, slope)", "slope = np.where(better, 0.5 * tried, slope)",
          _lines),
    Fault("drivers rest within a step", step.Stepper._relaxed, "down, now[1][:, 0] + wide + up",
          "0.0, now[1][:, 0] + wide", _point("clip", 0.5)),
    Fault("drivers do not feel the inputs", step.Stepper._relaxed,
          "upward((size * self._input_radius(lines)).sum(axis=1))", "0.0 * size.sum(axis=1)",
          tubes.outside_disturbed_knee),
)  # fmt: skip

FAULTS = {
    fault.name: fault
    for fault in (*ROUNDING, *TRUNCATION, *REMAINDER, *SIGNS, *SEGMENTS, *INPUTS, *KINKS)
}
