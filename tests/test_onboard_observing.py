"""Every observation contains the true car and the true people, within the stated bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from onboard_sensors import BOUNDS, OWN, PACMOD2, Scenario, played
from onboard_truth import GRID_US, Walker

from workbench.runtime.arc import Interval
from workbench.runtime.observation import Observation, fault_in_observation, tracked_people
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.observing import Integrals, NotObserved, observe
from workbench.runtime.person_guard import guard_disc
from workbench.runtime.person_tubes import PersonTube

INTEGRALS = Integrals((-0.1, 0.1), (-0.2, 0.2), 2.8)
# The truth is integrated with an error far below this.
SLACK = 1e-9


def outside(interval: Interval, value: float) -> bool:
    return not interval[0] - SLACK <= value <= interval[1] + SLACK


def leaves(tube: PersonTube, at_s: float, x: float, y: float) -> bool:
    """Whether a point is in one of the tube's bounds not contained."""
    for bound in tube.bounds:
        piece = [p for p in bound if p.from_s <= at_s][-1]
        s = at_s - piece.from_s
        radius = piece.radius_m + piece.growth_mps * s + 0.5 * piece.growth2_mps2 * s * s
        centre = piece.x_m + piece.vx_mps * s, piece.y_m + piece.vy_mps * s
        if math.hypot(x - centre[0], y - centre[1]) > radius + SLACK:
            return True
    return False


def wrong_in(seen: Observation, world: Scenario, now_us: int) -> list[str]:
    """What of the truth the observation does not contain."""
    car, found = world.car.at(now_us), []
    middle = 0.5 * (seen.heading[0] + seen.heading[1])
    heading = car.heading_rad + math.tau * round((middle - car.heading_rad) / math.tau)
    for name, value in (
        ("x", car.x_m),
        ("y", car.y_m),
        ("heading", heading),
        ("speed", car.speed_mps),
        ("steering", car.steering_rad),
    ):
        if outside(getattr(seen, name), value):
            found.append(f"{name} {value} not in {getattr(seen, name)}")
    return found + wrong_in_people(seen, world.walkers, now_us)


def wrong_in_people(seen: Observation, walkers: Sequence[Walker], now_us: int) -> list[str]:
    found = []
    known = {person.name: person for person in seen.people}
    for walker in walkers:
        x, y, _, _ = walker.at(now_us)
        person = known.get(f"{walker.track}")
        if person is None:
            watched = seen.watched
            if math.hypot(x - watched.x_m, y - watched.y_m) < watched.radius_m - SLACK:
                found.append(f"{walker.track} is nobody on the list, and within {watched}")
            continue
        guard = guard_disc(person.guard, from_s=0.0, until_s=10.0)
        for later_us in (0, 100_000, 600_000):
            x, y, _, _ = walker.at(now_us + later_us)
            if leaves(guard, later_us / 1e6, x, y):
                found.append(f"{walker.track} left the guard {later_us} us later")
    return found


def run(seed: int, *, until_us: int, standing: bool = False) -> tuple[list[str], int]:
    """Everything wrong in the observations of one scenario, and how many there were."""
    world = Scenario(seed, standing=standing)
    intake = Intake(PACMOD2, OWN, stamps=BOUNDS.stamps)
    wrong, count = [], 0
    steps = range(500_000, until_us, 7 * GRID_US)
    for now_us in played(world.frames(until_us), intake.receive, steps_us=steps):
        seen = observe(intake, now_us=now_us, integrals=INTEGRALS, settings=BOUNDS)
        if isinstance(seen, Observation):
            count += 1
            assert fault_in_observation(seen, tracked_people(seen)) is None
            wrong += wrong_in(seen, world, now_us)
        else:
            assert isinstance(seen, NotObserved)
            assert "CONTRADICTION" not in seen.fault.name, str(seen)
    return wrong, count


@pytest.mark.parametrize("first", range(0, 40, 10))
def test_the_truth_lies_in_every_observation(first: int) -> None:
    total = 0
    for seed in range(first, first + 10):
        wrong, count = run(seed, until_us=2_500_000)
        assert not wrong, (seed, wrong[:3])
        total += count
    assert total > 350
