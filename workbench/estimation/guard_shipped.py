"""Guards to start with: people on foot from recorded crowds, people on wheels assumed."""

from __future__ import annotations

from workbench.estimation.guard_model import GuardFit, GuardModel
from workbench.runtime import MotionLimits


def shipped_guards() -> GuardFit:
    """People on foot as fitted to "Crowds by Example", on wheels with assumed figures.

    On foot: `fit_folder` on four recordings, 818 pedestrians in two places, positions clicked about
    every 1.2 s; the noise of another sensor is another. Credit: A. Lerner, Y. Chrysanthou,
    D. Lischinski, Crowds by Example, Computer Graphics Forum 26(3), 2007. On wheels: 9 m/s, a
    change of velocity of 3.5 m/s and a fifth of the speed; not fitted. Fit to recordings of your
    own place and sensor before anything depends on them.
    """
    on_foot = GuardModel(
        position_m=0.360,
        noise_m=0.533,
        velocity_mps=0.042,
        per_speed=0.0177,
        per_unsteady=1.185,
        kept=0.619,
        limits=MotionLimits(speed_mps=2.56, acceleration_mps2=0.338),
        provenance="818 people (ped) in 4 recordings of Crowds by Example",
    )
    on_wheels = GuardModel(
        position_m=0.5,
        noise_m=0.3,
        velocity_mps=3.5,
        per_speed=0.2,
        per_unsteady=0.3,
        kept=0.9,
        limits=MotionLimits(speed_mps=9.0, acceleration_mps2=0.5),
        provenance="assumed",
    )
    return GuardFit({"ped": on_foot, "cyclist": on_wheels})
