"""What the cross-checks of speed, steering and localisation have found, and how long it counts."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.onboard.cross_checks import Check, contradictions
from workbench.runtime.onboard.faults import Fault, Found
from workbench.runtime.onboard.intake import Intake
from workbench.runtime.onboard.limits import FaultLimits
from workbench.runtime.onboard.readings import localised_pose
from workbench.runtime.onboard.sensor_bounds import SensorBounds
from workbench.runtime.onboard.set_streams import SetSeen
from workbench.runtime.protocols import Localised, NoSet

# The first that is found counts: a frozen pose also contradicts the way, and is no wrong unit.
_FAULTS: Final = {
    Check.FROZEN: Fault.FROZEN,
    Check.CHANGE: Fault.OUT_OF_RANGE,
    Check.SPEED: Fault.WRONG_SPEED,
    Check.WAY: Fault.WRONG_SPEED,
    Check.TURN: Fault.WRONG_TURN,
    Check.YAW_RATE: Fault.WRONG_TURN,
}
_LASTING: Final = frozenset({Fault.WRONG_SPEED, Fault.WRONG_TURN})


@final
@dataclass(frozen=True, slots=True)
class Agreement:
    """What comparing has found so far; `with_latest` returns the next value.

    agreed_m: distance over which reports and localisation agreed since they last contradicted each
    other. contradiction: a wrong unit or parameter does not heal, so it stays until they have
    agreed over agree_m (m), which a standing car never does; any other until the next localisation.
    compared: the localisation that was looked at last.
    """

    agreed_m: float = 0.0
    contradiction: Found | None = None
    compared: SetSeen[Localised] | None = None

    def with_latest(self, intake: Intake, sensors: SensorBounds, limits: FaultLimits) -> Agreement:
        """With the last localisation, if it is new."""
        latest, before = intake.localisation, self.compared
        if isinstance(latest, NoSet) or latest is before:
            return self
        found = contradictions(
            intake, sensors, moved_m=limits.frozen_m, yaw_rate_error_radps=limits.yaw_rate_radps
        )
        first = next((c for check in _FAULTS for c in found if c.check is check), None)
        if first is not None:
            detail = f"{first.check.value}: {first.detail}"
            fault = Found(_FAULTS[first.check], detail, first.since_us)
            stays = self.contradiction
            lasts = stays is not None and stays.fault in _LASTING
            return Agreement(0.0, stays if lasts else fault, latest)
        agreed_m = self.agreed_m
        if before is not None:
            agreed_m += _least_apart_m(before.value, latest.value)
        stays = self.contradiction
        if stays is not None and (stays.fault not in _LASTING or agreed_m >= limits.agree_m):
            stays = None
        return dataclasses.replace(self, agreed_m=agreed_m, contradiction=stays, compared=latest)


def _least_apart_m(one: Localised, two: Localised) -> float:
    a, b = localised_pose(one), localised_pose(two)
    gaps = (max(p[0] - q[1], q[0] - p[1], 0.0) for p, q in ((a.x, b.x), (a.y, b.y)))
    return math.hypot(*gaps)
