"""What is wrong with ranges that pass the gate: some came round a corner, but not by far."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from workbench.estimation.localisation_site import Ranges


def accepted_error(ranges: Ranges) -> tuple[float, float]:
    """Mean (m) of the error of a range that passes the gate, and the deviation to weigh it with.

    The error e is Gaussian, and longer by an exponential excess in `stray_share` of all cases; f is
    its density. Short excesses pass |e| <= g and make mean mu and variance those of f on
    [-g, g]. The gate stands around what is expected, so that an expectation wrong by d also moves
    which errors pass: their mean by kappa d, kappa = (g (f(g) + f(-g)) - mu (f(g) - f(-g))) / P(|e|
    <= g). Only (1 - kappa) d of it shows in the innovation, hence the deviation over (1 - kappa).
    g is the gate times that deviation, which four rounds settle.
    """
    sigma, share = ranges.deviation_m, ranges.stray_share
    stray = stats.exponnorm(ranges.stray_m / sigma, scale=sigma)
    width = math.sqrt(float(stats.chi2.ppf(ranges.accepted, 1)))
    mean, deviation = 0.0, sigma
    for _ in range(4):
        gate = width * deviation
        e = np.linspace(-gate, gate, 2001)
        f = (1.0 - share) * stats.norm.pdf(e, scale=sigma) + share * stray.pdf(e)
        passed = float(np.trapezoid(f, e))
        mean = float(np.trapezoid(e * f, e)) / passed
        variance = float(np.trapezoid((e - mean) ** 2 * f, e)) / passed
        low, high = float(f[0]), float(f[-1])
        moved = (gate * (high + low) - mean * (high - low)) / passed
        deviation = math.sqrt(variance) / (1.0 - moved)
    return mean, deviation
