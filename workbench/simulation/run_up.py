"""What a driver does before a car with ranges may drive itself: stand, drive some metres, stand.

From one antenna no heading follows. It is observed over the first metres that the car is driven by
hand, as on the vehicle.
"""

from __future__ import annotations

import math
from typing import Final, final

from workbench.runtime.onboard.drive_by_wire import DriveByWire
from workbench.simulation.plants.actuators import DriveByWireCar

AWAY_M: Final = 8.5
"""The car stands so far before its path's beginning, on the straight line through it."""
BEGUN_US: Final = 16_000_000
"""When it is over: the scenario begins."""
_STANDS_US: Final = 4_000_000
_SPEED_MPS: Final = 1.5
_BRAKES_MPS2: Final = 0.4
_MOST_MPS2: Final = 0.6
_HELD: Final = 0.3
_PER_S: Final = 2.0


@final
class RunUp:
    """The driver of a car that stands AWAY_M before a point ahead and is to stand at it."""

    def __init__(self, car: DriveByWireCar, wire: DriveByWire) -> None:
        self._car, self._pedals = car, wire.pedals
        motion = car.motion
        self._from = motion.x_m, motion.y_m

    def press(self, at_us: int) -> None:
        """The pedals for the next instant; the wheel is left straight."""
        car, pedals = self._car, self._pedals
        wanted_mps2 = self._wanted_mps2() if at_us >= _STANDS_US else -math.inf
        accelerator = brake = 0.0
        if wanted_mps2 >= pedals.coast_below_mps2:
            accelerator = pedals.accelerator.command_for(wanted_mps2)
        elif wanted_mps2 < 0.0:
            brake = _HELD
            if wanted_mps2 > -math.inf:
                brake = pedals.brake.command_for(-wanted_mps2)
        car.command(
            accelerator=accelerator, brake=brake, wheel_rad=car.wheel_rad, wheel_rate_radps=0.0
        )

    def _wanted_mps2(self) -> float:
        """Towards the speed from which a gentle brake still stops in time; -inf: stand."""
        motion = self._car.motion
        left_m = AWAY_M - math.dist(self._from, (motion.x_m, motion.y_m))
        if left_m <= 0.02:
            return -math.inf
        speed_mps = min(_SPEED_MPS, math.sqrt(2.0 * _BRAKES_MPS2 * left_m))
        wanted = _PER_S * (speed_mps - motion.speed_mps)
        return min(max(wanted, -_MOST_MPS2), _MOST_MPS2)
