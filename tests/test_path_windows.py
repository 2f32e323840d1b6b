"""A query's stretch of the path reaches back and ahead as far as tubes of a few seconds do."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tests.survey_cases import straight
from workbench.claims import Verdict
from workbench.codegen.decision_source import PATH_NODES
from workbench.runtime import Deciding
from workbench.runtime.query import PathWindows
from workbench.simulation.campaign.survey_drive import drive
from workbench.simulation.onboard_car import straight_road
from workbench.simulation.rig import Trial
from workbench.simulation.simulated import build_rig

ROAD = straight_road(-20.0, 180.0)


@given(stations=st.lists(st.floats(-16.0, 150.0), min_size=1, max_size=5))
def test_a_window_holds_16_nodes_behind_the_car_and_100_ahead(
    stations: list[float],
) -> None:
    windows = PathWindows(ROAD, nodes=PATH_NODES)
    for station_m in stations:
        window = windows.around(station_m)
        (start_m,), (count,) = window["path_start_m"], window["path_count"]
        (spacing_m,) = window["path_spacing_m"]
        end_m = start_m + (count - 1.0) * spacing_m
        assert start_m <= max(station_m - 16 * spacing_m, ROAD.start_m)
        assert end_m >= min(station_m + 100 * spacing_m, ROAD.end_m) - 1e-9


def test_a_standing_car_is_proved_to_go_on_for_four_seconds() -> None:
    # Its tube reaches two metres back, where a window that began with the car ended the proof.
    rig = build_rig(horizon_s=4.0, deciding_alone=True)
    trial = Trial(straight(duration_s=2.0), "bicycle", 1)
    driven = drive(rig, trial, rig.monitor(Deciding.LOOK_AHEAD))
    assert driven.set_off is not None
    assert set(driven.verdicts) == {Verdict.SAFE}
