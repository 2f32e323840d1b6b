"""Bad frames of every kind, in numbers."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable

from onboard_campaign_oracle import ALL, OWN, crc

Sent = tuple[int, bytes]
PATTERNS = tuple(
    struct.pack(form, value)
    for form in (">f", "<f", ">d", "<d")
    for value in (float("nan"), float("inf"), float("-inf"), -float("nan"))
)
SENTINELS = (0x7FFF, 0xFFFF, 0x8000, 0x8001, 0xFFFE, 0x7FFE, 0xFF7F, 0x0080)


def sealed(number: int, data: bytes) -> Sent:
    """With a checksum that fits, where there is one."""
    if number in OWN and len(data) == 8:
        return number, data[:7] + bytes([crc(number, data[:7])])
    return number, data


class Makes:
    """Draws bad frames; `heard` are true ones from before, which some are made of."""

    def __init__(self, dice: random.Random) -> None:
        self.dice = dice
        self.heard: list[Sent] = []
        self._ids = tuple(ALL)
        self._kinds: tuple[Callable[[], Sent], ...] = (
            self._noise, self._float, self._sentinel, self._edge, self._edge, self._length,
            self._flip, self._undefined, self._old, self._twice, self._stranger,
        )  # fmt: skip

    def next(self) -> tuple[str, Sent]:
        """Kind and frame."""
        kind = self.dice.choice(self._kinds)
        return kind.__name__[1:], kind()

    def hear(self, frame: Sent) -> None:
        if len(self.heard) < 256:
            self.heard.append(frame)
        else:
            self.heard[self.dice.randrange(256)] = frame

    def _true(self) -> Sent:
        return self.dice.choice(self.heard) if self.heard else self._noise()

    def _sealed(self, number: int, data: bytes) -> Sent:
        return sealed(number, data) if self.dice.random() < 0.8 else (number, data)

    def _noise(self) -> Sent:
        return self._sealed(self.dice.choice(self._ids), self.dice.randbytes(8))

    def _float(self) -> Sent:
        number, data = self._true()
        pattern = self.dice.choice(PATTERNS)
        place = self.dice.randrange(9 - len(pattern))
        return self._sealed(number, data[:place] + pattern + data[place + len(pattern) :])

    def _sentinel(self) -> Sent:
        number, data = self._true()
        place = self.dice.randrange(7)
        raw = self.dice.choice(SENTINELS).to_bytes(2, "big")
        return self._sealed(number, data[:place] + raw + data[place + 2 :])

    def _edge(self) -> Sent:
        number, data = self._true()
        field = self.dice.choice(tuple(ALL[number].fields.values()))
        edge = self.dice.choice((field.low, field.high)) + self.dice.choice((-1, 0, 1))
        word = field.put(int.from_bytes(data, "big"), edge)
        return self._sealed(number, word.to_bytes(8, "big"))

    def _length(self) -> Sent:
        number, data = self._true()
        count = self.dice.choice((0, 1, 6, 7, 9, 12, 64))
        return number, (data + self.dice.randbytes(56))[:count]

    def _flip(self) -> Sent:
        number, data = self._true()
        word = int.from_bytes(data, "big")
        for bit in self.dice.sample(range(64), self.dice.randint(1, 3)):
            word ^= 1 << bit
        return number, word.to_bytes(8, "big")

    def _undefined(self) -> Sent:
        number, data = self._true()
        zeros = ALL[number].zeros
        return sealed(number, (int.from_bytes(data, "big") | zeros).to_bytes(8, "big"))

    def _old(self) -> Sent:
        return self._true()

    def _twice(self) -> Sent:
        return self.heard[-1] if self.heard else self._noise()

    def _stranger(self) -> Sent:
        number = self.dice.choice(
            (0, 0x10, 0x7FF, 0x800, 0x1FFFFFFF, -1, self.dice.randrange(2**29))
        )
        return number, self.dice.randbytes(self.dice.randrange(9))
