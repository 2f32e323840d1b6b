"""How an estimate begins and ends its search: a standing antenna's place, a joined heading."""

from __future__ import annotations

from typing import Final

import casadi as ca

from workbench.estimation.localisation_site import Site
from workbench.estimation.localisation_states import HYPOTHESES, STATES, WINDOW

_SIZE: Final = len(STATES)
_HEADING: Final = STATES.index("heading")
_LOCATING_STEPS: Final = 24
_FINAL_STEPS: Final = 4
_WIDEST_M: Final = 10.0


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
