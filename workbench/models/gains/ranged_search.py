"""Smallest margins over ranges of cars that a search finds: upper bounds, never proofs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import Car, Ranges, coefficients

Array = NDArray[np.float64]

# Gain factors looked at are within [1 / MOST_GAIN, MOST_GAIN].
MOST_GAIN: Final = 20.0
MARGINS: Final = ("phase_deg", "gain_low", "gain_high", "delay_s", "disk")
_GRID: Final = 300
_HALVINGS: Final = 50
_REAL: Final = 1e-7
_GENERATIONS: Final = 15


@final
@dataclass(frozen=True, slots=True, eq=False)
class MarginValues:
    """Margins of n cars, each (n,); NaN where the car's loop is not stable.

    phase_deg: least angle by which the open loop may turn, either way; gain_low, gain_high: factors
    about 1 between which the loop gain may change, 0 and infinity where none is within MOST_GAIN;
    delay_s: least added delay; disk: the disk margin (skew 0). spare_delay_s: as delay_s, but below
    0 where the delay is more than the loop bears, -infinity where it is unstable without one.
    """

    phase_deg: Array
    gain_low: Array
    gain_high: Array
    delay_s: Array
    disk: Array
    spare_delay_s: Array

    def of(self, name: str) -> Array:
        """The margin of this name."""
        return np.asarray(getattr(self, name), dtype=np.float64)


@final
@dataclass(frozen=True, slots=True)
class Found:
    """The smallest value that a search has found (for gain_low the largest), and where."""

    value: float
    car: Car


def margins_of(loop: LateralLoop, cars: Array) -> MarginValues:
    """Margins of cars (n x 3: wheelbase, speed scale, delay); rigor NUMERICAL."""
    c, delay = _coefficients(loop, cars), cars[:, 2]
    spare = _spare(c, delay)
    values = {
        name: np.where(spare > 0.0, value(c, delay), math.nan) for name, value in _VALUES.items()
    }
    return MarginValues(**values, spare_delay_s=spare)


def _coefficients(loop: LateralLoop, cars: Array) -> Array:
    """(c3, c2, c1, c0) of each car (n x 4)."""
    fields = {name: np.full(len(cars), float(value)) for name, value in loop.exact().items()}
    return np.stack(coefficients(fields, cars[:, 0], cars[:, 1]), axis=-1)


def _spare(c: Array, delay: Array) -> Array:
    """Least added delay, from the least delay that each loop bears; see `MarginValues`."""
    whole = np.concatenate([np.ones((len(c), 1)), c], axis=1)
    # Without an integral one pole at 0 is nobody's.
    stable = _roots(whole if c[:, 3].any() else whole[:, :-1]).real.max(axis=1) < 0.0
    return np.where(stable, _delay(c, np.zeros(len(c))) - delay, -math.inf)


def _phase(c: Array, delay: Array) -> Array:
    turned = np.angle(_turned(c, _crossovers(c), delay))
    return np.asarray(np.degrees(np.nanmin(np.abs(turned), axis=1)))


def _delay(c: Array, delay: Array) -> Array:
    crossed = _crossovers(c)
    turned = np.angle(_turned(c, crossed, delay)) % (2.0 * math.pi)
    return np.asarray(np.nanmin(turned / crossed, axis=1))


def _roots(polynomials: Array) -> NDArray[np.complex128]:
    """Roots (n x degree) of polynomials (n x degree + 1), leading coefficient 1 first."""
    degree = polynomials.shape[1] - 1
    companion = np.zeros((len(polynomials), degree, degree))
    companion[:, 0] = -polynomials[:, 1:]
    companion[:, range(1, degree), range(degree - 1)] = 1.0
    return np.linalg.eigvals(companion).astype(complex)


def _crossovers(c: Array) -> Array:
    """Frequencies (n x 4) at which |open loop| = 1, NaN beyond those that there are."""
    c3, c2, c1, c0 = c.T
    excess = np.stack(
        [np.ones_like(c3), -c3 * c3, 2 * c1 * c3 - c2 * c2, 2 * c0 * c2 - c1 * c1, -c0 * c0],
        axis=1,
    )
    x = _roots(excess)
    real = (np.abs(x.imag) <= _REAL * np.abs(x)) & (x.real > 0.0)
    return np.sqrt(np.where(real, x.real, math.nan))


def _turned(c: Array, frequencies: Array, delay: Array) -> NDArray[np.complex128]:
    """Minus the open loop of each car at its frequencies (n x m)."""
    c3, c2, c1, c0 = (each[:, None] for each in c.T)
    w = frequencies
    value = (c2 / w**2 - c0 / w**4) + 1j * (c3 / w - c1 / w**3)
    return np.asarray(value * np.exp(-1j * w * delay[:, None]))


def _grid(c: Array) -> Array:
    """Frequencies (n x m) from where the open loop is above MOST_GAIN to where it is below."""
    c3, c2, c1, c0 = np.abs(c.T)
    high = 2.0 * MOST_GAIN * (c3 + np.sqrt(c2) + np.cbrt(c1) + c0**0.25)
    low = 0.3 * np.minimum(np.cbrt(c1 / MOST_GAIN), np.sqrt(c1 / np.maximum(c3, 1e-300)))
    return np.asarray(np.geomspace(np.maximum(low, 1e-6), high, _GRID, axis=1))


def _gains(c: Array, delay: Array) -> tuple[Array, Array]:
    """Largest factor <= 1 and smallest above at which the loop is on the brink."""
    grid = _grid(c)
    turned = _turned(c, grid, delay)
    sign = np.signbit(turned.imag)
    rows, columns = np.nonzero((sign[:, 1:] != sign[:, :-1]) & (turned.real[:, 1:] > 0.0))
    left, right = grid[rows, columns], grid[rows, columns + 1]
    first = sign[rows, columns]
    for _ in range(_HALVINGS):
        middle = 0.5 * (left + right)
        same = np.signbit(_turned(c[rows], middle[:, None], delay[rows]).imag[:, 0]) == first
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    factor = 1.0 / np.abs(_turned(c[rows], left[:, None], delay[rows])[:, 0])
    low, high = np.zeros(len(c)), np.full(len(c), math.inf)
    within = (factor >= 1.0 / MOST_GAIN) & (factor <= MOST_GAIN)
    np.maximum.at(low, rows[within & (factor <= 1.0)], factor[within & (factor <= 1.0)])
    np.minimum.at(high, rows[within & (factor > 1.0)], factor[within & (factor > 1.0)])
    return low, high


def _disk(c: Array, delay: Array) -> Array:
    """2 min |1 + L| / |1 - L| over frequencies, on a grid that is refined about its least."""
    grid = _grid(c)
    for _ in range(3):
        turned = _turned(c, grid, delay)
        ratio = np.abs(1.0 - turned) / np.abs(1.0 + turned)
        best = np.clip(ratio.argmin(axis=1), 1, _GRID - 2)
        rows = np.arange(len(c))
        ends = grid[rows, best - 1], grid[rows, best + 1]
        grid = np.asarray(np.linspace(*ends, _GRID, axis=1))
    return 2.0 * np.asarray(ratio.min(axis=1))


_VALUES: Final[Mapping[str, Callable[[Array, Array], Array]]] = {
    "phase_deg": _phase,
    "gain_low": lambda c, delay: _gains(c, delay)[0],
    "gain_high": lambda c, delay: _gains(c, delay)[1],
    "delay_s": _delay,
    "disk": _disk,
}


def search(loop: LateralLoop, ranges: Ranges, *, seed: int) -> tuple[dict[str, Found], Car | None]:
    """The worst of each margin that is found, and a car whose loop seems unstable (None: none).

    Corners and the middle are always tried; scipy's differential evolution looks between them.
    With such a car there are no margins: they mean nothing for an unstable loop.
    """
    tried = np.array(
        [[c.wheelbase_m, c.speed_scale, c.delay_s] for c in (*ranges.corners(), ranges.middle)]
    )
    worst = _least(lambda cars: _spare(_coefficients(loop, cars), cars[:, 2]), tried, ranges, seed)
    if not worst.value > 0.0:
        return {}, worst.car
    found = {}
    for name in MARGINS:
        sign = -1.0 if name == "gain_low" else 1.0

        def value(cars: Array, name: str = name, sign: float = sign) -> Array:
            return sign * _VALUES[name](_coefficients(loop, cars), cars[:, 2])

        least = worst if name == "delay_s" else _least(value, tried, ranges, seed)
        found[name] = Found(sign * least.value, least.car)
    return found, None


def _least(value: Callable[[Array], Array], tried: Array, ranges: Ranges, seed: int) -> Found:
    """Least value over the ranges; tried (n x 3): cars to begin with."""
    known = value(tried)
    best = int(np.argmin(known))
    found = Found(float(known[best]), Car(*map(float, tried[best])))
    open_axes = [k for k, (low, high) in enumerate(ranges.ends) if low < high]
    if not open_axes or math.isinf(found.value):
        return found

    def cars(x: Array) -> Array:
        rows = np.tile(tried[best], (x.shape[1], 1))
        rows[:, open_axes] = x.T
        return rows

    def of_columns(x: Array, /) -> Any:  # The stubs know no vectorised function.
        return np.minimum(value(cars(x)), 1e9)

    with np.errstate(all="ignore"):
        outcome = differential_evolution(
            of_columns, Bounds(*np.array([ranges.ends[k] for k in open_axes]).T), popsize=8,
            maxiter=_GENERATIONS, tol=1e-6, polish=False, rng=seed, vectorized=True,
            updating="deferred",
        )  # fmt: skip
    if outcome.fun < found.value:
        found = Found(float(outcome.fun), Car(*map(float, cars(outcome.x[:, None])[0])))
    return found
