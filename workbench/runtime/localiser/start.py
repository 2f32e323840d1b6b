"""How an estimate of the heading begins: every heading that a car at a known place may have."""

from __future__ import annotations

import math
from typing import Final

from workbench.runtime.localiser.site import Site
from workbench.runtime.localiser.states import HYPOTHESES, STATES
from workbench.runtime.localiser.steps import Numbers, doubles

_N: Final = len(STATES)
_SPEED: Final = STATES.index("speed")
# Of a hypothesis' heading, over the spacing to the next: side by side they are all but uniform.
_OVERLAP: Final = 0.6


def spread_headings(site: Site, place: Numbers, covariance: Numbers) -> tuple[Numbers, Numbers]:
    """Means (7 each) and covariances (7 x 7 each) of all hypotheses of an antenna at a place.

    place (2), covariance (2 x 2): of the antenna. With f forward and l left of the axle's middle at
    heading h, the middle is at place - (f cos h - l sin h, f sin h + l cos h), which moves by
    (f sin h + l cos h, l sin h - f cos h) per radian.
    """
    antenna, reports = site.antenna, site.reports
    means, covariances = doubles(_N * HYPOTHESES), doubles(_N * _N * HYPOTHESES)
    width2 = (_OVERLAP * math.tau / HYPOTHESES) ** 2
    alone = (
        site.motion.standing_mps**2, math.pi**2 / 4, reports.speed_scale**2,
        reports.steering_zero_rad**2,
    )  # fmt: skip
    for k in range(HYPOTHESES):
        heading = k * (math.tau / HYPOTHESES)
        c, s = math.cos(heading), math.sin(heading)
        forward_m, left_m = antenna.forward_m, antenna.left_m
        mean = means[_N * k : _N * (k + 1)]
        mean[0] = place[0] - (forward_m * c - left_m * s)
        mean[1] = place[1] - (forward_m * s + left_m * c)
        mean[2] = heading
        turned = (forward_m * s + left_m * c, left_m * s - forward_m * c, 1.0)
        spread = covariances[_N * _N * k : _N * _N * (k + 1)]
        for i, a in enumerate(turned):
            for j, b in enumerate(turned):
                spread[_N * i + j] = width2 * a * b
        for i in (0, 1):
            for j in (0, 1):
                spread[_N * i + j] += covariance[2 * i + j]
        for i, variance in enumerate(alone, start=_SPEED):
            spread[(_N + 1) * i] = variance
    return means, covariances
