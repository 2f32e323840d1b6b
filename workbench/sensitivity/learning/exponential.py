"""One exponential per state: over its own initial distance (DryVR's), or over the set's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from workbench.sensitivity.learning.form import Fit, Progress, common_distance
from workbench.sensitivity.learning.largest import largest_per_state
from workbench.sensitivity.learning.log_lines import fit_log_lines
from workbench.sensitivity.learning.pairs import PairSource
from workbench.sensitivity.learning.piecewise import (
    LEAST,
    equal_nodes,
    fitted_amplitudes,
    support_pairs,
)
from workbench.sensitivity.vectorised import Array


@final
@dataclass(frozen=True, slots=True)
class PerStateExponential:
    """|e_i(t)| <= factor_i exp(rate_i t) |e_i(0)|: every state by its own initial distance."""

    factor: tuple[float, ...]
    rate_per_s: tuple[float, ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|."""
        return tuple(self.bounds(np.array([initial]), np.array([t_s]))[0, 0].tolist())

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many, (N, K+1, n)."""
        return np.asarray(initial[:, None] * exponentials(self.factor, self.rate_per_s, times))


@final
@dataclass(frozen=True, slots=True)
class ExponentialEnvelope:
    """|e_i(t)| <= amplitude_i exp(rate_i t) rho with rho = max_j |e_j(0)| / scale_j.

    scale: half widths of the initial set the envelope was learned on, in the states' units; a
    coordinate with scale 0 did not vary there, so its initial distance must be 0. amplitude: in the
    states' units; 0 for a coordinate that never moved.
    """

    scale: tuple[float, ...]
    amplitude: tuple[float, ...]
    rate_per_s: tuple[float, ...]

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """Bound on |e_i(t)|; InputError for a distance along an axis that was never varied."""
        return tuple(self.bounds(np.array([initial]), np.array([t_s]))[0, 0].tolist())

    def bounds(self, initial: Array, times: Array) -> Array:
        """The same for many, (N, K+1, n)."""
        rho = common_distance(initial, np.array(self.scale))
        return np.asarray(rho[:, None, None] * exponentials(self.amplitude, self.rate_per_s, times))


def exponentials(factor: tuple[float, ...], rate: tuple[float, ...], times: Array) -> Array:
    """factor_i exp(rate_i t_k), (K+1, n)."""
    return np.asarray(np.array(factor) * np.exp(times[:, None] * np.array(rate)))


@final
@dataclass(frozen=True, slots=True)
class GlobalExponential:
    """ln |e_i(t_k)| <= ln K_i + gamma_i t_k + ln |e_i(0)|, the lowest such line by LP per state.

    The published form: K_i >= 1, gamma_i free, a state bounded by its own initial distance alone.
    A ratio to a small distance may be of any size, and a state that others move although it does
    not differ at first cannot be bounded at all. Two parameters per state. Source: Fan, Qi, Mitra,
    Viswanathan, "DryVR", CAV 2017.
    """

    @property
    def name(self) -> str:
        """The form's word."""
        return "exponential"

    def parameters(self, scale: Array) -> int:
        """Factor and rate of every state."""
        return 2 * len(scale)

    def fit(self, pairs: PairSource, count: int, *, progress: Progress | None = None) -> Fit:
        """As `Form` says."""
        found = largest_per_state(pairs, count, progress=progress)
        moved = np.flatnonzero(found.ratio.max(axis=0) > 0.0)
        logs = np.log(np.maximum(found.ratio[:, moved], LEAST))
        logs[0] = 0.0
        lines = fit_log_lines(pairs.times, logs, nodes=equal_nodes(pairs.times, 1))
        factor, rate = np.ones(len(pairs.names)), np.zeros(len(pairs.names))
        factor[moved] = np.exp(lines.heights[0])
        rate[moved] = np.diff(lines.heights, axis=0)[0] / float(pairs.times[-1])
        return Fit(
            PerStateExponential(tuple(factor.tolist()), tuple(rate.tolist())),
            "learned: |e_i(t)| <= K_i exp(gamma_i t) |e_i(0)|",
            self.parameters(pairs.scale),
            support_pairs(found, lines, moved, logs),
        )


@final
@dataclass(frozen=True, slots=True)
class SetExponential:
    """ln |e_i(t_k)| <= ln(K_i r_i) + gamma_i t_k + ln rho, the lowest such line by LP per state.

    rho: initial distance in units of the set, max_j |e_j(0)| / r_j with its half widths r. ln K_i
    >= 0 where the set has width; elsewhere K_i r_i is one number in the state's unit. Two
    parameters per state. Source: the common distance as in Li, Zhu, Braught, Shen, Mitra, "Verse",
    CAV 2023.
    """

    @property
    def name(self) -> str:
        """The form's word."""
        return "set"

    def parameters(self, scale: Array) -> int:
        """Amplitude and rate of every state."""
        return 2 * len(scale)

    def fit(self, pairs: PairSource, count: int, *, progress: Progress | None = None) -> Fit:
        """As `Form` says."""
        nodes = equal_nodes(pairs.times, 1)
        ends, support = fitted_amplitudes(pairs, count, nodes=nodes, progress=progress)
        moved = ends[0] > 0.0
        rate = np.zeros(len(moved))
        rate[moved] = np.log(ends[1, moved] / ends[0, moved]) / nodes[1]
        return Fit(
            ExponentialEnvelope(
                tuple(pairs.scale.tolist()), tuple(ends[0].tolist()), tuple(rate.tolist())
            ),
            "learned: |e_i(t)| <= K_i r_i exp(gamma_i t) max_j |e_j(0)|/r_j, r half widths",
            self.parameters(pairs.scale),
            support,
        )
