"""Claim: at poles, blow-ups, knees and extreme sizes a tube contains, or ends where it says."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from tube_cases import box, disturbed, system_of

from workbench.errors import InputError
from workbench.models import Ranged
from workbench.reach import ReachTube, TubeStatus, compute_tube
from workbench.reach.validated.tube import ValidatedTube
from workbench.sets import Box

cases = pytest.importorskip("validated_cases", reason="python-flint is not installed")
flint = pytest.importorskip("flint", reason="python-flint is not installed")

FORMS = {form.name: form for form in (*cases.SMOOTH, *cases.PLANAR, *cases.KINKED)}


def tube_from(name: str, start: Box, horizon_s: float, *, step_s: float = 0.05) -> ReachTube:
    """The tube of a closed form from another set; what it misses is an error here."""
    form = FORMS[name]
    moved = cases.ClosedForm(name, form.system, start, form.solution, horizon_s)
    tube: ReachTube = moved.tube(step_s=step_s)
    assert cases.escapes(tube, moved, cases.points(start, 5), per_row=3) == []
    return tube


def test_a_blow_up_ends_the_tube_before_it() -> None:
    tube = tube_from("square", box(x=(0.9, 1.1)), 2.0)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert 0.7 < tube.times[-1] < 1 / 1.1
    assert f"{tube.times[-1]:.6g}" in tube.message


def test_a_pole_of_tan_ends_the_tube_before_it() -> None:
    tube = tube_from("tangent", box(x=(1.1, 1.3)), 1.0)
    assert tube.status is TubeStatus.SINGULAR
    assert tube.times[-1] < -math.log(math.sin(1.3))
    through = system_of(lambda x, y: [1.0, ca.tan(x)], "x", "y")
    tube = compute_tube(through, initial_set=box(x=(1.0, 1.0), y=(0.0, 0.0)), horizon_s=1.0)
    assert tube.status is TubeStatus.SINGULAR
    assert 1.5 < 1.0 + tube.times[-1] < math.pi / 2
    assert tube.message


@pytest.mark.parametrize(
    "field", [lambda x: 1 / x, ca.log, lambda x: ca.sqrt(x) / x, lambda x: x**-0.3]
)
def test_a_set_with_a_pole_has_only_its_start(field: Callable[[ca.SX], ca.SX]) -> None:
    system = system_of(lambda x: [field(x)], "x")
    tube = compute_tube(system, initial_set=box(x=(-0.1, 0.2)), horizon_s=1.0)
    assert tube.status is TubeStatus.SINGULAR
    assert (len(tube.times), tube.lower.shape, tube.upper_at.tolist()) == (1, (0, 1), [[0.2]])
    assert tube.kinks is not None
    assert tube.message


def test_a_wide_argument_of_an_entire_function_is_no_pole() -> None:
    decay = system_of(lambda x, y: [-0.1 * x, 0.5 * ca.atan(x) - 0.3 * y], "x", "y")
    tube = compute_tube(decay, initial_set=box(x=(-0.8, 0.8), y=(0.0, 0.0)), horizon_s=3.0)
    assert tube.complete
    # |y(3)| <= (1 - e^-0.9) / 0.6 * max |atan|, and twice that bounds a tube worth having.
    assert tube.upper_at[-1, 1] < 2.0 * math.atan(0.8) * (1.0 - math.exp(-0.9)) / 0.6


def test_a_proof_that_needs_ever_shorter_steps_ends_soon() -> None:
    # x = 1 / (1 / x0 - t): within each grid interval the steps shrink with the distance to 1 / x0.
    tube = tube_from("square", box(x=(0.99999, 1.0)), 1.5)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert tube.times[-1] < 1.0


def test_a_region_over_an_unknown_state_is_refused() -> None:
    form = FORMS["oscillator"]
    method = ValidatedTube(0.05, 2, region=box(q=(0.0, 1.0)))
    with pytest.raises(InputError, match=r"region over states .*got q"):
        compute_tube(form.system, initial_set=form.start, horizon_s=1.0, method=method)


def test_a_tube_that_leaves_the_region_ends_inside() -> None:
    method = ValidatedTube(0.05, 2, region=box(y=(-0.3, 1.5)))
    form = FORMS["oscillator"]
    tube = compute_tube(form.system, initial_set=form.start, horizon_s=4.0, method=method)
    assert tube.status is TubeStatus.LEFT_REGION
    assert np.all(tube.lower[:, 1] >= -0.3)
    assert 0.1 < tube.times[-1] < math.asin(0.3)
    wide = ValidatedTube(0.05, 2, region=box(x=(-2.0, 2.0)))
    assert compute_tube(form.system, initial_set=form.start, horizon_s=4.0, method=wide).complete


@pytest.mark.parametrize("horizon_s", [1e-300, 1e-12, 0.05 * (1 + 1e-15), 0.1499999999])
def test_any_short_horizon_is_reached_exactly(horizon_s: float) -> None:
    tube = tube_from("square", box(x=(0.2, 0.9)), horizon_s)
    assert tube.complete
    assert tube.times[-1] == horizon_s


def test_a_contracting_flow_goes_on_for_a_long_time() -> None:
    tube = tube_from("decay", box(x=(0.9, 1.1)), 200.0, step_s=5.0)
    assert tube.complete
    assert np.all(np.abs([tube.lower_at[-1], tube.upper_at[-1]]) < 1e-80)


@pytest.mark.parametrize(
    "interval",
    [
        (0.0, 0.0),
        (-0.0, 0.0),
        (0.5, 0.5 + 2**-53),
        (0.0, 5e-324),
        (-1e-310, 1e-310),
        (1e-300, 1.1e-300),
        (-1e300, 1e300),
        (1e-160, 0.5),
    ],
)
@pytest.mark.parametrize("name", ["decay", "sine", "absolute value", "clip"])
def test_sets_of_every_size_are_contained(name: str, interval: tuple[float, float]) -> None:
    if name != "decay" and interval[1] > 1e100:
        interval = (-1.5, 1.5)
    tube = tube_from(name, box(x=interval), 0.4)
    assert tube.complete
    assert np.all(tube.lower_at[0] == interval[0])
    assert np.all(tube.upper_at[0] == interval[1])


KNEES = {
    "clip": [(1.0, 1.0), (1.0, 1.3), (0.7, 1.0), (-1.0, 1.0), (1.0, 1.0 + 2**-52), (-3.0, 3.0)],
    "absolute value": [(0.0, 0.3), (-0.3, 0.0), (-1e-300, 1e-300), (0.0, 2**-1074)],
    "two rates": [(0.0, 0.0), (0.0, 0.5), (-0.5, 0.0)],
}


@pytest.mark.parametrize(("name", "interval"), [(n, i) for n, all_ in KNEES.items() for i in all_])
def test_sets_that_begin_at_a_knee_are_contained(name: str, interval: tuple[float, float]) -> None:
    assert tube_from(name, box(x=interval), 1.0).complete


def test_a_knee_that_is_met_by_a_disturbance_alone() -> None:
    """x' = fmin(w, 0.5 w) and every |w| <= 1: from -1 t to 0.5 t."""
    system = disturbed(
        lambda x, p, w: [ca.fmin(w[0], 0.5 * w[0])],
        ("x",),
        disturbances=(Ranged.symmetric("w", "", 1.0),),
    )
    tube = compute_tube(system, initial_set=box(x=(0.0, 0.0)), horizon_s=1.0)
    assert np.all(tube.lower_at[:, 0] <= -tube.times)
    assert np.all(tube.upper_at[:, 0] >= 0.5 * tube.times)
    assert tube.upper_at[-1, 0] < 1.0


def test_limits_that_parameters_make_are_rounded_outward() -> None:
    """floor = a b - c loses all its digits in doubles: 5.6e-17 instead of 2.8e-17."""
    parameters = tuple(Ranged.exactly(n, "", v) for n, v in (("a", 0.1), ("b", 3.0), ("c", 0.3)))
    system = disturbed(
        lambda x, p, w: [ca.fmin(ca.fmax(x[0] - 1e3, p[0] * p[1] - p[2]), 100.0)],
        ("x",),
        parameters=parameters,
    )
    tube = compute_tube(system, initial_set=box(x=(0.0, 0.0)), horizon_s=1.0)
    with cases.precise():
        exact = flint.arb(0.1) * 3 - flint.arb(0.3)
        assert exact > float(tube.lower_at[-1, 0])
        assert exact < float(tube.upper_at[-1, 0])


def test_a_driver_beyond_every_limit_is_refused_or_contained() -> None:
    """A one-sided kink is a clip at -1e300 inside; x' = -2 x must not become x' = -1."""
    system = system_of(lambda x: [ca.fmin(-2e300 * x, 0.0) * 1e-300], "x")
    tube = compute_tube(system, initial_set=box(x=(0.9, 1.0)), horizon_s=0.2)
    low = 0.9 * np.exp(-2 * tube.times)
    assert np.all(tube.lower_at[:, 0] <= low * (1 + 1e-12))


def test_a_parabola_of_tiny_coefficients_keeps_its_minimum() -> None:
    system = system_of(lambda x, y: [1e-170 * (y + y * y), 0 * y], "x", "y")
    tube = compute_tube(system, initial_set=box(x=(0.0, 0.0), y=(-1.0, 1.0)), horizon_s=1.0)
    assert tube.lower_at[-1, 0] <= -0.25e-170


@pytest.mark.parametrize(
    ("interval", "within"), [((0.5, 0.9), True), ((-0.9, 0.9), True), ((0.5, 1.1), False)]
)
def test_unsaturated_is_said_of_sets_within_the_limits_alone(
    interval: tuple[float, float], within: bool
) -> None:
    tube = tube_from("clip", box(x=interval), 0.3)
    assert tube.kinks is not None
    assert tube.kinks.unsaturated is within


def test_sets_of_one_batch_are_the_sets_one_by_one() -> None:
    form = FORMS["sine"]
    starts = [box(x=(0.3, 0.4)), box(x=(0.4, 0.4)), box(x=(0.1, 0.9))]
    together = ValidatedTube().tubes(form.system, initial_sets=starts, horizon_s=0.5)
    for start, tube in zip(starts, together, strict=True):
        moved = cases.ClosedForm("sine", form.system, start, form.solution, 0.5)
        assert cases.escapes(tube, moved, cases.points(start, 3)) == []
        alone = compute_tube(form.system, initial_set=start, horizon_s=0.5)
        assert np.allclose(alone.upper_at, tube.upper_at, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: ValidatedTube(0.0),
        lambda: ValidatedTube(math.nan),
        lambda: ValidatedTube(0.1, 0),
        lambda: ValidatedTube(0.1, 5),
        lambda: FORMS["decay"].tube(step_s=-1.0),
        lambda: tube_from("decay", box(x=(0.0, 1.0)), math.inf),
        lambda: tube_from("decay", box(x=(0.0, 1.0)), 0.0),
        lambda: tube_from("decay", box(y=(0.0, 1.0)), 1.0),
    ],
)
def test_misuse_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
