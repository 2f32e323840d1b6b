"""The score of a gain point without this project's kernels: python-control and scipy's integrator.

Margins and poles by python-control's own functions, the disk margin on a grid; the eight runs by
`solve_ivp` (RK45) as one system, on the field as CasADi evaluates it. What this route lacks is the
proved tube and what follows from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import control
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from workbench.models.control_view import margins
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import disk_margins, frequencies
from workbench.models.system import Ode
from workbench.models.vehicle import Vehicle
from workbench.simulation.gain_sweep.figures import FIGURES
from workbench.simulation.gain_sweep.gains import Gains, as_parameters, with_gains
from workbench.simulation.gain_sweep.kernels import RUN_S, RUN_STEP_S, run_loop
from workbench.simulation.gain_sweep.plan import Case
from workbench.simulation.gain_sweep.scores import corners, run_figures, speed_figures, start_of

_TOLERANCE: Final = 1e-6
Array = NDArray[np.float64]
Score = dict[str, float]
LACKS: Final = tuple(each.label for each in FIGURES.values() if each.how == "proved tube")
"""Labels of the figures that this route has none of."""


def baseline(vehicle: Vehicle) -> Callable[[Gains, Case], Score]:
    """What scores a point in a case; the loop's expressions are made once."""
    ode = run_loop(vehicle)
    field = ode.function()

    def scored(gains: Gains, case: Case) -> Score:
        car = with_gains(vehicle, gains, case.speed_mps)
        start = corners(start_of(car, case), ode.names)
        runs = _runs(field, _inputs(ode, gains, case), start)
        speeds = runs[:, :, ode.names.index("speed")]
        return (
            _linear(LateralLoop.of(car))
            | _speed(car)
            | run_figures(car, runs, ode.names)
            | speed_figures(speeds, case.speed_mps)
        )

    return scored


def _linear(loop: LateralLoop) -> Score:
    opened = loop.open_loop()
    closed = control.feedback(opened, 1)
    poles = control.poles(closed)
    found = {"decay_per_s": -float(poles.real.max())}
    if not found["decay_per_s"] > 0.0:
        return found | dict.fromkeys(("phase_deg", "delay_margin_s", "disk"), math.nan)
    known = margins(opened)
    disk = disk_margins(opened, frequencies(tuple(complex(z) for z in poles)))
    return found | {
        "phase_deg": known.phase_margin_deg, "delay_margin_s": known.delay_margin_s,
        "disk": disk.size,
    }  # fmt: skip


def _speed(vehicle: Vehicle) -> Score:
    kp, ki = vehicle.speed_pid.proportional_per_s, vehicle.speed_pid.integral_per_s2
    known = margins(control.tf([kp, ki], [1.0, 0.0, 0.0]))
    return {
        "speed_phase_deg": known.phase_margin_deg, "speed_delay_margin_s": known.delay_margin_s
    }  # fmt: skip


def _inputs(ode: Ode, gains: Gains, case: Case) -> tuple[Array, Array]:
    values = as_parameters(gains) | {"reference_speed": case.speed_mps}
    middle = sum(case.curvature_per_m) / 2.0
    p = [values.get(each.name, each.nominal) for each in ode.parameters]
    w = [middle if d.name == "curvature" else d.nominal for d in ode.disturbances]
    return np.array(p), np.array(w)


def _runs(field: Callable[..., object], inputs: tuple[Array, Array], starts: Array) -> Array:
    """Runs x instants x states, every RUN_STEP_S."""
    shape = starts.T.shape
    times = np.linspace(0.0, RUN_S, round(RUN_S / RUN_STEP_S) + 1)

    def rate(_t: float, x: Array) -> Array:
        return np.asarray(field(x.reshape(shape), *inputs)).ravel()

    found = solve_ivp(
        rate, (0.0, RUN_S), starts.T.ravel(), t_eval=times, rtol=_TOLERANCE, atol=_TOLERANCE
    )
    return np.asarray(found.y.reshape(*shape, len(times)).transpose(1, 2, 0), dtype=np.float64)
