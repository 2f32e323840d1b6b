"""One vehicle's state from ranges and reports: where it is, which way it faces, how it moves."""

from __future__ import annotations

import enum
import math
from array import array
from typing import Final, TypeAlias, final

from workbench.errors import InputError
from workbench.runtime.localiser.site import Site
from workbench.runtime.localiser.start import spread_headings
from workbench.runtime.localiser.states import HYPOTHESES, STATES, WINDOW
from workbench.runtime.localiser.steps import Numbers, Step, Steps, doubles

_Belief: TypeAlias = tuple[Numbers, Numbers]
_N: Final = len(STATES)
_HEADING: Final = STATES.index("heading")
_SQUARE: Final = _N * _N
# Longest step of the prediction: longer spans are cut.
_STEP_S: Final = 0.05
# A place less sure than this is no place: the window goes on.
_PLACED_M: Final = 0.5
# What nothing but motion can tell, and so is not learned at a standstill.
_MOTION_ONLY: Final = ("heading", "speed_scale", "steering_zero")


def _mask(forgotten: tuple[str, ...]) -> array[float]:
    return array("d", (float(name not in forgotten) for name in STATES))


_MOVING: Final = _mask(())
# Standing: whether x, and whether y, is surer than it may become.
_STANDING: Final = {
    (x, y): _mask((*_MOTION_ONLY, *("x",) * x, *("y",) * y))
    for x in (False, True) for y in (False, True)
}  # fmt: skip


class Status(enum.Enum):
    """What is known of a car."""

    UNPLACED = "not placed: fewer ranges from a standing car than are needed"
    HEADING_INVALID = "the place is known, the heading is not"
    VALID = "place and heading are known"
    LOST = "ranges contradict the estimate, or none was accepted for too long"


@final
class Car:
    """What is known of one car; its methods take messages in the order of their instants.

    `reported` takes reports of speed or steering or both (about 30 Hz), `ranged` a range to one
    beacon. Instants are of one clock, those at which what was measured held. The car must stand
    while it is placed, and drive some metres until its heading is known; who is LOST begins anew,
    with another Car.

    mean (7), covariance (7 x 7, column by column): of an aligned car; each_mean, each_covariance:
    of a placed one that is not, of every hypothesis, one after the other, with their log weights.
    ranged_s: when the last range was accepted; refused: how many were refused since.
    """

    __slots__ = (
        "_commands", "_filled", "_site", "_slow_since_s", "_steps", "_window",
        "aligned", "covariance", "each_covariance", "each_mean", "logs", "mean", "placed",
        "ranged_s", "refused", "stamp_s", "standing",
    )  # fmt: skip

    def __init__(self, site: Site, steps: Steps, *, at_s: float) -> None:
        self._site, self._steps = site, steps
        self.stamp_s = at_s
        self.mean, self.covariance = doubles(_N), doubles(_SQUARE)
        self.each_mean, self.each_covariance = doubles(0), doubles(0)
        self.logs: list[float] = []
        self.placed = self.aligned = self.standing = False
        self.ranged_s, self.refused = -math.inf, 0
        self._commands = (0.0, 0.0)
        self._slow_since_s = math.inf
        self._window: tuple[Numbers, ...] = tuple(map(doubles, (3 * WINDOW, WINDOW, WINDOW)))
        self._filled = 0

    def reported(
        self, *, at_s: float, speed_mps: float | None, steering_rad: float | None,
        commands: tuple[float, float] | None,
    ) -> None:  # fmt: skip
        """After reports of speed and steering of one instant; None where there is none.

        commands: acceleration and steering rate in force from now on; None where they are not
        known, and then `site.motion` must allow for what the driver does.
        """
        belief = self._moved(at_s)
        self._commands = commands or (0.0, 0.0)
        reports = self._site.reports
        if speed_mps is not None:
            slow = abs(speed_mps) < reports.standing_mps
            self._slow_since_s = min(self._slow_since_s, at_s) if slow else math.inf
        self.standing = at_s - self._slow_since_s >= reports.standing_s and self._commands[0] <= 0.0
        if not self.placed:
            return
        steps, one, learned = self._steps, self.aligned, self._learning(belief[1])
        if speed_mps is not None:
            step = steps.report_speed if one else steps.each_report_speed
            belief = _fused(step, belief, speed_mps, learned)
        if steering_rad is not None:
            step = steps.report_steering if one else steps.each_report_steering
            belief = _fused(step, belief, steering_rad, learned)
        self._keep(belief)
        if not one and not self.standing:
            self._align()

    def ranged(self, *, at_s: float, beacon: int, range_m: float | None) -> None:
        """After a range (m) to one of the beacons; None where one was due and did not come."""
        belief = self._moved(at_s)
        place = self._site.beacons[beacon]
        at = (place.x_m, place.y_m, place.height_m)
        if self.placed:
            self._keep(belief if range_m is None else self._measured(belief, at, range_m))
        elif self.standing:
            self._collect(at, range_m)
        else:
            self._filled = 0

    def moved_on(self, *, at_s: float) -> None:
        """The same at a later instant, without any news; InputError for an earlier one."""
        self._keep(self._moved(at_s))

    def status(self, *, now_s: float) -> Status:
        """What is known of the car at now_s."""
        limits = self._site.limits
        if not self.placed:
            return Status.UNPLACED
        if self.refused >= limits.lost_after or now_s - self.ranged_s > limits.range_age_s:
            return Status.LOST
        if self.aligned and self.covariance[_HEADING * (_N + 1)] <= limits.heading_rad**2:
            return Status.VALID
        return Status.HEADING_INVALID

    def continued(self, site: Site, steps: Steps) -> Car:
        """The same car, to go on from by itself, with this site and these steps."""
        other = Car(site, steps, at_s=self.stamp_s)
        for name in ("mean", "covariance", "each_mean", "each_covariance"):
            setattr(other, name, _copy(getattr(self, name)))
        other._window = tuple(map(_copy, self._window))
        other._commands, other._slow_since_s = self._commands, self._slow_since_s
        other._filled, other.logs = self._filled, self.logs
        other.placed, other.aligned, other.standing = self.placed, self.aligned, self.standing
        other.ranged_s, other.refused = self.ranged_s, self.refused
        return other

    def _moved(self, at_s: float) -> _Belief:
        """What is known at that instant; the caller keeps it."""
        if not at_s >= self.stamp_s:
            raise InputError(
                f"at_s: expected an instant not before {self.stamp_s!r} s, up to which messages "
                f"are used, got {at_s!r}; sort them by their instants"
            )
        span_s = at_s - self.stamp_s
        self.stamp_s = at_s
        one = self.aligned
        belief = (self.mean, self.covariance) if one else (self.each_mean, self.each_covariance)
        if span_s == 0.0 or not self.placed:
            return belief
        count = math.ceil(span_s / _STEP_S)
        step = self._steps.predict if one else self._steps.each_predict
        mean, covariance, commands, duration, standing = step.given
        if one:
            commands[0], commands[1] = self._commands
            duration[0], standing[0] = span_s / count, self.standing
        else:
            commands[:] = array("d", self._commands * HYPOTHESES)
            duration[:] = array("d", (span_s / count,) * HYPOTHESES)
            standing[:] = array("d", (self.standing,) * HYPOTHESES)
        for _ in range(count):
            mean[:], covariance[:] = belief
            step.run()
            belief = step.found[0], step.found[1]
        return belief

    def _keep(self, belief: _Belief) -> None:
        if self.aligned:
            self.mean[:], self.covariance[:] = belief
        else:
            self.each_mean[:], self.each_covariance[:] = belief

    def _learning(self, covariance: Numbers) -> array[float]:
        """Which states a measurement may teach.

        At a standstill: neither heading, scale nor zero, and no coordinate that is surer than
        still_m already, for errors of ranges between standing antennas need not be independent.
        """
        if not self.standing:
            return _MOVING
        if not self.aligned:
            return _STANDING[False, False]
        floor2 = self._site.limits.still_m**2
        return _STANDING[covariance[0] < floor2, covariance[_N + 1] < floor2]

    def _measured(self, belief: _Belief, at: tuple[float, float, float], range_m: float) -> _Belief:
        """After a range; counts whether it was accepted."""
        one, learned = self.aligned, self._learning(belief[1])
        step = self._steps.range_update if one else self._steps.each_range_update
        mean, covariance, measured, beacon, learning = step.given
        mean[:], covariance[:] = belief
        many = len(measured)
        measured[:], beacon[:] = array("d", (range_m,) * many), array("d", at * many)
        learning[:] = learned * many
        step.run()
        accepted = step.found[3]
        if one:
            taken = accepted[0] > 0.5
        else:
            # By the likeliest hypothesis of those before.
            taken = accepted[self.logs.index(max(self.logs))] > 0.5
            self.logs = [a + b for a, b in zip(self.logs, step.found[4], strict=True)]
        if taken:
            self.refused, self.ranged_s = 0, self.stamp_s
        else:
            self.refused += 1
        return step.found[0], step.found[1]

    def _collect(self, at: tuple[float, float, float], range_m: float | None) -> None:
        """One more range of a standing car; place it once there are enough."""
        beacons, ranges, received = self._window
        beacons[:-3], ranges[:-1], received[:-1] = beacons[3:], ranges[1:], received[1:]
        beacons[-3], beacons[-2], beacons[-1] = at
        ranges[-1], received[-1] = (1.0, 0.0) if range_m is None else (range_m, 1.0)
        self._filled += 1
        if self._filled < WINDOW:
            return
        step = self._steps.locate
        for given, kept in zip(step.given, self._window, strict=True):
            given[:] = kept
        step.run()
        place, covariance = step.found
        if covariance[0] + covariance[3] <= _PLACED_M**2:
            self.each_mean, self.each_covariance = spread_headings(self._site, place, covariance)
            self.logs = [0.0] * HYPOTHESES
            self.placed, self.refused, self.ranged_s = True, 0, self.stamp_s

    def _align(self) -> None:
        """Join the hypotheses once the heading of their mixture is sure."""
        step = self._steps.collapse
        means, covariances, logs = step.given
        means[:], covariances[:] = self.each_mean, self.each_covariance
        for k, log in enumerate(self.logs):
            logs[k] = log
        step.run()
        mean, covariance = step.found
        if covariance[_HEADING * (_N + 1)] <= self._site.limits.heading_rad**2:
            self.aligned = True
            self.mean[:], self.covariance[:] = mean, covariance
            self.each_mean, self.each_covariance, self.logs = doubles(0), doubles(0), []


def _fused(step: Step, belief: _Belief, value: float, learned: array[float]) -> _Belief:
    """After a report."""
    mean, covariance, report, learning = step.given
    mean[:], covariance[:] = belief
    if len(report) == 1:
        report[0], learning[:] = value, learned
    else:
        report[:], learning[:] = array("d", (value,) * HYPOTHESES), learned * HYPOTHESES
    step.run()
    return step.found[0], step.found[1]


def _copy(numbers: Numbers) -> Numbers:
    return memoryview(bytearray(numbers)).cast("d")
