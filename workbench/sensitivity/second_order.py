"""Second-order steps of the search: maximise a quadratic model of each goal over the box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.sensitivity.ascent import Goals, Pairs, Reached, Runs
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box

# How far a step may go, as shares of the half widths: 2 reaches any vertex from anywhere.
_REACHES = (2.0, 0.5, 0.1)
# Distance of the gradients from which curvature is taken, as a share of the half widths.
_APART = 1e-3
_SWEEPS = 6
# Entries of a direction below this do not move their coordinate.
_STILL = 1e-12


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """g . d + d . H d / 2 per row about shares z of the half widths: z, g (N, m), H (N, m, m).

    paired: z holds the shares of `first`, then those of `second`; otherwise `second` alone.
    """

    shares: Array
    gradient: Array
    curvature: Array
    paired: bool

    def step(self, reach: Array) -> Array:
        """Direction by direction to the model's maximum in the box and `reach` (N, 1): (N, m).

        Along the axes of the curvature, which alone would do without constraints, then along those
        of the box, and for a pair along those that move both ends together.
        """
        step = np.zeros_like(self.shares)
        axes = self.shares.shape[1]
        own = np.linalg.eigh(self.curvature).eigenvectors
        directions = [own[:, :, i] for i in range(axes)]
        fixed = list(np.eye(axes))
        if self.paired:
            half = axes // 2
            fixed += [fixed[i] + fixed[half + i] for i in range(half)]
        directions += [np.broadcast_to(each, step.shape) for each in fixed]
        for _ in range(_SWEEPS):
            for direction in directions:
                step = step + self._along(step, direction, reach)[:, None] * direction
        return step

    def _along(self, step: Array, direction: Array, reach: Array) -> Array:
        """Length (N,) of the best move from `step` along `direction` (N, m)."""
        low, high = self._room(step, direction, reach)
        turned = np.einsum("nij,nj->ni", self.curvature, direction)
        slope = np.einsum("nm,nm->n", self.gradient, direction)
        slope = slope + np.einsum("nm,nm->n", turned, step)
        bend = np.einsum("nm,nm->n", turned, direction)
        with np.errstate(divide="ignore", invalid="ignore"):
            inner = np.clip(-slope / bend, low, high)
        at_low = slope * low + 0.5 * bend * low**2
        at_high = slope * high + 0.5 * bend * high**2
        outer = np.where(at_high >= at_low, high, low)
        return np.where(bend < 0.0, inner, outer)

    def _room(self, step: Array, direction: Array, reach: Array) -> tuple[Array, Array]:
        """Least and largest length that keep shares, their differences and the step allowed."""
        place = self.shares + step
        one = np.ones_like(reach)
        sides = [(place, direction, one), (step, direction, reach)]
        if self.paired:
            half = place.shape[1] // 2
            gap, widening = (v[:, half:] - v[:, :half] for v in (place, direction))
            sides.append((gap, widening, one))
        low, high = np.full(len(step), -np.inf), np.full(len(step), np.inf)
        for value, slope, most in sides:
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.stack([(-most - value) / slope, (most - value) / slope])
            moving = np.abs(slope) > _STILL
            low = np.maximum(low, np.where(moving, ends.min(axis=0), -np.inf).max(axis=1))
            high = np.minimum(high, np.where(moving, ends.max(axis=0), np.inf).min(axis=1))
        return np.clip(low, -4.0, 0.0), np.clip(high, 0.0, 4.0)


def second_order_steps(
    flow: Runs, box: Box, *, goals: Goals, start: Pairs, rounds: int, move_first: bool
) -> Pairs:
    """Maximise each goal by box-constrained Newton steps from `start`, one row per goal.

    Each round takes gradients at the pair and a little beside it along every axis with width, from
    their differences the curvature, and goes where the quadratic model is largest: inside the box
    or on its faces, edges and vertices. Constraints as in `ascend`. Never returns a worse pair.
    A row that gained nothing in a round goes a tenth as far from then on.
    """
    best = Reached(start, goals.values(start.differences(flow)))
    free = np.flatnonzero(np.array(box.radius) > 0.0)
    pace = np.ones((len(best.values), 1))
    for _ in range(rounds if len(free) else 0):
        base, before = best.pairs, best.values
        model = _model(flow, box, goals, base, paired=move_first)
        for reach in _REACHES:
            candidate = _shifted(box, base, model.step(reach * pace), paired=move_first)
            best = best.or_better(candidate, goals.values(candidate.differences(flow)))
        pace = np.where((best.values > before)[:, None], pace, 0.1 * pace)
    return best.pairs


def _model(flow: Runs, box: Box, goals: Goals, base: Pairs, *, paired: bool) -> _Model:
    shares = _shares(box, base, paired=paired)
    count, axes = shares.shape
    # Beside the pair towards the inside, so that no run starts outside the box.
    aside = np.where(shares > 0.0, -_APART, _APART)
    probes = [base]
    for i in range(axes):
        shift = np.zeros_like(shares)
        shift[:, i] = aside[:, i]
        probes.append(_shifted(box, base, shift, paired=paired))
    together = Pairs(
        *(
            np.concatenate([getattr(probe, name) for probe in probes])
            for name in ("first", "second", "parameters")
        )
    )
    rows = np.tile(np.arange(count), axes + 1)
    found = _gradients(flow, box, goals.take(rows), together, paired=paired)
    gradients = found.reshape(axes + 1, count, axes)
    curvature = ((gradients[1:] - gradients[0]) / aside.T[:, :, None]).transpose(1, 0, 2)
    return _Model(shares, gradients[0], 0.5 * (curvature + curvature.transpose(0, 2, 1)), paired)


def _gradients(flow: Runs, box: Box, goals: Goals, pairs: Pairs, *, paired: bool) -> Array:
    half = np.array(box.radius)
    free = half > 0.0
    ends = goals.gradients(flow, pairs, move_first=paired)
    parts = [(half * g)[:, free] for g in (ends if paired else ends[1:])]
    return np.asarray(np.concatenate(parts, axis=1))


def _shares(box: Box, pairs: Pairs, *, paired: bool) -> Array:
    half, centre = np.array(box.radius), np.array(box.center)
    free = half > 0.0
    ends = (pairs.first, pairs.second) if paired else (pairs.second,)
    shares = [((end - centre) / np.where(free, half, 1.0))[:, free] for end in ends]
    return np.asarray(np.clip(np.concatenate(shares, axis=1), -1.0, 1.0))


def _shifted(box: Box, base: Pairs, step: Array, *, paired: bool) -> Pairs:
    """The base moved by shares (N, m) of the half widths, kept in the box and near each other."""
    lower, upper, half = np.array(box.lower), np.array(box.upper), np.array(box.radius)
    free = half > 0.0
    axes = int(free.sum())
    first, second = base.first.copy(), base.second.copy()
    if paired:
        first[:, free] += step[:, :axes] * half[free]
        first = np.clip(first, lower, upper)
    second[:, free] += step[:, -axes:] * half[free]
    near = np.clip(second, first - half, first + half)
    return Pairs(first, np.clip(near, lower, upper), base.parameters)
