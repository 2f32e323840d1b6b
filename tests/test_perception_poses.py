"""The pose between two rows of a table holds every drive that agrees with them; tables that mix
vehicles, go back, jump or do not say how sure they are are refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.perception.poses import Poses, Stated, load_poses

SURE = (0.0, 0.0)
HEAD = "t,x,y,heading,x_half,y_half,heading_half\n"


def loaded(tmp_path: Path, text: str, **options: object) -> Poses:
    (tmp_path / "poses.csv").write_text(text)
    given: dict[str, object] = {"recording": None, "half_m_rad": None, "reference_ahead_m": 0.0}
    return load_poses(tmp_path / "poses.csv", **(given | options))  # type: ignore[arg-type]


@given(st.integers(0, 2**32 - 1), st.floats(0.02, 1.0), st.floats(0.0, 1.0))
def test_the_pose_between_rows_is_held(seed: int, gap_s: float, part: float) -> None:
    """Drives with the strongest acceleration allowed, turned at will half way."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.0, 0.2, 3)
    start, rate = rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3)
    first, second = rng.choice([-10.0, 10.0], (2, 3))
    turn = 0.5 * gap_s

    def truth(t: float) -> np.ndarray:
        early, late = min(t, turn), max(t - turn, 0.0)
        moved = start + rate * t + 0.5 * first * early**2 + 0.5 * second * late**2
        return moved + first * early * late

    def row(t: float) -> Stated:
        middle = truth(t) + half * rng.uniform(-1, 1, 3)
        return Stated(t, tuple(middle), tuple(half))

    at_s = part * gap_s
    pose = Poses((row(0.0), row(gap_s)), 0.0, Path("poses.csv")).at(at_s)
    for (low, high), value in zip((pose.x, pose.y, pose.heading), truth(at_s), strict=True):
        assert low - 1e-12 <= value <= high + 1e-12


def test_at_a_row_the_pose_is_the_row(tmp_path: Path) -> None:
    text = HEAD + "1,2,3,0.5,0.1,0.2,0.01\n2,4,5,0.6,0.1,0.2,0.01\n"
    pose = loaded(tmp_path, text).at(1.0)
    assert pose.x == pytest.approx((1.9, 2.1))
    assert pose.y == pytest.approx((2.8, 3.2))
    assert pose.heading == pytest.approx((0.49, 0.51))


def test_halfway_it_is_wider_by_what_a_car_can_do(tmp_path: Path) -> None:
    text = HEAD + "1,2,3,0.5,0.1,0.2,0.01\n2,4,5,0.6,0.1,0.2,0.01\n"
    pose = loaded(tmp_path, text).at(1.5)
    assert pose.x == pytest.approx((3.0 - 0.1 - 1.25, 3.0 + 0.1 + 1.25))
    assert pose.heading == pytest.approx((0.55 - 0.01 - 1.25, 0.55 + 0.01 + 1.25))


def test_the_reference_point_is_ahead_of_the_axle(tmp_path: Path) -> None:
    text = f"t,x,y,heading\n0,2,3,{math.pi / 2}\n1,2,3,{math.pi / 2}\n"
    pose = loaded(tmp_path, text, half_m_rad=(0.1, 0.0), reference_ahead_m=0.3).at(0.0)
    assert pose.x == pytest.approx((1.9, 2.1))
    assert pose.y == pytest.approx((2.6, 2.8))


def test_rows_of_one_recording_are_taken(tmp_path: Path) -> None:
    text = "recording,agent,t,x,y,heading\na,car,0,1,0,0\nb,car,0,2,0,0\nb,car,1,2,0,0\n"
    poses = loaded(tmp_path, text, recording="b", half_m_rad=(0.0, 0.0))
    assert poses.at(1.0).x == pytest.approx((2.0, 2.0))


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("t,x,y\n0,0,0\n", {}, "missing column heading"),
        (HEAD, {}, "found no row"),
        (HEAD + "0,0,0,0,0,0,0\n0,0,0,0,0,0,0\n", {}, "expected a time after"),
        (HEAD + "0,0,0,3.1,0,0,0\n1,0,0,-3.1,0,0,0\n", {}, "unwrap it"),
        (HEAD + "0,0,0,0,0,-1,0\n", {}, "half width >= 0"),
        (HEAD + "0,0,0,0,0,0,0\n", {"half_m_rad": (0.1, 0.1)}, "either as columns"),
        ("t,x,y,heading\n0,0,0,0\n", {}, "either as columns"),
        ("t,x,y,heading,x_half\n0,0,0,0,0\n", {}, "either as columns"),
        ("recording,t,x,y,heading\na,0,0,0,0\nb,1,0,0,0\n", {"half_m_rad": SURE}, "one vehicle"),
        ("agent,t,x,y,heading\na,0,0,0,0\nb,1,0,0,0\n", {"half_m_rad": SURE}, "one vehicle"),
        ("recording,t,x,y,heading\na,0,0,0,0\n", {"recording": "b"}, "of the recording 'b'"),
    ],
)  # fmt: skip
def test_tables_that_cannot_be_are_refused(
    text: str, options: dict[str, object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=said):
        loaded(tmp_path, text, **options)


def test_before_and_after_the_rows_nothing_is_known(tmp_path: Path) -> None:
    poses = loaded(tmp_path, HEAD + "1,2,3,0.5,0,0,0\n2,2,3,0.5,0,0,0\n")
    for t_s in (0.99, 2.01):
        with pytest.raises(InputError, match="on one clock"):
            poses.at(t_s)
    alone = loaded(tmp_path, HEAD + "1,2,3,0.5,0,0,0\n")
    assert alone.at(1.0).x == pytest.approx((2.0, 2.0))
    with pytest.raises(InputError, match="expected a table of poses"):
        load_poses(tmp_path / "absent.csv", recording=None, half_m_rad=None, reference_ahead_m=0.0)
