"""Every fault of the list, in random phases, is answered on the bus within 34 ms of being there."""

from __future__ import annotations

import random
import statistics
import sys
from collections import Counter
from collections.abc import Sequence

import pytest
from onboard_campaign_more import IN_GATE, OFF_BUS, PARTLY
from onboard_campaign_rows import DRIVEN, Row
from onboard_campaign_world import Answer, in_child, tried, warm
from onboard_world_bus import frame_us

REACTION_US = 34_000
WORLDS = 25
BEAT_US = 1_200_000
"""Reports come every 33.333 ms and turns every 33 ms: their phases drift apart within seconds."""
ROWS = (*DRIVEN, *IN_GATE, *OFF_BUS)


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def one(row: Row, number: int, *, within_us: int = BEAT_US) -> Answer | None:
    """One trial: where in all cycles the fault falls is chance."""
    dice = random.Random(f"{row.name} {number}")

    def work() -> Answer | None:
        world = warm(row.mode, number % WORLDS, row.from_us)
        made = row.make(world.timeline.now_us + row.after_us + dice.randrange(within_us), dice)
        *others, last = made if isinstance(made, tuple) else (made,)
        for each in others:
            world.inject(each)
        return tried(
            world,
            last,
            truth=row.truth,
            faults=frozenset(row.faults),
            most_us=row.most_us,
            kept_us=within_us // 2,
        )

    warm(row.mode, number % WORLDS, row.from_us)
    return in_child(work)


HEAD = (
    "| fault | phases | unanswered | it began: found max | it was there: pedal let go (yield: "
    "ENABLE 0) median | max | brake begins (off the bus: is handed over) median | max | its last "
    "bit max | found as |"
)


def checked(row: Row, phases: int, *, within_us: int = BEAT_US) -> list[str]:
    """Prints the row's line, times in ms; what is wrong with it.

    The answer is on the bus when its first frame has been, and the frame that brakes has won it.
    """
    answers = [one(row, number, within_us=within_us) for number in range(phases)]
    known = [each for each in answers if each is not None and each.kept]
    if row.on_bus:
        known = [each for each in known if each.answered_us is not None]
    first, begun, ended = _reactions(known, on_bus=row.on_bus)
    names = Counter(name for each in known for name in each.faults)
    shown = " ".join(f"{name} {count}" for name, count in names.most_common(4))
    unanswered = phases - len(known)
    found = max((each.found_us - each.injected_us for each in known), default=0)
    say(
        f"| {row.name:28} | {phases:3} | {unanswered:3} | {found / 1e3:7.1f} | {_times(first)} "
        f"| {_times(begun)} | {max(ended, default=0) / 1e3:5.2f} | {shown} |"
    )
    wrong = [f"{row.name}: {unanswered} of {phases} unanswered"] if unanswered else []
    latest = max((*first, *begun), default=0)
    return [*wrong, f"{row.name}: {latest} us"] if latest > REACTION_US else wrong


def _reactions(known: Sequence[Answer], *, on_bus: bool) -> tuple[list[int], list[int], list[int]]:
    """From the condition to the first frame's last bit, to the begin of the frame that brakes or
    yields, and to its last bit."""
    if not on_bus:
        made = [each.made_us - each.condition_us for each in known]
        return made, made, []
    first = [each.first_us - each.condition_us for each in known if each.first_us is not None]
    ended = [each.answered_us - each.condition_us for each in known if each.answered_us is not None]
    return first, [time - frame_us(bytes(8)) for time in ended], ended


def _times(values: Sequence[int]) -> str:
    if not values:
        return "    - |     -"
    return f"{statistics.median(values) / 1e3:5.2f} | {max(values) / 1e3:5.2f}"


@pytest.mark.campaign
def test_every_fault_is_answered_in_random_phases() -> None:
    say("\n" + HEAD)
    wrong = [text for row in ROWS for text in checked(row, 100)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.campaign
def test_plausible_lies_are_noticed_where_they_are_large_enough() -> None:
    say("\n| plausible lie | phases | noticed | within ms, median | max | as |")
    for row in PARTLY:
        known = [each for each in (one(row, k) for k in range(100)) if each is not None]
        assert all(each.kept for each in known)
        names = Counter(name for each in known for name in each.faults).most_common(4)
        took = [each.found_us - each.injected_us for each in known]
        say(
            f"| {row.name:28} | 100 | {len(known):3} | {_times(took)} "
            f"| {' '.join(f'{n} {c}' for n, c in names)} |"
        )


@pytest.mark.parametrize("part", range(4))
def test_every_fault_is_answered_in_three_phases(part: int) -> None:
    wrong = [text for row in ROWS[part::4] for text in checked(row, 3, within_us=160_000)]
    assert not wrong, "\n".join(wrong)
