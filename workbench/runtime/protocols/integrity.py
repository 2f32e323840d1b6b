"""What shows that a frame is whole and new: CRC-8, sum, counters."""

from __future__ import annotations

from typing import Final

# x^8 + x^5 + x^3 + x^2 + x + 1: any three flipped bits are seen in up to 119.
CRC_POLYNOMIAL: Final = 0x2F
_ALL_ONES: Final = 0xFF


def _remainder(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (CRC_POLYNOMIAL if byte & 0x80 else 0)
    return byte & 0xFF


_REMAINDERS: Final = tuple(_remainder(byte) for byte in range(256))


def crc8(data: bytes) -> int:
    """CRC-8 of some bytes: polynomial 0x2F, most significant bit first, from 0xFF, inverted at the
    end.

    It sees every change of one, two or three bits of a frame of 8 bytes, and every burst of up to 8
    bits; of other changes one in 256 goes unseen. It says nothing about who sent a frame. Source:
    AUTOSAR, specification of CRC routines, CRC8H2F (its check value is that of this example).

    >>> hex(crc8(b"123456789"))
    '0xdf'
    """
    crc = _ALL_ONES
    for byte in data:
        crc = _REMAINDERS[crc ^ byte]
    return crc ^ _ALL_ONES


def frame_crc(frame_id: int, payload: bytes) -> int:
    """CRC-8 of a frame: two bytes of identifier, most significant first, then what precedes it."""
    return crc8(frame_id.to_bytes(2, "big") + payload)


def frame_sum(frame_id: int, counter: int) -> int:
    """PACMod 3's checksum of a health report: (identifier + counter) mod 256."""
    return (frame_id + counter) & 0xFF


def counter_step(previous: int, current: int, *, bits: int) -> int:
    """How far a counter of so many bits has moved: 0 repeated, 1 the next one, more with losses.

    A step in the upper half of the range is one backwards, and is negative.

    >>> counter_step(255, 1, bits=8), counter_step(3, 2, bits=8)
    (2, -1)
    """
    step = (current - previous) % (1 << bits)
    return step - (1 << bits) if step >> (bits - 1) else step
