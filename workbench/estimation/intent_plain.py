"""The update of the particles in plain Python, one particle at a time: obvious, and slow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, final

import numpy as np

from workbench.estimation.intent_cloud import (
    SOFTENING_M,
    Cloud,
    Draws,
    FilterSettings,
    Measured,
    Values,
)

# Nested lists by intent, particle and axis; speeds are numbers in the place of pairs.
Part = list[list[Any]]
Parts = tuple[Part, Part, Part, Part]


@final
class PlainUpdate:
    """As `NumpyUpdate`, written as loops over lists; the yardstick for speed, and a second method
    to hold the others against."""

    def __call__(
        self, cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
    ) -> tuple[Cloud, Values]:
        """See `Update`."""
        place, velocity = cloud.place.tolist(), cloud.velocity.tolist()
        aim, speed = cloud.aim.tolist(), cloud.speed.tolist()
        parts = (place, velocity, aim, speed)
        _move(parts, draws.kicks.tolist(), measured.duration_s, settings)
        target, comb = measured.place.tolist(), draws.comb.tolist()
        mass = measured.weights.tolist()
        intents, n = len(place), len(place[0])
        chosen = []
        for j in range(intents):
            weight = [_weight(each, target, settings) for each in place[j]]
            mass[j] *= sum(weight) / n
            chosen.append(_comb(weight, comb[j]))
        posterior = [each / sum(mass) for each in mass]
        kept = [[[part[j][k] for k in chosen[j]] for j in range(intents)]
                for part in parts]  # fmt: skip
        wander = 0.1 * math.sqrt(measured.duration_s)
        mixed = [[list(row) for row in part] for part in kept]
        _replace(mixed, kept, draws, measured, posterior)
        pushes = draws.speeds.tolist()
        for j in range(intents):
            for i in range(n):
                mixed[3][j][i] = min(max(mixed[3][j][i] + wander * pushes[j][i], 0.2), 2.5)
        return Cloud(*(np.array(part) for part in mixed)), np.array(posterior)


def _move(parts: Parts, kicks: list[Part], duration_s: float, settings: FilterSettings) -> None:
    """Changes places and velocities where they stand."""
    place, velocity, aim, speed = parts
    h = duration_s / len(kicks)
    keep = math.exp(-h / settings.relax_s)
    for step in kicks:
        for j, row in enumerate(step):
            free = j == len(step) - 1
            size = (settings.free_kick if free else settings.kick) * math.sqrt(h)
            for i, kick in enumerate(row):
                p, v, g = place[j][i], velocity[j][i], aim[j][i]
                distance = math.sqrt((g[0] - p[0]) ** 2 + (g[1] - p[1]) ** 2 + SOFTENING_M**2)
                turned = []
                for axis in (0, 1):
                    wanted = speed[j][i] * (g[axis] - p[axis]) / distance
                    goes = v[axis] if free else wanted + keep * (v[axis] - wanted)
                    turned.append(goes + size * kick[axis])
                place[j][i] = [p[axis] + 0.5 * h * (v[axis] + turned[axis]) for axis in (0, 1)]
                velocity[j][i] = turned


def _weight(place: list[float], target: list[float], settings: FilterSettings) -> float:
    square = (place[0] - target[0]) ** 2 + (place[1] - target[1]) ** 2
    return math.exp(-0.5 * square / settings.deviation_m**2) + settings.floor


def _comb(weight: list[float], offset: float) -> list[int]:
    n, total = len(weight), sum(weight)
    chosen, k, reached = [], 0, weight[0]
    for i in range(n):
        while k < n - 1 and reached <= (i + offset) * total / n:
            k += 1
            reached += weight[k]
        chosen.append(k)
    return chosen


def _replace(
    mixed: Sequence[Part],
    kept: Sequence[Part],
    draws: Draws,
    measured: Measured,
    posterior: list[float],
) -> None:
    intents, n = len(posterior), len(kept[0][0])
    for r, mark in enumerate(draws.sources.tolist()):
        source, reached = 0, posterior[0]
        while source < intents - 1 and reached <= mark:
            source += 1
            reached += posterior[source]
        for j in range(intents):
            k = min(int(draws.members[j, r] * n), n - 1)
            for part in (0, 1, 3):
                mixed[part][j][r] = kept[part][source][k]
            if j < intents - 1:
                spread = measured.spreads[j] / math.sqrt(2.0)
                mixed[2][j][r] = list(measured.goals[j] + spread * draws.aims[j, r])
