"""Recorded runs make pairs of near starts, no recording twice, chosen without looking ahead."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from cli_fixture import invoke

from workbench.errors import InputError
from workbench.sensitivity.learning.pairs import PairRuns
from workbench.sensitivity.learning.recorded_pairs import RecordedPairs, Stretch
from workbench.simulation.conformance.driven_runs import DrivenRun, runs_tables
from workbench.simulation.recorded_stretches import recorded_pairs

TIMES = np.array([0.0, 0.5, 1.0])


def _stretches(*, count: int, futures: int) -> list[Stretch]:
    """Three stretches per recording, starts on a grid of 0.1; what follows depends on `futures`."""
    starts, later = np.random.default_rng(1), np.random.default_rng(futures)
    found = []
    for k in range(count):
        for _ in range(3):
            start = starts.integers(0, 5, size=2) / 10.0
            states = np.array([start, *later.normal(size=(2, 2))])
            found.append(Stretch(f"r{k}", "north" if k % 2 else "south", states))
    return found


def _matched(stretches: list[Stretch], radius: float, seed: int = 4) -> RecordedPairs:
    return RecordedPairs.matched(
        stretches, names=("a", "b"), times=TIMES, radius=(radius, radius), seed=seed, what="runs"
    )


def _owners(stretches: list[Stretch], runs: PairRuns) -> list[tuple[str, str]]:
    """Recordings of both ends of every pair."""
    by_bits = {each.states.tobytes(): each.recording for each in stretches}
    return [
        (by_bits[one.tobytes()], by_bits[other.tobytes()])
        for one, other in zip(runs.first, runs.second, strict=True)
    ]


def test_no_recording_is_in_two_pairs_and_starts_are_within_the_radius_of_a_common_state() -> None:
    stretches = _stretches(count=40, futures=2)
    pairs = _matched(stretches, 0.05)
    runs = pairs.block(0, pairs.most or 0)
    owners = [name for pair in _owners(stretches, runs) for name in pair]
    assert len(owners) == len(set(owners)) == 2 * (pairs.most or 0)
    assert 4 <= (pairs.most or 0) < 20, "some near each other, some not"
    assert runs.distances[:, 0].max() == pytest.approx(0.1)
    place = {each.recording: each.place for each in stretches}
    assert all(place[one] == place[other] for one, other in _owners(stretches, runs))
    wide = _matched(stretches, 10.0)
    assert wide.most == 20, "without a limit every two recordings of a place make a pair"
    assert "unit: the recording" in pairs.distribution
    assert "as the 40 were" in pairs.distribution


def test_who_is_paired_does_not_depend_on_what_came_later() -> None:
    one, other = (_stretches(count=40, futures=seed) for seed in (2, 3))
    found = [_matched(each, 0.1) for each in (one, other)]
    count = found[0].most or 0
    assert count == found[1].most
    owners = [_owners(s, p.block(0, count)) for s, p in zip((one, other), found, strict=True)]
    assert owners[0] == owners[1]
    changed = _matched(one, 0.1, seed=5)
    assert _owners(one, changed.block(0, changed.most or 0)) != owners[0]


def test_pairs_of_all_places_come_in_random_order() -> None:
    stretches = _stretches(count=40, futures=2)
    place = {each.recording: each.place for each in stretches}
    pairs = _matched(stretches, 10.0)
    first = [place[one] for one, _ in _owners(stretches, pairs.block(0, 10))]
    assert {"north", "south"} == set(first), "the held-out half would be of one place otherwise"
    assert first.count("north") < 10


def test_too_few_pairs_are_named() -> None:
    stretches = _stretches(count=6, futures=2)
    with pytest.raises(InputError, match="got 6 recordings and no such pair; widen --radius"):
        _matched(
            [dataclasses.replace(s, states=s.states + int(s.recording[1:])) for s in stretches], 0.1
        )
    with pytest.raises(InputError, match="expected a radius >= 0"):
        _matched(stretches, -1.0)
    pairs = _matched(stretches, 10.0)
    with pytest.raises(InputError, match="expected at most the 2 pairs that 6 recordings give"):
        pairs.block(0, 3)


def _drives(folder: Path, *, brakes: tuple[int, ...] = ()) -> Path:
    """Twelve drives of 6 s along y = 0 at speeds of their own, offset sin-shaped."""
    clock = np.arange(0.0, 6.01, 0.1)
    runs = []
    for k in range(12):
        speed = 2.0 + 0.02 * k
        offset = 0.05 * np.sin(clock + 0.1 * k)
        zero = np.zeros_like(clock)
        table = np.column_stack(
            [clock, 5.0 + speed * clock, offset, zero, zero, zero + speed, zero, zero]
        )
        tracking = np.full(len(clock), k not in brakes)
        waypoints = np.column_stack([np.linspace(0.0, 30.0, 7), np.zeros(7)])
        runs.append(DrivenRun(f"d{k:02d}", table, tracking, waypoints))
    folder.mkdir()
    for name, text in runs_tables(runs).items():
        (folder / name).write_text(text)
    return folder


def test_drives_give_states_along_their_path(tmp_path: Path) -> None:
    pairs = recorded_pairs(_drives(tmp_path / "drives"), np.linspace(0.0, 2.0, 5), {}, 1)
    assert pairs.most == 6
    assert pairs.names[:2] == ("station", "offset")
    runs = pairs.block(0, 6)
    speed = runs.first[:, 0, 3]
    assert np.allclose(runs.first[:, :, 0] - runs.first[:, :1, 0], speed[:, None] * pairs.times)
    assert np.abs(runs.first[:, :, 1]).max() <= 0.05
    assert runs.distances[:, 0, 0].max() <= 1.0 + 1e-9


def test_only_stretches_under_track_count(tmp_path: Path) -> None:
    folder = _drives(tmp_path / "drives", brakes=(0, 1, 2, 3))
    pairs = recorded_pairs(folder, np.linspace(0.0, 2.0, 5), {}, 1)
    assert pairs.recordings == 8
    assert pairs.most == 4


def test_unknown_states_and_folders_are_named(tmp_path: Path) -> None:
    folder = _drives(tmp_path / "drives")
    with pytest.raises(InputError, match=r"--radius: expected states of these runs \(station"):
        recorded_pairs(folder, TIMES, {"height": 1.0}, 1)
    with pytest.raises(InputError, match=r"found neither"):
        recorded_pairs(tmp_path, TIMES, {}, 1)


def test_the_command_learns_from_a_folder_with_all_the_pairs_it_gives(tmp_path: Path) -> None:
    folder, saved = _drives(tmp_path / "drives"), tmp_path / "learned.json"
    words = ("learn", "--from", folder, "--horizon", "1", "--step", "0.1")
    found = invoke(*words, "--save", saved, "--json")
    assert found.status == 0, found.err
    assert found.data["statement"]["pairs"] == 6
    assert "6 pairs" in found.err
    assert "these recordings give 6" in found.err
    document = json.loads(saved.read_text())
    assert document["source"] == str(folder)
    assert document["region"] is None
    refused = invoke(*words, "--epsilon", "0.1")
    assert refused.status == 2
    assert "expected at most the 6 pairs that the recordings give" in refused.err
    held = invoke(*words, "--hold-out", "2", "--json")
    assert [each["pairs"] for each in held.data["statements"]] == [4, 2]


@pytest.mark.skipif("WORKBENCH_DATA" not in os.environ, reason="needs the recordings")
def test_real_recordings_give_moving_pairs_seen_from_their_start() -> None:
    folder = Path(os.environ["WORKBENCH_DATA"]) / "kitti"
    pairs = recorded_pairs(folder, np.linspace(0.0, 2.0, 21), {"speed": 1.0}, 1)
    runs = pairs.block(0, pairs.most or 0)
    assert len(runs.first) >= 2
    assert np.array_equal(runs.first[:, 0, :3], np.zeros((len(runs.first), 3)))
    ways = runs.first[:, -1, 0] - 0.1 * runs.first[:, :-1, 3].sum(axis=1)
    assert np.abs(ways).max() < 1.5, "place ahead is the sum of speeds"
