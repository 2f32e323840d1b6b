"""What a choice of gains is scored by in every case, and which way each figure is better."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

from workbench.errors import InputError

INSTANTS_S: Final = (1.0, 2.0, 3.0)
"""When widths of the tube are taken."""


@final
@dataclass(frozen=True, slots=True)
class Figure:
    """A column of a sweep: words, unit, whether more is better, how it is known."""

    name: str
    words: str
    unit: str
    more_is_better: bool
    how: str

    @property
    def label(self) -> str:
        """Words with the unit in brackets."""
        return f"{self.words} ({self.unit})"

    def cost(self, value: float) -> float:
        """Less is better; inf for what is not a number."""
        if math.isnan(value):
            return math.inf
        return -value if self.more_is_better else value


_LINEAR: Final = "linearised on a straight path"
_TUBE: Final = "proved tube"
_RUNS: Final = "runs from corners of the initial set"
_SPEED: Final = "speed loop, exact in closed form"
_DRIVES: Final = "drives of scenarios"

FIGURES: Final = {
    each.name: each
    for each in (
        Figure("decay_per_s", "slowest pole's decay", "1/s", True, _LINEAR),
        Figure("phase_deg", "phase margin", "deg", True, _LINEAR),
        Figure("delay_margin_s", "delay margin", "s", True, _LINEAR),
        Figure("disk", "disk margin", "1", True, _LINEAR),
        Figure("proved_until_s", "tube proved until", "s", True, _TUBE),
        *(
            Figure(f"{name}_{t:g}s_m", f"{words} half width at {t:g} s", "m", False, _TUBE)
            for name, words in (("along", "along"), ("lateral", "lateral"))
            for t in INSTANTS_S
        ),
        Figure("area_3s_m2", "tube area at 3 s, width by width", "m²", False, _TUBE),
        Figure("growth", "largest lateral width over the first", "1", False, _TUBE),
        Figure("stopping_m", "stopping distance", "m", False, _TUBE),
        Figure("settling_s", "settling time", "s", False, _RUNS),
        Figure("rest_m", "offset left at the end", "m", False, _RUNS),
        Figure("saturated", "share of time at the steering-rate limit", "1", False, _RUNS),
        Figure("speed_phase_deg", "phase margin of the speed loop", "deg", True, _SPEED),
        Figure("speed_delay_margin_s", "delay margin of the speed loop", "s", True, _SPEED),
        Figure("speed_settling_s", "settling time of the speed", "s", False, _RUNS),
        Figure("speed_overshoot_mps", "overshoot of the speed", "m/s", False, _RUNS),
    )
}
"""What every point is scored by in every case."""

DRIVEN: Final = {
    each.name: each
    for each in (
        Figure("needless_per_km", "needless stops per km", "1/km", False, _DRIVES),
        Figure("standing", "share of the time at standstill", "1", False, _DRIVES),
        Figure("contacts", "drives with a contact while moving", "1", False, _DRIVES),
        Figure("avoidable", "drives with an avoidable contact", "1", False, _DRIVES),
        Figure("driven_km", "way of the drives", "km", True, _DRIVES),
        Figure("driven_mps", "mean speed of the drives", "m/s", True, _DRIVES),
    )
}
"""What present gains and finalists alone are scored by, where a study has [drives]."""

ALL_FIGURES: Final = {**FIGURES, **DRIVEN}


def figure(name: str) -> Figure:
    """The figure of this name. Raises InputError on another."""
    if name not in ALL_FIGURES:
        raise InputError(f"expected a figure, one of {', '.join(ALL_FIGURES)}, got {name!r}")
    return ALL_FIGURES[name]
