"""The board of the intent filter does the work that it says: twenty people cost twenty updates."""

from __future__ import annotations

import math

from workbench.bench.intent_cost import CROWDS, KERNEL, PLAIN, update_costs, update_text


def test_every_way_is_measured_for_one_person_and_for_twenty() -> None:
    done: list[int] = []
    costs = update_costs(rounds=40, advance_by=lambda: done.append(1))
    assert len(done) == len(costs) == 8
    assert [cost.people for cost in costs] == 4 * [1] + 4 * [20]
    assert {cost.particles for cost in costs} == {600}
    by = {(cost.way, cost.people): cost for cost in costs}
    counted = [by[KERNEL, people].instructions for people in CROWDS]
    if None not in counted:  # valgrind is there
        one, twenty = (float(count or 0) for count in counted)
        # At least ten instructions per particle; people differ in how particles are resampled.
        assert one > 6000.0
        assert math.isclose(twenty, 20.0 * one, rel_tol=0.1)
    # Compiled code is quicker by two orders of magnitude; tenfold is seen on a busy machine, too.
    assert by[KERNEL, 1].median_us < 0.1 * by[PLAIN, 1].median_us
    text = update_text(costs)
    assert text.count(KERNEL) == 2
    assert len(text.splitlines()) == 9
