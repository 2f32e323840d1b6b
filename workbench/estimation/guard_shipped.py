"""Guards to start with: people on foot from recorded crowds, people on wheels assumed."""

from __future__ import annotations

from workbench.estimation.guard_model import GuardFit, GuardModel, VelocityError
from workbench.runtime import MotionLimits


def shipped_guards() -> GuardFit:
    """People on foot as fitted to "Crowds by Example", on wheels with assumed figures.

    On foot: `fit_folder` on four recordings, 802 pedestrians in two places, positions clicked about
    every 1.2 s; the noise of another sensor is another. Credit: A. Lerner, Y. Chrysanthou,
    D. Lischinski, Crowds by Example, Computer Graphics Forum 26(3), 2007. On wheels: 9 m/s, a
    change of velocity of 3.5 m/s and a fifth of the speed; not fitted. Fit to recordings of your
    own place and sensor before anything depends on them.
    """
    on_foot = GuardModel(
        position_m=0.454,
        error=VelocityError(
            base_mps=0.0825,
            per_speed=0.0561,
            slow_mps=0.526,
            per_unsteady=0.415,
            noise_m=0.0930,
            new_mps=1.53,
            per_missed=0.414,
            per_missed_long=0.383,
            per_scatter=0.181,
            per_fastest=0.0381,
        ),
        kept=0.687,
        limits=MotionLimits(speed_mps=2.70, acceleration_mps2=0.126),
        provenance="802 people (ped) in 4 recordings of Crowds by Example",
    )
    on_wheels = GuardModel(
        position_m=0.5,
        error=VelocityError(
            base_mps=3.5,
            per_speed=0.2,
            slow_mps=0.0,
            per_unsteady=0.3,
            noise_m=0.3,
            new_mps=0.0,
            per_missed=0.0,
            per_missed_long=0.0,
            per_scatter=0.0,
            per_fastest=0.0,
        ),
        kept=0.9,
        limits=MotionLimits(speed_mps=9.0, acceleration_mps2=0.5),
        provenance="assumed",
    )
    return GuardFit({"ped": on_foot, "cyclist": on_wheels})
