"""People who keep to limits, measured at even times, for the tests of fitted guards."""

from __future__ import annotations

import numpy as np

from workbench.estimation.people_data import PersonTrack
from workbench.runtime import MotionLimits

FINE = 20
"""Steps of the walk per sample."""


def walker(
    rng: np.random.Generator,
    limits: MotionLimits,
    *,
    samples: int = 60,
    step_s: float = 0.1,
    name: tuple[str, str, str] = ("r", "p", "ped"),
) -> PersonTrack:
    """A walk of constant accelerations, full or none, in random directions, the speed kept below
    its limit by refusing what would break it."""
    dt = step_s / FINE
    velocity = rng.normal(size=2)
    velocity *= rng.uniform(0.0, limits.speed_mps) / np.hypot(*velocity)
    place, places, push = np.zeros(2), [], np.zeros(2)
    for step in range(samples * FINE):
        if step % FINE == 0:
            places.append(place)
            if rng.random() < 0.2:
                push = rng.normal(size=2)
                push *= rng.choice([0.0, limits.acceleration_mps2]) / np.hypot(*push)
        after = velocity + push * dt
        if np.hypot(*after) > limits.speed_mps:
            push, after = np.zeros(2), velocity
        place = place + 0.5 * (velocity + after) * dt
        velocity = after
    return PersonTrack(
        *name, np.arange(samples, dtype=np.float64) * np.float64(step_s), np.array(places)
    )


def crowd(seed: int, recordings: int, people: int, limits: MotionLimits) -> list[PersonTrack]:
    """People in several recordings, half of them cyclists at three times the limits."""
    rng = np.random.default_rng(seed)
    fast = MotionLimits(3.0 * limits.speed_mps, 3.0 * limits.acceleration_mps2)
    return [
        walker(
            rng, fast if i % 2 else limits, name=(f"r{k}", f"p{i}", "cyclist" if i % 2 else "ped")
        )
        for k in range(recordings)
        for i in range(people)
    ]
