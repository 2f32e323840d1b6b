"""The board finds a build whose decisions have other bits, and none where the builds agree."""

from __future__ import annotations

from dataclasses import replace

from bench_decision_fixture import BUDGET, small_kernel

from workbench.bench.decision_agreement import decision_agreement
from workbench.bench.decision_kernel import compiled_again


def test_both_builds_agree_on_answers_of_every_kind() -> None:
    done: list[int] = []
    found = decision_agreement(small_kernel(), inputs=100, seed=7, advance=lambda: done.append(1))
    assert (found.method, found.budget) == ("local, linear", BUDGET)
    assert (found.inputs, found.differing) == (100, 0)
    assert found.safe + found.unproved + found.invalid == 100
    assert min(found.safe, found.unproved) > 10
    assert found.invalid > 0
    assert len(done) == 100


def test_a_hair_of_difference_is_found() -> None:
    """The optimised build rounds the speed's bound by half as much again, 2^-41 m/s."""
    source = small_kernel().source
    assert "#define WB_SPEED_ROUNDING 0x1p-40" in source
    other = source.replace("WB_SPEED_ROUNDING 0x1p-40", "WB_SPEED_ROUNDING 0x1.8p-40")
    changed = replace(small_kernel(), shared_object=compiled_again(other, level="-O0"))
    found = decision_agreement(changed, inputs=20, seed=7)
    assert found.differing > 10
