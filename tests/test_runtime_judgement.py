"""What is not judged claims nothing for no time, and a status that does not exist is a fault."""

from __future__ import annotations

import math
import struct

import pytest

from workbench.claims import Verdict
from workbench.runtime.bundle import Result
from workbench.runtime.contents import Field
from workbench.runtime.judgement import (
    CannotJudgeError,
    KernelFaultError,
    Question,
    farthest_m,
    judge,
    unjudged,
)
from workbench.runtime.layout import KernelStatus
from workbench.runtime.policies import Ground, Watched
from workbench.sets import Box

QUESTION = Question(
    (Box(("speed",), (0.0,), (1.0,)),), 0, (), 0.5, (0.0, 0.1), 9, Watched(0.0, 0.0, 9.0),
    (0.1, 0.2), None,
)  # fmt: skip


def said(status: float, *, code: int = 0, spent: float = 0.0) -> Result:
    fields = {"status": Field("status", 0, 1, None), "spent": Field("spent", 1, 1, None)}
    return Result(code, struct.pack("2d", status, spent), fields)


def test_what_is_not_judged_holds_for_no_time_and_excludes_nothing() -> None:
    found = unjudged("why", Ground.REGION)
    for answer in (found.track_intent, found.brake_intent, found.brake_guard):
        assert (answer.verdict, answer.reason) == (Verdict.INVALID, "invalid: why")
        assert (answer.holds_s, answer.ground) == (0.0, Ground.REGION)
        assert answer.clearance_m is None
    stop = found.stop_guard
    assert (tuple(stop.tube.times_s), stop.farthest_m) == ((0.0,), math.inf)
    # No instant lies in this interval, so that it covers none that is needed.
    assert stop.switch_s == (math.inf, -math.inf)


@pytest.mark.parametrize("status", [-1.0, max(KernelStatus) + 1.0, 0.5, math.nan])
def test_a_status_that_does_not_exist_is_a_fault_of_the_kernel(status: float) -> None:
    with pytest.raises(KernelFaultError, match="status"):
        judge(said(status), QUESTION)


@pytest.mark.parametrize("status", [each for each in KernelStatus if each.name != "COMPLETE"])
def test_of_the_whole_query_only_bad_input_is_no_fault(status: KernelStatus) -> None:
    bad = status is KernelStatus.BAD_INPUT
    with pytest.raises(CannotJudgeError if bad else KernelFaultError, match=status.text):
        judge(said(status), QUESTION)


@pytest.mark.parametrize("code", [-1, 1])
def test_a_kernel_that_refuses_is_a_fault(code: int) -> None:
    with pytest.raises(KernelFaultError, match=f"code {code}"):
        judge(said(KernelStatus.COMPLETE, code=code), QUESTION)


@pytest.mark.parametrize("spent", [-1.0, 10.0])
def test_nobody_spends_more_than_the_budget_or_less_than_nothing(spent: float) -> None:
    with pytest.raises(KernelFaultError, match="spent"):
        judge(said(KernelStatus.COMPLETE, spent=spent), QUESTION)


@pytest.mark.parametrize("spent", [0.0, 9.0])
def test_nothing_and_all_of_the_budget_may_be_spent(spent: float) -> None:
    # What is asked for next is not in this result.
    with pytest.raises(KeyError, match="track"):
        judge(said(KernelStatus.COMPLETE, spent=spent), QUESTION)


def test_without_rectangles_nothing_is_far() -> None:
    assert farthest_m((), Watched(3.0, 4.0, 1.0)) == 0.0


def test_what_cannot_be_judged_says_its_reason_alone() -> None:
    error = CannotJudgeError("too fast", Ground.REGION)
    assert (str(error), error.ground) == ("too fast", Ground.REGION)
