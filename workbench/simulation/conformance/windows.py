"""What conformance compares: measured windows of motion, and the model that should enclose them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.system import Ode
from workbench.models.vehicle_sections import Uncertainty
from workbench.sets import Box

Array = NDArray[np.float64]

_MOST_STEPS: Final = 1000

LONGEST_GAP_S: Final = 0.25
"""Between the samples of a window at most: farther apart, motion between them is not measured."""

SIGNALS: Final = {
    "lateral_m": "position_error_lateral",
    "heading_rad": "heading_estimate_error",
    "speed_mps": "speed_estimate_error",
    "acceleration_mps2": "acceleration_disturbance",
    "steering_rate_radps": "steering_rate_disturbance",
    "wheelbase_m": "wheelbase",
}
"""Key of a vehicle file's [uncertainty] -> the signal of the equations that it bounds."""


class MotionModel(Protocol):
    """Equations whose tubes are to contain measured motion."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """The states that are compared with what was measured."""

    @property
    def weights(self) -> tuple[float, ...]:
        """Cost of a unit of half width, one per output."""

    @property
    def fitted(self) -> tuple[str, ...]:
        """The keys of [uncertainty] that measured motion can say something about."""

    def ode(self, uncertainty: Uncertainty) -> Ode:
        """The equations with disturbances and parameter ranges of this size."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A stretch of measured motion.

    recording: whose it is, the independent unit; start_s: on the recording's clock; initial: what
    is known of the model's states at its beginning; measured (K+1, m): the outputs at the instants;
    gaps (K, 3): realised less commanded acceleration (m/s^2) and steering rate (rad/s) and the
    sideways speed (m/s) that the bicycle cannot have, at each step, NaN where unknown.
    """

    recording: str
    start_s: float
    initial: Box
    measured: Array
    gaps: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Windows of one length, with their instants times_s (K+1,) from each window's beginning."""

    times_s: Array
    windows: tuple[Window, ...]

    def __post_init__(self) -> None:
        for window in self.windows:
            if len(window.measured) != len(self.times_s):
                raise ValueError(
                    f"expected {len(self.times_s)} instants in each window, got "
                    f"{len(window.measured)}"
                )

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings that have windows, sorted."""
        return tuple(sorted({window.recording for window in self.windows}))

    def of(self, recordings: Sequence[str]) -> Measured:
        """The windows of these recordings alone."""
        chosen = frozenset(recordings)
        return Measured(self.times_s, tuple(w for w in self.windows if w.recording in chosen))

    def without(self, left_out: Sequence[int]) -> Measured:
        """All windows but these, by place."""
        gone = frozenset(left_out)
        kept = (w for place, w in enumerate(self.windows) if place not in gone)
        return Measured(self.times_s, tuple(kept))


@final
@dataclass(frozen=True, slots=True)
class Split:
    """Which recordings the figures are fitted to, and which they are tested on."""

    rule: str
    training: tuple[str, ...]
    held_out: tuple[str, ...]


def alternating(names: Sequence[str]) -> Split:
    """Every other recording by name, beginning with the first, is fitted to; the others test.

    Raises InputError for fewer than two.
    """
    ordered = sorted(names)
    if len(ordered) < 2:
        raise InputError(
            f"expected at least two recordings with whole windows (no {LONGEST_GAP_S:g} s between "
            f"samples), got {len(ordered)}; one to fit and one to test on is the least, add "
            "recordings or shorten --window"
        )
    rule = "every other recording by name, beginning with the first, is fitted to"
    return Split(rule, tuple(ordered[::2]), tuple(ordered[1::2]))


def named(names: Sequence[str], training: Sequence[str]) -> Split:
    """The recordings named are fitted to, all others test. Raises InputError on unknown ones."""
    unknown = sorted(set(training) - set(names))
    others = tuple(sorted(set(names) - set(training)))
    if unknown:
        raise InputError(
            f"--train: expected recordings with whole windows ({', '.join(sorted(names))}), got "
            f"{', '.join(unknown)}"
        )
    if not others:
        raise InputError("--train: expected to leave recordings to test on, got all of them")
    return Split("named by --train", tuple(sorted(set(training))), others)


def instants(window_s: float, step_s: float) -> Array:
    """0, step, ..., window; raises InputError unless it is a whole number of steps, not too many
    for the fit to end."""
    if window_s / step_s > _MOST_STEPS:
        raise InputError(
            f"expected at most {_MOST_STEPS} steps in a window, got --window {window_s:g} / --step "
            f"{step_s:g} = {window_s / step_s:.3g}; give a longer step"
        )
    steps = round(window_s / step_s)
    if steps < 1 or abs(steps * step_s - window_s) > 1e-9 * window_s:
        raise InputError(
            f"expected a window of whole steps, got --window {window_s:g} and --step {step_s:g}"
        )
    return np.asarray(step_s * np.arange(steps + 1))
