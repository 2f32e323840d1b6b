"""The paper's tube holds runs like those its beta was learned from, loses them where that is too
small, claims no more than SAMPLED, and says where it cannot answer."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models import System, system_from_casadi
from workbench.models.benchmarks import all_benchmarks
from workbench.reach import LearnedTube, TubeStatus, compute_tube
from workbench.reach.learned.table import Shares, beta_table
from workbench.sensitivity import Discrepancy, LearnedExponential, learn_discrepancy
from workbench.sensitivity.sampling import rollout, uniform_states
from workbench.sets import Box

STEP_S = 0.05
B1 = next(each for each in all_benchmarks() if each.name == "B1")
WIDE = ("x", "y", "steering", "speed", "heading")
RNG = 5


@pytest.fixture(scope="module")
def learned() -> Discrepancy:
    method = LearnedExponential(pairs=3000, seed=1, step_s=STEP_S, delta=1e-6)
    return learn_discrepancy(B1.system, initial_set=B1.initial_set, horizon_s=3.0, method=method)


@dataclass(frozen=True)
class Scaled:
    """Another beta's half widths times a share, from some time on."""

    of: Discrepancy
    share: float
    from_s: float = 0.0

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        share = self.share if t_s >= self.from_s else 1.0
        return tuple(share * each for each in self.of.growth.half_widths(initial, t_s))


@dataclass(frozen=True)
class Decay:
    """The exact beta of x' = -x, y' = -2 y."""

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        return tuple(r * math.exp(-g * t_s) for r, g in zip(initial, (1.0, 2.0), strict=True))


def decay() -> System:
    x = ca.SX.sym("x", 2)
    return system_from_casadi(x, ca.vertcat(-x[0], -2.0 * x[1]), ("x", "y"))


def exact(region: Box | None = None) -> Discrepancy:
    return Discrepancy(("x", "y"), region, 2.0, "exact", Rigor.SAMPLED, "always", Decay())


def shares_outside(learned: Discrepancy, regions: dict[str, int]) -> float:
    """Of runs drawn as the beta's pairs were, the share that leaves the tube at some instant."""
    method = LearnedTube(learned, regions, STEP_S)
    tube = compute_tube(B1.system, initial_set=B1.initial_set, horizon_s=3.0, method=method)
    assert tube.complete
    assert tube.rigor is Rigor.SAMPLED
    box = B1.initial_set.reordered(tube.names)
    states = uniform_states(box, 4000, np.random.default_rng(RNG))
    runs = rollout(B1.system, states, horizon_s=3.0, step_s=STEP_S)
    inside = (runs >= tube.lower_at - 1e-12) & (runs <= tube.upper_at + 1e-12)
    return 1.0 - float(inside.all(axis=(1, 2)).mean())


@pytest.mark.parametrize("regions", [{}, dict.fromkeys(WIDE, 2)])
def test_runs_of_the_learning_distribution_stay_in_it(
    learned: Discrepancy, regions: dict[str, int]
) -> None:
    """Not for certain, and no statement says so: of 4000 runs at most 2 %."""
    assert shares_outside(learned, regions) <= 0.02


@pytest.mark.parametrize("from_s", [0.0, 1.5])
def test_a_beta_that_is_too_small_leaves_runs_outside(learned: Discrepancy, from_s: float) -> None:
    planted = dataclasses.replace(learned, growth=Scaled(learned, 0.4, from_s))
    assert shares_outside(planted, {}) > 0.2


@settings(deadline=None, max_examples=20)
@given(st.floats(0.0, 1.0), st.integers(1, 4), st.integers(1, 4))
def test_with_the_exact_beta_a_linear_tube_is_the_reachable_set(
    middle: float, along_x: int, along_y: int
) -> None:
    """x0 e^-t: whatever the regions, their union is the image of the set, to the solver's error."""
    box = Box(("x", "y"), (middle - 0.3, -0.2), (middle + 0.3, 0.4))
    method = LearnedTube(exact(), {"x": along_x, "y": along_y}, STEP_S)
    tube = compute_tube(decay(), initial_set=box, horizon_s=2.0, method=method)
    shrink = np.exp(-np.outer(tube.times, (1.0, 2.0)))
    assert np.allclose(tube.lower_at, shrink * box.lower, atol=1e-6)
    assert np.allclose(tube.upper_at, shrink * box.upper, atol=1e-6)
    assert np.array_equal(tube.lower, np.minimum(tube.lower_at[:-1], tube.lower_at[1:]))


def test_regions_are_of_the_union_not_of_its_hull() -> None:
    box = Box(("x", "y"), (0.0, 0.0), (1.0, 0.0))
    cells = LearnedTube(exact(), {"x": 4}, STEP_S).cells(decay(), initial_set=box, horizon_s=1.0)
    ends = [(cell.lower_at[0, 0], cell.upper_at[0, 0]) for cell in cells]
    assert np.allclose(ends, [(0.25 * k, 0.25 * (k + 1)) for k in range(4)])


def test_a_set_beyond_what_was_learned_has_no_row() -> None:
    region = Box(("x", "y"), (-1.0, -1.0), (1.0, 1.0))
    box = Box(("x", "y"), (0.0, 0.0), (0.1, 1.1))
    method = LearnedTube(exact(region), {}, STEP_S)
    tube = compute_tube(decay(), initial_set=box, horizon_s=1.0, method=method)
    assert tube.status is TubeStatus.LEFT_REGION
    assert (len(tube.times), len(tube.lower)) == (1, 0)
    assert "['y']" in tube.message


def test_a_simulation_that_explodes_ends_the_tube() -> None:
    x = ca.SX.sym("x", 2)
    explodes = system_from_casadi(x, ca.vertcat(x[0] ** 3, x[1]), ("x", "y"))
    box = Box(("x", "y"), (2.0, 0.0), (2.2, 0.1))
    method = LearnedTube(exact(), {}, STEP_S)
    tube = compute_tube(explodes, initial_set=box, horizon_s=2.0, method=method)
    assert tube.status is TubeStatus.ENCLOSURE_FAILED
    assert 0 < len(tube.lower) < 40
    assert np.isfinite(tube.upper_at).all()


def test_misuse_is_told(learned: Discrepancy) -> None:
    box = Box(("x", "y"), (0.0, 0.0), (1.0, 1.0))
    with pytest.raises(InputError, match="regions along"):
        LearnedTube(exact(), {"z": 2}, STEP_S)
    with pytest.raises(InputError, match="at most 64"):
        LearnedTube(exact(), {"x": 9, "y": 8}, STEP_S)
    with pytest.raises(InputError, match="expected a bound for the states"):
        LearnedTube(learned, {}, STEP_S).tube(decay(), initial_set=box, horizon_s=1.0)
    with pytest.raises(InputError, match="at most 2 s"):
        LearnedTube(exact(), {}, STEP_S).tube(decay(), initial_set=box, horizon_s=3.0)
    noisy = next(each for each in all_benchmarks() if each.name == "B2-noise")
    other = dataclasses.replace(learned, region=None, names=noisy.system.ode.names)
    with pytest.raises(InputError, match="one value each"):
        LearnedTube(other, {}, STEP_S).tube(
            noisy.system, initial_set=noisy.initial_set, horizon_s=1.0
        )


def test_tables_know_sums_maxima_and_what_is_neither(learned: Discrepancy) -> None:
    @dataclass(frozen=True)
    class Euclid:
        def half_widths(self, initial: tuple[float, ...], _t_s: float) -> tuple[float, ...]:
            return (math.hypot(*initial),) * len(initial)

    @dataclass(frozen=True)
    class Sum:
        def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
            return (initial[0] + t_s * initial[1], initial[1])

    table = beta_table(learned, horizon_s=3.0, step_s=STEP_S)
    assert table.shares is Shares.MAX
    unseen = [learned.names.index(name) for name in ("speed_integral", "offset_integral")]
    assert np.isinf(table.entries[:, :, unseen]).all()
    adds = dataclasses.replace(exact(), growth=Sum())
    found = beta_table(adds, horizon_s=1.0, step_s=STEP_S)
    assert found.shares is Shares.SUM
    assert found.half_widths(np.array([1.0, 2.0]), 10) == pytest.approx([1.0 + 0.5 * 2.0, 2.0])
    with pytest.raises(InputError, match="neither"):
        beta_table(dataclasses.replace(exact(), growth=Euclid()), horizon_s=1.0, step_s=STEP_S)
