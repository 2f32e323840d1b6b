"""How long faults kept a car from driving, and when it was given back to the driver, in words."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

from workbench.runtime.onboard.states import State
from workbench.simulation.bus_drive import Instant
from workbench.simulation.undecided import fault_words

_MOST: Final = 0.5
"""Beyond this share of the time a summary says that the car was held."""


def holding_notes(instants: Sequence[Instant]) -> tuple[str, ...]:
    """A sentence for each time that the driver got the car, and one where faults held it for more
    than half of the time; () for neither."""
    held = _held_s(instants)
    whole_s, total_s = instants[-1].t_s - instants[0].t_s, held.pop("", 0.0)
    notes = list(_yielded(instants))
    if total_s > _MOST * whole_s:
        longest = sorted(held.items(), key=lambda item: -item[1])
        named = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in longest)
        notes.append(
            f"held by faults for {total_s:.1f} s of {whole_s:.1f} s: {named}; a fault holds the "
            "car until it is gone, the car stands, and TRACK is permitted again"
        )
    return tuple(notes)


def _held_s(instants: Sequence[Instant]) -> dict[str, float]:
    """Time by fault, the whole of it under "": from when it is found until TRACK is sent, or a
    decision itself stands against it."""
    found: dict[str, float] = {}
    named: tuple[str, ...] = ()
    for now, after in itertools.pairwise(instants):
        if now.faults:
            named = now.faults
        elif now.tracks or now.grounds:
            named = ()
        for name in dict.fromkeys((*named, "")) if named else ():
            found[name] = found.get(name, 0.0) + after.t_s - now.t_s
    return found


def _yielded(instants: Sequence[Instant]) -> Iterator[str]:
    for yields, turns in itertools.groupby(instants, lambda each: each.state is State.YIELDED):
        if yields:
            those = tuple(turns)
            found = next((fault_words(each) for each in those if each.faults), ())
            yield (
                f"the monitor gave the car to the driver (YIELDED) from {those[0].t_s:.1f} s until "
                f"{those[-1].t_s:.1f} s, for {'; '.join(found) or 'no fault on record'}"
            )
