"""The image of a polynomial set under a map with kinks."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import final

import casadi as ca
import numpy as np
import numpy.typing as npt

from workbench.models.system import Ode
from workbench.reach.validated.algebra import Algebra, Array
from workbench.reach.validated.bounds import BatchInclusion, Range
from workbench.reach.validated.lines import Lines
from workbench.reach.validated.picard import NoEnclosureError
from workbench.reach.validated.series import Series
from workbench.reach.validated.sets import PolynomialSet
from workbench.reach.validated.tape import Running, Tape
from workbench.sensitivity.kinks import relax, smooth_form

# A kink without a floor has one at -1e300 (`kinks`); drivers must stay away from it.
_LARGEST_DRIVER = 1e299


@final
@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Numbers center + generators xi, |xi| <= 1, new at every use: (m,) and (m, g)."""

    center: Array
    generators: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """A set after a map; decided (B, n_kinks) as in `Lines`."""

    end: PolynomialSet
    decided: npt.NDArray[np.int8]


@final
class SetMap:
    """x+ = g(x, v), ready for polynomial sets of x (n rows) and noise v (m rows).

    ode: its states are x and v, its field is g followed by m zeros; it serves as a container of
    symbols. Each kink is replaced by the best line over the range of its driver, the gap enters as
    one generator of its own, so that all rows that feel the kink move together. The polynomial
    arithmetic bounds what it drops and its rounding: the image is enclosed.
    """

    def __init__(self, ode: Ode, noises: int) -> None:
        form = smooth_form(ode)
        lines = relax(form)
        inputs = [ode.x, form.p, ode.w, lines.slope, lines.offset, lines.error]
        self._kinks, self._noises = form.kappa.numel(), noises
        self._image = Tape.of(ca.Function("image", inputs, [ca.densify(lines.field)]))
        self._drivers = [
            Tape.of(ca.Function("driver", inputs, [lines.drivers[i]])) for i in range(self._kinks)
        ]
        self._p = np.array(form.parameter_values())
        self._limits = BatchInclusion.of([form.p], [form.floor, form.ceiling])
        self._limited = form.limited

    def __call__(self, source: PolynomialSet, noise: Noise) -> Image:
        """Raises OutsideDomainError where g is not defined on the whole set, NoEnclosureError
        where numbers overflow."""
        with np.errstate(all="ignore"):
            return self._mapped(source, noise)

    def _mapped(self, source: PolynomialSet, noise: Noise) -> Image:
        batch, rows = source.coef.shape[:2]
        first = rows + self._noises
        extended = _extended(source, noise, self._kinks)
        lines = Lines.none(batch, self._limited)
        point = np.broadcast_to(self._p, (batch, len(self._p)))
        limits, bounded = self._limits([(point, point)])
        if not np.all(bounded):
            raise NoEnclosureError("the limits of a limited command could not be bounded")
        for i, tape in enumerate(self._drivers):
            driver = _driven(extended, self._run(tape, extended, lines, first).outputs[0][0])
            floor, ceiling = ((end[0][:, i], end[1][:, i]) for end in limits)
            lines.set(i, driver, np.zeros(batch), floor=floor, ceiling=ceiling)
            extended = _with_radius(extended, first + i, lines.gap[:, i])
        found = self._run(self._image, extended, lines, first).outputs[0]
        coef = np.zeros(extended.coef.shape)
        radius = np.zeros(extended.coef.shape[:2])
        for row, series in enumerate(found[:rows]):
            coef[:, row], radius[:, row] = series.coef[0], series.radius[0]
        moved = extended.mapped(coef, radius, np.zeros((batch, first + self._kinks, 0)))
        end = _stripped(moved, source)
        low, high = end.hull()
        if not np.all(np.isfinite(low + high)):
            raise NoEnclosureError("the set left the range of numbers")
        return Image(end, lines.decided)

    def _run(self, tape: Tape, source: PolynomialSet, lines: Lines, first: int) -> Running:
        """Order 0 of a tape on the rows of an extended set."""
        batch = source.batch
        rows = [_steady(source.algebra, column) for column in _rows(source)]
        exact = np.zeros(batch)

        def numbers(columns: Array) -> list[Series]:
            return [Series.constant(source.algebra, c.copy(), exact) for c in columns]

        p = numbers(np.repeat(self._p[:, None], batch, axis=1))
        running = tape.start(
            [rows[:first], p, [], numbers(lines.slope.T), numbers(lines.offset.T), rows[first:]]
        )
        running.extend(0)
        return running


def _driven(source: PolynomialSet, driver: Series) -> Range:
    """Range (B,) of a kink's driver."""
    found = source.image_range(driver.coef[0][:, None], driver.radius[0][:, None])
    low, high = (end[:, 0] for end in found)
    if not (np.all(low > -_LARGEST_DRIVER) and np.all(high < _LARGEST_DRIVER)):
        raise NoEnclosureError("a limited quantity left the range of numbers")
    return low, high


@functools.lru_cache(maxsize=32)
def _algebra(deep: int, degree: int, shallow: int) -> Algebra:
    return Algebra.of(deep=deep, degree=degree, shallow=shallow)


def _extended(source: PolynomialSet, noise: Noise, kinks: int) -> PolynomialSet:
    """The set with a row per noise, and an empty one per kink."""
    batch, rows, old = source.generators.shape
    noises, new = noise.generators.shape
    total, known = rows + noises + kinks, source.algebra
    algebra = _algebra(known.deep, known.degree, total)
    coef = np.zeros((batch, total, algebra.size))
    coef[:, :rows, : known.size - rows] = source.coef[:, :, : known.size - rows]
    coef[:, rows : rows + noises, 0] = noise.center
    generators = np.zeros((batch, total, old + new))
    generators[:, :rows, :old] = source.generators
    generators[:, rows : rows + noises, old:] = noise.generators
    return PolynomialSet(algebra, coef, generators)


def _with_radius(source: PolynomialSet, row: int, radius: Array) -> PolynomialSet:
    column = np.zeros((*source.coef.shape[:2], 1))
    column[:, row, 0] = radius
    return PolynomialSet(
        source.algebra, source.coef, np.concatenate([source.generators, column], axis=2)
    )


def _stripped(moved: PolynomialSet, source: PolynomialSet) -> PolynomialSet:
    """The first rows in the algebra of `source`, without generators that are zero."""
    rows, known = source.coef.shape[1], source.algebra
    coef = np.zeros(source.coef.shape)
    coef[:, :, : known.size - rows] = moved.coef[:, :rows, : known.size - rows]
    generators = moved.generators[:, :rows]
    return PolynomialSet(known, coef, generators[:, :, generators.any(axis=(0, 1))])


def _rows(source: PolynomialSet) -> list[Array]:
    coef = source.with_spread_as_variables()
    return [coef[:, i] for i in range(coef.shape[1])]


def _steady(algebra: Algebra, coef: Array) -> Series:
    made = Series(algebra, 1, len(coef), steady=True)
    made.fill(0, coef, np.zeros(len(coef)))
    return made
