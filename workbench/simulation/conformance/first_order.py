"""Half widths of tubes to first order: linear in the bounds that are to be fitted.

Along the nominal trajectory, with transition matrix Phi and columns B_j of the disturbances,
half width of output i at t = |Phi_i(t, 0)| r0 + sum_j s_j integral |Phi_i(t, tau) B_j(tau)| dtau;
a constant parameter enters as |integral Phi_i B dtau|. Within a step the integrand keeps its sign
here. Source: M. Althoff, J. M. Dolan, "Reachability computation of low-order models for the safety
verification of high-order road vehicle models", ACC 2012 (fitting disturbances to runs); S. B. Liu,
M. Althoff, "Reachset conformance of forward dynamic models for the formal analysis of robots", IROS
2018 (as a linear program).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Final, final

import casadi as ca
import numpy as np

from workbench.models.system import Ode
from workbench.models.vehicle_sections import Uncertainty
from workbench.simulation.conformance.windows import SIGNALS, Array, Measured, MotionModel

# So small that every vehicle file takes it: only the signals are wanted.
_PRESENT: Final = 1e-3


@final
@dataclass(frozen=True, slots=True, eq=False)
class FirstOrder:
    """Half widths of every window at every instant, to first order.

    deviation (W, K+1, m): |measured - nominal|; given (W, K+1, m): from the initial set and from
    what is bounded already; per_bound (W, K+1, m, p): per unit of each fitted bound.
    """

    deviation: Array
    given: Array
    per_bound: Array

    def half_widths(self, bounds: Array) -> Array:
        """(W, K+1, m) for these values of the fitted bounds (p,)."""
        return np.asarray(self.given + self.per_bound @ bounds)


@final
class _Columns:
    """One Runge-Kutta step of all windows, and its derivatives."""

    def __init__(self, model: MotionModel, *, step_s: float, windows: int) -> None:
        present = dict.fromkeys(model.fitted, _PRESENT)
        self.ode: Ode = model.ode(dataclasses.replace(Uncertainty(), **present))  # type: ignore[arg-type]
        fitted = [SIGNALS[name] for name in model.fitted]
        inputs = [signal.name for signal in self.ode.disturbances]
        parameters = [signal.name for signal in self.ode.parameters]
        self.varying = [(inputs.index(s), k) for k, s in enumerate(fitted) if s in inputs]
        self.constant = [(parameters.index(s), k) for k, s in enumerate(fitted) if s in parameters]
        self.known = [
            (place, max(d.upper - d.nominal, d.nominal - d.lower))
            for place, d in enumerate(self.ode.disturbances)
            if d.name not in fitted
        ]
        self.ranged = [
            (place, max(p.upper - p.nominal, p.nominal - p.lower))
            for place, p in enumerate(self.ode.parameters)
            if p.name not in fitted
        ]
        self.outputs = [self.ode.names.index(name) for name in model.outputs]
        self._nominal = np.array([d.nominal for d in self.ode.disturbances])
        self._parameters = np.array(self.ode.parameter_values())
        self._step = _step(self.ode, step_s).map(windows)

    def __call__(self, states: Array) -> tuple[Array, Array, Array, Array]:
        """States (W, n) a step later, and the derivatives by states, disturbances, parameters."""
        count, n = states.shape
        results = self._step(
            states.T,
            np.tile(self._nominal[:, None], (1, count)),
            np.tile(self._parameters[:, None], (1, count)),
        )
        after, by_state, by_input, by_parameter = (np.array(r, dtype=float) for r in results)
        return (
            after.T,
            by_state.reshape(n, count, -1).swapaxes(0, 1),
            by_input.reshape(n, count, -1).swapaxes(0, 1),
            by_parameter.reshape(n, count, -1).swapaxes(0, 1),
        )


def _step(ode: Ode, step_s: float) -> ca.Function:
    field = ode.function()
    x = ode.x
    k1 = field(x, ode.p, ode.w)
    k2 = field(x + step_s / 2 * k1, ode.p, ode.w)
    k3 = field(x + step_s / 2 * k2, ode.p, ode.w)
    k4 = field(x + step_s * k3, ode.p, ode.w)
    after = x + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    derivatives = [ca.densify(ca.jacobian(after, by)) for by in (x, ode.w, ode.p)]
    return ca.Function("step", [x, ode.w, ode.p], [after, *derivatives])


def first_order(model: MotionModel, measured: Measured) -> FirstOrder:
    """The half widths of all windows; `measured` has at least one."""
    windows, times = measured.windows, measured.times_s
    columns = _Columns(model, step_s=float(times[1] - times[0]), windows=len(windows))
    names = columns.ode.names
    boxes = [window.initial.reordered(names) for window in windows]
    states = np.array([box.center for box in boxes])
    spread = _Spread.at_start(np.array([box.radius for box in boxes]), columns, len(model.fitted))
    deviation, given, per_bound = [], [], []
    for place in range(len(times)):
        if place:
            states, *derivatives = columns(states)
            spread.advance(*derivatives)
        seen = np.array([window.measured[place] for window in windows])
        deviation.append(np.abs(seen - states[:, columns.outputs]))
        given.append(spread.given())
        per_bound.append(spread.per_bound())
    return FirstOrder(*(np.stack(part, axis=1) for part in (deviation, given, per_bound)))


@final
@dataclass(slots=True)
class _Spread:
    """Where each initial deviation, each step's disturbance and each parameter has got to."""

    columns: _Columns
    bounds: int
    radius: Array
    initial: Array
    inputs: list[Array]
    parameters: Array

    @classmethod
    def at_start(cls, radius: Array, columns: _Columns, bounds: int) -> _Spread:
        count, n = radius.shape
        start = np.tile(np.eye(n), (count, 1, 1))
        return cls(columns, bounds, radius, start, [], np.zeros((count, n, columns.ode.p.numel())))

    def advance(self, by_state: Array, by_input: Array, by_parameter: Array) -> None:
        self.initial = by_state @ self.initial
        self.inputs = [*(by_state @ each for each in self.inputs), by_input]
        self.parameters = by_state @ self.parameters + by_parameter

    def given(self) -> Array:
        rows = self.columns.outputs
        total = np.einsum("wij,wj->wi", np.abs(self.initial[:, rows]), self.radius)
        summed = self._summed()
        for place, bound in self.columns.known:
            total = total + bound * summed[:, :, place]
        for place, bound in self.columns.ranged:
            total = total + bound * np.abs(self.parameters[:, rows, place])
        return np.asarray(total)

    def per_bound(self) -> Array:
        rows, columns = self.columns.outputs, self.columns
        result = np.zeros((len(self.radius), len(rows), self.bounds))
        summed = self._summed()
        for place, bound in columns.varying:
            result[:, :, bound] = summed[:, :, place]
        for place, bound in columns.constant:
            result[:, :, bound] = np.abs(self.parameters[:, rows, place])
        return result

    def _summed(self) -> Array:
        rows = self.columns.outputs
        total = np.zeros((len(self.radius), len(rows), self.columns.ode.w.numel()))
        for each in self.inputs:
            total += np.abs(each[:, rows])
        return total


def one_step(model: MotionModel, states: Array, *, step_s: float) -> tuple[Array, dict[str, Array]]:
    """Where the model, undisturbed, takes each of these states (M, n) in a step, (M, n), and by
    name what a unit of each disturbance adds to each state by then, (M, n)."""
    columns = _Columns(model, step_s=step_s, windows=len(states))
    after, _, by_input, _ = columns(states)
    names = [signal.name for signal in columns.ode.disturbances]
    return after, {name: by_input[:, :, place] for place, name in enumerate(names)}
