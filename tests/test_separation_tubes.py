"""Nobody who is where a tube says comes nearer to the car than what is claimed of it."""

from __future__ import annotations

import dataclasses
import inspect
import math
import sys
from types import ModuleType

import numpy as np
import pytest
from person_cases import (
    BOTH,
    INTENT,
    SEGMENTS,
    STANDING,
    asked,
    claimed,
    disc,
    escapes,
    intent,
    kernel,
)

from workbench.codegen.separation_source import CompiledSeparation, alone_source
from workbench.reach import person_gap
from workbench.reach.person_clearance import Nearest, nearest_people, people_window
from workbench.runtime.layout import NO_CLEARANCE_M, KernelCause
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    TrackedPerson,
    TubeKind,
)


def test_no_place_of_anybody_is_nearer_than_the_claim() -> None:
    found, positive = escapes(kernel(), scenes=250)
    assert found == 0
    assert positive > 400


_C_FAULTS = {
    "early skew dropped": ("wb_sum_outward(start, crowd->skew_lower, -1.0)", "start"),
    "late skew dropped": ("wb_sum_outward(end, crowd->skew_upper, 1.0)", "end"),
    "one skew for both": (
        "wb_sum_outward(end, crowd->skew_upper, 1.0)",
        "wb_sum_outward(end, crowd->skew_lower, 1.0)",
    ),
    "only the first piece": ("wb_next_piece(crowd, j + 1, end, window, part)", "end"),
    "wrong piece at a boundary": ("if (next <= window[0]) continue;",
                                  "if (next <= window[1]) continue;"),
    "the last piece's gap": ("if (!(gap >= *smallest)) *smallest = gap;", "*smallest = gap;"),
    "bounds added up": ("if (gap > *largest) *largest = gap;",
                        "*largest = *largest > 0.0 ? *largest + gap : gap;"),
    "boxes of one segment": ("wb_window(&crowd, times[k], times[last], window);",
                             "wb_window(&crowd, times[k], times[k + 1], window);"),
    "boxes too far apart": ("return x * x + y * y > need;",
                            "return (x + y) * (x + y) > need;"),
}  # fmt: skip
_FUNCTION_FAULTS = {
    "growth dropped": ("radius + growth * t", "radius"),
    "growth of growth dropped": ("(0.5 * growth2) * (t * t)", "0.0 * t"),
    "motion dropped": ("drift * time", "drift * swept.times[0]"),
    "motion of the box dropped": ("(x + vx * times[1], y", "(x + vx * times[0], y"),
    "box of the first radius": ("radius = ca.fmax(*swept.radii)", "radius = swept.radii[0]"),
    "sign of the heading": ("for each in (c, s)]", "for each in (c, -s)]"),
    "sides exchanged": (
        "rectangle[3] * ca.fabs(along) + rectangle[4]",
        "rectangle[4] * ca.fabs(along) + rectangle[3]",
    ),
    "the later end": ("gap = (ca.fmin(first, last)", "gap = (ca.fmax(first, last)"),
    "half a box": ("half_length * c_size + half_width * s_size", "half_length * c_size"),
}


@pytest.mark.parametrize("fault", _C_FAULTS)
def test_a_fault_in_the_loop_is_caught(fault: str) -> None:
    old, new = _C_FAULTS[fault]
    assert old in kernel().source
    assert escapes(CompiledSeparation(SEGMENTS, source=kernel().source.replace(old, new)))[0] > 0


@pytest.mark.parametrize("fault", _FUNCTION_FAULTS)
def test_a_fault_in_the_functions_is_caught(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = _FUNCTION_FAULTS[fault]
    text = inspect.getsource(person_gap)
    assert old in text
    mutant = ModuleType("mutant")
    monkeypatch.setitem(sys.modules, "mutant", mutant)
    exec(compile(text.replace(old, new), "mutant", "exec"), vars(mutant))
    source = alone_source(SEGMENTS, mutant.separation_functions())
    assert escapes(CompiledSeparation(SEGMENTS, source=source))[0] > 0


def test_skew_reaches_both_ends() -> None:
    towards, away = intent(disc(-1.0, 6.0, -1.0)), intent(disc(-1.0, 4.0, 1.0))
    # Beside the car, 1 m wide, radius 0.5; at time 0 both are at 5 m.
    assert claimed(towards).clearance_m == pytest.approx(3.4, abs=1e-9)
    assert claimed(away).clearance_m == pytest.approx(3.5, abs=1e-9)
    assert claimed(towards, skew=(0.0, 0.3)).clearance_m == pytest.approx(3.1, abs=1e-9)
    assert claimed(away, skew=(-0.3, 0.0)).clearance_m == pytest.approx(3.2, abs=1e-9)
    assert claimed(towards, skew=(-0.5, -0.3)).clearance_m == pytest.approx(3.7, abs=1e-9)


def test_a_piece_counts_from_its_start_until_the_next() -> None:
    near_late = intent(disc(-1.0, 9.0), disc(0.05, 4.0), disc(0.07, 9.0))
    assert claimed(near_late).clearance_m == pytest.approx(2.5, abs=1e-9)
    assert claimed(near_late, times=(0.0, 0.05)).clearance_m == pytest.approx(2.5, abs=1e-9)
    assert claimed(near_late, times=(0.0, 0.0499)).clearance_m == pytest.approx(7.5, abs=1e-9)
    # At 0.07 the third piece holds, and no longer the second.
    assert claimed(near_late, times=(0.07, 0.1)).clearance_m == pytest.approx(7.5, abs=1e-9)
    before = math.nextafter(0.07, 0.0)
    assert claimed(near_late, times=(before, 0.1)).clearance_m == pytest.approx(2.5, abs=1e-9)


@pytest.mark.parametrize(
    ("from_s", "until_s", "skew", "cause"),
    [
        (0.0, 0.1, (0.0, 0.0), KernelCause.PROVED),
        (0.0, math.nextafter(0.1, 0.0), (0.0, 0.0), KernelCause.NOT_PREDICTED),
        (5e-324, 0.1, (0.0, 0.0), KernelCause.NOT_PREDICTED),
        (0.0, 0.1, (0.0, 1e-9), KernelCause.NOT_PREDICTED),
        (0.0, 0.1, (0.0, 5e-324), KernelCause.NOT_PREDICTED),
        (0.0, 0.1, (-5e-324, 0.0), KernelCause.NOT_PREDICTED),
        (-0.5, 0.625, (-0.5, 0.5), KernelCause.PROVED),
    ],
)
def test_outside_of_its_time_a_tube_clears_nothing(
    from_s: float, until_s: float, skew: tuple[float, float], cause: KernelCause
) -> None:
    found = claimed(intent(disc(from_s, 50.0), until_s=until_s), skew=skew)
    assert found.cause is cause
    assert (found.clearance_m > 0.0) == (cause is KernelCause.PROVED)
    if cause is not KernelCause.PROVED:
        assert found == Nearest(-NO_CLEARANCE_M, 0.0, 0, 0, KernelCause.NOT_PREDICTED)


def test_the_window_is_rounded_outward_and_exact_sums_stay() -> None:
    assert people_window(0.25, 0.5, (-0.25, 0.25)) == (0.0, 0.75)
    low, high = people_window(0.1, 0.2, (-1e-20, 1e-20))
    assert low < 0.1
    assert high > 0.2


def test_the_better_bound_counts_and_the_worse_one_alone_does_not() -> None:
    seen = Guard(0.0, Disc(0.0, 6.0, 0.3), Disc(0.0, 0.0, 0.1), MotionLimits(2.0, 1.0))
    tube = guard_disc(seen, from_s=-0.5, until_s=9.0)
    clearances = []
    for bounds in (tube.bounds, tube.bounds[:1], tube.bounds[1:]):
        person = TrackedPerson("p", (dataclasses.replace(tube, bounds=bounds),))
        for start in (0.0, 4.0):
            answer = nearest_people(
                [person], times_s=np.array([start, start + 0.1]), rectangles=STANDING,
                kinds=BOTH - INTENT, skew_s=(0.0, 0.0),
            )  # fmt: skip
            clearances.append(answer[TubeKind.GUARD].clearance_m)
    both, accelerated, fast = clearances[:2], clearances[2:4], clearances[4:]
    assert both == [max(pair) for pair in zip(accelerated, fast, strict=True)]
    assert accelerated[0] > fast[0]
    assert accelerated[1] < fast[1]


def test_the_nearest_tube_of_the_nearest_person_is_named() -> None:
    far, near = disc(-1.0, 9.0), disc(-1.0, 4.0)
    pair = TrackedPerson("b", tuple(intent(each).tubes[0] for each in (far, near, far)))
    found = claimed(intent(far), pair, intent(far), times=(0.0, 0.1, 0.2))
    assert (found.person, found.tube, found.time_s) == (1, 1, 0.0)
    coming = intent(disc(-1.0, 5.0, -0.5))
    found = claimed(intent(far), coming, times=(0.0, 0.1, 0.2, 0.3))
    assert (found.person, found.tube, found.time_s) == (1, 0, 0.2)


def test_nobody_is_clear_and_somebody_without_such_a_tube_is_not() -> None:
    for kinds in (INTENT, BOTH):
        rest = {"times_s": np.array([0.0, 0.1]), "rectangles": STANDING, "kinds": kinds,
                "skew_s": (0.0, 0.0)}  # fmt: skip
        empty = nearest_people([], **rest)  # type: ignore[arg-type]
        assert empty == asked([], **rest)
        assert empty[TubeKind.INTENT] == Nearest(
            NO_CLEARANCE_M, 0.0, None, None, KernelCause.PROVED
        )
        only = nearest_people([intent(disc(-1.0, 9.0))], **rest)  # type: ignore[arg-type]
        assert only == asked([intent(disc(-1.0, 9.0))], **rest)
        assert only[TubeKind.INTENT].clearance_m > 0.0
        assert only[TubeKind.GUARD].clearance_m == -NO_CLEARANCE_M
        expected = KernelCause.NOT_PREDICTED if TubeKind.GUARD in kinds else KernelCause.NOT_ASKED
        assert only[TubeKind.GUARD].cause is expected
