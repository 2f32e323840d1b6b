"""Nyquist and Bode curves, root loci over gain, and step responses, linear and nonlinear."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import casadi as ca
import control
import numpy as np
from numpy.typing import NDArray

from workbench.models.bicycle import PathFrame
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.over_speed import frequencies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from workbench.models.vehicle import Vehicle

Array = NDArray[np.float64]
_FACTORS: Final = np.concatenate([np.linspace(0.0, 1.0, 61), np.linspace(1.0, 5.0, 100)[1:]])
_STEP_S: Final = 0.01
_SETTLED: Final = 0.05


@final
@dataclass(frozen=True, slots=True, eq=False)
class FrequencyResponse:
    """L(j w) of the loop broken open at the steering rate, at one speed; radps (n), values (n)."""

    speed_mps: float
    radps: Array
    values: NDArray[np.complex128]

    def rows(self) -> list[dict[str, float]]:
        """Magnitude and unwrapped phase at each frequency."""
        phase = np.degrees(np.unwrap(np.angle(self.values)))
        return [
            {"speed_mps": self.speed_mps, "frequency_radps": float(w), "magnitude": float(m),
             "phase_deg": float(p)}
            for w, m, p in zip(self.radps, np.abs(self.values), phase, strict=True)
        ]  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class RootLocus:
    """Poles (n x order) as the whole loop gain changes by factors (n), at one speed."""

    speed_mps: float
    factors: Array
    poles: NDArray[np.complex128]

    def rows(self) -> list[dict[str, float]]:
        """One row per factor and pole."""
        return [
            {"speed_mps": self.speed_mps, "factor": float(k), "real_per_s": float(pole.real),
             "imaginary_per_s": float(pole.imag)}
            for k, poles in zip(self.factors, self.poles, strict=True)
            for pole in poles
        ]  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepResponse:
    """The offset after a start `start_m` beside the path, at one speed.

    times_s (n); linear_m: python-control's answer; nonlinear_m: the full loop with its limits;
    saturated: share of time at the steering rate's limit until settled or the end; settling_s: the
    last time at which |offset| exceeds 5 % of the start, of the linear and of the full loop (NaN:
    not within the time shown); overshoot: largest offset on the other side as share of the start.
    """

    speed_mps: float
    start_m: float
    times_s: Array
    linear_m: Array
    nonlinear_m: Array
    saturated: float
    settling_s: tuple[float, float]
    overshoot: tuple[float, float]

    def rows(self) -> list[dict[str, float]]:
        """One row per instant."""
        columns = zip(self.times_s, self.linear_m, self.nonlinear_m, strict=True)
        return [
            {"speed_mps": self.speed_mps, "time_s": float(t), "linear_m": float(a),
             "nonlinear_m": float(b)}
            for t, a, b in columns
        ]  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class Responses:
    """All of these at a few speeds."""

    frequency: tuple[FrequencyResponse, ...]
    loci: tuple[RootLocus, ...]
    steps: tuple[StepResponse, ...]

    def rows(self) -> list[dict[str, float]]:
        """The step responses, one row per speed and instant."""
        return [row for step in self.steps for row in step.rows()]

    def plot(self) -> Figure:
        """Step responses, root locus, Nyquist and Bode curves as a matplotlib figure."""
        from workbench.models.gains.pictures import figure, paint_responses

        return figure(lambda canvas: paint_responses(canvas, self), width_in=9.0, height_in=6.0)


def responses(
    vehicle: Vehicle, loop: LateralLoop, speeds_mps: Sequence[float], *, horizon_s: float
) -> Responses:
    """Curves of `loop` at some speeds > 0; nonlinear answers of the vehicle with its gains.

    The nonlinear loop starts at the initial set's largest offset, at the speed it keeps.
    """
    at = [loop.at({"speed": v}) for v in speeds_mps]
    low, high = vehicle.initial_set.interval("offset")
    start_m = max(abs(low), abs(high)) or 1.0
    return Responses(
        tuple(_frequency(each) for each in at),
        tuple(_locus(each) for each in at),
        tuple(step_response(vehicle, each, start_m, horizon_s=horizon_s) for each in at),
    )


def _frequency(loop: LateralLoop) -> FrequencyResponse:
    radps = frequencies(loop.poles())
    found = control.frequency_response(loop.open_loop(), radps)
    return FrequencyResponse(loop.speed_mps, radps, np.asarray(found.complex).ravel())


def _locus(loop: LateralLoop) -> RootLocus:
    found = control.root_locus_map(loop.open_loop(), gains=_FACTORS)
    return RootLocus(loop.speed_mps, _FACTORS, np.asarray(found.loci, dtype=complex))


def step_response(
    vehicle: Vehicle, loop: LateralLoop, start_m: float, *, horizon_s: float
) -> StepResponse:
    """From rest on a line `start_m` beside the path; the vehicle gets the gains of `loop`."""
    times = np.linspace(0.0, horizon_s, round(horizon_s / _STEP_S) + 1)
    system = loop.state_space()
    linear = control.initial_response(system, times, [start_m] + [0.0] * (system.nstates - 1))
    offset = np.asarray(linear.outputs).ravel()
    run = simulated(vehicle, loop, {"offset": start_m}, horizon_s=horizon_s)
    limit = vehicle.limits.steering_rate_radps
    settled = [_settling(times, y, start_m) for y in (offset, run.offset_m)]
    end = settled[1] if math.isfinite(settled[1]) else horizon_s
    before = times <= end
    return StepResponse(
        loop.speed_mps, start_m, times, offset, run.offset_m,
        float(np.mean(np.abs(run.raw_rate_radps[before]) >= limit)),
        (settled[0], settled[1]),
        tuple(max(0.0, float(-np.min(y / start_m))) for y in (offset, run.offset_m)),  # type: ignore[arg-type]
    )  # fmt: skip


def _settling(times: Array, offset: Array, start: float) -> float:
    outside = np.flatnonzero(np.abs(offset) > _SETTLED * abs(start))
    last = int(outside[-1]) if len(outside) else 0
    return math.nan if last == len(times) - 1 else float(times[last])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A run of the full loop: offset (m), steering rate before its limit (rad/s), all states."""

    offset_m: Array
    raw_rate_radps: Array
    states: Array
    names: tuple[str, ...]


def simulated(
    vehicle: Vehicle, loop: LateralLoop, start: dict[str, float], *, horizon_s: float
) -> Run:
    """The nonlinear loop with limits, by Runge and Kutta's fourth order in steps of 0.01 s.

    start: state name -> value, others 0; the speed starts at, and is led to, that of `loop`.
    """
    gains = dataclasses.replace(
        vehicle.steering_pid,
        proportional_radps_per_m=loop.proportional,
        integral_radps_per_ms=loop.integral,
        derivative_rad_per_m=loop.derivative,
        look_ahead_m=loop.look_ahead_m,
    )
    mode = dataclasses.replace(vehicle.track(), reference_speed_mps=loop.speed_mps)
    changed = dataclasses.replace(vehicle, steering_pid=gains)
    ode = changed.closed_loop(mode, PathFrame(0.0, 0.0)).ode
    field, p = ode.function(), ode.parameter_values()
    x = ca.SX.sym("x", len(ode.names))
    w = [each.nominal for each in ode.disturbances]
    h = _STEP_S
    k1 = field(x, p, w)
    k2 = field(x + h / 2 * k1, p, w)
    k3 = field(x + h / 2 * k2, p, w)
    k4 = field(x + h * k3, p, w)
    step = ca.Function("step", [x], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    count = round(horizon_s / h)
    first = {"speed": loop.speed_mps} | start
    x0 = [first.get(name, 0.0) for name in ode.names]
    states = np.hstack([np.array(x0)[:, None], step.mapaccum(count)(x0).full()])
    raw = ca.Function("raw", [ode.x, ode.p, ode.w], [dict(ode.outputs)["steering_rate_command"]])
    rates = raw.map(count + 1)(
        states, ca.repmat(ca.DM(p), 1, count + 1), ca.repmat(ca.DM(w), 1, count + 1)
    )
    return Run(states[ode.names.index("offset")], rates.full().ravel(), states, ode.names)
