"""Whatever a driver of python-can does has a name, and waiting does not read the wall clock."""

from __future__ import annotations

import errno
import itertools
import socket
import time
from collections.abc import Iterator
from typing import Any

import can
import pytest

from workbench.runtime.onboard.bus import (
    EXTENDED,
    FLEXIBLE,
    REMOTE,
    BusFaultError,
    BusSettings,
    Heard,
    PythonCanBus,
    cannot_listen_only,
    heard,
)
from workbench.runtime.onboard.intake import BusError


class Failing:
    """A bus of python-can that raises what it is given."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def recv(self, timeout: float) -> None:
        raise self.error

    def send(self, message: can.Message, timeout: float) -> None:
        raise self.error

    def shutdown(self) -> None:
        raise self.error


@pytest.mark.parametrize(
    ("error", "broken"),
    [
        (can.CanOperationError("Failed to transmit", errno.ENOBUFS), False),
        (can.CanOperationError("Transmit buffer full"), False),
        (can.CanOperationError("Network is down", errno.ENETDOWN), True),
        (OSError(errno.ENODEV, "gone"), True),
        (ValueError("invalid literal for int()"), False),
        (can.CanTimeoutError("slow"), True),
    ],
)
def test_failures_of_the_driver_have_a_name(
    error: Exception, broken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(can, "Bus", lambda **_: Failing(error))
    bus = PythonCanBus(BusSettings("virtual", "x", listens_only=False))
    for doing, kind in (
        (lambda: bus.receive(0), BusError.RECEIVE),
        (lambda: bus.send(1, b""), BusError.SEND),
    ):
        with pytest.raises(BusFaultError) as raised:
            doing()
        assert (raised.value.kind, raised.value.broken) == (kind, broken)
    bus.close()


def test_a_bus_that_cannot_be_opened_is_one_sentence() -> None:
    with pytest.raises(BusFaultError) as raised:
        PythonCanBus(BusSettings("no such interface", "x"))
    assert raised.value.kind is BusError.CLOSED
    assert "no such interface" in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "identifier"),
    [
        ({}, 0x6F),
        ({"is_extended_id": True}, 0x6F | EXTENDED),
        ({"is_remote_frame": True}, 0x6F | REMOTE),
        ({"is_fd": True}, 0x6F | FLEXIBLE),
    ],
)
def test_only_a_classic_standard_data_frame_has_its_plain_identifier(
    changes: dict[str, Any], identifier: int
) -> None:
    usual: dict[str, Any] = {"arbitration_id": 0x6F, "is_extended_id": False}
    assert heard(can.Message(**(usual | changes))).identifier == identifier


@pytest.mark.parametrize(
    ("error_class", "data", "kind"),
    [
        (0x040, bytes(8), BusError.BUS_OFF),
        (0x004, bytes([0, 0x01]), BusError.OVERFLOW),
        (0x004, bytes([0, 0x20]), BusError.ERROR_PASSIVE),
        (0x004, bytes([0, 0x08]), BusError.ERROR_FRAME),
        (0x004, b"", BusError.ERROR_FRAME),
        (0x008, bytes(8), BusError.ERROR_FRAME),
    ],
)
def test_error_frames_have_a_kind(error_class: int, data: bytes, kind: BusError) -> None:
    message = can.Message(
        arbitration_id=error_class, data=data, is_error_frame=True, is_extended_id=False
    )
    assert heard(message) == Heard(error_class, data, kind)


def test_who_cannot_be_silenced_is_said() -> None:
    for interface in ("virtual", "slcan", "pcan", "kvaser", "vector", "seeedstudio"):
        assert cannot_listen_only(BusSettings(interface, "c")) is None
    said = cannot_listen_only(BusSettings("socketcan", "can0"))
    assert said is not None
    assert "ip link set can0" in said
    assert cannot_listen_only(BusSettings("gs_usb", "0")) is not None
    assert cannot_listen_only(BusSettings("socketcan", "can0", listens_only=False)) is None


@pytest.fixture
def fake_socketcan(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """python-can's SocketCAN on one end of a pair of sockets; the kernel's CAN is not touched."""
    from can.interfaces.socketcan import socketcan

    ours, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    class Options(socket.socket):
        def setsockopt(self, *_: object) -> None:  # type: ignore[override]
            return

        def recvmsg(self, size: int, ancillary: int = 0, flags: int = 0) -> Any:  # type: ignore[override]
            data, _, kind, address = super().recvmsg(size, ancillary, flags)
            stamp = socketcan.RECEIVED_TIMESTAMP_STRUCT.pack(1_000_000, 0)
            level = (socket.SOL_SOCKET, socketcan.constants.SO_TIMESTAMPNS, stamp)
            return data, [level], kind, address

    fake = Options(fileno=ours.detach())
    monkeypatch.setattr(socketcan, "create_socket", lambda: fake)
    monkeypatch.setattr(socketcan, "bind_socket", lambda *_: None)
    yield other
    other.close()


def test_socketcan_reads_sends_and_reports_errors(fake_socketcan: socket.socket) -> None:
    from can.interfaces.socketcan.socketcan import build_can_frame

    bus = PythonCanBus(BusSettings("socketcan", "can0", listens_only=False))
    assert bus.receive(1_000) is None
    usual = can.Message(arbitration_id=0x6F, data=bytes(8), is_extended_id=False)
    fake_socketcan.send(build_can_frame(usual))
    assert bus.receive(1_000) == Heard(0x6F, bytes(8))
    off = bytes.fromhex("40000020080000000000000000000000")
    fake_socketcan.send(off)
    assert bus.receive(1_000) == Heard(0x40, bytes(8), BusError.BUS_OFF)
    bus.send(0x6B, bytes([1, 2, 3]))
    sent = fake_socketcan.recv(64)
    assert (sent[:5], sent[8:11]) == (bytes.fromhex("6b00000003"), bytes([1, 2, 3]))
    for _ in range(100_000):
        try:
            bus.send(0x6B, bytes(8))
        except BusFaultError as fault:
            assert (fault.kind, fault.broken) == (BusError.SEND, False)
            break
    else:
        pytest.fail("the queue never filled")
    bus.close()


def test_the_wall_clock_does_not_hold_up_a_selected_wait(
    fake_socketcan: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """python-can's own wait would go on for the size of the step."""
    from can import bus as python_can_bus

    jumping = itertools.count(2e9, -3600.0)
    monkeypatch.setattr(python_can_bus, "time", lambda: next(jumping))
    bus = PythonCanBus(BusSettings("socketcan", "can0"))
    begun = time.monotonic()
    assert bus.receive(20_000) is None
    assert time.monotonic() - begun < 1.0
    bus.close()
