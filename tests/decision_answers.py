"""The result of the decision kernel by name: of each of its three tubes, and of all together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Nearest:
    """What one tube's comparison with one kind of people's tubes gave."""

    clearance_m: float
    time_s: float
    person: float
    tube: float
    cause: float


class TubeAnswer:
    """One tube's part of a result, read by field."""

    def __init__(self, answer: Answer, name: str) -> None:
        self._answer, self._name = answer, name

    def field(self, name: str) -> Array:
        return self._answer.field(f"{self._name}_{name}")

    @property
    def verdicts(self) -> tuple[float, ...]:
        return tuple(self.field("verdicts").tolist())

    @property
    def verdict(self) -> float:
        """Of the first level, which decides in the shipped bundle."""
        return self.verdicts[0]

    @property
    def status(self) -> float:
        return float(self.field("status")[0])

    @property
    def steps(self) -> int:
        return int(self.field("rows")[0])

    @property
    def level(self) -> int:
        return int(self.field("level")[0])

    @property
    def cells(self) -> int:
        return int(self.field("cells")[0])

    @property
    def intent(self) -> Nearest:
        return Nearest(*self.field("intent").tolist())

    @property
    def guard(self) -> Nearest:
        return Nearest(*self.field("guard").tolist())

    def rows(self, name: str, width: int) -> Array:
        return self.field(name).reshape(-1, width)[: self.steps]


class Answer:
    """One result buffer."""

    def __init__(self, numbers: Array, fields: Mapping[str, slice]) -> None:
        self.numbers, self._fields = numbers, fields
        self.track, self.stop, self.brake = self.tubes = tuple(
            TubeAnswer(self, name) for name in ("track", "stop", "brake")
        )

    def field(self, name: str) -> Array:
        return self.numbers[self._fields[name]]

    @property
    def status(self) -> float:
        return float(self.field("status")[0])

    @property
    def spent(self) -> int:
        return int(self.field("spent")[0])
