"""A hunt's verdict is about all of its trials, a tuned baseline about its training half, and what
left the proof's region is counted by its kind."""

from __future__ import annotations

import argparse
import dataclasses
import json
import socket
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.survey_cases import row
from workbench.cli import survey_hunt
from workbench.cli.main import main
from workbench.errors import InputError
from workbench.runtime import Action, Decision, Observation
from workbench.runtime.policies import Ground, Turn
from workbench.simulation.campaign import hunting
from workbench.simulation.campaign.hunting import COLLISIONS, Quarry, hunt, load_catches
from workbench.simulation.campaign.rows import Row
from workbench.simulation.campaign.scripted_judges import Counted, plain_decision
from workbench.simulation.campaign.store import Store
from workbench.simulation.campaign.surveying import Survey, Task, missed_part, training_half
from workbench.simulation.campaign.workers import InProcess

WHO = ("FailSafe", "time to collision", "never brakes")
TRIALS = 14


@pytest.fixture
def store(tmp_path: Path) -> Store:
    found = Store(tmp_path / "survey")
    found.begin(seed=1, contenders=WHO, long_looks=10)
    return found


def contacts(avoidable: int) -> Callable[[Any], Row]:
    """Each trial touches somebody, each slower than the one before; the last ones avoidably."""
    count = iter(range(TRIALS))

    def tried(_: Any) -> Row:
        k = next(count)
        return row(
            0, contact=True, contact_mps=2.0 - 0.1 * k, contact_person="p",
            avoidable=k >= TRIALS - avoidable,
        )  # fmt: skip

    return tried


@pytest.mark.parametrize(("avoidable", "status"), [(0, 0), (1, 1)])
def test_an_avoidable_contact_beyond_the_ten_worst_is_not_overlooked(
    avoidable: int, status: int, store: Store, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    pytest.importorskip("optuna")
    monkeypatch.setattr(hunting, "_tried", contacts(avoidable))
    monkeypatch.setattr("workbench.cli.survey.begun", lambda args, store: store.manifest())
    args = argparse.Namespace(
        hunt=COLLISIONS, contenders=["FailSafe"], plants=["bicycle"], seed=1, trials=TRIALS,
        jobs=1, scheduler=None, json=True,
    )  # fmt: skip
    assert survey_hunt.hunted(args, store) == status
    (said,) = json.loads(capsys.readouterr().out)
    assert (said["trials"], said["avoidable"]) == (TRIALS, avoidable)
    assert said["worst"]["row"]["avoidable"] is (avoidable > 0)
    catches = load_catches(store.folder / "hunts" / "collisions-FailSafe-bicycle-1" / "best.json")
    assert len(catches) == 10
    assert [each.row.avoidable for each in catches] == [True] * avoidable + [False] * (
        10 - avoidable
    )


def test_a_hunt_gives_all_of_its_trials_back(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("optuna")
    monkeypatch.setattr(hunting, "_tried", contacts(0))
    quarry = Quarry(COLLISIONS, "FailSafe", "bicycle", 1)
    found = hunt(store, quarry, TRIALS, InProcess(), at_once=2, advance=lambda _: None)
    assert len(found) == TRIALS
    assert [each.worth for each in found] == sorted(each.worth for each in found)


class Refusing:
    """A judge whose decisions are refused for one ground, in words that say nothing of it."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground

    def turn(self, now_s: float) -> Turn:
        return Turn(Action.BRAKE, None)

    def step(self, observation: Observation) -> Decision:
        decision = plain_decision(Action.BRAKE, "the proof covers nothing of it")
        return dataclasses.replace(decision, grounds=(self._ground,))


@pytest.mark.parametrize("ground", Ground)
def test_out_of_region_is_counted_by_its_kind_and_not_by_words(ground: Ground) -> None:
    counted = Counted(Refusing(ground))
    for _ in range(3):
        counted.step(None)  # type: ignore[arg-type]
    assert counted.out_of_region == (3 if ground is Ground.REGION else 0)


class Tuning:
    """Workers that miss every third index below a parameter of 3 s, and nothing above it."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def done(
        self, work: Callable[[Task], list[int]], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, list[int]]]:
        assert work is missed_part
        for task in tasks:
            self.asked += task.indices
            (_, parameter) = task.parameters[0]
            yield task, [k for k in task.indices if k % 3 == 0 and parameter < 3.0]


def test_a_larger_training_half_is_tuned_on_anew_while_nothing_was_driven(store: Store) -> None:
    workers = Tuning()
    survey = Survey(store, store.manifest(), workers)
    survey.tune("bicycle", range(0, 8, 2), lambda _: None)
    assert store.parameters()["bicycle"]["time to collision"]["training"] == 4
    workers.asked.clear()
    survey.tune("bicycle", range(0, 8, 2), lambda _: None)
    survey.tune("bicycle", range(0, 4, 2), lambda _: None)
    assert workers.asked == []
    survey.tune("bicycle", range(0, 20, 2), lambda _: None)
    assert store.parameters()["bicycle"]["time to collision"]["training"] == 10
    assert set(workers.asked) == set(range(0, 20, 2))


def test_tuned_on_fewer_and_driven_is_refused(store: Store) -> None:
    pytest.importorskip("pyarrow")
    survey = Survey(store, store.manifest(), Tuning())
    survey.tune("bicycle", range(0, 8, 2), lambda _: None)
    before = store.parameters()
    store.write("bicycle", range(1), [row(0)])
    with pytest.raises(InputError, match="keep them with --training 4, or name another folder"):
        survey.tune("bicycle", range(0, 20, 2), lambda _: None)
    assert store.parameters() == before
    survey.tune("bicycle", range(0, 8, 2), lambda _: None)
    # Another plant's results are none of this one's.
    survey.tune("single-track", range(0, 20, 2), lambda _: None)
    assert store.parameters()["single-track"]["time to collision"]["training"] == 10


def test_parameters_that_were_lost_after_driving_are_not_tuned_again(store: Store) -> None:
    pytest.importorskip("pyarrow")
    survey = Survey(store, store.manifest(), Tuning())
    survey.tune("bicycle", range(0, 8, 2), lambda _: None)
    store.write("bicycle", range(1), [row(0)])
    (store.folder / "baselines.json").unlink()
    with pytest.raises(InputError, match=r"time to collision of bicycle drove with"):
        survey.tune("bicycle", range(0, 8, 2), lambda _: None)


def test_a_listener_that_is_no_scheduler_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("workbench.simulation.campaign.workers._ANSWERS_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        assert main(["survey", "--out", str(tmp_path / "o"), "--scheduler", address]) == 2
    assert "expected the address of a Dask scheduler that answers" in capsys.readouterr().err


def test_baselines_that_nobody_judges_yet_are_named(
    store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    words = ["survey", "--out", str(store.folder), "--table"]
    other = training_half(1, 1)[0]
    store.write("bicycle", range(other, other + 1), [row(other, name) for name in WHO])
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "time to collision are judged on the half of the scenarios" in said
    assert "| bicycle | time to collision |" not in said
    store.write("bicycle", range(1), [row(0, name) for name in WHO])
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "are judged on" not in said
    assert "| bicycle | time to collision |" in said


@pytest.mark.parametrize("address", ["luck", "tcp://127.0.0.1:9", "127.0.0.1:9"])
@pytest.mark.parametrize("more", [(), ("--hunt", "collisions", "--contenders", "FailSafe")])
def test_a_scheduler_that_does_not_answer_is_said_before_anything_is_made(
    address: str, more: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    out = tmp_path / "out"
    assert main(["survey", "--out", str(out), "--scheduler", address, *more]) == 2
    assert "--scheduler: expected the address of a Dask scheduler" in capsys.readouterr().err
    assert not out.exists()
