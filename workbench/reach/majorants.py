"""Bounds of the second-order terms of one tube step, from magnitudes of the derivatives.

All quantities are symbolic and non-negative. M >= |A| elementwise over the step's box, the one that
contains nominal and tube for the whole step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import casadi as ca

_LARGEST = 1e300


def magnitude(lower: ca.SX, upper: ca.SX) -> ca.SX:
    """Largest absolute value in [lower, upper], elementwise."""
    return ca.fmax(ca.fabs(lower), ca.fabs(upper))


@final
@dataclass(frozen=True, slots=True)
class Magnitudes:
    """Elementwise bounds, all over one box that contains nominal and tube for the whole step.

    field |x'| (n), in the states' units per s; its derivatives in these units per unit of what they
    are taken by: jacobian |dg/dx| (n x n), by_exogenous |dg/dv| (n x n_v), hessians |D^2 g_i| over
    (x, v) (n upper triangles, n + n_v square).
    """

    jacobian: ca.SX
    by_exogenous: ca.SX
    hessians: tuple[ca.SX, ...]
    field: ca.SX

    @staticmethod
    def quadratic(sparsity: ca.Sparsity, sizes: ca.SX, left: ca.SX, right: ca.SX) -> ca.SX:
        """sum_jl |H_jl| left_j right_l of a symmetric H given by its upper triangle."""
        total = ca.SX(0)
        rows, columns = sparsity.get_triplet()
        for k, (j, col) in enumerate(zip(rows, columns, strict=True)):
            product = left[j] * right[col]
            total = total + sizes[k] * (product if j == col else product + left[col] * right[j])
        return total

    def curvature(self, left: ca.SX, right: ca.SX) -> ca.SX:
        """|D^2 g|[left, right], one entry per state."""
        return ca.vertcat(
            *[
                self.quadratic(h.sparsity(), ca.vertcat(*h.nonzeros()), left, right)
                for h in self.hessians
            ]
        )


@final
@dataclass(frozen=True, slots=True)
class StepTerms:
    """Bounds over one step, in the states' units, one entry per state (n).

    box: what the set gains as a box; chord: deviation of a state from its chord; radius: |e| over
    the whole step; cut: (h M)^5 (r + h B v) / 24, an estimate (five times the first omitted term of
    a constant M) of what the Runge-Kutta step leaves out of S d0; ok: 1.0 if the a priori bounds
    verified themselves and everything is finite. All rest on `Magnitudes` over the step's box.
    """

    box: ca.SX
    chord: ca.SX
    radius: ca.SX
    cut: ca.SX
    ok: ca.SX


@final
@dataclass(frozen=True, slots=True)
class Growth:
    """Bounds of exp(M tau) a for tau in [0, h].

    If v >= a + h M v then every solution of v' <= M v from a stays below v (Picard). With a vector
    margin >= 1 for which h M margin <= margin / 2, the series to order 4 plus
    2 max_i ((h M)^5 a)_i margin is such a v. ok is 1.0 where the margin verified itself.
    """

    matrix: ca.SX
    margin: ca.SX
    ok: ca.SX

    @classmethod
    def over(cls, jacobian: ca.SX, h: ca.SX) -> Growth:
        """For M = jacobian over a step of h (s); margin: the first terms of sum (2 h M)^i 1."""
        matrix = h * jacobian
        ones = ca.SX.ones(jacobian.shape[0])
        margin = ones
        for _ in range(4):
            margin = ones + 2.2 * (matrix @ margin)
        slack = margin / 2 - matrix @ margin
        ok = ca.SX(1)
        for i in range(slack.numel()):
            ok = ok * (slack[i] >= 0)
        return cls(matrix, margin, ok)

    def __call__(self, start: ca.SX) -> ca.SX:
        """E(start) >= exp(M tau) start, for start >= 0."""
        term, v = start, start
        for _ in range(4):
            term = self.matrix @ term
            v = v + term
        rest = self.matrix @ term
        largest = rest[0]
        for i in range(1, rest.numel()):
            largest = ca.fmax(largest, rest[i])
        return v + 2 * largest * self.margin


def step_terms(m: Magnitudes, r: ca.SX, r_end: ca.SX, v_rad: ca.SX, h: ca.SX) -> StepTerms:
    """Remainder, chord deviation and radius over one step.

    r, r_end (n): radius of the set at t_k and of its linear image at t_k+1; v_rad (n_v): radii of
    the exogenous inputs; h: s. Formulas, with E from `Growth`:

    coarse radius: w0 = E(r + h B v)
    second order: rho(w) = 1/2 |D^2 g|[(w, v), (w, v)]
    linear radius: max(r, r_end) + h^2/8 (|D^2 g|[x', w0] + M M w0), the chord of y'' = (A' + A A) y
    tight radius: w = linear radius + h E(B v) + h E(rho(w0))
    remainder: h mean(rho(w)) + h^2/2 M E(rho(w)), where w stays below the straight line from r to
    r_end plus a constant, and mean(a_j a_l) = mid_j mid_l + dif_j dif_l / 3
    chord: h^2/8 M |x'| + h/2 B v
    held inputs: a disturbance that varies within the step differs from its mean's effect by at most
    h^2/4 E(M B v + |D^2 g|[x', v])
    """
    n = r.numel()
    b = m.by_exogenous @ v_rad
    grown = Growth.over(m.jacobian, h)
    coarse = grown(r + h * b)
    exogenous = grown(b) if v_rad.numel() else ca.SX.zeros(n)
    held = ca.SX.zeros(n)
    speed = ca.vertcat(m.field, ca.SX.zeros(v_rad.numel()))
    if v_rad.numel():
        only_v = ca.vertcat(ca.SX.zeros(n), v_rad)
        held = h * h / 4 * grown(m.jacobian @ b + m.curvature(speed, only_v))
    only_x = ca.vertcat(coarse, ca.SX.zeros(v_rad.numel()))
    bend = m.curvature(speed, only_x) + m.jacobian @ (m.jacobian @ coarse)
    rho = m.curvature(*[ca.vertcat(coarse, v_rad)] * 2) / 2
    spread = grown(rho)
    more = h * h / 8 * bend + h * (exogenous + spread)
    radius = ca.fmin(ca.fmax(r, r_end) + more, coarse)
    start, end = (ca.vertcat(side + more, v_rad) for side in (r, r_end))
    mid, dif = (start + end) / 2, (start - end) / 2
    mean = (m.curvature(mid, mid) + m.curvature(dif, dif) / 3) / 2
    # E is linear and monotone, so the share by which rho shrinks for the tight radius carries over.
    tight = ca.vertcat(radius, v_rad)
    share = _largest_share(m.curvature(tight, tight) / 2, rho)
    zeta = h * ca.fmin(mean, rho) + h * h / 2 * share * (m.jacobian @ spread)
    chord = h * h / 8 * (m.jacobian @ m.field) + h / 2 * b
    cut = r + h * b
    for _ in range(5):
        cut = grown.matrix @ cut
    # Minima and maxima drop a NaN, so what they are fed with must be finite.
    fed = ca.sum1(coarse + rho + spread + mean + more + zeta + held)
    return StepTerms(zeta + held, chord, radius, cut / 24, grown.ok * (fed <= _LARGEST))


def _largest_share(part: ca.SX, whole: ca.SX) -> ca.SX:
    """max_i part_i / whole_i for 0 <= part <= whole, at most 1; 0/0 counts as 0."""
    share = ca.SX(0)
    for i in range(whole.numel()):
        if not whole[i].is_zero():
            share = ca.fmax(share, part[i] / ca.fmax(whole[i], 1e-300))
    return ca.fmin(share, 1)
