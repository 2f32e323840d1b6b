"""An online kernel that forgets a term of its proof is caught: by an escaping run, by an exact
solution, or by the law that the term obeys."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
import test_online_parts as parts
from online_cases import CASES, Case, Change, Edit, compiled, derived, functions_of, seen, steps_of
from online_faults import TEXT_FAULTS, UNSEEN, TextFault, negated, without
from tube_cases import box, system_of

from workbench.bench.containment import bounds_at
from workbench.reach import TubeStatus

_ALLOWANCE = 1e-12


def clearance(
    name: str, *, quadratic: bool, edit: Edit | None = None, change: Change | None = None
) -> float:
    """Least distance of the runs seen to the tube of a (changed) kernel; negative: an escape."""
    case, runs = CASES[name], seen(name)
    functions = functions_of(name, quadratic=quadratic)
    functions = change(functions) if change else functions
    kernel = compiled(functions, steps=steps_of(case.horizon_s, case.step_s), edit=edit)
    tube = kernel.tube(case.initial_set, horizon_s=case.horizon_s, step_s=case.step_s)
    lower, upper = bounds_at(tube, runs.times)
    return float(np.min(np.minimum(runs.low - lower, upper - runs.high)))


def used() -> list[tuple[str, bool]]:
    return sorted({(fault.case, fault.quadratic) for fault in TEXT_FAULTS.values()})


@pytest.mark.parametrize(("name", "quadratic"), used())
def test_without_a_fault_nothing_escapes(name: str, quadratic: bool) -> None:
    assert clearance(name, quadratic=quadratic) > -1e-13


@pytest.mark.parametrize("fault", TEXT_FAULTS.values(), ids=TEXT_FAULTS.keys())
def test_a_planted_fault_in_the_text_lets_a_run_escape(fault: TextFault) -> None:
    assert clearance(fault.case, quadratic=fault.quadratic, edit=fault.plant) < -_ALLOWANCE


@pytest.mark.parametrize(
    ("part", "output", "wrong", "name", "quadratic"),
    [
        ("majorant", "third", without, "pendulum", False),
        ("majorant", "input_rate", without, "bilinear", False),
        ("majorant", "curvature", without, "turning", False),
        ("majorant", "taylor_x", without, "turning", False),
        ("inputs", "by_input", without, "pendulum", False),
        ("second", "hessian", without, "riccati", False),
        ("second", "source", negated, "riccati", True),
        ("second", "bent_source", negated, "swinging", True),
        ("source", "rate", without, "riccati", False),
        ("advance", "rates", without, "pendulum", False),
        ("drivers", "gradient", without, "saturated", False),
    ],
)
def test_a_function_without_one_result_lets_a_run_escape(
    part: str, output: str, wrong: Change, name: str, quadratic: bool
) -> None:
    found: ca.Function = getattr(functions_of(name, quadratic=quadratic), part)
    spoilt = wrong(found, output)  # type: ignore[call-arg]
    gap = clearance(
        name, quadratic=quadratic,
        change=lambda functions: dataclasses.replace(functions, **{part: spoilt}),  # type: ignore[arg-type]
    )  # fmt: skip
    assert gap < -_ALLOWANCE


@pytest.mark.parametrize("quadratic", [False, True])
def test_every_bound_of_the_majorant_is_held_against_an_exact_quantity(
    quadratic: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With any one of them dropped, a law of test_online_parts fails in one of its systems."""
    whole = parts.premise
    names = set(parts.WHICH) | ({"bend_linear", "response", "source_bend", "source_turn"}
                                if quadratic else {"bend_rest", "second_bend"})  # fmt: skip
    for dropped in sorted(names):

        def premise(*arguments: object, key: str = dropped, **more: object) -> parts.Premise:
            at = whole(*arguments, **more)  # type: ignore[arg-type]
            return dataclasses.replace(at, bounds={**at.bounds, key: 0.0 * at.bounds[key]})

        monkeypatch.setattr(parts, "premise", premise)
        found = {
            key
            for name in ("curved limit", "forced", "pushed limit")
            for seed in range(3)
            for key in parts.dominated(name, seed, quadratic=quadratic)
        }
        caught = {dropped, dropped.replace("_linear", "")} & found
        assert caught, dropped


def test_a_dropped_rounding_budget_misses_the_exact_solution() -> None:
    """x' = 0.3: every step rounds x to the same side."""
    system = system_of(lambda x: [0.3 + 0 * x], "x")
    case = Case(system, box(x=(0.0, 0.0)), 1.0, region=2e3)
    functions = derived(case.system, case.initial_set, case.step_s, False, case.region)

    edit = TextFault(r"\+ m->round\[i\]\) \* WB_UP", ") * WB_UP", "", False).plant
    for change, misses in ((None, False), (edit, True)):
        kernel = compiled(functions, steps=120, edit=change)
        tube = kernel.tube(box(x=(1024.0, 1024.0)), horizon_s=12.0, step_s=0.1)
        assert tube.status is TubeStatus.COMPLETE
        outside = [
            not Fraction(low) <= Fraction(1024) + Fraction(0.3) * k * Fraction(0.1) <= Fraction(up)
            for k, (low, up) in enumerate(
                zip(tube.lower_at[:-1, 0], tube.upper_at[:-1, 0], strict=True)
            )
        ]
        assert any(outside) == misses


def test_a_tube_that_leaves_the_region_says_so() -> None:
    """Where its budget does not hold the kernel may not go on; without the check it would."""
    case = CASES["turning"]
    functions = derived(case.system, case.initial_set, case.step_s, False, 1.01)
    start = box(x=(0.9, 0.99), y=(0.5, 0.6))
    for edit, status in (
        (None, TubeStatus.LEFT_REGION),
        (lambda s: s.replace("return wb_in_region(s) ?", "return 1 ?"), TubeStatus.COMPLETE),
    ):
        kernel = compiled(functions, steps=20, edit=edit)
        assert kernel.tube(start, horizon_s=1.0, step_s=0.1).status is status


def test_a_pattern_that_fits_nowhere_is_no_silent_pass() -> None:
    with pytest.raises(LookupError, match="adapt the table"):
        TextFault("no such text", "", "riccati", False).plant("text")
    assert UNSEEN
