"""A log that another computer on the bus wrote is replayed as well as its times allow, and what the
replay decides is held against the log without a claim to every bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from log_cases import TURN_US, TURNS, EchoCore, own, recorded

from workbench.runtime.onboard.intake import BusError
from workbench.runtime.onboard.playback import BusErrorSeen, Turn, compare
from workbench.runtime.onboard.playback_logs import open_log
from workbench.runtime.onboard.recorder_entries import LoggedFrame


def of_another_node(path: Path, *, offset_s: float, marked: bool) -> Path:
    """What another computer on the bus has on record, some hundred microseconds later."""
    writer = can.CanutilsLogWriter(path) if path.suffix == ".log" else can.ASCWriter(path)
    with writer:
        for k, line in enumerate(f for f in recorded() if isinstance(f, LoggedFrame)):
            message = can.Message(
                timestamp=offset_s + (line.at_us + 100 + 37 * (k % 11)) / 1e6,
                arbitration_id=line.identifier, data=line.data, is_extended_id=False,
                is_rx=not (marked and line.made), channel=0,
            )  # fmt: skip
            writer(message)
    return path


@pytest.mark.parametrize("marked", [True, False])
def test_another_nodes_log_is_replayed_but_nothing_exact_is_claimed_of_it(
    marked: bool, tmp_path: Path
) -> None:
    path = of_another_node(tmp_path / "x.log", offset_s=1.7e9, marked=marked)
    log = open_log(path)
    assert not log.exact
    assert log.header is None
    turns = []
    for event in log.events:
        if isinstance(event, Turn):
            turns.append(event)
    assert len(turns) == TURNS - 1
    for k, turn in enumerate(turns):
        assert abs(turn.at_us - (k * TURN_US + TURN_US - 11)) < 1000
    compared = compare(EchoCore(), open_log(path).events, exact=False)
    assert compared.mismatches == ()
    assert compared.decisions == TURNS // 3

    class Braking(EchoCore):
        def turn(self, at_us: int, clock: Callable[[], int]) -> Any:
            result = super().turn(at_us, clock)
            brakes = own(
                "DECISION", COUNTER=0, ACTION=1, VERDICT=2, ALERT=1, STAMP=0.0, PEOPLE_SET=0
            )  # fmt: skip
            if result.decision is None:
                return result
            return dataclasses.replace(result, frames=(*result.frames[:-1], brakes))

    compared = compare(Braking(), open_log(path).events, exact=False)
    assert {m.what for m in compared.mismatches} == {"DECISION.ACTION", "DECISION.VERDICT"}


def test_error_frames_of_another_nodes_log_are_bus_errors(tmp_path: Path) -> None:
    path = of_another_node(tmp_path / "x.log", offset_s=5.0, marked=True)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:9], "(5.040000) can0 20000080#\n", *lines[9:]]))
    errors = [event for event in open_log(path).events if isinstance(event, BusErrorSeen)]
    assert [error.kind for error in errors] == [BusError.ERROR_FRAME]
