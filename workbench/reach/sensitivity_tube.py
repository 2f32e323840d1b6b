"""The tube to ship: nominal, sensitivity, and a bounded second-order remainder."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import Ode, System
from workbench.reach.ranged_parameters import initial_box, with_ranged_parameters_as_states
from workbench.reach.step_functions import PICARD_TRIALS, StepFunctions, step_functions
from workbench.reach.truncation import truncation_function
from workbench.reach.tube import Array, ReachTube, TubeStatus
from workbench.sets import Box


@final
@dataclass(frozen=True, slots=True)
class SensitivityTube:
    """x(t) in xi(t) + S(t) d0 + (box-valued remainders carried as generators), all time covered.

    step_s: grid spacing in s; the last step is shorter when it does not divide the horizon. The set
    at an instant is the zonotope nominal + G [-1, 1]^m. Each step maps G by the sensitivity of the
    nominal and appends a diagonal block for the remainder, the truncation of the Runge-Kutta step
    and disturbances that vary within the step. Kinks enter by their best affine relaxation over the
    current range. Between instants every state stays within h^2/8 |x''| of its chord.
    Rigor NUMERICAL: truncation is bounded with outward rounding; remainder, motion between instants
    and the verified boxes are bounded by the same argument in plain floats, and the rounding of
    nominal, sensitivity and generators is not bounded. The linear image that bounds the set between
    instants is the Runge-Kutta one; it differs from the exact one by the truncation, which the
    chord's own slack (h^2/8 M M r, four orders above h^5 M^5 r / 120) covers for h M < 1/2.
    Source: conservative linearisation, Althoff, Stursberg, Buss, CDC 2008; relaxation and carrying
    of remainders: docs/decisions.
    """

    step_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.step_s) and self.step_s > 0):
            raise InputError(f"expected a positive step_s in s, got {self.step_s!r}")

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """Run over [0, horizon_s] from `initial_set` (axes = state names)."""
        original = system.ode
        ode, steps, truncation = _prepared(original)
        start = initial_box(original, ode, initial_set)
        run = _Run(ode, steps, truncation, start, horizon_s, self.step_s)
        return run.tube(len(original.states))


@functools.lru_cache(maxsize=16)
def _prepared(original: Ode) -> tuple[Ode, StepFunctions, ca.Function]:
    """What depends on the system alone; building it takes longer than a tube."""
    ode = with_ranged_parameters_as_states(original)
    steps = step_functions(ode)
    return ode, steps, truncation_function(steps)


class _Run:
    """The loop over the steps; holds the zonotope (x, G) and the rows found so far."""

    def __init__(
        self, ode: Ode, steps: StepFunctions, truncation: ca.Function, start: Box,
        horizon_s: float, step_s: float,
    ) -> None:  # fmt: skip
        if not (math.isfinite(horizon_s) and horizon_s > 0):
            raise InputError(f"expected a positive horizon_s in s, got {horizon_s!r}")
        self.ode, self.steps, self.truncation = ode, steps, truncation
        count = max(1, math.ceil(horizon_s / step_s - 1e-9))
        self.times = np.append(step_s * np.arange(count), horizon_s)
        self.x: Array = np.array(start.center)
        self.generators: Array = np.diag(np.array(start.radius))
        self.p = np.array(steps.form.parameter_values())
        self.w_mid = np.array([(d.lower + d.upper) / 2 for d in ode.disturbances])
        self.w_rad = np.array([(d.upper - d.lower) / 2 * (1 + 1e-15) for d in ode.disturbances])
        self.lower_at, self.upper_at = [np.array(start.lower)], [np.array(start.upper)]
        self.lower: list[Array] = []
        self.field_range: dict[str, tuple[Array, Array]] = {}
        self.upper: list[Array] = []

    def tube(self, n_shown: int) -> ReachTube:
        status, message = TubeStatus.COMPLETE, ""
        for k, h in enumerate(np.diff(self.times)):
            failure = self._step(float(h))
            if failure:
                status = TubeStatus.ENCLOSURE_FAILED
                message = f"{failure} at t = {self.times[k]:.3f} s"
                break
        done, n = len(self.lower), len(self.ode.states)
        return ReachTube(
            times=self.times[: done + 1],
            lower=np.array(self.lower).reshape(done, n)[:, :n_shown],
            upper=np.array(self.upper).reshape(done, n)[:, :n_shown],
            lower_at=np.array(self.lower_at)[:, :n_shown],
            upper_at=np.array(self.upper_at)[:, :n_shown],
            names=self.ode.names[:n_shown],
            status=status,
            rigor=Rigor.NUMERICAL,
            message=message,
        )

    def _step(self, h: float) -> str:
        """Advance by h; returns what failed, or '' when the step is done."""
        call = _call
        radius = np.abs(self.generators).sum(axis=1)
        common = {
            "x": self.x,
            "r": radius,
            "p": self.p,
            "w_mid": self.w_mid,
            "w_rad": self.w_rad,
            "h": h,
        }
        kinks = self._relax(common)
        if kinks is None:
            return "the range of a limited command could not be bounded"
        common |= kinks
        box = self._enclosed(self.steps.bounds, common)
        if box is None:
            return "no a priori enclosure of the field was found"
        moved = call(self.steps.advance, common)
        n = len(self.x)
        mapped = moved["transition"].reshape(n, n) @ self.generators
        r_end = np.abs(mapped).sum(axis=1)
        terms = call(self.steps.remainder, common | box | {"r_end": r_end})
        v_rad = np.concatenate([self.w_rad, kinks["gap"]])
        cut = call(
            self.truncation, _as_ranges(common) | box | {"radius": terms["radius"], "v_rad": v_rad}
        )
        if terms["ok"][0] != 1.0 or cut["ok"][0] != 1.0:
            return "the remainder could not be bounded"
        if not all(
            np.all(np.isfinite(v)) for v in (*moved.values(), *terms.values(), cut["bound"])
        ):
            return "the remainder left the range of numbers"
        by_v = moved["by_exogenous"].reshape(n, len(v_rad)) * v_rad
        added = np.diag(terms["box"] + cut["bound"])
        new = np.hstack([by_v, added])
        self.generators = np.hstack([mapped, new[:, np.abs(new).sum(axis=0) > 0]])
        self._record(moved["x_end"], box, terms["chord"])
        return ""

    def _enclosed(self, function: ca.Function, common: dict[str, Array]) -> dict[str, Array] | None:
        """Picard trials, from the range of the field over the previous step."""
        zero = np.zeros(len(self.x))
        for _ in range(PICARD_TRIALS):
            low, high = self.field_range.get(function.name(), (zero, zero))
            guess = {"guess_lower": low, "guess_upper": high}
            box = _call(function, common | guess)
            if not np.all(np.isfinite(box["f_lower"]) & np.isfinite(box["f_upper"])):
                return None
            self.field_range[function.name()] = box["f_lower"], box["f_upper"]
            if box["ok"][0] == 1.0:
                return box
        return None

    def _relax(self, common: dict[str, Array]) -> dict[str, Array] | None:
        count = len(self.steps.relaxations)
        state = {name: np.zeros(count) for name in ("slope", "offset", "gap")}
        box = self._enclosed(self.steps.enclose, common) if count else {}
        if box is None:
            return None
        for i in range(count):
            row = _call(self.steps.driver_rows[i], common | state)
            spread = np.abs(row["gradient"] @ self.generators).sum()
            line = _call(
                self.steps.relaxations[i],
                common | state | box | {"driver": row["driver"], "linear_radius": spread},
            )
            if line["ok"][0] != 1.0:
                return None
            for name in state:
                state[name][i] = line[f"{name}_i"][0]
        return state

    def _record(self, x_end: Array, box: dict[str, Array], chord: Array) -> None:
        self.x = x_end
        radius = np.abs(self.generators).sum(axis=1)
        lower = np.maximum(self.x - radius, box["box_lower"])
        upper = np.minimum(self.x + radius, box["box_upper"])
        segment_lower = np.minimum(self.lower_at[-1], lower) - chord
        segment_upper = np.maximum(self.upper_at[-1], upper) + chord
        self.lower.append(np.maximum(segment_lower, box["box_lower"]))
        self.upper.append(np.minimum(segment_upper, box["box_upper"]))
        self.lower_at.append(lower)
        self.upper_at.append(upper)


def _as_ranges(common: dict[str, Array]) -> dict[str, Array]:
    w_mid, w_rad = common["w_mid"], common["w_rad"]
    ranges = {"h": common["h"], "w_lower": w_mid - w_rad, "w_upper": w_mid + w_rad}
    for name in ("p", "slope", "offset"):
        ranges |= {f"{name}_lower": common[name], f"{name}_upper": common[name]}
    return ranges


def _call(function: ca.Function, values: dict[str, Array]) -> dict[str, Array]:
    inputs = [values[name] for name in function.name_in()]
    outputs = function.call([ca.DM(v) for v in inputs])
    return {
        name: np.array(ca.densify(value)).ravel()
        for name, value in zip(function.name_out(), outputs, strict=True)
    }
