"""Axis-aligned boxes with named axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import final


def _checked_number(what: str, name: str, value: float) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"expected a finite {what} for axis {name!r}, got {value!r}")
    return number


@final
@dataclass(frozen=True, slots=True)
class Box:
    """The set {z : lower_i <= z_i <= upper_i} with one name per axis.

    names: axis names in order; lower, upper: end points in the axes' own units.
    End points made by `around` and `split` are rounded outward, so that the box contains the exact
    real set it was asked for. Raises ValueError on empty, unordered, duplicate or non-finite axes.

    >>> box = Box.around({"x": 1.0, "y": 0.0}, radius={"x": 0.5})
    >>> box.names, box.contains({"x": 1.5, "y": 0.0})
    (('x', 'y'), True)
    """

    names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.names or len(set(self.names)) != len(self.names):
            raise ValueError(f"expected distinct axis names, at least one, got {self.names!r}")
        if not len(self.names) == len(self.lower) == len(self.upper):
            raise ValueError(
                f"expected {len(self.names)} lower and upper end points, "
                f"got {len(self.lower)} and {len(self.upper)}"
            )
        for name, low, high in zip(self.names, self.lower, self.upper, strict=True):
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                raise ValueError(
                    f"expected finite end points lower <= upper on axis {name!r}, got [{low!r}, "
                    f"{high!r}]"
                )

    @classmethod
    def around(cls, center: Mapping[str, float], *, radius: Mapping[str, float]) -> Box:
        """Box with the given centre; axes missing in `radius` get radius 0. Rounded outward."""
        unknown = sorted(set(radius) - set(center))
        if unknown:
            raise ValueError(
                f"radius names axes {unknown} that the centre lacks; the centre has "
                f"{sorted(center)}"
            )
        lower, upper = [], []
        for name, value in center.items():
            mid = _checked_number("centre", name, value)
            rad = _checked_number("radius", name, radius.get(name, 0.0))
            if rad < 0.0:
                raise ValueError(f"expected a radius >= 0 for axis {name!r}, got {rad!r}")
            exact = rad == 0.0
            lower.append(mid if exact else math.nextafter(mid - rad, -math.inf))
            upper.append(mid if exact else math.nextafter(mid + rad, math.inf))
        return cls(tuple(center), tuple(lower), tuple(upper))

    @classmethod
    def from_intervals(cls, intervals: Mapping[str, tuple[float, float]]) -> Box:
        """Box from axis name -> (lower, upper), taken as they are."""
        return cls(
            tuple(intervals),
            tuple(float(low) for low, _ in intervals.values()),
            tuple(float(high) for _, high in intervals.values()),
        )

    @property
    def center(self) -> tuple[float, ...]:
        """A point of the box near its middle (rounded to nearest)."""
        return tuple(
            min(max(low + 0.5 * (high - low), low), high)
            for low, high in zip(self.lower, self.upper, strict=True)
        )

    @property
    def radius(self) -> tuple[float, ...]:
        """Radii about `center`, rounded outward: center +- radius contains the box."""
        return tuple(
            0.0 if low == high else math.nextafter(max(high - mid, mid - low), math.inf)
            for low, mid, high in zip(self.lower, self.center, self.upper, strict=True)
        )

    def interval(self, name: str) -> tuple[float, float]:
        """End points of one axis."""
        try:
            index = self.names.index(name)
        except ValueError:
            raise KeyError(f"no axis {name!r}; the box has {self.names}") from None
        return self.lower[index], self.upper[index]

    def contains(self, point: Mapping[str, float] | Sequence[float]) -> bool:
        """Whether `point` (by name, or values in axis order) lies in the box; NaN lies nowhere."""
        values = [point[name] for name in self.names] if isinstance(point, Mapping) else list(point)
        return len(values) == len(self.names) and all(
            low <= value <= high
            for low, value, high in zip(self.lower, values, self.upper, strict=True)
        )

    def reordered(self, names: Sequence[str]) -> Box:
        """The same box with its axes in another order."""
        if set(names) != set(self.names):
            raise ValueError(f"expected the axes {sorted(self.names)}, got {sorted(names)}")
        return Box.from_intervals({name: self.interval(name) for name in names})

    def split(self, parts: Mapping[str, int]) -> tuple[Box, ...]:
        """Partition into a grid of cells, `parts[name]` along each named axis.

        Neighbouring cells share identical end points and the outermost ones are the box's own, so
        the cells cover the box by construction.
        """
        cuts: list[list[float]] = []
        for name, low, high in zip(self.names, self.lower, self.upper, strict=True):
            count = int(parts.get(name, 1))
            if count < 1:
                raise ValueError(f"expected at least 1 part along {name!r}, got {count}")
            inner = [low + (high - low) * (k / count) for k in range(1, count)]
            cuts.append([low, *(min(max(cut, low), high) for cut in inner), high])
        unknown = sorted(set(parts) - set(self.names))
        if unknown:
            raise ValueError(f"cannot split along {unknown}; the box has {self.names}")
        ranges = [list(itertools.pairwise(points)) for points in cuts]
        return tuple(
            Box(self.names, tuple(low for low, _ in cell), tuple(high for _, high in cell))
            for cell in itertools.product(*ranges)
        )

    def vertices(self) -> Iterator[tuple[float, ...]]:
        """All corners; axes of zero width contribute one value."""
        choices = [
            (low,) if low == high else (low, high)
            for low, high in zip(self.lower, self.upper, strict=True)
        ]
        return itertools.product(*choices)
