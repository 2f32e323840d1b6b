"""Many chosen trajectories at once in floats, and how their ends depend on the choices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self, final

import casadi as ca
import numpy as np

from workbench.models.system import Ode
from workbench.reach.inner.choices import Choices
from workbench.reach.ranged_parameters import with_inputs_as_states
from workbench.reach.tube import Array
from workbench.sensitivity.vectorised import Index, Vectorised

# Longest Runge-Kutta step in s: its error is far below what a search can make use of.
_LONGEST_STEP_S = 0.05


@final
@dataclass(frozen=True, slots=True, eq=False)
class ChoiceFlow:
    """Runge-Kutta runs of order 4 over a time grid, with adjoint gradients: for searching only."""

    ode: Ode
    times_s: Array
    field: Vectorised
    both: Vectorised
    parameters: Array

    @classmethod
    def of(cls, ode: Ode, times_s: Array) -> Self:
        """For the choices of `ode` on the grid `times_s` (K+1,)."""
        open_ode = with_inputs_as_states(ode)
        jacobian = ca.vec(ca.densify(ca.jacobian(open_ode.field, open_ode.x)))
        both = [ca.densify(open_ode.field), jacobian]
        return cls(
            ode, times_s, Vectorised(ca.Function("field", [open_ode.x, open_ode.p], both[:1])),
            Vectorised(ca.Function("both", [open_ode.x, open_ode.p], both)),
            np.array(open_ode.parameter_values(), dtype=float)[:, None],
        )  # fmt: skip

    def runs(self, choices: Choices) -> Array:
        """States (N, K+1, n) at the grid's instants; inf or NaN where a run leaves the numbers."""
        n, z = len(self.ode.states), self._start(choices)
        rows = [z[:n].T]
        for k, h in self._steps():
            z = self._held(z, choices, k)
            for _ in range(_substeps(h)):
                z = _step(self._rate, z, h / _substeps(h))
            rows.append(z[:n].T)
        return np.stack(rows, axis=1)

    def gradients(self, choices: Choices, ends: Index, weights: Array) -> Choices:
        """Gradient of weights (N, n) . x(times_s[ends]) by each run's own choice.

        Discrete adjoint of the Runge-Kutta map, with CasADi's Jacobian of the field; at a kink that
        Jacobian is undecided and counts as zero.
        """
        size, n = choices.states.shape[1] + choices.constants.shape[1], choices.states.shape[1]
        slopes = self._slopes(choices)
        costate = np.zeros((len(choices), slopes[0].shape[1] if slopes else size))
        by_signal = np.zeros_like(choices.signals)
        for k in range(len(slopes), 0, -1):
            starting = ends == k
            costate[starting, :n] += weights[starting]
            costate = np.einsum("bij,bi->bj", slopes[k - 1], costate)
            by_signal[:, k - 1] = costate[:, size:]
            costate[:, size:] = 0.0
        costate[ends == 0, :n] += weights[ends == 0]
        found = costate[:, :n], costate[:, n:size], by_signal
        return Choices(*(np.nan_to_num(part, posinf=0.0, neginf=0.0) for part in found))

    def _slopes(self, choices: Choices) -> list[Array]:
        """d z_{k+1} / d z_k, one (N, n_z, n_z) per grid interval."""
        z, found = self._start(choices), []
        eye = np.broadcast_to(np.eye(len(z)), (len(choices), len(z), len(z)))
        for k, h in self._steps():
            z, slope = self._held(z, choices, k), eye
            for _ in range(_substeps(h)):
                z, slope = _step_with_slope(self._rates, z, slope, h / _substeps(h))
            found.append(slope)
        return found

    def _start(self, choices: Choices) -> Array:
        signals = np.zeros((len(choices), choices.signals.shape[2]))
        return np.concatenate([choices.states, choices.constants, signals], axis=1).T

    def _steps(self) -> list[tuple[int, float]]:
        return list(enumerate(np.diff(self.times_s).tolist()))

    def _held(self, z: Array, choices: Choices, k: int) -> Array:
        z = z.copy()
        z[len(z) - choices.signals.shape[2] :] = choices.signals[:, k].T
        return z

    def _rate(self, z: Array) -> Array:
        return self.field(z, self.parameters)[0]

    def _rates(self, z: Array) -> tuple[Array, Array]:
        rate, slope = self.both(z, self.parameters)
        return rate, np.nan_to_num(slope).reshape(len(z), len(z), -1).transpose(2, 1, 0)


def _substeps(h: float) -> int:
    return max(1, int(np.ceil(h / _LONGEST_STEP_S - 1e-9)))


def _step(rate: Callable[[Array], Array], z: Array, h: float) -> Array:
    with np.errstate(all="ignore"):
        k1 = rate(z)
        k2 = rate(z + (0.5 * h) * k1)
        k3 = rate(z + (0.5 * h) * k2)
        k4 = rate(z + h * k3)
        return np.asarray(z + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4))


def _step_with_slope(
    rates: Callable[[Array], tuple[Array, Array]], z: Array, s: Array, h: float
) -> tuple[Array, Array]:
    def stage(z: Array, s: Array) -> tuple[Array, Array]:
        rate, slope = rates(z)
        return rate, slope @ s

    with np.errstate(all="ignore"):
        k1, l1 = stage(z, s)
        k2, l2 = stage(z + 0.5 * h * k1, s + 0.5 * h * l1)
        k3, l3 = stage(z + 0.5 * h * k2, s + 0.5 * h * l2)
        k4, l4 = stage(z + h * k3, s + h * l3)
        slope = s + h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4)
        return z + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), slope
