"""A tube carried in a moving frame, written so that every step can be re-checked by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.linalg import expm

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models.system import System
from workbench.reach.certified.frame_functions import FieldBounds
from workbench.reach.certified.frame_step import Advance, Frame, Step, advanced
from workbench.reach.certified.graph import CertifiedModel, certified_model
from workbench.reach.tube import ReachTube, TubeStatus
from workbench.sensitivity.interval_arrays import Interval
from workbench.sensitivity.vectorised import Array
from workbench.sets.box import Box


@final
@dataclass(frozen=True, slots=True, eq=False)
class FrameProof:
    """All steps of a moving-frame tube: frames (K+1), steps (K), and where and why it ended."""

    model: CertifiedModel
    initial: Interval
    times: tuple[float, ...]
    frames: tuple[Frame, ...]
    steps: tuple[Step, ...]
    message: str

    def tube(self) -> ReachTube:
        """The tube that the steps prove."""
        sets = [frame.states for frame in self.frames]
        rows = [step.row for step in self.steps]
        shape = (len(rows), len(self.model.states))
        return ReachTube(
            times=np.array(self.times),
            lower=np.array([row[0] for row in rows]).reshape(shape),
            upper=np.array([row[1] for row in rows]).reshape(shape),
            lower_at=np.array([each[0] for each in sets]),
            upper_at=np.array([each[1] for each in sets]),
            names=self.model.states,
            status=TubeStatus.ENCLOSURE_FAILED if self.message else TubeStatus.COMPLETE,
            rigor=Rigor.ENCLOSED,
            message=self.message,
        )


@final
@dataclass(frozen=True, slots=True)
class FrameTube:
    """x(t) = xi(t) + exp(A (t - t_k)) T_k v(t): a nominal solution and a frame that moves with it.

    In a step v obeys v' = (T^-1 e^(-A s) (J - A) e^(A s) T) v + T^-1 e^(-A s) r with J an interval
    Jacobian (mixed: column j over the set's first j coordinates and the nominal's others), A its
    midpoint and r what inputs other than the middle ones add, so that |v| grows by a Metzler
    matrix that is of first order in the set's size. step_s: length of a step; parts: the nominal
    solution takes this many second-order Taylor steps in it; condition_max: beyond it the frame is
    orthogonalised anew. Rigor ENCLOSED: all bounds are rounded outward, remainders are bounded over
    verified sets. Ends early, with a status, where no a priori box is found. Wider than
    `ValidatedTube` for large sets; its steps can be certified (`certificate.tube_certificate`).
    Source: Lohner, Computing enclosures for the solutions of ordinary initial and boundary value
    problems, 1987; Kapela and Zgliczynski, DCDS-B 11(2), 2009.
    """

    step_s: float
    parts: int
    condition_max: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.step_s) and self.step_s > 0.0):
            raise InputError(f"expected a finite step_s > 0, got {self.step_s!r}")
        if self.parts < 1:
            raise InputError(f"expected at least 1 part, got {self.parts}")
        if not self.condition_max >= 1.0:
            raise InputError(f"expected condition_max >= 1, got {self.condition_max!r}")

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        """The tube; its message says why a proof ended early."""
        return self.prove(system, initial_set=initial_set, horizon_s=horizon_s).tube()

    def prove(self, system: System, *, initial_set: Box, horizon_s: float) -> FrameProof:
        """The steps behind the tube. Raises InputError as `certified_model` and on bad sets."""
        model = certified_model(system)
        box = initial_set.reordered(model.states)
        bounds = FieldBounds(model)
        count = max(1, math.ceil(horizon_s / self.step_s - 1e-9))
        times = [k * (horizon_s / count) for k in range(count)] + [horizon_s]
        initial = np.array(box.lower), np.array(box.upper)
        frames, steps, message = [_first(box)], [], ""
        inputs = (
            tuple(np.array(side) for side in zip(*model.ranges, strict=True)) or (np.zeros(0),) * 2
        )
        for k in range(count):
            advance = Advance(bounds, (inputs[0], inputs[1]), self.parts, times[k + 1] - times[k])
            following = advanced(advance, frames[-1], self._frame)
            if isinstance(following, str):
                message = f"{following} after {times[k]:g} s; use a shorter step or a smaller set"
                break
            steps.append(following[0])
            frames.append(following[1])
        ended = tuple(times[: len(frames)])
        return FrameProof(model, initial, ended, tuple(frames), tuple(steps), message)

    def _frame(self, jacobian: Array, frame: Array, radius: Array, length_s: float) -> Array:
        moved = np.asarray(expm(jacobian * length_s) @ frame)
        scaled = moved * radius
        if np.linalg.cond(scaled) <= self.condition_max:
            return moved
        order = np.argsort(-np.linalg.norm(scaled, axis=0), kind="stable")
        return np.asarray(np.linalg.qr(scaled[:, order])[0])


def _first(box: Box) -> Frame:
    center = np.array(box.center)
    # Axes without width get a tiny one, so that the checker's strict inclusions can hold.
    radius = np.array(box.radius) * (1.0 + 1e-12) + 1e-12
    identity = np.eye(len(center))
    return Frame.of(center, identity, radius)
