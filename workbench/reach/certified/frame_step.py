"""One step of a moving-frame tube."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.certified.frame_functions import FieldBounds
from workbench.sensitivity.growth_matrix import MetzlerGrowth
from workbench.sensitivity.interval_arrays import (
    Interval,
    add,
    matrix_product,
    multiply,
    negate,
    point,
)
from workbench.sensitivity.rounding import up
from workbench.sensitivity.vectorised import Array

_MORE, _TINY = 1e-9, 1e-14
_TRIES = 30
_TERMS = 7


@final
@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The states center + T v, |v| <= radius; inverse: approximates T^-1; states: their box."""

    center: Array
    matrix: Array
    inverse: Array
    radius: Array
    states: Interval

    @classmethod
    def of(cls, center: Array, matrix: Array, radius: Array) -> Frame:
        """The frame with its box."""
        spread = applied(point(matrix), (-radius, radius))
        inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
        return cls(center, matrix, inverse, radius, widened(add(point(center), spread)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A priori box of the set, a priori boxes of the nominal's parts, and the set over the step."""

    box: Interval
    cores: tuple[Interval, ...]
    row: Interval


@final
@dataclass(frozen=True, slots=True, eq=False)
class Advance:
    """What every step needs: bounds of the field, ranges of the inputs, parts and length."""

    bounds: FieldBounds
    inputs: Interval
    parts: int
    length_s: float

    @property
    def length(self) -> Interval:
        """The length with the rounding of the difference of two instants, as arrays of one."""
        length = np.array([self.length_s])
        return np.nextafter(length, 0.0), np.nextafter(length, np.inf)


NextFrame = Callable[[Array, Array, Array, float], Array]


def advanced(step: Advance, frame: Frame, next_frame: NextFrame) -> tuple[Step, Frame] | str:
    """The step from `frame` and the frame it leads to, or what failed.

    next_frame: (A, T, radius, length) -> the matrix of the next frame, any invertible one.
    """
    # Halves of the least doubles are rounded: their sum may lie outside.
    middle = point(np.clip(0.5 * step.inputs[0] + 0.5 * step.inputs[1], *step.inputs))
    box = _a_priori(step.bounds, frame.states, step.inputs, step.length)
    nominal = None if box is None else _nominal(step, frame.center, middle)
    if box is None or nominal is None:
        return "no a priori enclosure was found"
    end, cores = nominal
    core = np.min([c[0] for c in cores], axis=0), np.max([c[1] for c in cores], axis=0)
    box = np.minimum(box[0], core[0] - _TINY), np.maximum(box[1], core[1] + _TINY)
    if not _stays(step.bounds, frame.states, step.inputs, step.length, box):
        return "the a priori enclosure does not hold the nominal solution"
    n = len(frame.center)
    mixed = [
        tuple(np.concatenate([box[k][: j + 1], core[k][j + 1 :]]) for k in (0, 1)) for j in range(n)
    ]
    jacobian = step.bounds.jacobian([(low, high) for low, high in mixed], step.inputs)
    gap = add(step.inputs, negate(middle))
    still = np.zeros(n)
    felt = step.bounds.tangent(core, step.inputs, (still, still), gap)
    if jacobian is None or felt is None:
        return "the Jacobian could not be enclosed"
    return _carried(
        step, frame, next_frame, _Dynamics(box, tuple(cores), core, end, jacobian, felt)
    )


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Dynamics:
    box: Interval
    cores: tuple[Interval, ...]
    core: Interval
    end: Interval
    jacobian: Interval
    felt: Interval


def _carried(
    step: Advance, frame: Frame, next_frame: NextFrame, found: _Dynamics
) -> tuple[Step, Frame] | str:
    center = 0.5 * found.jacobian[0] + 0.5 * found.jacobian[1]
    rest = add(found.jacobian, point(-center))
    flow, inverse = _flow(center, step.length), enclosed_inverse(frame)
    back = _flow(-center, step.length)
    if flow is None or back is None or inverse is None:
        return "the step is too long for its Jacobian, or the frame nearly singular"
    onward = matrix_product(flow[1], point(frame.matrix))
    backward = matrix_product(inverse, back[1])
    growth = magnitude(matrix_product(matrix_product(backward, rest), onward))
    drift = magnitude(applied(backward, found.felt))
    grown = MetzlerGrowth(tuple(map(tuple, growth.tolist())), tuple(drift.tolist()))
    radius = np.array(grown.half_widths(tuple(frame.radius.tolist()), float(step.length[1][0])))
    if not np.isfinite(radius).all():
        return "the set's growth left the numbers"
    radius = radius * (1.0 + _MORE)
    row = widened(add(found.core, applied(onward, (-radius, radius))))
    middle = 0.5 * found.end[0] + 0.5 * found.end[1]
    matrix = next_frame(center, frame.matrix, radius, step.length_s)
    following = Frame.of(middle, matrix, radius)
    inverse = enclosed_inverse(following)
    if inverse is None:
        return "the frame became nearly singular"
    turned = matrix_product(inverse, matrix_product(flow[0], point(frame.matrix)))
    offset = applied(inverse, add(found.end, point(-middle)))
    radius = magnitude(add(applied(turned, (-radius, radius)), offset)) * (1.0 + _MORE) + _TINY
    return Step(found.box, found.cores, row), Frame.of(middle, matrix, radius)


def _nominal(
    step: Advance, center: Array, middle: Interval
) -> tuple[Interval, list[Interval]] | None:
    """x(h) in x + h f(x) + h^2 / 2 (Df f)(core), part after part."""
    here, cores = point(center), []
    part = down(step.length[0] / step.parts), upward(step.length[1] / step.parts)
    half = down(part[0] * part[0]) / 2.0, upward(part[1] * part[1]) / 2.0
    still = (np.zeros(len(middle[0])),) * 2
    for _ in range(step.parts):
        core = _a_priori(step.bounds, here, middle, part)
        rates = None if core is None else step.bounds.rates(core, middle)
        if core is None or rates is None:
            return None
        bent = step.bounds.tangent(core, middle, rates, still)
        ahead = step.bounds.rates(here, middle)
        if bent is None or ahead is None:
            return None
        here = add(add(here, multiply(part, ahead)), multiply(half, bent))
        cores.append(core)
    return here, cores


def _a_priori(
    bounds: FieldBounds, start: Interval, inputs: Interval, length: Interval
) -> Interval | None:
    """A box that holds start + [0, h] f(box) in its interior (Picard)."""
    box = start
    for _ in range(_TRIES):
        box = widened(box)
        reached = _reached(bounds, start, inputs, length, box)
        if reached is None:
            return None
        if np.all(box[0] < reached[0]) and np.all(reached[1] < box[1]):
            return (
                widened(reached) if _stays(bounds, start, inputs, length, widened(reached)) else box
            )
        more = 0.05 * (reached[1] - reached[0])
        box = reached[0] - more, reached[1] + more
    return None


def _stays(
    bounds: FieldBounds, start: Interval, inputs: Interval, length: Interval, box: Interval
) -> bool:
    reached = _reached(bounds, start, inputs, length, box)
    return reached is not None and bool(np.all(box[0] < reached[0]) and np.all(reached[1] < box[1]))


def _reached(
    bounds: FieldBounds, start: Interval, inputs: Interval, length: Interval, box: Interval
) -> Interval | None:
    rates = bounds.rates(box, inputs)
    if rates is None:
        return None
    moved = multiply((np.zeros(len(start[0])), np.full(len(start[0]), float(length[1][0]))), rates)
    return add(start, moved)


def _flow(matrix: Array, length: Interval) -> tuple[Interval, Interval] | None:
    """exp(A h), and a hull of exp(A s) over [0, h]; None where |A h| > 1 in row sums."""
    size = up(float(np.abs(matrix).sum(axis=1).max()) * (1.0 + 1e-12) * float(length[1][0]))
    if not size <= 1.0:
        return None
    term = point(np.eye(len(matrix)))
    end, onward = term, term
    for k in range(1, _TERMS):
        term = multiply(matrix_product(point(matrix), term), length)
        term = np.nextafter(term[0] / k, -np.inf), np.nextafter(term[1] / k, np.inf)
        end = add(end, term)
        onward = add(onward, (np.minimum(term[0], 0.0), np.maximum(term[1], 0.0)))
    # |A h|^7 / 7! and what follows it: less than 8 / 7 of it, and 7! > 8 / 7 * 4000.
    rest = np.full(matrix.shape, (size * (1.0 + 1e-12)) ** _TERMS / 4000.0)
    return add(end, (-rest, rest)), add(onward, (-rest, rest))


def enclosed_inverse(frame: Frame) -> Interval | None:
    """T^-1, within 2 |E| max_i |G_ij| of G, E = I - G T in row sums; None for |E| > 1/2."""
    product = matrix_product(point(frame.inverse), point(frame.matrix))
    residual = magnitude(add(product, point(-np.eye(len(frame.center)))))
    size = float(residual.sum(axis=1).max()) * (1.0 + 1e-12)
    if not size <= 0.5:
        return None
    far = np.full(residual.shape, 2.0 * size) * np.abs(frame.inverse).max(axis=0) * (1.0 + 1e-12)
    return add(point(frame.inverse), (-far, far))


def applied(matrix: Interval, vector: Interval) -> Interval:
    """{A v}."""
    low, high = matrix_product(matrix, (vector[0][:, None], vector[1][:, None]))
    return low[:, 0], high[:, 0]


def down(value: Array) -> Array:
    """The next doubles below results >= 0."""
    return np.nextafter(value, 0.0)


def upward(value: Array) -> Array:
    """The next doubles above."""
    return np.nextafter(value, np.inf)


def magnitude(a: Interval) -> Array:
    """max |x|, entry by entry, exact."""
    return np.asarray(np.maximum(np.abs(a[0]), np.abs(a[1])))


def widened(a: Interval) -> Interval:
    """A little larger, so that a checker with other roundings agrees."""
    more = _MORE * (a[1] - a[0]) + _TINY * (1.0 + magnitude(a))
    return a[0] - more, a[1] + more
