"""The update of the particles is one function: NumPy, plain Python and C give the same result."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.codegen.compiler import compile_shared, find_compiler
from workbench.errors import InputError
from workbench.estimation.intent_cloud import (
    SOFTENING_M,
    Cloud,
    Draws,
    FilterSettings,
    Measured,
    NumpyUpdate,
    Update,
    _moved,
)
from workbench.estimation.intent_kernel import CompiledUpdate, kernel_source
from workbench.estimation.intent_plain import PlainUpdate
from workbench.estimation.potential_field import Field, Repulsion, field_step

FEW = dataclasses.replace(FilterSettings.chosen(), particles=7)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Update:
    try:
        find_compiler()
    except InputError:
        pytest.skip("needs a C compiler")
    library = tmp_path_factory.mktemp("kernel") / "intent.so"
    library.write_bytes(compile_shared(kernel_source()).shared_object)
    return CompiledUpdate(library)


def case(seed: int, *, goals: int, steps: int, m: int) -> tuple[Cloud, Draws, Measured]:
    rng = np.random.default_rng(seed)
    n, intents = FEW.particles, goals + 1
    cloud = Cloud(
        rng.standard_normal((intents, n, 2)), rng.standard_normal((intents, n, 2)),
        5.0 * rng.standard_normal((intents, n, 2)), rng.uniform(0.2, 2.5, (intents, n)),
    )  # fmt: skip
    weights = rng.dirichlet(np.ones(intents))
    measured = Measured(
        rng.standard_normal(2), float(rng.uniform(0.05, 3.0)), weights,
        5.0 * rng.standard_normal((goals, 2)), rng.uniform(0.3, 2.0, goals),
    )  # fmt: skip
    return cloud, Draws.of(rng, steps=steps, intents=intents, n=n, m=m), measured


def same(first: tuple[Cloud, np.ndarray], second: tuple[Cloud, np.ndarray]) -> None:
    for name in ("place", "velocity", "aim", "speed"):
        np.testing.assert_allclose(
            getattr(first[0], name), getattr(second[0], name), rtol=1e-9, atol=1e-9
        )
    np.testing.assert_allclose(first[1], second[1], rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 5), st.integers(1, 4), st.integers(0, 7))
def test_numpy_and_plain_python_agree(seed: int, goals: int, steps: int, m: int) -> None:
    cloud, draws, measured = case(seed, goals=goals, steps=steps, m=m)
    same(NumpyUpdate()(cloud, draws, measured, FEW), PlainUpdate()(cloud, draws, measured, FEW))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), goals=st.integers(1, 5), steps=st.integers(1, 4),
       m=st.integers(0, 7))  # fmt: skip
def test_numpy_and_c_agree(compiled: Update, seed: int, goals: int, steps: int, m: int) -> None:
    cloud, draws, measured = case(seed, goals=goals, steps=steps, m=m)
    kept = [part.copy() for part in (cloud.place, cloud.velocity, cloud.aim, cloud.speed)]
    same(NumpyUpdate()(cloud, draws, measured, FEW), compiled(cloud, draws, measured, FEW))
    for before, after in zip(
        kept, (cloud.place, cloud.velocity, cloud.aim, cloud.speed), strict=True
    ):
        np.testing.assert_array_equal(before, after)


def test_weights_follow_their_formula() -> None:
    cloud, draws, measured = case(3, goals=3, steps=2, m=0)
    place, _ = _moved(cloud, draws.kicks, measured.duration_s, FEW)
    square = ((place - measured.place) ** 2).sum(axis=-1)
    likelihood = (np.exp(-square / (2 * FEW.deviation_m**2)) + FEW.floor).mean(axis=1)
    wanted = measured.weights * likelihood / (measured.weights * likelihood).sum()
    _, weights = NumpyUpdate()(cloud, draws, measured, FEW)
    np.testing.assert_allclose(weights, wanted, rtol=1e-12)


def test_particles_move_as_the_potential_field_says_in_short_steps() -> None:
    cloud, _, _ = case(4, goals=2, steps=1, m=0)
    none = Repulsion(0.0, 1.0)
    field = Field(FEW.relax_s, SOFTENING_M, none, none)
    step_s, kicks = 1e-4, np.zeros((1, *cloud.place.shape))
    place, velocity = _moved(cloud, kicks, step_s, FEW)
    step = field_step(field, step_s, obstacles=0, vehicles=0)
    for j in range(2):
        for i in range(FEW.particles):
            state = np.concatenate([cloud.place[j, i], cloud.velocity[j, i]])
            wanted = step(state, cloud.aim[j, i], cloud.speed[j, i], [], []).full().ravel()
            # Both are of first order in the step; what they gain per second must be the same.
            gained = (np.concatenate([place[j, i], velocity[j, i]]) - state) / step_s
            np.testing.assert_allclose(gained, (wanted - state) / step_s, atol=5e-3)


def test_a_heavy_particle_takes_its_share_of_places() -> None:
    cloud, draws, measured = case(5, goals=1, steps=1, m=0)
    place, _ = _moved(cloud, draws.kicks, measured.duration_s, FEW)
    at = dataclasses.replace(measured, place=place[0, 3])
    sharp = dataclasses.replace(FEW, deviation_m=1e-3, floor=1e-9)
    after, _ = NumpyUpdate()(cloud, draws, at, sharp)
    np.testing.assert_allclose(after.place[0], np.tile(place[0, 3], (FEW.particles, 1)))


def test_a_file_that_is_no_library_is_refused(tmp_path: Path) -> None:
    (tmp_path / "not.so").write_text("no")
    with pytest.raises(InputError, match="compile it on this machine"):
        CompiledUpdate(tmp_path / "not.so")
