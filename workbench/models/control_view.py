"""The control engineer's view of a closed loop: linearisation, poles, margins."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import final

import casadi as ca
import control
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.bicycle import PathFrame
from workbench.models.system import System
from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]

_AT_REST = 1e-9
_LEAST_PHASE_MARGIN_DEG = 30.0
_LEAST_GAIN_MARGIN = 2.0


@final
@dataclass(frozen=True, slots=True)
class Linearisation:
    """d' = A d + B w about an operating point, and the commands' rows d -> u.

    names: the n states kept; state_matrix A (n x n); disturbance_matrix B (n x n_w);
    command_rows: output name -> row (n).
    """

    names: tuple[str, ...]
    disturbances: tuple[str, ...]
    state_matrix: Array
    disturbance_matrix: Array
    command_rows: Mapping[str, Array]

    def poles(self) -> tuple[complex, ...]:
        """Eigenvalues of A, largest real part first."""
        values = np.linalg.eigvals(self.state_matrix)
        return tuple(complex(value) for value in sorted(values, key=lambda z: (-z.real, z.imag)))

    def state_space(self) -> control.StateSpace:
        """The linearisation as a python-control system from the disturbances to all states."""
        size, inputs = self.disturbance_matrix.shape
        columns = self.disturbance_matrix if inputs else np.zeros((size, 1))
        return control.ss(
            self.state_matrix,
            columns,
            np.eye(size),
            np.zeros((size, columns.shape[1])),
            states=list(self.names),
            outputs=[f"{name}_out" for name in self.names],
            inputs=list(self.disturbances) or ["nothing"],
        )

    def loop_transfer(self, *, command: str, actuated: str) -> control.StateSpace:
        """L(s) = -K (sI - (A - b K))^-1 b: the loop broken where `command` drives `actuated`'.

        K is the command's row and b the unit column of the actuated state. Valid where the command
        is inside its limits. Raises InputError when the state's own rate is not the command.
        """
        row = self.command_rows[command]
        index = self.names.index(actuated)
        if not np.allclose(self.state_matrix[index], row, rtol=1e-9, atol=1e-12):
            raise InputError(
                f"loop_transfer: the rate of {actuated!r} is not {command!r} at this operating "
                "point; choose a point at which the command is inside its limits"
            )
        column = np.zeros((len(self.names), 1))
        column[index] = 1.0
        return control.ss(
            self.state_matrix - column @ row[None, :], column, -row[None, :], np.zeros((1, 1))
        )


def linearise(
    system: System,
    point: Mapping[str, float],
    *,
    cyclic: tuple[str, ...] = (),
    disturbances: Mapping[str, float] | None = None,
) -> Linearisation:
    """Linearise at an equilibrium, with CasADi's exact derivatives at nominal parameters.

    point: state name -> value; states left out are 0. cyclic: states that run on while the others
    rest, and that the others do not depend on (the station); they are left out of the result.
    disturbances: values at the point, nominal where not given. Raises InputError for unknown names,
    a point at which the kept states do not rest, and a cyclic state that matters.
    """
    ode = system.ode
    held = {w.name: w.nominal for w in ode.disturbances}
    _require_known(point, ode.names)
    _require_known(cyclic, ode.names)
    _require_known(disturbances or {}, held)
    held.update(disturbances or {})
    commands = ca.vertcat(*(expression for _, expression in ode.outputs))
    evaluate = ca.Function(
        "linearise",
        [ode.x, ode.p, ode.w],
        [
            ode.field,
            ca.jacobian(ode.field, ode.x),
            ca.jacobian(ode.field, ode.w),
            ca.jacobian(commands, ode.x),
        ],
    )
    values = [point.get(name, 0.0) for name in ode.names]
    outcome = evaluate(values, ode.parameter_values(), list(held.values()))
    rate, full, inputs, rows = (np.asarray(part.full(), dtype=float) for part in outcome)
    kept = [index for index, name in enumerate(ode.names) if name not in cyclic]
    left = [index for index, name in enumerate(ode.names) if name in cyclic]
    for index in kept:
        if not abs(rate[index, 0]) <= _AT_REST:
            raise InputError(
                f"linearise: expected an equilibrium, but {ode.names[index]!r} changes at "
                f"{rate[index, 0]:.3g} per second there; choose another point or name it cyclic"
            )
    if np.any(full[np.ix_(kept, left)]) or np.any(rows[:, left]):
        raise InputError(f"linearise: other states depend on {cyclic}; it is not cyclic")
    return Linearisation(
        names=tuple(ode.names[index] for index in kept),
        disturbances=tuple(held),
        state_matrix=full[np.ix_(kept, kept)],
        disturbance_matrix=inputs[kept],
        command_rows={name: rows[k, kept] for k, (name, _) in enumerate(ode.outputs)},
    )


def _require_known(given: Iterable[str], known: Collection[str]) -> None:
    unknown = [name for name in given if name not in known]
    if unknown:
        raise InputError(f"linearise: unknown names {unknown}; the system has {tuple(known)}")


@final
@dataclass(frozen=True, slots=True)
class Stability:
    """Whether all poles lie in the open left half plane; `offending` are those that do not."""

    stable: bool
    offending: tuple[complex, ...]
    message: str


def stability(poles: tuple[complex, ...]) -> Stability:
    """Asymptotic stability of a linear system from its poles.

    A pole counts as stable if its real part is below -1e-9 max(1, largest modulus): computed poles
    carry rounding, and one on the axis must not pass. Rigor NUMERICAL.
    """
    edge = -1e-9 * max(1.0, max((abs(pole) for pole in poles), default=0.0))
    offending = tuple(pole for pole in poles if pole.real >= edge)
    if not offending:
        return Stability(True, (), "asymptotically stable")
    listed = ", ".join(_shown(pole) for pole in offending)
    return Stability(
        False, offending, f"not asymptotically stable: poles {listed} are not in Re < 0"
    )


def _shown(pole: complex) -> str:
    if abs(pole.imag) < 1e-12:
        return f"{pole.real:+.4g}"
    return f"{pole.real:+.4g}{pole.imag:+.4g}j"


@final
@dataclass(frozen=True, slots=True)
class Margins:
    """Distance of a loop from instability; infinite where the loop has no such crossing.

    gain_margin: the factor nearest to 1 by which the loop gain may change, above or below 1;
    phase_margin_deg; delay_margin_s: the largest additional delay; crossover_radps: frequency of
    the phase margin. Meaningful only for a stable loop.
    """

    gain_margin: float
    phase_margin_deg: float
    delay_margin_s: float
    crossover_radps: float


def margins(loop: control.StateSpace) -> Margins:
    """Classical margins of a loop transfer function L(s) under negative feedback."""
    gains, phases, _, _, crossovers, _ = control.stability_margins(loop, returnall=True)
    gain = min((float(g) for g in gains if g > 0.0), key=lambda g: abs(math.log(g)), default=None)
    pairs = [(float(p), float(w)) for p, w in zip(phases, crossovers, strict=True)]
    phase, crossover = min(pairs, key=lambda pair: abs(pair[0]), default=(math.inf, math.nan))
    delays = [math.radians(p % 360.0) / w for p, w in pairs if w > 0.0]
    return Margins(
        gain_margin=math.inf if gain is None else gain,
        phase_margin_deg=phase,
        delay_margin_s=min(delays, default=math.inf),
        crossover_radps=crossover,
    )


@final
@dataclass(frozen=True, slots=True)
class QuickStudy:
    """What a first look at one vehicle's gains shows, on a straight path at reference speed.

    poles: of the linearised loop without the station and without integrals that no gain reads.
    steering_margins, speed_margins: of the loops broken at the steering rate and at the
    acceleration command. warnings: full sentences.
    """

    vehicle: str
    speed_mps: float
    poles: tuple[complex, ...]
    verdict: Stability
    steering_margins: Margins
    speed_margins: Margins
    warnings: tuple[str, ...]


def quick_study(vehicle: Vehicle) -> QuickStudy:
    """Poles, margins and warnings for one vehicle's gains; linearised, rigor NUMERICAL."""
    speed = vehicle.operation.reference_speed_mps
    loop = vehicle.closed_loop(vehicle.track(), PathFrame(0.0, 0.0))
    unread = ["station"]
    if vehicle.steering_pid.integral_radps_per_ms == 0.0:
        unread.append("offset_integral")
    if vehicle.speed_pid.integral_per_s2 == 0.0:
        unread.append("speed_integral")
    linear = linearise(loop, {"speed": speed}, cyclic=tuple(unread))
    poles = linear.poles()
    verdict = stability(poles)
    steering = margins(linear.loop_transfer(command="steering_rate_command", actuated="steering"))
    along = margins(linear.loop_transfer(command="acceleration_command", actuated="speed"))
    return QuickStudy(
        vehicle=vehicle.name,
        speed_mps=speed,
        poles=poles,
        verdict=verdict,
        steering_margins=steering,
        speed_margins=along,
        warnings=(
            *_stability_warnings(vehicle, verdict),
            *_margin_warnings("steering", steering, verdict.stable),
            *_margin_warnings("speed", along, verdict.stable),
        ),
    )


def _stability_warnings(vehicle: Vehicle, verdict: Stability) -> list[str]:
    gains, found = vehicle.steering_pid, []
    if not verdict.stable:
        found.append(f"The loop is {verdict.message}.")
    if gains.look_ahead_m == 0.0:
        found.append(
            "look_ahead_m is 0: steering rate from the offset of the rear axle alone is never "
            "asymptotically stable, whatever the gains; use a point ahead, about 2 m."
        )
    if gains.derivative_rad_per_m <= 0.0:
        found.append(
            f"derivative_rad_per_m is {gains.derivative_rad_per_m}: the loop commands a steering "
            "rate and needs a derivative gain > 0 for damping."
        )
    return found


def _margin_warnings(name: str, found: Margins, stable: bool) -> list[str]:
    if not stable:
        return []
    warnings = []
    if found.phase_margin_deg < _LEAST_PHASE_MARGIN_DEG:
        warnings.append(
            f"The {name} loop has a phase margin of {found.phase_margin_deg:.1f} degrees; below "
            f"{_LEAST_PHASE_MARGIN_DEG:.0f} it rings."
        )
    if max(found.gain_margin, 1.0 / found.gain_margin) < _LEAST_GAIN_MARGIN:
        warnings.append(
            f"The {name} loop becomes unstable when its gain changes by a factor of "
            f"{found.gain_margin:.2f}; a factor of {_LEAST_GAIN_MARGIN:.0f} is usual."
        )
    return warnings
