"""Whether every car of the ranges is stable, and what margins it keeps: proved or found."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.errors import InputError
from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import Car, Ranges, everywhere_stable_without_delay
from workbench.models.gains.ranged_search import Found, search
from workbench.reach.robustness.margins import MarginProofs, Proved
from workbench.reach.robustness.unstable import proved_unstable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZES: Final = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)


class Robust(enum.Enum):
    """What is known about the cars of the ranges."""

    PROVED = "every car of the ranges is stable, proved"
    REFUTED = "a car of the ranges is not stable, proved"
    OPEN = "open: neither proved nor refuted"


@final
@dataclass(frozen=True, slots=True)
class MarginName:
    """A margin: its key, its words with unit, and whether a larger value is the worse one."""

    key: str
    label: str
    larger_is_worse: bool = False


MARGIN_NAMES: Final = (
    MarginName("phase_deg", "phase margin (deg)"),
    MarginName("gain_low", "factor to which the gain may fall (1)", larger_is_worse=True),
    MarginName("gain_high", "factor to which the gain may rise (1)"),
    MarginName("delay_s", "delay margin (s)"),
    MarginName("disk", "disk margin (1)"),
)


@final
@dataclass(frozen=True, slots=True)
class Margin:
    """The worst of one margin over the ranges.

    proved: what every car keeps (rigor ENCLOSED), None where nothing was proved; found: the worst
    that a search found (rigor NUMERICAL), None where the loop of a car is not stable; at: the car
    it was found for. The truth lies between the two. boxes: what the proof has judged.
    """

    name: MarginName
    proved: float | None
    found: float | None
    at: Car | None
    boxes: int


@final
@dataclass(frozen=True, slots=True)
class Robustness:
    """The answer for one set of ranges; witness: a car that is not stable, where REFUTED."""

    ranges: Ranges
    answer: Robust
    witness: Car | None
    margins: tuple[Margin, ...]

    def rows(self) -> list[dict[str, object]]:
        """One row per margin."""
        return [
            {"margin": each.name.key, "proved": each.proved, "found_by_search": each.found,
             "at_wheelbase_m": each.at.wheelbase_m if each.at else None,
             "at_speed_scale": each.at.speed_scale if each.at else None,
             "at_delay_s": each.at.delay_s if each.at else None, "boxes": each.boxes}
            for each in self.margins
        ]  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Effort:
    """boxes: most that one proof may judge; seed: of the search."""

    boxes: int
    seed: int

    def __post_init__(self) -> None:
        if self.boxes < 1:
            raise InputError(f"boxes: expected at least 1, got {self.boxes}")


def robustness(loop: LateralLoop, ranges: Ranges, *, effort: Effort) -> Robustness:
    """Stability and worst margins of all cars of the ranges, at a measured speed above 0.

    PROVED: stable without delay by Hurwitz' conditions at the corners, which decide for all (exact
    rationals), and with every delay up to the longest, since none up to there brings any car to the
    brink (branch and bound in outward-rounded intervals). REFUTED: the roots of one car are counted
    and some are on the right. About the linearised loop on a straight path; each car's numbers are
    constant. Raises InputError on a speed that is not above 0.
    """
    if not loop.speed_mps > 0.0:
        raise InputError(f"expected a speed > 0 in m/s, got {loop.speed_mps:g}")
    found, suspect = search(loop, ranges, seed=effort.seed)
    for car in _suspects(ranges, suspect):
        if proved_unstable(loop, car):
            return _without_proof(ranges, Robust.REFUTED, {}, car)
    longest = ranges.delay_s[1]
    if not everywhere_stable_without_delay(loop, ranges):
        return _without_proof(ranges, Robust.OPEN, found, None)
    proofs = MarginProofs(loop, ranges, most=effort.boxes)
    # Somewhat beyond the longest delay where the search thinks that a car is not stable.
    limit = longest + (found["delay_s"].value if found else longest)
    total = proofs.total_delay(limit)
    if total.value is None or not total.value > longest or not found:
        return _without_proof(ranges, Robust.OPEN, found, None)
    spare = math.nextafter(total.value - longest, 0.0)
    proved = {
        "phase_deg": proofs.phase(found["phase_deg"].value),
        "gain_low": proofs.gain_low(found["gain_low"].value),
        "gain_high": proofs.gain_high(found["gain_high"].value),
        "delay_s": Proved(spare, total.boxes),
        "disk": proofs.disk(found["disk"].value),
    }
    return Robustness(ranges, Robust.PROVED, None, _margins(found, proved))


def _suspects(ranges: Ranges, suspect: Car | None) -> Sequence[Car]:
    return tuple(dict.fromkeys([*([suspect] if suspect else []), *ranges.corners()]))


def _without_proof(
    ranges: Ranges, answer: Robust, found: dict[str, Found], witness: Car | None
) -> Robustness:
    return Robustness(ranges, answer, witness, _margins(found, {}))


def _margins(found: dict[str, Found], proved: dict[str, Proved]) -> tuple[Margin, ...]:
    rows = []
    for name in MARGIN_NAMES:
        worst, bound = found.get(name.key), proved.get(name.key, Proved(None, 0))
        rows.append(
            Margin(
                name, bound.value, worst.value if worst else None, worst.car if worst else None,
                bound.boxes,
            )
        )  # fmt: skip
    return tuple(rows)


@final
@dataclass(frozen=True, slots=True)
class OverSize:
    """The same for ranges `sizes` times as long about the same middle."""

    sizes: tuple[float, ...]
    answers: tuple[Robustness, ...]

    def rows(self) -> list[dict[str, object]]:
        """One row per size and margin."""
        return [
            {"size": size, "answer": each.answer.name, **row}
            for size, each in zip(self.sizes, self.answers, strict=True)
            for row in each.rows()
        ]

    def plot(self) -> Figure:
        """Worst margins over the size of the ranges as a matplotlib figure."""
        from workbench.reach.robustness.pictures import figure_of

        return figure_of(self)


def over_size(
    loop: LateralLoop, ranges: Ranges, *, effort: Effort, sizes: Sequence[float] = SIZES
) -> OverSize:
    """`robustness` for ranges of several sizes, 1 being those given."""
    answers = tuple(robustness(loop, ranges.at_size(size), effort=effort) for size in sizes)
    return OverSize(tuple(sizes), answers)
