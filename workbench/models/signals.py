"""Named, unit-carrying signals of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Signal:
    """A state of a model: name (by meaning) and SI unit ('' if unknown, '1' if dimensionless)."""

    name: str
    unit: str


@final
@dataclass(frozen=True, slots=True)
class Ranged:
    """A parameter or disturbance with nominal value and range, all in `unit`.

    As a parameter it is one unknown constant in [lower, upper]; as a disturbance it is an arbitrary
    (measurable) function of time with values in [lower, upper].
    """

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float

    def __post_init__(self) -> None:
        numbers = (self.lower, self.nominal, self.upper)
        if not all(math.isfinite(number) for number in numbers) or not (
            self.lower <= self.nominal <= self.upper
        ):
            raise ValueError(
                f"{self.name}: expected finite lower <= nominal <= upper, "
                f"got lower={self.lower!r}, nominal={self.nominal!r}, upper={self.upper!r}"
            )

    @classmethod
    def exactly(cls, name: str, unit: str, value: float) -> Ranged:
        """A known constant."""
        return cls(name, unit, value, value, value)

    @classmethod
    def symmetric(cls, name: str, unit: str, bound: float) -> Ranged:
        """A disturbance in [-bound, bound]."""
        return cls(name, unit, 0.0, -bound, bound)
