"""What holds for every frame of the workbench's own: how it is sent, how far rounding moves it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

from workbench.runtime.protocols.codec import Refusal, encode
from workbench.runtime.protocols.tables import Signal, load_protocol

OWN: Final = "workbench"


def encoded_frames(
    wanted: Sequence[tuple[str, Mapping[str, float]]],
) -> tuple[tuple[int, bytes], ...] | Refusal:
    """(identifier, bytes) of messages in their order, or the first refusal of a value."""
    protocol = load_protocol(OWN)
    frames = []
    for name, values in wanted:
        data = encode(protocol, name, values)
        if isinstance(data, Refusal):
            return data
        frames.append((protocol.by_name[name].frame_id, data))
    return tuple(frames)


def rounding_of(signal: Signal) -> float:
    """Proved bound on |decoded - sent| of a scaled signal whose sender rounds to the nearest count.

    Half a count, plus half an ulp of the largest value for the division when it is decoded, rounded
    up; 0 for counts, flags and choices, which are exact.

    >>> rounding_of(load_protocol("workbench").by_name["LOC_POSITION"].signal("X")) < 0.0005 + 1e-9
    True
    """
    if signal.divisor == 1:
        return 0.0
    largest = max(abs(signal.value_of(raw)) for raw in (signal.raw_min, signal.raw_max))
    half = signal.factor / (2 * signal.divisor)
    # math.ulp of the largest value exceeds the division's error twice, and half's and the sum's.
    return math.nextafter(half + math.ulp(largest), math.inf)


@cache
def worst_rounding() -> Mapping[tuple[str, str], float]:
    """`rounding_of` by (message, signal), of every scaled signal of the workbench's own frames."""
    return {
        (message.name, signal.name): rounding_of(signal)
        for message in load_protocol(OWN).by_name.values()
        for signal in message.signals
        if signal.divisor != 1
    }
