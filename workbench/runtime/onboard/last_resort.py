"""Frames that brake, made before anything can go wrong: for when making frames goes wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import final

from workbench.runtime.onboard.actuation import DriveByWire
from workbench.runtime.onboard.commands import Frame
from workbench.runtime.onboard.states import Mode
from workbench.runtime.protocols import Protocol, encode, load_protocol


@final
class LastResort:
    """BRAKE with the last steering command that was sent, as ready-made frames.

    Without one the steering gets no frame, and the vehicle keeps what it was told last. In SHADOW
    there is none at all.
    """

    def __init__(self, drive_by_wire: DriveByWire, mode: Mode) -> None:
        self._pedals: tuple[Frame, ...] = ()
        self._enable: tuple[Frame, ...] = ()
        self._disable: tuple[Frame, ...] = ()
        self._steering: tuple[Frame, ...] = ()
        self._steering_id = -1
        if mode is Mode.SHADOW:
            return
        protocol = load_protocol(drive_by_wire.protocol)
        self._steering_id = protocol.by_name["STEERING_CMD"].frame_id
        flags = {"PACMOD_ENABLE": 1, "CLEAR_OVERRIDE": 0, "IGNORE_OVERRIDE": 0}
        profile = drive_by_wire.pedals.brake_profile
        # The pedals come before all else, as in every other turn.
        self._pedals = (
            _frame(protocol, "ACCEL_CMD", {"ACCEL_CMD": 0.0}),
            _frame(protocol, "BRAKE_CMD", {"BRAKE_CMD": profile}),
        )
        self._enable = (_frame(protocol, "GLOBAL_CMD", flags),)
        self._disable = (_frame(protocol, "GLOBAL_CMD", flags | {"PACMOD_ENABLE": 0}),)

    def sent(self, frames: Iterable[Frame]) -> None:
        """Remember the steering command among what is sent."""
        for frame in frames:
            if frame.identifier == self._steering_id:
                self._steering = (frame,)

    def brake(self) -> tuple[Frame, ...]:
        """ENABLE, accelerator 0, the brake profile, steering as last sent."""
        return (*self._pedals, *self._steering, *self._enable)

    def disable(self) -> tuple[Frame, ...]:
        """ENABLE 0."""
        return self._disable


def _frame(protocol: Protocol, name: str, values: Mapping[str, float]) -> Frame:
    data = encode(protocol, name, values)
    assert isinstance(data, bytes), f"a drive-by-wire's own figures can be sent: {data}"
    return Frame(protocol.by_name[name].frame_id, data)
