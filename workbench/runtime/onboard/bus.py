"""The vehicle's bus through python-can: frames in, frames out, and every failure by its name."""

from __future__ import annotations

import errno
import select
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol, final

from workbench.runtime.onboard.intake import BusError

if TYPE_CHECKING:
    import can

EXTENDED: Final = 1 << 31
REMOTE: Final = 1 << 30
FLEXIBLE: Final = 1 << 28
"""Set in the identifier of a frame that is no classic standard data frame: it means nothing here,
and must not look like the standard identifier with the same number. As in Linux, but FLEXIBLE."""

_SEND_S: Final = 0.0005
# pyserial calls a line late that was written whole, if it took longer than this.
_SEND_SERIAL_S: Final = 0.02
# Error classes and the controller's states in frames of SocketCAN: linux/can/error.h.
_CONTROLLER, _BUS_OFF = 0x004, 0x040
_OVERFLOW, _PASSIVE = 0x01, 0x30
_FULL: Final = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM})
# Interfaces whose recv(0) takes only what select finds, read in their sources.
_SELECTED: Final = frozenset({"socketcan", "slcan", "udp_multicast"})
# By default pyserial waits for 1 ms when nothing came, and slcan for 2 s whenever it is opened.
_AS_FAST: Final[Mapping[str, Mapping[str, object]]] = {
    "slcan": {"timeout": 0, "sleep_after_open": 0}
}
_NO_CONTROLLER: Final = frozenset({"virtual", "udp_multicast"})
# Hands back what it sends, whatever it is told; our own commands would look like somebody else's.
_ECHOES: Final = frozenset({"udp_multicast"})


@final
@dataclass(frozen=True, slots=True)
class Heard:
    """What came: a frame, or (error given) that the bus or its controller reports one."""

    identifier: int
    data: bytes
    error: BusError | None = None


@final
class BusFaultError(Exception):
    """The bus did not do what was asked. broken: it has to be opened again."""

    def __init__(self, kind: BusError, detail: str, *, broken: bool) -> None:
        super().__init__(detail)
        self.kind = kind
        self.broken = broken


class Bus(Protocol):
    """A bus that is open; both directions raise BusFaultError and nothing else."""

    def receive(self, wait_us: int) -> Heard | None:
        """The next frame, or None when none came within about so long; 0 does not wait."""
        ...

    def send(self, identifier: int, data: bytes) -> None:
        """Hand a frame to the controller, without waiting for longer than 500 us (slcan: 20 ms)."""
        ...

    def close(self) -> None:
        """Let go of it; never raises."""
        ...


@final
@dataclass(frozen=True, slots=True)
class BusSettings:
    """Which bus: python-can's names, bits per second (None: as it stands), and whether to listen
    only."""

    interface: str
    channel: str
    bitrate: int | None = None
    listens_only: bool = True


def listen_only_options(interface: str) -> Mapping[str, object] | None:
    """What makes an interface's controller silent, acknowledgements included; None: nothing can.

    Of what python-can 4.6 offers; `virtual` and `udp_multicast` have no controller to silence.
    """
    from can import BusState

    if interface in _NO_CONTROLLER:
        return {}
    passive: dict[str, object] = {"state": BusState.PASSIVE}
    silencing: dict[str, dict[str, object]] = {
        "slcan": {"listen_only": True},
        "vector": {"listen_only": True},
        "nixnet": {"listen_only": True},
        "seeedstudio": {"operation_mode": "silent"},
        "kvaser": {"driver_mode": False},
        "pcan": passive,
        "systec": passive,
    }
    return silencing.get(interface)


def cannot_listen_only(settings: BusSettings) -> str | None:
    """What an operator must know of a bus that is only listened to, where we cannot silence it."""
    if not settings.listens_only or listen_only_options(settings.interface) is not None:
        return None
    mend = (
        f"`ip link set {settings.channel} type can listen-only on` before starting does it"
        if settings.interface == "socketcan"
        else "silence it by its own driver's settings"
    )
    return (
        f"nothing is sent, but the controller of {settings.interface} still acknowledges frames: "
        f"python-can cannot make it listen only; {mend}"
    )


@final
class PythonCanBus:
    """A bus of python-can: `Bus` for the loop. Raises BusFaultError when it cannot be opened.

    Waiting goes by select where the interface allows: python-can's own waiting reads the wall
    clock, and a step of it backwards can make a wait of milliseconds one of hours.
    """

    __slots__ = ("_bus", "_file", "_send_s")

    def __init__(self, settings: BusSettings) -> None:
        if settings.interface in _ECHOES and not settings.listens_only:
            raise BusFaultError(
                BusError.CLOSED,
                f"{settings.interface} returns our own frames, which cannot be told from a second "
                "sender's; only listen on it",
                broken=True,
            )
        options: dict[str, Any] = dict(_AS_FAST.get(settings.interface, {}))
        if settings.bitrate is not None:
            options["bitrate"] = settings.bitrate
        if settings.listens_only:
            options |= listen_only_options(settings.interface) or {}
        try:
            import can

            self._bus: can.BusABC = can.Bus(
                channel=settings.channel,
                interface=settings.interface,
                receive_own_messages=False,
                ignore_config=True,
                **options,
            )
        except Exception as error:
            # Drivers fail to open in many ways, and each of them means the same here.
            raise BusFaultError(BusError.CLOSED, f"{error}", broken=True) from error
        self._send_s = _SEND_SERIAL_S if settings.interface == "slcan" else _SEND_S
        self._file = self._bus.fileno() if settings.interface in _SELECTED else None

    def receive(self, wait_us: int) -> Heard | None:
        """As `Bus.receive`."""
        try:
            if self._file is None:
                received = self._bus.recv(wait_us / 1e6)
            elif select.select((self._file,), (), (), wait_us / 1e6)[0]:
                received = self._bus.recv(0)
            else:
                return None
        except Exception as error:
            raise _fault(error, "receive", BusError.RECEIVE) from error
        return None if received is None else heard(received)

    def send(self, identifier: int, data: bytes) -> None:
        """As `Bus.send`."""
        from can import Message

        message = Message(arbitration_id=identifier, data=data, is_extended_id=False)
        try:
            self._bus.send(message, timeout=self._send_s)
        except Exception as error:
            raise _fault(error, "send", BusError.SEND) from error

    def close(self) -> None:
        """As `Bus.close`."""
        try:
            self._bus.shutdown()
        except Exception:
            # It is given up, whatever it says; the next one is opened from the beginning.
            return


def heard(received: can.Message) -> Heard:
    """What python-can received, as the core and the replay of a log take it.

    Its time stamp is left alone: it is the wall clock's, or the sender's.
    """
    identifier, data = received.arbitration_id, bytes(received.data)
    if received.is_error_frame:
        return Heard(identifier, data, _error_of(identifier, data))
    if received.is_extended_id:
        identifier |= EXTENDED
    if received.is_remote_frame:
        identifier |= REMOTE
    if received.is_fd:
        identifier |= FLEXIBLE
    return Heard(identifier, data)


def _error_of(error_class: int, data: bytes) -> BusError:
    """Which kind of error an error frame reports; interfaces that say no more report the plain
    one."""
    if error_class & _BUS_OFF:
        return BusError.BUS_OFF
    if error_class & _CONTROLLER and len(data) > 1:
        if data[1] & _OVERFLOW:
            return BusError.OVERFLOW
        if data[1] & _PASSIVE:
            return BusError.ERROR_PASSIVE
    return BusError.ERROR_FRAME


def _fault(error: Exception, doing: str, kind: BusError) -> BusFaultError:
    """A failure of python-can by name: a full queue and a garbled line leave the bus open."""
    from can import CanError

    number = getattr(error, "error_code", None) or getattr(error, "errno", None)
    full = number in _FULL or "buffer full" in str(error).lower()
    broken = isinstance(error, CanError | OSError) and not full
    return BusFaultError(kind, f"cannot {doing}: {error}"[:200], broken=broken)
