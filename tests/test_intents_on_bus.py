"""What the desk forwards of people's intents is what LookAhead's tubes on the vehicle hold."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from onboard_intakes import filled, give, observed
from onboard_sensors import BOUNDS
from ways_cases import WALKER, crowd, frames_of

from workbench.errors import InputError
from workbench.estimation.intents_on_bus import forwarded_frames
from workbench.estimation.person_intents import Forwarded, Intent, Waypoints
from workbench.runtime.observation import Observation
from workbench.runtime.onboard.mcap_scene import discs_of
from workbench.runtime.protocols import Refusal, SentIntents
from workbench.runtime.protocols.codec import decode
from workbench.runtime.protocols.tables import load_protocol

BODY_M = 0.3


def waypoints(goal: tuple[float, float], *, until_s: float = 3.0, knots: int = 7) -> Waypoints:
    """Straight to a goal from where the first of the crowd is, ever less certain."""
    times = np.linspace(0.0, until_s, knots)
    start = np.array([WALKER.x_m, WALKER.y_m])
    places = start + np.outer(times / until_s, np.array(goal) - start)
    return Waypoints(Intent(0.5, goal), times, places, 0.2 + 0.3 * times)


def frames(forwarded: dict[int, Forwarded]) -> SentIntents | Refusal:
    return forwarded_frames(crowd(6, 7, 8), forwarded, body_m=BODY_M)


def test_tubes_on_the_vehicle_hold_what_the_desk_forwards() -> None:
    people = dataclasses.replace(crowd(6, 7, 8), number=2, stamp_s=1.05)
    ways = (waypoints((15.0, -4.0)), waypoints((12.0, -8.0)))
    sent = forwarded_frames(people, {7: Forwarded(ways, 0.1)}, body_m=BODY_M)
    assert isinstance(sent, SentIntents)
    assert sent.left_out == {}
    found = filled()
    give(found, frames_of(people), 1_060_000)
    give(found, list(sent.frames), 1_080_000)
    seen = observed(found, 1_080_000)
    assert isinstance(seen, Observation)
    tubes = {each.name: each.intent for each in seen.people}["7"]
    within_us = found.ways.seen.stamp_us  # type: ignore[union-attr]
    for tube, way in zip(tubes, ways, strict=True):
        desk = way.tube(body_m=BODY_M)
        for stamp_us in within_us:
            for at_s in np.arange(0.0, 2.9, 0.01):
                (told,) = discs_of(desk, (at_s + (1_080_000 - stamp_us) / 1e6,))
                (held,) = discs_of(tube, (at_s,))
                spare = held[2] - told[2] - math.hypot(held[0] - told[0], held[1] - told[1])
                assert 0.0 <= spare < 0.2
    assert BOUNDS.stamps.delay_us[1] > 0


def test_nobody_with_ways_is_a_set_that_says_so() -> None:
    for forwarded in ({}, {7: Forwarded((), 1.0)}):
        sent = frames(forwarded)
        assert isinstance(sent, SentIntents)
        assert len(sent.frames) == 1
        assert sent.left_out.keys() == forwarded.keys()


def test_the_period_is_that_of_the_waypoints() -> None:
    for until_s, knots, period_s in ((3.0, 7, 0.5), (1.7, 5, 0.425), (1.1, 12, 0.1)):
        way = waypoints((15.0, -4.0), until_s=until_s, knots=knots)
        sent = frames({7: Forwarded((way,), 0.0)})
        assert isinstance(sent, SentIntents)
        header = decode(load_protocol("workbench"), *sent.frames[0])
        assert not isinstance(header, Refusal)
        assert header.values["KNOT_PERIOD"] == period_s
    uneven = waypoints((15.0, -4.0), until_s=1.0, knots=4)
    assert isinstance(frames({7: Forwarded((uneven,), 0.0)}), Refusal)


def test_times_that_are_not_multiples_of_one_period_are_refused() -> None:
    way = waypoints((15.0, -4.0))
    for other in (
        waypoints((15.0, -4.0), knots=6),
        dataclasses.replace(way, times_s=way.times_s + 0.1),
        dataclasses.replace(way, times_s=way.times_s * (1.0 + 1e-8)),
    ):
        with pytest.raises(InputError, match=r"expected waypoints every 0\.5 s from 0 on"):
            frames({7: Forwarded((way,), 0.0), 8: Forwarded((other,), 0.0)})
