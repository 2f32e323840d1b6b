"""The vehicle's state from ranges and reports: the vehicle's own localiser, for many cars."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from workbench.estimation.lanes import Array
from workbench.estimation.localisation_filter import FilterFunctions
from workbench.estimation.localisation_states import HYPOTHESES, STATES
from workbench.estimation.localisation_steps import casadi_steps
from workbench.runtime.localiser.car import Car, Status
from workbench.runtime.localiser.site import Site
from workbench.runtime.localiser.steps import Numbers, Steps

__all__ = ["Belief", "Car", "Flags", "Localisation", "Localiser", "Status"]

Flags = NDArray[np.bool_]
_SIZE: Final = len(STATES)
T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True)
class Belief:
    """Means (n, 7) and covariances (n, 7, 7) over `STATES`."""

    mean: Array
    covariance: Array


@final
@dataclass(frozen=True, slots=True)
class Localisation:
    """What is known of n cars at one instant; a vehicle estimates one, n = 1. Nothing changes it.

    What the properties give has one row for each car.
    """

    cars: tuple[Car, ...]

    @property
    def stamp_s(self) -> float:
        """Up to which messages are used."""
        return self.cars[0].stamp_s

    @property
    def belief(self) -> Belief:
        """Of the cars that are aligned; of the others zeros."""
        return _belief([(car.mean, car.covariance) for car in self.cars])

    @property
    def hypotheses(self) -> Belief | None:
        """Of the placed cars that are not aligned HYPOTHESES beliefs each, one after the other."""
        followed = [(car.each_mean, car.each_covariance) for car in self.cars if car.logs]
        return _belief(followed) if followed else None

    @property
    def logs(self) -> Array:
        """The log weights of these (m, HYPOTHESES)."""
        return np.array([car.logs for car in self.cars if car.logs]).reshape(-1, HYPOTHESES)

    @property
    def placed(self) -> Flags:
        """Whose place is known."""
        return np.array([car.placed for car in self.cars])

    @property
    def aligned(self) -> Flags:
        """Whose heading is known, or was."""
        return np.array([car.aligned for car in self.cars])

    @property
    def standing(self) -> Flags:
        """Who stands, as the reports say."""
        return np.array([car.standing for car in self.cars])


@final
@dataclass(frozen=True, slots=True)
class Localiser:
    """The filter of a site and a wheelbase; all of its functions are pure.

    Order of use: `begin`, then for each message in the order of its instant `reported` (speed and
    steering, about 30 Hz) or `ranged` (one beacon); who is LOST begins anew. What happens to a
    message is `runtime.localiser.car.Car`'s, here as on the vehicle.
    """

    site: Site
    steps: Steps

    @classmethod
    def of(cls, site: Site, functions: FilterFunctions) -> Localiser:
        """The filter with these functions: `filter_functions` of the site, or what a compiler made
        of them (`casadi.external`)."""
        return cls(site, casadi_steps(functions))

    def begin(self, *, at_s: float, cars: int) -> Localisation:
        """Nothing is known of any of the cars."""
        return Localisation(tuple(Car(self.site, self.steps, at_s=at_s) for _ in range(cars)))

    def reported(
        self, known: Localisation, *, at_s: float, speed_mps: Array, steering_rad: Array,
        commands: Array,
    ) -> Localisation:  # fmt: skip
        """After reports of speed and steering (n each).

        commands (n, 2): the acceleration and steering rate in force from now on; zeros where they
        are not known, and then `site.motion` must allow for what the driver does.
        """

        def take(car: Car, said: tuple[float, float, tuple[float, float]]) -> None:
            speed, steering, command = said
            car.reported(at_s=at_s, speed_mps=speed, steering_rad=steering, commands=command)

        pairs = ((float(a), float(b)) for a, b in commands)
        return self._changed(
            known, take, zip(map(float, speed_mps), map(float, steering_rad), pairs, strict=True)
        )

    def ranged(
        self, known: Localisation, *, at_s: float, beacon: int, range_m: Array, received: Flags
    ) -> Localisation:
        """After ranges (n) to one of the site's beacons; `received` says which cars got theirs."""

        def take(car: Car, value: float | None) -> None:
            car.ranged(at_s=at_s, beacon=beacon, range_m=value)

        came = zip(range_m, received, strict=True)
        return self._changed(known, take, (float(r) if there else None for r, there in came))

    def moved_on(self, known: Localisation, *, at_s: float) -> Localisation:
        """The same at a later instant, without any news; InputError for an earlier one."""
        return self._changed(known, lambda car, _: car.moved_on(at_s=at_s), known.cars)

    def status(self, known: Localisation, car: int = 0, *, now_s: float | None = None) -> Status:
        """What is known of one car; at now_s, or at its stamp."""
        one = known.cars[car].continued(self.site, self.steps)
        return one.status(now_s=known.stamp_s if now_s is None else now_s)

    def _changed(
        self, known: Localisation, change: Callable[[Car, T], None], news: Iterable[T]
    ) -> Localisation:
        cars = tuple(car.continued(self.site, self.steps) for car in known.cars)
        for car, each in zip(cars, news, strict=True):
            change(car, each)
        return Localisation(cars)


def _belief(parts: list[tuple[Numbers, Numbers]]) -> Belief:
    means, covariances = (
        np.concatenate([np.frombuffer(bytes(part[k])) for part in parts]) for k in (0, 1)
    )
    return Belief(means.reshape(-1, _SIZE), covariances.reshape(-1, _SIZE, _SIZE))
