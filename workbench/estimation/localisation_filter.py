"""The steps of the vehicle's state estimate as CasADi Functions, which also run as compiled C."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import casadi as ca
from scipy import stats

from workbench.errors import InputError
from workbench.estimation.accepted_ranges import accepted_error
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_start import collapse_function, locate_function
from workbench.estimation.localisation_states import STATES

_SIZE: Final = len(STATES)
_X, _Y, _HEADING, _SPEED, _STEERING, _SCALE, _ZERO = range(_SIZE)
_LEAST_STRAY: Final = 1e-3


@final
@dataclass(frozen=True, slots=True)
class FilterFunctions:
    """Everything that runs on the vehicle; m (7), P (7 x 7) are mean and covariance.

    predict: m, P, commanded acceleration (m/s^2) and steering rate (rad/s), duration (s), standing
    (0 or 1) -> m, P. report_speed, report_steering: m, P, report, learning (7) -> m, P.
    range_update: m, P, range (m), beacon (3), learning (7) -> m, P, innovation^2 / its variance,
    accepted (0 or 1), log-likelihood. locate: places of beacons (3 x n), ranges (n), received (n,
    0 or 1) -> place of the antenna (2), its covariance (2 x 2). collapse: means (7 x h),
    covariances (7 x 7h), log weights (h) -> m, P.
    """

    predict: ca.Function
    report_speed: ca.Function
    report_steering: ca.Function
    range_update: ca.Function
    locate: ca.Function
    collapse: ca.Function

    def all(self) -> tuple[ca.Function, ...]:
        """Every one of them."""
        return (self.predict, self.report_speed, self.report_steering, self.range_update,
                self.locate, self.collapse)  # fmt: skip


def filter_functions(site: Site, *, wheelbase_m: float) -> FilterFunctions:
    """The filter for a site and the distance between a vehicle's axles.

    An extended Kalman filter over `STATES`. Between instants the kinematic bicycle, moved on by the
    midpoint rule, and the random walks of `site.motion`; the Jacobian is that of the step itself.
    Each measurement is one number z with variance R: S = H P H' + R, K = M P H' / S, m + K (z - h),
    P = (I - K H) P (I - K H)' + K R K' (Joseph's form, which holds for whatever K). M = diag of
    `learning`: what is not to be learned has no gain, and its uncertainty does not shrink. A range
    with (z - h)^2 / S beyond the gate is refused, K = 0. Rigor: SAMPLED, as `nees_table` shows it;
    linearised, Gaussian. Numbers that are not finite come out as such; InputError on a wheelbase
    that is not > 0. Gelb, Applied Optimal Estimation, 1974.
    """
    if not (math.isfinite(wheelbase_m) and wheelbase_m > 0.0):
        raise InputError(f"wheelbase_m: expected a number > 0, got {wheelbase_m!r}")
    mean, covariance = ca.SX.sym("m", _SIZE), ca.SX.sym("P", _SIZE, _SIZE)
    reports = site.reports
    return FilterFunctions(
        predict=_predict(site, wheelbase_m),
        report_speed=_report(
            "speed", mean[_SPEED] * (1 + mean[_SCALE]), reports.speed_mps, mean, covariance
        ),
        report_steering=_report(
            "steering", mean[_STEERING] + mean[_ZERO], reports.steering_rad, mean, covariance
        ),
        range_update=_range_update(site, mean, covariance),
        locate=locate_function(site),
        collapse=collapse_function(),
    )


def _predict(site: Site, wheelbase_m: float) -> ca.Function:
    mean, covariance = ca.SX.sym("m", _SIZE), ca.SX.sym("P", _SIZE, _SIZE)
    commands, duration = ca.SX.sym("commands", 2), ca.SX.sym("duration")
    standing, acceleration = ca.SX.sym("standing"), ca.SX.sym("acceleration")
    moving = 1 - standing

    def rates(at: ca.SX) -> ca.SX:
        v = moving * at[_SPEED]
        turn = v * ca.tan(at[_STEERING]) / wheelbase_m
        return ca.vertcat(v * ca.cos(at[_HEADING]), v * ca.sin(at[_HEADING]), turn,
                          moving * acceleration, commands[1], 0, 0)  # fmt: skip

    after = mean + duration * rates(mean + 0.5 * duration * rates(mean))
    # A standing car's speed is what its body rocks with, whatever it was before.
    after[_SPEED] = moving * after[_SPEED]
    step = ca.jacobian(after, mean)
    # Braking ends at a standstill. Put in after the Jacobian is taken: the speed's uncertainty
    # does not vanish there.
    braked = ca.fmax(commands[0] * duration, -ca.fmax(mean[_SPEED], 0)) / ca.fmax(duration, 1e-9)
    before, walk = ca.SX.sym("before", _SIZE, _SIZE), _walk(site, mean, standing, duration)
    half = 0.5 * (ca.SX.eye(_SIZE) + step)
    walked = half @ walk @ half.T
    walked[_SPEED, _SPEED] += standing * site.motion.standing_mps**2
    spread = step @ before @ step.T + walked
    results = ca.substitute([after, spread], [acceleration], [braked])
    spread = ca.substitute(results[1], before, covariance)
    return ca.Function(
        "wb_loc_predict", [mean, covariance, commands, duration, standing],
        [results[0], _symmetric(spread)],
        ["m", "P", "commands", "duration", "standing"], ["m_after", "P_after"],
    )  # fmt: skip


def _walk(site: Site, mean: ca.SX, standing: ca.SX, duration: ca.SX) -> ca.SX:
    """Covariance of what the random walks add in the duration."""
    motion, moving = site.motion, 1 - standing
    way = moving * ca.fabs(mean[_SPEED]) * duration
    forward = motion.forward_slip**2 * way
    forward += standing * 2 * motion.standing_s * motion.standing_mps**2 * duration
    lateral = motion.lateral_slip**2 * way
    cosine, sine = ca.cos(mean[_HEADING]), ca.sin(mean[_HEADING])
    walk = ca.SX(_SIZE, _SIZE)
    walk[_X, _X] = cosine**2 * forward + sine**2 * lateral
    walk[_Y, _Y] = sine**2 * forward + cosine**2 * lateral
    walk[_X, _Y] = walk[_Y, _X] = cosine * sine * (forward - lateral)
    standing_turn = standing * motion.standing_heading**2 * duration
    walk[_HEADING, _HEADING] = motion.heading_slip**2 * way + standing_turn
    walk[_SPEED, _SPEED] = moving * motion.acceleration**2 * duration
    walk[_STEERING, _STEERING] = motion.steering_rate**2 * duration
    walk[_SCALE, _SCALE] = motion.scale_walk**2 * duration
    walk[_ZERO, _ZERO] = motion.zero_walk_rad**2 * duration
    return walk


def _symmetric(matrix: ca.SX) -> ca.SX:
    return 0.5 * (matrix + matrix.T)


@final
@dataclass(frozen=True, slots=True)
class _Updated:
    mean: ca.SX
    covariance: ca.SX
    surprise: ca.SX
    accepted: ca.SX
    variance: ca.SX


def _gradient(expected: ca.SX, mean: ca.SX) -> ca.SX:
    """Row of derivatives of what a measurement is expected to be."""
    return ca.jacobian(expected, mean)


def _updated(
    belief: tuple[ca.SX, ca.SX], innovation: ca.SX, row: ca.SX, *,
    deviation: float, learning: ca.SX, gate: float | None,
) -> _Updated:  # fmt: skip
    mean, covariance = belief
    gain = covariance @ row.T
    variance = row @ gain + deviation**2
    surprise = innovation**2 / variance
    accepted = ca.SX(1) if gate is None else surprise <= gate
    gain = ca.if_else(accepted, learning * gain / variance, ca.SX.zeros(_SIZE))
    rest = ca.SX.eye(_SIZE) - gain @ row
    joseph = rest @ covariance @ rest.T + deviation**2 * (gain @ gain.T)
    return _Updated(mean + gain * innovation, _symmetric(joseph), surprise, accepted, variance)


def _report(
    name: str, expected: ca.SX, deviation: float, mean: ca.SX, covariance: ca.SX
) -> ca.Function:
    report, learning = ca.SX.sym("report"), ca.SX.sym("learning", _SIZE)
    found = _updated((mean, covariance), report - expected, _gradient(expected, mean),
                     deviation=deviation, learning=learning, gate=None)  # fmt: skip
    return ca.Function(
        f"wb_loc_report_{name}", [mean, covariance, report, learning],
        [found.mean, found.covariance],
        ["m", "P", "report", "learning"], ["m_after", "P_after"],
    )  # fmt: skip


def expected_range(site: Site, mean: ca.SX, beacon: ca.SX) -> ca.SX:
    """Distance of the antenna of a vehicle in state m from a beacon (3)."""
    antenna = site.antenna
    cosine, sine = ca.cos(mean[_HEADING]), ca.sin(mean[_HEADING])
    x = mean[_X] + cosine * antenna.forward_m - sine * antenna.left_m
    y = mean[_Y] + sine * antenna.forward_m + cosine * antenna.left_m
    return ca.norm_2(ca.vertcat(x, y, antenna.height_m) - beacon)


def _range_update(site: Site, mean: ca.SX, covariance: ca.SX) -> ca.Function:
    measured, beacon = ca.SX.sym("range"), ca.SX.sym("beacon", 3)
    learning, ranges = ca.SX.sym("learning", _SIZE), site.ranges
    error_m, deviation_m = accepted_error(ranges)
    expected = expected_range(site, mean, beacon) + error_m
    found = _updated(
        (mean, covariance), measured - expected, _gradient(expected, mean),
        deviation=deviation_m, learning=learning,
        gate=float(stats.chi2.ppf(ranges.accepted, 1)),
    )  # fmt: skip
    density = ca.exp(-0.5 * found.surprise) / ca.sqrt(2 * ca.pi * found.variance)
    # No single range rules a heading out, however sure the site is of its ranges.
    share = max(ranges.stray_share, _LEAST_STRAY)
    likelihood = ca.log((1 - share) * density + share / ranges.stray_m)
    return ca.Function(
        "wb_loc_range", [mean, covariance, measured, beacon, learning],
        [found.mean, found.covariance, found.surprise, found.accepted, likelihood],
        ["m", "P", "range", "beacon", "learning"],
        ["m_after", "P_after", "surprise", "accepted", "log_likelihood"],
    )  # fmt: skip
