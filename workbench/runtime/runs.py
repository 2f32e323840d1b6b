"""Lists of floats as JSON holds them: exact, and short where a number is repeated."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

_SHORTEST = 4


def packed_runs(numbers: Sequence[float]) -> list[object]:
    """The numbers by float.hex; runs of equal ones as [how many, number].

    >>> packed_runs((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    ['0x1.0000000000000p+0', [5, '0x0.0p+0']]
    """
    items: list[object] = []
    for text, run in itertools.groupby(map(float.hex, numbers)):
        count = sum(1 for _ in run)
        items += [text] * count if count < _SHORTEST else [[count, text]]
    return items


def unpacked_runs(items: Sequence[object], *, most: int) -> tuple[float, ...]:
    """What `packed_runs` packed; raises ValueError for anything else and for more than `most`."""
    numbers: list[float] = []
    for item in items:
        count, text = item if isinstance(item, list) and len(item) == 2 else (1, item)
        whole = isinstance(count, int) and not isinstance(count, bool) and count >= 1
        if not whole or count > most - len(numbers):
            raise ValueError(
                f"expected at most {most} numbers, one by one or as [how many, number], "
                f"got {item!r:.80}"
            )
        numbers += [_hex_float(text)] * count
    return tuple(numbers)


def _hex_float(value: object) -> float:
    try:
        return float.fromhex(value if isinstance(value, str) else "")
    except (ValueError, OverflowError):
        raise ValueError(f"expected a number as float.hex writes it, got {value!r:.80}") from None
