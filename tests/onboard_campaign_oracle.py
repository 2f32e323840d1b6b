"""What is legal on the bus, read anew from the DBC text: no line of the codec is used here."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from importlib.resources import files

_BO = re.compile(r"^BO_ (\d+) (\w+): (\d+) (\w+)")
_SG = re.compile(
    r"^ SG_ (\w+) : (\d+)\|(\d+)@0([+-]) \(([-\d.e]+),([-\d.e]+)\) \[([-\d.e]+)\|([-\d.e]+)\]"
)
_VAL = re.compile(r"^VAL_ (\d+) (\w+) (.*);")
_ROLE = re.compile(r'^BA_ "Role" SG_ (\d+) (\w+) 1;')
_ZEROS = re.compile(r'^BA_ "UndefinedBits" BO_ (\d+) 1;')


@dataclass
class Field:
    """Place from the right of the frame as one number, and raw values that are stated."""

    name: str
    shift: int
    bits: int
    signed: bool
    low: int
    high: int
    factor: Fraction
    choices: set[int] = field(default_factory=set)
    must_be_set: bool = False

    def raw(self, word: int) -> int:
        raw = word >> self.shift & (1 << self.bits) - 1
        return raw - (1 << self.bits) if self.signed and raw >> (self.bits - 1) else raw

    def put(self, word: int, raw: int) -> int:
        mask = (1 << self.bits) - 1
        return word & ~(mask << self.shift) | (raw & mask) << self.shift


@dataclass
class Stated:
    """One message of a DBC file."""

    name: str
    number: int
    sender: str
    fields: dict[str, Field] = field(default_factory=dict)
    zeros: int = 0


def crc(number: int, seven: bytes) -> int:
    """CRC-8, polynomial x^8 + x^5 + x^3 + x^2 + x + 1, bit by bit."""
    register = 0xFF
    for byte in (number >> 8, number & 0xFF, *seven):
        for bit in range(7, -1, -1):
            top = register >> 7 ^ byte >> bit & 1
            register = register << 1 & 0xFF ^ 0x2F * top
    return register ^ 0xFF


def stated(protocol: str) -> dict[int, Stated]:
    """Messages by identifier."""
    text = (files("workbench.runtime.protocols") / f"{protocol}.dbc").read_text()
    found: dict[int, Stated] = {}
    last = Stated("", 0, "")
    for line in text.splitlines():
        if match := _BO.match(line):
            number, name, length, sender = match.groups()
            assert length == "8"
            last = found[int(number)] = Stated(name, int(number), sender)
        elif match := _SG.match(line):
            last.fields[match[1]] = _field(match)
        elif match := _VAL.match(line):
            codes = re.findall(r'(-?\d+) "', match[3])
            found[int(match[1])].fields[match[2]].choices = {int(code) for code in codes}
        elif match := _ROLE.match(line):
            found[int(match[1])].fields[match[2]].must_be_set = True
        elif match := _ZEROS.match(line):
            message = found[int(match[1])]
            used = sum((1 << f.bits) - 1 << f.shift for f in message.fields.values())
            message.zeros = ~used & (1 << 64) - 1
    return found


def _field(match: re.Match[str]) -> Field:
    start, bits, factor = int(match[2]), int(match[3]), Fraction(match[5])
    # Motorola order: bit 7 is the frame's first, 15 the ninth.
    first = 8 * (start // 8) + 7 - start % 8
    offset, low, high = (Fraction(match[k]) for k in (6, 7, 8))
    return Field(
        match[1], 64 - first - bits, bits, match[4] == "-",
        -((offset - low) // factor) if (offset - low) % factor else int((low - offset) / factor),
        int((high - offset) // factor), factor,
    )  # fmt: skip


VEHICLE, OWN = stated("pacmod2"), stated("workbench")
ALL = {**VEHICLE, **OWN}


def illegal(number: int, data: bytes) -> str:
    """Why a frame of a known identifier may not be used, or ''."""
    message = ALL[number]
    if len(data) != 8:
        return "length"
    word = int.from_bytes(data, "big")
    if number in OWN and crc(number, data[:7]) != data[7]:
        return "checksum"
    if word & message.zeros:
        return "undefined bits"
    for each in message.fields.values():
        raw = each.raw(word)
        if each.choices and raw not in each.choices:
            return f"no choice: {each.name}"
        if not each.low <= raw <= each.high:
            return f"range: {each.name}"
        if each.must_be_set and not raw:
            return f"invalid: {each.name}"
    return ""


SPEED, WHEEL = 0x6F, 0x6E
_POSSIBLE = {
    SPEED: ("VEHICLE_SPEED", -5.0, 15.0, 12.0, 0.3),
    WHEEL: ("OUTPUT_VALUE", -10.7, 10.7, 20.0, 0.2),
}
"""Signal, least, most, fastest change per second, step: the numbers of the vehicle's limits."""


@dataclass
class Vehicle:
    """Last speed and angle that were possible: what cannot follow them is impossible."""

    last: dict[int, tuple[int, Fraction]] = field(default_factory=dict)

    def impossible(self, number: int, data: bytes, at_us: int) -> bool:
        """Of a frame that is legal; with exact numbers."""
        if number not in _POSSIBLE:
            return False
        _, low, high, rate, step = _POSSIBLE[number]
        value = self._value(number, data)
        # A hair's breadth either way is left to the arithmetic.
        near = Fraction(1, 10**9)
        if not Fraction(low) - near <= value <= Fraction(high) + near:
            return True
        if number in self.last:
            then_us, before = self.last[number]
            most = Fraction(step) + Fraction(rate) * (at_us - then_us) / 10**6
            if abs(value - before) > most + near:
                return True
        return False

    def follow(self, number: int, data: bytes, at_us: int) -> None:
        """It was possible, and was believed."""
        if number in _POSSIBLE:
            self.last[number] = at_us, self._value(number, data)

    def _value(self, number: int, data: bytes) -> Fraction:
        each = ALL[number].fields[_POSSIBLE[number][0]]
        return each.raw(int.from_bytes(data, "big")) * each.factor


@dataclass
class Chain:
    """Frames of one kind of set, in the order in which they may count: whole tells the set's
    header once nothing is missing, in order, of one SET, with nothing illegal between.

    ahead: SET and STAMP of the newest header that may be believed: SET goes on by less than half of
    its range, STAMP grows."""

    header: int
    parts: tuple[int, ...]
    frames: list[tuple[int, bytes]] = field(default_factory=list)
    last: tuple[int, bytes] | None = None
    ahead: tuple[int, int] | None = None

    def take(self, number: int, data: bytes) -> None:
        if number != self.header and number not in self.parts:
            return
        if (number, data) == self.last:
            return
        self.last = number, data
        if illegal(number, data):
            self.frames = []
        elif number == self.header:
            self.frames = [(number, data)] if self._goes_on(data) else []
        elif self.frames and (number, data[0]) == (self._next(), self.frames[0][1][0]):
            self.frames.append((number, data))
        else:
            self.frames = []

    def _goes_on(self, data: bytes) -> bool:
        word, fields = int.from_bytes(data, "big"), ALL[self.header].fields
        number, stamp = fields["SET"].raw(word), fields["STAMP"].raw(word)
        if self.ahead is not None:
            of, at = self.ahead
            if not 0 < (number - of) % 256 < 128 or stamp <= at:
                return False
        self.ahead = number, stamp
        return True

    def _next(self) -> int:
        return self.parts[(len(self.frames) - 1) % len(self.parts)]

    @property
    def whole(self) -> bool:
        if not self.frames:
            return False
        rounds = 1
        if self.header == PEOPLE_ID:
            rounds = self.frames[0][1][1] >> 2 & 0x3F
        return len(self.frames) == 1 + rounds * len(self.parts)


PEOPLE_ID = next(n for n, m in OWN.items() if m.name == "PEOPLE")
