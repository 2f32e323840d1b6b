"""What inputs that vary arbitrarily in time can add over one step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.reach.validated.algebra import UNIT, Array, upward
from workbench.reach.validated.bounds import Range
from workbench.reach.validated.picard import NoEnclosureError


@final
@dataclass(frozen=True, slots=True, eq=False)
class Forced:
    """x - y at the end of the step lies in generators [-1, 1]^g + [-box, box].

    x solves x' = g(x, v(t)), y solves y' = g(y, 0) from the same state. generators (B, n, g), box
    (B, n); chord (B, n): how far x - y leaves its chord within the step.
    """

    generators: Array
    box: Array
    chord: Array

    @classmethod
    def none(cls, batch: int, n: int) -> Forced:
        """No input."""
        blank = np.zeros((batch, n))
        return cls(np.zeros((batch, n, 0)), blank, blank)


def forced(jacobian: Range, by_input: Range, radius: Array, h: float) -> Forced:
    """Bound x - y for |v| <= radius (B, n_v) over a step of h.

    jacobian (B, n, n) and by_input (B, n, n_v): ranges over a convex box that holds x and y for the
    whole step and every |v| <= radius. With B0, A0 their centres and d >= sup |x - y|,
        (x - y)(h) = (h B0 + h^2/2 A0 B0) v_mean + A0 B0 m + rest,  |m| <= h^2/4 radius,
        |rest| <= h B_rad radius + h A_rad d + h^2/2 |A0| (B_rad radius + |A| d).
    Source: variation of constants; v_mean is the mean of v, m its first moment about h/2.
    """
    a_mid, a_rad = _centred(jacobian)
    b_mid, b_rad = _centred(by_input)
    a_size, b_size = np.abs(a_mid) + a_rad, np.abs(b_mid) + b_rad
    push = upward(_times(b_size, radius))
    reach = _largest_deviation(a_size, push, h)
    ab = a_mid @ b_mid
    ab_slack = (a_mid.shape[1] + 2) * UNIT * (np.abs(a_mid) @ np.abs(b_mid))
    loose = upward(_times(b_rad, radius))
    first = h * b_mid + 0.5 * h * (h * ab)
    generators = (
        np.concatenate([first, 0.25 * h * (h * ab)], axis=2) * np.tile(radius, 2)[:, None, :]
    )
    rounding = 4.0 * UNIT * _times(np.abs(h * b_mid) + h * (h * np.abs(ab)), radius)
    box = (
        h * (loose + _times(a_rad, reach))
        + 0.5 * h * (h * _times(np.abs(a_mid), upward(loose + _times(a_size, reach))))
        + h * (h * _times(ab_slack, radius))
        + 2.0 * rounding
    )
    return Forced(generators, upward(box), upward(0.5 * h * push + 2.0 * h * _times(a_size, reach)))


def _largest_deviation(a_size: Array, push: Array, h: float) -> Array:
    """d with d >= h (push + |A| d), so that |x - y| <= d up to h (Gronwall's argument)."""
    found = h * push
    term = found
    for _ in range(6):
        term = h * _times(a_size, term)
        found = found + term
    for share in (1e-6, 1e-3, 0.1, 1.0):
        tried = found * (1.0 + share) + np.max(found, axis=1, keepdims=True) * share * 1e-3 + 1e-280
        if np.all(upward(h * (push + _times(a_size, tried))) <= tried):
            return np.asarray(tried)
    raise NoEnclosureError("the effect of the disturbances could not be bounded")


def _centred(pair: Range) -> tuple[Array, Array]:
    middle = np.clip(0.5 * pair[0] + 0.5 * pair[1], *pair)
    return middle, upward(np.maximum(pair[1] - middle, middle - pair[0]))


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("bij,bj->bi", matrix, vector))
