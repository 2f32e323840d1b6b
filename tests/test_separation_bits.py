"""Separation on the desk and in C has the same bits, at full capacity, and no garbage is clear."""

from __future__ import annotations

import dataclasses
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from person_cases import (
    BOTH,
    INTENT,
    SEGMENTS,
    STANDING,
    Array,
    asked,
    claimed,
    disc,
    intent,
    kernel,
    random_person,
    random_rectangles,
)

from workbench.codegen.compiler import FLAGS, find_compiler
from workbench.codegen.separation_source import CompiledSeparation
from workbench.errors import InputError
from workbench.reach.person_clearance import Nearest, nearest_people
from workbench.runtime.layout import NO_CLEARANCE_M, KernelCause
from workbench.runtime.person_guard import Disc, Guard, MotionLimits, guard_disc
from workbench.runtime.person_tubes import (
    FOREVER_S,
    MOST_PEOPLE,
    MOST_PIECES,
    MOST_TUBES,
    DiscPiece,
    PersonTube,
    TrackedPerson,
    TubeKind,
)

UNOPTIMISED = tuple("-O0" if flag == "-O2" else flag for flag in FLAGS)


@pytest.fixture(scope="module")
def slow() -> CompiledSeparation:
    return CompiledSeparation(SEGMENTS, flags=UNOPTIMISED)


@pytest.fixture(scope="module")
def patient() -> CompiledSeparation:
    """A kernel that looks at every tube in every segment."""
    old = "return x * x + y * y > need;"
    return CompiledSeparation(
        SEGMENTS, source=kernel().source.replace(old, "return 0.0 * (x + y) > need;")
    )


def scenes(count: int, segments: int) -> list[dict[str, object]]:
    rng = np.random.default_rng(9)
    return [
        {
            "people": [random_person(rng, i) for i in range(rng.integers(0, 5))],
            "times_s": np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.2, segments))]),
            "rectangles": random_rectangles(rng, segments),
            "kinds": [BOTH, INTENT, BOTH - INTENT][k % 3],
            "skew_s": tuple(sorted(rng.uniform(-0.2, 0.2, 2))),
        }
        for k in range(count)
    ]


def test_desk_and_kernel_have_the_same_bits(slow: CompiledSeparation) -> None:
    proved = 0
    for scene in scenes(60, 8):
        desk = nearest_people(**scene)  # type: ignore[arg-type]
        query = kernel().query(**scene)  # type: ignore[arg-type]
        assert desk == kernel().nearest(query)
        assert np.array_equal(kernel().call(query)[1].view(np.int64),
                              slow.call(query)[1].view(np.int64))  # fmt: skip
        proved += sum(each.cause is KernelCause.PROVED for each in desk.values())
    assert proved > 60


def test_optimised_and_not_have_the_same_bits_over_long_runs(slow: CompiledSeparation) -> None:
    for scene in scenes(300, 40):
        query = kernel().query(**scene)  # type: ignore[arg-type]
        assert np.array_equal(kernel().call(query)[1].view(np.int64),
                              slow.call(query)[1].view(np.int64))  # fmt: skip


def test_skipping_what_is_far_changes_no_answer(patient: CompiledSeparation) -> None:
    for scene in scenes(150, 20):
        query = kernel().query(**scene)  # type: ignore[arg-type]
        fast, all_of_them = kernel().call(query)[1], patient.call(query)[1]
        assert fast == pytest.approx(all_of_them, rel=0, abs=1e-12)


def full_house() -> list[TrackedPerson]:
    rng = np.random.default_rng(2)
    people = []
    for i in range(MOST_PEOPLE):
        tubes = []
        for kind in (TubeKind.INTENT, TubeKind.GUARD, TubeKind.INTENT, TubeKind.GUARD)[:MOST_TUBES]:
            starts = np.linspace(-1.0, 0.5, MOST_PIECES)
            pieces = tuple(
                DiscPiece(float(s), *rng.uniform(5, 15, 2), *rng.uniform(-1, 1, 2), 0.3, 0.1, 0.1)
                for s in starts
            )  # fmt: skip
            tubes.append(PersonTube(kind, (pieces,), FOREVER_S))
        people.append(TrackedPerson(f"p{i}", tuple(tubes)))
    return people


def test_full_capacity_is_judged_and_more_is_refused() -> None:
    people = full_house()
    rest = {"times_s": np.array([0.0, 0.2, 0.4]), "rectangles": np.repeat(STANDING, 2, axis=0),
            "kinds": BOTH, "skew_s": (0.0, 0.1)}  # fmt: skip
    alone = [nearest_people([person], **rest) for person in people[-2:]]  # type: ignore[arg-type]
    query = kernel().query(people, **rest)  # type: ignore[arg-type]
    whole = kernel().nearest(query)
    for kind in TubeKind:
        assert 0.0 < whole[kind].clearance_m <= min(answer[kind].clearance_m for answer in alone)
        again = nearest_people([people[whole[kind].person or 0]], **rest)[kind]  # type: ignore[arg-type]
        assert again.clearance_m == whole[kind].clearance_m
        assert (again.tube, again.time_s) == (whole[kind].tube, whole[kind].time_s)
    for i, value in ((0, 33.0), (1, 129.0), (5, SEGMENTS + 1.0), (4, 4.0)):
        broken = query.copy()
        broken[i] = value
        code, result = kernel().call(broken)
        assert code == 1
        assert max(result[0], result[5]) == -NO_CLEARANCE_M


HOSTILE = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1.7976931348623157e308)


@pytest.mark.parametrize("value", HOSTILE)
def test_a_number_that_is_none_is_never_clear(value: float) -> None:
    guard = guard_disc(
        Guard(0.0, Disc(0.0, 9.0, 0.3), Disc(0.0, 0.0, 0.1), MotionLimits(2.0, 1.0)),
        from_s=-0.5, until_s=9.0,
    )  # fmt: skip
    people = [TrackedPerson("p", (*intent(disc(-1.0, 9.0), disc(0.05, 8.0)).tubes, guard))]
    rest = {"times_s": np.array([0.0, 0.1, 0.2]), "rectangles": np.repeat(STANDING, 2, axis=0),
            "kinds": BOTH, "skew_s": (-0.1, 0.1)}  # fmt: skip
    query = kernel().query(people, **rest)  # type: ignore[arg-type]
    assert all(each.clearance_m > 0.0 for each in kernel().nearest(query).values())
    rows = [range(6 + 3), range(7 + SEGMENTS, 7 + SEGMENTS + 10)]
    tubes = 7 + 6 * SEGMENTS
    rows += [range(tubes, tubes + 10)]
    pieces = tubes + 5 * MOST_PEOPLE * MOST_TUBES
    rows += [range(pieces, pieces + 6 * 9)]
    for i in (i for row in rows for i in row):
        broken = query.copy()
        broken[i] = value
        code, result = kernel().call(broken)
        assert code == 1 or min(result[0], result[5]) < 0.0, i


@pytest.mark.parametrize("value", [5e-324, -5e-324, 2.2e-308, -0.0])
def test_denormal_numbers_are_numbers(value: float) -> None:
    for number in range(1, 8):
        piece = dataclasses.replace(disc(-1.0, 5.0))
        numbers = list(piece.numbers)
        if number not in (2, 5):
            numbers[number] = value
        if numbers[5] < 0.0 or numbers[7] < 0.0:
            continue
        found = claimed(intent(DiscPiece(*numbers)))
        assert found.clearance_m == pytest.approx(3.5, abs=1e-9)
    in_the_car = claimed(intent(DiscPiece(-1.0, 0.0, value, 0.0, value, 0.5, 0.0, 0.0)))
    assert in_the_car.clearance_m < 0.0


def test_a_rectangle_that_is_unknown_is_never_clear() -> None:
    rows = np.array([[0.0, 0.0, 0.0, 2.0, 1.0], [math.nan] * 5])
    rest = {"times_s": np.array([0.0, 0.1, 0.2]), "kinds": INTENT, "skew_s": (0.0, 0.0)}
    answer = nearest_people([intent(disc(-1.0, 9.0))], rectangles=rows, **rest)  # type: ignore[arg-type]
    assert answer == asked([intent(disc(-1.0, 9.0))], rectangles=rows, **rest)
    assert answer[TubeKind.INTENT] == Nearest(-NO_CLEARANCE_M, 0.1, 0, 0, KernelCause.NOT_COMPUTED)


def test_random_numbers_everywhere_are_never_clear_of_somebody_in_the_car() -> None:
    """One to three numbers of the first person are garbage; the second stands in the car."""
    rng = np.random.default_rng(12)
    people = [intent(disc(-1.0, 9.0)), intent(disc(-1.0, 0.0))]
    query = kernel().query(
        people, times_s=np.array([0.0, 0.1]), rectangles=STANDING, kinds=INTENT, skew_s=(0.0, 0.0)
    )
    tubes = 7 + 6 * SEGMENTS
    pieces = tubes + 5 * MOST_PEOPLE * MOST_TUBES
    places = [*range(tubes, tubes + 5), *range(pieces, pieces + 9)]
    for _ in range(2000):
        broken = query.copy()
        bits = rng.integers(-(2**63), 2**63 - 1, 3, dtype=np.int64).view(np.float64)
        broken[rng.choice(places, 3)] = np.where(rng.random(3) < 0.5, bits, rng.integers(-2, 5, 3))
        code, result = kernel().call(broken)
        assert code == 1 or result[0] < 0.0


def test_the_hand_written_text_compiles_without_a_warning(tmp_path: Path) -> None:
    (tmp_path / "kernel.c").write_text(kernel().source)
    # CasADi's own functions leave a parameter unused.
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror",
             "-Wno-unused-parameter", "-c", "kernel.c", "-o", "kernel.o"]  # fmt: skip
    done = subprocess.run([find_compiler(), *flags], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_more_rectangles_than_fit_are_refused() -> None:
    rows: Array = np.repeat(STANDING, SEGMENTS + 1, axis=0)
    with pytest.raises(InputError, match="at most 60 rectangles, got 61"):
        kernel().query([], times_s=np.arange(SEGMENTS + 2.0), rectangles=rows, kinds=BOTH,
                       skew_s=(0.0, 0.0))  # fmt: skip
