"""Faults with conditions of their own: in GATE, of the process itself, of a bus that is gone,
and those that physics shows only where they are large enough."""

from __future__ import annotations

from onboard_campaign_injectors import parameter, says, upstream
from onboard_campaign_rows import NEEDED, Row
from onboard_campaign_truth import disabled_upstream, lost_upstream, own
from onboard_world_injectors import Replayed, Stopped, identifiers
from onboard_world_intruders import babbling

from workbench.runtime.onboard.faults import Fault
from workbench.runtime.onboard.states import Mode

F = Fault
IN_GATE = (
    *(
        Row(f"upstream's {name} stops", (F.UPSTREAM_LOST,),
            lambda at, dice, name=name: upstream(at, lambda world: world.mute.add(name)),  # type: ignore[misc]
            lost_upstream(name), mode=Mode.GATE)
        for name in ("GLOBAL_CMD", "ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD")
    ),
    Row("upstream lets go", (F.UPSTREAM_DISABLED,),
        lambda at, dice: upstream(at, lambda world: setattr(world, "enable", 0)),
        disabled_upstream, mode=Mode.GATE),
    Row("speed stops, in GATE", (F.STALE_REPORT,), lambda at, dice: Stopped(
        at, stops=identifiers("VEHICLE_SPEED_RPT")), mode=Mode.GATE),
)  # fmt: skip
OFF_BUS = (
    Row("babbling, identifier 0", (F.BUS_FLOOD, F.STALE_REPORT), lambda at, dice: babbling(at),
        lambda world, made, found: None, on_bus=False),
)  # fmt: skip
ANY = tuple(Fault)
REPLAYED_US = 400_000


def _scaled(message: str, signal: str, by: float) -> Row:
    return Row(
        f"{signal.lower()} times {by:g}", ANY,
        lambda at, dice: says(at, message, lambda v: v.update({signal: v[signal] * by})),
    )  # fmt: skip


def _shifted(message: str, signal: str, by: float) -> Row:
    return Row(
        f"{signal.lower()} and {by:g}", ANY,
        lambda at, dice: says(at, message, lambda v: v.update({signal: v[signal] + by})),
    )  # fmt: skip


PARTLY = (
    *(
        Row(f"{name} replayed", ANY, lambda at, dice, name=name: Replayed(  # type: ignore[misc]
            at, of=identifiers(name), window_us=REPLAYED_US), after_us=REPLAYED_US)
        for name in NEEDED
    ),
    Row("all reports replayed", ANY, lambda at, dice: Replayed(
        at, of=identifiers(*NEEDED), window_us=REPLAYED_US), after_us=REPLAYED_US),
    *(_scaled("VEHICLE_SPEED_RPT", "VEHICLE_SPEED", by) for by in (0.7, 0.9, 1.1, 1.3)),
    *(_shifted("VEHICLE_SPEED_RPT", "VEHICLE_SPEED", by) for by in (-0.5, -0.2, 0.2, 0.5)),
    *(_shifted("STEERING_RPT_1", "OUTPUT_VALUE", by) for by in (-1.0, -0.3, 0.3, 1.0)),
    Row("wheelbase 1 m", ANY, lambda at, dice: parameter(at, wheelbase_m=1.0), own),
    Row("wheelbase 2.45 m", ANY, lambda at, dice: parameter(at, wheelbase_m=2.45), own),
    Row("steering ratio 15", ANY, lambda at, dice: parameter(at, steering_ratio=15.0), own),
)  # fmt: skip
"""Plausible lies: any fault that answers counts as noticed; many are within what errors allow."""
