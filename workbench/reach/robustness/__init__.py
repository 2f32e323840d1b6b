"""Stability, margins and tubes of all cars that ranges allow, under one controller.

>>> from workbench.models.gains import LateralLoop
>>> loop = LateralLoop(1.75, 2.8, 2.0, 0.6, 0.05, 1.0)
>>> ranges = Ranges(wheelbase_m=(1.74, 1.76), speed_scale=(0.99, 1.01), delay_s=(0.0, 0.02))
>>> robustness(loop, ranges, effort=Effort(boxes=2000, seed=1)).answer.name
'PROVED'
"""

from workbench.models.gains.ranged_loop import Car, Ranges
from workbench.reach.robustness.tubes import RangedTube, ranged_tube
from workbench.reach.robustness.verdict import (
    Effort,
    OverSize,
    Robust,
    Robustness,
    over_size,
    robustness,
)

__all__ = [
    "Car",
    "Effort",
    "OverSize",
    "RangedTube",
    "Ranges",
    "Robust",
    "Robustness",
    "over_size",
    "ranged_tube",
    "robustness",
]
