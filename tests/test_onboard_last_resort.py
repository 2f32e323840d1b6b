"""The last resort brakes by three frames, pedals first, with the steering command that went out."""

from __future__ import annotations

import pytest
from actuation_cases import shipped

from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.last_resort import LastResort
from workbench.runtime.onboard.states import Mode
from workbench.runtime.protocols import Decoded, decode, load_protocol

PACMOD2 = load_protocol("pacmod2")
STEERING = Frame(PACMOD2.by_name["STEERING_CMD"].frame_id, bytes(8))


def said(frames: tuple[Frame, ...]) -> list[tuple[str, dict[str, float]]]:
    found = []
    for frame in frames:
        decoded = decode(PACMOD2, frame.identifier, frame.data)
        assert isinstance(decoded, Decoded)
        found.append((decoded.message, dict(decoded.values)))
    return found


def flags(enable: int) -> tuple[str, dict[str, float]]:
    return "GLOBAL_CMD", {"PACMOD_ENABLE": enable, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0}


@pytest.mark.parametrize("mode", [Mode.GATE, Mode.DRIVE])
def test_it_lets_the_accelerator_go_brakes_and_stays_enabled(mode: Mode) -> None:
    dbw = shipped()
    resort = LastResort(dbw, mode)
    pedals = [
        ("ACCEL_CMD", {"ACCEL_CMD": 0.0}),
        ("BRAKE_CMD", {"BRAKE_CMD": pytest.approx(dbw.pedals.brake_profile, abs=0.00051)}),
    ]
    # The steering keeps what it was told last: without a command there is no frame for it.
    assert said(resort.brake()) == [*pedals, flags(1)]
    resort.sent((Frame(0x123, b""), STEERING, Frame(0x124, b"")))
    names = [name for name, _ in said(resort.brake())]
    assert names == ["ACCEL_CMD", "BRAKE_CMD", "STEERING_CMD", "GLOBAL_CMD"]
    assert resort.brake()[2] == STEERING
    assert said(resort.disable()) == [flags(0)]


def test_in_shadow_there_is_none_whatever_is_sent() -> None:
    resort = LastResort(shipped(), Mode.SHADOW)
    for identifier in (0, 1, 2, STEERING.identifier):
        resort.sent((Frame(identifier, bytes(8)),))
    assert resort.brake() == resort.disable() == ()
