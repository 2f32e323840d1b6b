"""What was found that people may want, as frames for the monitor on the vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench.errors import InputError
from workbench.estimation.person_intents import Forwarded, Waypoints
from workbench.runtime.protocols import PeopleSeen, Refusal, SentIntents, Way, intent_frames


def forwarded_frames(
    people: PeopleSeen, forwarded: Mapping[int, Forwarded], *, body_m: float
) -> SentIntents | Refusal:
    """Every intent that is passed on of these people, as `intent_frames` sends them.

    forwarded: by track number, the most important person first, all for the instant of the set's
    stamp and in the frame of its places, until 7.5 s at most, as a way has 16 knots; body_m: how
    far a body reaches from the person's position, the largest of all kinds there, and what the
    measured position may be wrong by. Raises InputError unless the times of all are
    multiples of one period.
    """
    every = [each for found in forwarded.values() for each in found.waypoints]
    period_s = _period_s(every)
    ways = {
        track: [_way(each, body_m=body_m) for each in found.waypoints]
        for track, found in forwarded.items()
    }
    return intent_frames(people, ways, knot_period_s=period_s)


def _period_s(every: list[Waypoints]) -> float:
    if not every:
        # Nobody has a way: a header that says so, with any period.
        return 1.0
    period_s = float(every[0].times_s[1])
    for each in every:
        expected = period_s * np.arange(len(each.times_s))
        if not np.allclose(each.times_s, expected, rtol=0.0, atol=1e-9):
            raise InputError(
                f"expected waypoints every {period_s:g} s from 0 on, as the first ones are, got "
                f"{each.times_s.tolist()}; forward all of them until the same time"
            )
    return round(period_s, 9)


def _way(waypoints: Waypoints, *, body_m: float) -> Way:
    radii = waypoints.radii_m + body_m
    return tuple(zip(*waypoints.places_m.T.tolist(), radii.tolist(), strict=True))
