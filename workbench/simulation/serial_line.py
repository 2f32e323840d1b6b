"""A CAN bus that leaves a process without hardware: a serial line of the system (a pair of pseudo
terminals) that carries frames as text, as adapters of python-can's `slcan` do."""

from __future__ import annotations

import os
import pty
import select
import termios
import tty
from importlib.util import find_spec
from typing import Final, final

from workbench.errors import InputError
from workbench.simulation.pacmod2_unit import CanFrame

_MOST_BYTES: Final = 65_536
_HEADER: Final = 5
"""Of a frame's line: t, three digits of the identifier, one of the length."""


def frame_line(frame: CanFrame) -> bytes:
    """A frame as a line.

    >>> frame_line((0x6F, bytes([1, 255])))
    b't06F201ff\\r'
    """
    identifier, data = frame
    return f"t{identifier:03X}{len(data)}{data.hex()}\r".encode()


def line_frame(line: bytes) -> CanFrame | None:
    """The frame of a line without its end; None for what is no standard data frame.

    >>> line_frame(b"t06F201FF"), line_frame(b"S6")
    ((111, b'\\x01\\xff'), None)
    """
    if line[:1] != b"t":
        return None
    try:
        text = line.decode("ascii")
        identifier, length = int(text[1:4], 16), int(text[4:_HEADER])
        data = bytes.fromhex(text[_HEADER : _HEADER + 2 * length])
    except ValueError:
        return None
    return (identifier, data) if len(data) == length else None


@final
class SerialLine:
    """The car's end of such a line; name: the other end, as a monitor's --channel.

    lost: frames that nobody read and that no longer fitted. Raises InputError where python-can
    cannot talk to serial lines.
    """

    def __init__(self) -> None:
        if find_spec("serial") is None:
            raise InputError(
                "expected pyserial, with which python-can talks to serial lines, found none; "
                "pip install pyserial"
            )
        self._ours, self._theirs = pty.openpty()
        for end in (self._ours, self._theirs):
            tty.setraw(end, termios.TCSANOW)
        self.name = os.ttyname(self._theirs)
        self._rest = b""
        self.lost = 0

    def send(self, frame: CanFrame) -> None:
        """A frame to whoever listens; it is lost where it does not fit, as on a bus."""
        if select.select((), (self._ours,), (), 0.0)[1]:
            os.write(self._ours, frame_line(frame))
        else:
            self.lost += 1

    def receive(self, wait_s: float) -> list[CanFrame]:
        """What has come, or comes first within so long."""
        if not select.select((self._ours,), (), (), wait_s)[0]:
            return []
        *lines, self._rest = (self._rest + os.read(self._ours, _MOST_BYTES)).split(b"\r")
        return [frame for line in lines if (frame := line_frame(line)) is not None]

    def close(self) -> None:
        """Let go of both ends."""
        os.close(self._ours)
        os.close(self._theirs)
