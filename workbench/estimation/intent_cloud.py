"""The particles of one person's intents, and one update of them: move, weigh, resample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError

Values = NDArray[np.float64]

SOFTENING_M = 0.5
"""People slow down within about this distance of where they go."""


@final
@dataclass(frozen=True, slots=True)
class FilterSettings:
    """Numbers of the filter; all lengths in m, times in s.

    particles: per intent. kick, free_kick (m/s per square root of s): how much the velocity of
    people with a known and an unknown goal wanders; relax_s: how soon a velocity turns towards the
    goal; deviation_m: standard deviation of a measured from a predicted position; floor: weight
    that a particle keeps wherever the measurement is. switch_per_s: rate at which people choose
    anew, from all intents; mixing_per_s: rate at which particles of an intent are replaced by ones
    that move as the likeliest do. unknown: share of people whose goal is none of the known;
    entry_doubt, entry_m: a person first seen at distance d of a goal is less likely to go there,
    by the factor 1 - entry_doubt exp(-d^2 / (2 entry_m^2)). bearing, doubted_bearing: how much the
    way that a person goes now counts in answers, with a known and an unknown goal. speed_mps,
    speed_spread_mps: of people not seen before.
    """

    particles: int
    kick: float
    free_kick: float
    relax_s: float
    deviation_m: float
    floor: float
    switch_per_s: float
    mixing_per_s: float
    unknown: float
    entry_doubt: float
    entry_m: float
    bearing: float
    doubted_bearing: float
    speed_mps: float = 1.2
    speed_spread_mps: float = 0.35

    def __post_init__(self) -> None:
        above = ("particles", "kick", "free_kick", "relax_s", "deviation_m", "floor", "entry_m",
                 "speed_mps", "speed_spread_mps")  # fmt: skip
        for name in above:
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"{name}: expected a number above 0, got {getattr(self, name)}")
        for name in ("unknown", "entry_doubt"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise InputError(f"{name}: expected a share from 0 up to 1, got "
                                 f"{getattr(self, name)}")  # fmt: skip
        for name in ("switch_per_s", "mixing_per_s", "bearing", "doubted_bearing"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name}: expected 0 or more, got {getattr(self, name)}")

    @classmethod
    def chosen(cls) -> FilterSettings:
        """Round numbers, the best of a few tried on the UCY recordings (Lerner et al., 2007)."""
        return cls(
            particles=200, kick=0.45, free_kick=0.9, relax_s=0.6, deviation_m=0.4, floor=0.02,
            switch_per_s=0.2, mixing_per_s=0.3, unknown=0.1, entry_doubt=0.9, entry_m=3.0,
            bearing=1.0, doubted_bearing=2.0,
        )  # fmt: skip

    @classmethod
    def paper(cls) -> FilterSettings:
        """As the paper: known goals only, equally likely wherever a person is first seen.

        People may still choose anew: without that an intent once resampled away never returns.
        """
        return cls(
            particles=200, kick=0.45, free_kick=0.9, relax_s=0.6, deviation_m=0.4, floor=0.02,
            switch_per_s=0.2, mixing_per_s=0.3, unknown=0.0, entry_doubt=0.0, entry_m=3.0,
            bearing=0.0, doubted_bearing=0.0,
        )  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Particles (intents, particles, ...): place (m), velocity (m/s), aim (m), speed (m/s).

    The last intent is the unknown goal, whose aim is not used.
    """

    place: Values
    velocity: Values
    aim: Values
    speed: Values


@final
@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The random numbers of one update; with them it is a plain function.

    kicks (steps, I, n, 2), speeds (I, n), aims (I, m, 2): standard normal; comb (I,), sources
    (m,), members (I, m): uniform in [0, 1). m is the number of particles that are replaced.
    """

    kicks: Values
    speeds: Values
    aims: Values
    comb: Values
    sources: Values
    members: Values

    @classmethod
    def of(cls, rng: np.random.Generator, *, steps: int, intents: int, n: int, m: int) -> Draws:
        """Drawn in a fixed order."""
        normal = rng.standard_normal(2 * steps * intents * n + intents * n + 2 * intents * m)
        uniform = rng.random(intents + m + intents * m)
        a = 2 * steps * intents * n
        b = a + intents * n
        return cls(
            normal[:a].reshape(steps, intents, n, 2), normal[a:b].reshape(intents, n),
            normal[b:].reshape(intents, m, 2), uniform[:intents], uniform[intents : intents + m],
            uniform[intents + m :].reshape(intents, m),
        )  # fmt: skip


@final
@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One measurement: place (2,) m, duration_s since the last, weights (I,) before it; goals
    (I - 1, 2) and spreads (I - 1,) m."""

    place: Values
    duration_s: float
    weights: Values
    goals: Values
    spreads: Values


class Update(Protocol):
    """One way to compute an update; all ways agree to rounding."""

    def __call__(
        self, cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
    ) -> tuple[Cloud, Values]:
        """The resampled particles and the weights (I,) after the measurement, which sum to 1."""
        ...


@final
@dataclass(frozen=True, slots=True)
class NumpyUpdate:
    """The update in NumPy, as it is meant: the reference of the compiled one."""

    def __call__(
        self, cloud: Cloud, draws: Draws, measured: Measured, settings: FilterSettings
    ) -> tuple[Cloud, Values]:
        """See `Update`."""
        place, velocity = _moved(cloud, draws.kicks, measured.duration_s, settings)
        square = ((place - measured.place) ** 2).sum(axis=-1)
        weight = np.exp(-0.5 * square / settings.deviation_m**2) + settings.floor
        posterior = measured.weights * weight.mean(axis=1)
        posterior = posterior / posterior.sum()
        chosen = _resampled(weight, draws.comb)
        rows = np.arange(len(weight))[:, None]
        place, velocity = place[rows, chosen], velocity[rows, chosen]
        aim, speed = cloud.aim[rows, chosen], cloud.speed[rows, chosen]
        place, velocity, aim, speed = _mixed(
            Cloud(place, velocity, aim, speed), draws, measured, posterior
        )
        wander = 0.1 * math.sqrt(measured.duration_s)
        speed = np.clip(speed + wander * draws.speeds, 0.2, 2.5)
        return Cloud(place, velocity, aim, speed), posterior


def _moved(
    cloud: Cloud, kicks: Values, duration_s: float, settings: FilterSettings
) -> tuple[Values, Values]:
    """Attraction to the aim, as `potential_field.attraction` has it, and a random kick.

    In equal steps, each exact for an aim that keeps its direction during the step.
    """
    h = duration_s / len(kicks)
    keep = math.exp(-h / settings.relax_s)
    kick = np.full((len(cloud.place), 1, 1), settings.kick * math.sqrt(h))
    kick[-1] = settings.free_kick * math.sqrt(h)
    place, velocity = cloud.place, cloud.velocity
    for each in kicks:
        way = cloud.aim - place
        distance = np.sqrt((way**2).sum(axis=-1) + SOFTENING_M**2)
        wanted = way * (cloud.speed / distance)[..., None]
        turned = wanted + keep * (velocity - wanted)
        turned[-1] = velocity[-1]
        turned = turned + kick * each
        place, velocity = place + 0.5 * h * (velocity + turned), turned
    return place, velocity


def _resampled(weight: Values, comb: Values) -> NDArray[np.intp]:
    """Systematic resampling within each intent: which particle each of its n places takes."""
    n = weight.shape[1]
    total = np.cumsum(weight, axis=1)
    marks = (np.arange(n) + comb[:, None]) * (total[:, -1:] / n)
    rows = [np.searchsorted(t, mark, side="right") for t, mark in zip(total, marks, strict=True)]
    chosen: NDArray[np.intp] = np.minimum(np.array(rows), n - 1)
    return chosen


def _mixed(
    cloud: Cloud, draws: Draws, measured: Measured, posterior: Values
) -> tuple[Values, Values, Values, Values]:
    """The first m particles of each intent move on as ones of intents drawn by their weight."""
    intents, n = cloud.speed.shape
    m = len(draws.sources)
    source = np.searchsorted(np.cumsum(posterior), draws.sources, side="right")
    source = np.minimum(source, intents - 1)
    member = np.minimum((draws.members * n).astype(np.intp), n - 1)
    place, velocity, speed = cloud.place.copy(), cloud.velocity.copy(), cloud.speed.copy()
    place[:, :m] = cloud.place[source, member]
    velocity[:, :m] = cloud.velocity[source, member]
    speed[:, :m] = cloud.speed[source, member]
    aim = cloud.aim.copy()
    spread = (measured.spreads / math.sqrt(2.0))[:, None, None]
    aim[:-1, :m] = measured.goals[:, None] + spread * draws.aims[:-1]
    return place, velocity, aim, speed
