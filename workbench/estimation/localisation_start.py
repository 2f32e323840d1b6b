"""How an estimate begins: the place of a standing antenna, and every heading it may have."""

from __future__ import annotations

import math
from typing import Final

import casadi as ca
import numpy as np

from workbench.estimation.lanes import Array
from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_states import HYPOTHESES, STATES, WINDOW

_SIZE: Final = len(STATES)
_HEADING: Final = STATES.index("heading")
_LOCATING_STEPS: Final = 24
_FINAL_STEPS: Final = 4
_WIDEST_M: Final = 10.0
# Of a hypothesis' heading, over the spacing to the next: side by side they are all but uniform.
_OVERLAP: Final = 0.6


def locate_function(site: Site) -> ca.Function:
    """Place of an antenna from ranges some of which are far too long.

    Least squares by Gauss-Newton from the middle of the beacons, each residual e weighted by
    1 / (1 + (e / c)^2), c falling geometrically from 10 m to 3 deviations; at last those beyond 3
    deviations have no weight.
    """
    step, narrow_m = _locating_step(site), 3.0 * site.ranges.deviation_m
    inputs = [
        ca.MX.sym("beacons", 3, WINDOW), ca.MX.sym("ranges", WINDOW), ca.MX.sym("received", WINDOW)
    ]  # fmt: skip
    count = len(site.beacons)
    place = ca.MX(
        ca.DM([sum(b.x_m for b in site.beacons) / count, sum(b.y_m for b in site.beacons) / count])
    )
    narrowing = _LOCATING_STEPS - 2 * _FINAL_STEPS
    for k in range(_LOCATING_STEPS):
        final = k >= _LOCATING_STEPS - _FINAL_STEPS
        width_m = max(narrow_m, _WIDEST_M * (narrow_m / _WIDEST_M) ** (k / narrowing))
        place, spread = step(place, *inputs, width_m, float(final))
    return ca.Function("wb_loc_locate", inputs, [place, spread],
                       ["beacons", "ranges", "received"], ["place", "covariance"])  # fmt: skip


def _locating_step(site: Site) -> ca.Function:
    """One weighted Gauss-Newton step, and the covariance that its weights leave."""
    beacons, ranges = ca.SX.sym("beacons", 3, WINDOW), ca.SX.sym("ranges", WINDOW)
    received, place, width = ca.SX.sym("received", WINDOW), ca.SX.sym("place", 2), ca.SX.sym("c")
    final, information, pull = ca.SX.sym("final"), ca.SX.zeros(2, 2), ca.SX.zeros(2)
    for k in range(WINDOW):
        away = place - beacons[:2, k]
        # The last number keeps the division below a beacon finite.
        distance = ca.sqrt(ca.sumsqr(away) + (site.antenna.height_m - beacons[2, k]) ** 2 + 1e-12)
        residual, row = ranges[k] - distance, away / distance
        ratio = (residual / width) ** 2
        weight = received[k] * ca.if_else(final, ratio <= 1, 1 / (1 + ratio))
        information += weight * (row @ row.T)
        pull += weight * row * residual
    covariance = ca.inv(information + 1e-9 * ca.SX.eye(2))
    return ca.Function(
        "wb_loc_locate_step", [place, beacons, ranges, received, width, final],
        [place + covariance @ pull, site.ranges.deviation_m**2 * covariance],
    )  # fmt: skip


def collapse_function() -> ca.Function:
    """One Gaussian with the mean and covariance of a weighted sum; headings to the nearest turn."""
    total, one = ca.SX.sym("total", _SIZE, _SIZE), ca.SX.sym("one", _SIZE, _SIZE)
    off, weight = ca.SX.sym("off", _SIZE), ca.SX.sym("weight")
    second = one + off @ off.T
    add = ca.Function(
        "wb_loc_collapse_add",
        [total, one, off, weight],
        [total + weight * (0.5 * (second + second.T))],
    )
    means, logs = ca.SX.sym("means", _SIZE, HYPOTHESES), ca.SX.sym("logs", HYPOTHESES)
    top, best = logs[0], means[:, 0]
    for k in range(1, HYPOTHESES):
        better = logs[k] > top
        best, top = ca.if_else(better, means[:, k], best), ca.fmax(top, logs[k])
    weights = ca.exp(logs - top)
    weights = weights / ca.sum1(weights)
    away = means - ca.repmat(best, 1, HYPOTHESES)
    turns = away[_HEADING, :]
    away[_HEADING, :] = turns - 2 * ca.pi * ca.floor(turns / (2 * ca.pi) + 0.5)
    shift = away @ weights
    middle = ca.Function(
        "wb_loc_collapse_mean", [means, logs],
        [best + shift, away - ca.repmat(shift, 1, HYPOTHESES), weights],
    )  # fmt: skip
    given, scores = ca.MX.sym("means", _SIZE, HYPOTHESES), ca.MX.sym("logs", HYPOTHESES)
    spreads = ca.MX.sym("covariances", _SIZE, _SIZE * HYPOTHESES)
    mean, offs, shares = middle(given, scores)
    spread = ca.MX(ca.DM.zeros(_SIZE, _SIZE))
    for k in range(HYPOTHESES):
        block = spreads[:, _SIZE * k : _SIZE * (k + 1)]
        spread = add(spread, block, offs[:, k], shares[k])
    return ca.Function("wb_loc_collapse", [given, spreads, scores], [mean, spread],
                       ["means", "covariances", "logs"], ["m", "P"])  # fmt: skip


def spread_headings(site: Site, place: Array, covariance: Array) -> tuple[Array, Array]:
    """Means and covariances of every heading's hypothesis, for antennas at `place` (n, 2)."""
    n, antenna, reports = len(place), site.antenna, site.reports
    headings = np.arange(HYPOTHESES) * (math.tau / HYPOTHESES)
    lever = np.array([[antenna.forward_m, -antenna.left_m],
                      [antenna.left_m, antenna.forward_m]])  # fmt: skip
    # Columns of cosine and sine: the axle is behind the antenna by `lever` turned.
    behind = np.stack([np.cos(headings), np.sin(headings)], axis=1) @ lever.T
    across = np.stack([-np.sin(headings), np.cos(headings)], axis=1) @ lever.T
    mean = np.zeros((n, HYPOTHESES, _SIZE))
    mean[:, :, :2] = place[:, None, :] - behind
    mean[:, :, _HEADING] = headings
    spread = np.zeros((n, HYPOTHESES, _SIZE, _SIZE))
    turned = np.zeros((HYPOTHESES, _SIZE))
    turned[:, :2], turned[:, _HEADING] = -across, 1.0
    width2 = (_OVERLAP * math.tau / HYPOTHESES) ** 2
    spread[:] = width2 * turned[:, :, None] * turned[:, None, :]
    spread[:, :, :2, :2] += covariance[:, None]
    zero2 = reports.steering_zero_rad**2
    for k, variance in ((3, site.motion.standing_mps**2), (4, math.pi**2 / 4),
                        (5, reports.speed_scale**2), (6, zero2)):  # fmt: skip
        spread[:, :, k, k] = variance
    return mean.reshape(-1, _SIZE), spread.reshape(-1, _SIZE, _SIZE)
