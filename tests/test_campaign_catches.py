"""The campaign finds no escape from sound tubes and finds one, proved, from every faulty tube."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from cli_fixture import invoke

from workbench.bench import campaign
from workbench.bench.campaign import CampaignResult, LoopResult, check_loop, run_campaign
from workbench.bench.random_loops import RandomLoop, random_loops
from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.models import ClosedLoop, Disturbance, System
from workbench.models.benchmarks import b1, b1_small
from workbench.reach import ReachTube, ValidatedTube
from workbench.sets import Box

Fault = Callable[[ReachTube], ReachTube]
# Its first two loops are quickly done.
SEED = 284


@dataclass(frozen=True)
class Faulty:
    """A sound method whose tubes are spoilt afterwards."""

    fault: Fault
    step_s: float = 0.05

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        sound = ValidatedTube(self.step_s).tube(
            system, initial_set=initial_set, horizon_s=horizon_s
        )
        return self.fault(sound)


@dataclass(frozen=True)
class WithoutDisturbance:
    """Forgets W."""

    def tube(self, system: System, *, initial_set: Box, horizon_s: float) -> ReachTube:
        assert isinstance(system, ClosedLoop)
        calm = dataclasses.replace(system, disturbance=Disturbance())
        return ValidatedTube().tube(calm, initial_set=initial_set, horizon_s=horizon_s)


def sound(tube: ReachTube) -> ReachTube:
    return tube


def shrunk(name: str) -> Fault:
    """Two per cent narrower in one coordinate."""

    def fault(tube: ReachTube) -> ReachTube:
        i = tube.names.index(name)
        changed = {}
        for low, high in (("lower", "upper"), ("lower_at", "upper_at")):
            lower, upper = getattr(tube, low).copy(), getattr(tube, high).copy()
            half = 0.5 * (upper[:, i] - lower[:, i])
            lower[:, i] += 0.02 * half
            upper[:, i] -= 0.02 * half
            changed |= {low: lower, high: upper}
        return dataclasses.replace(tube, **changed)

    return fault


def without_segments(tube: ReachTube) -> ReachTube:
    """Between instants nothing but the hull of the two sets."""
    return dataclasses.replace(
        tube,
        lower=np.minimum(tube.lower_at[:-1], tube.lower_at[1:]),
        upper=np.maximum(tube.upper_at[:-1], tube.upper_at[1:]),
    )


def narrower(name: str, slack: float, rigor: Rigor = Rigor.ENCLOSED) -> Fault:
    """One face at the instants after the start moved inward."""

    def fault(tube: ReachTube) -> ReachTube:
        upper = tube.upper_at.copy()
        upper[1:, tube.names.index(name)] -= slack
        return dataclasses.replace(tube, upper_at=upper, rigor=rigor)

    return fault


def checked(method, *, loop: RandomLoop | None = None, count: int = 600) -> LoopResult:
    benchmark = b1_small()
    loop = loop or RandomLoop("B1-small", benchmark.system, benchmark.initial_set, 1.03)
    return check_loop(loop, method, count=count, seed=3)


def small_set() -> RandomLoop:
    loop = b1()
    center = dict(zip(loop.initial_set.names, loop.initial_set.center, strict=True))
    start = Box.around(center, radius={"y": 1e-4, "heading": 1e-5})
    return RandomLoop("B1 from a small set", loop.system, start, 2.0)


def disturbed_loop() -> RandomLoop:
    loop = b1_small()
    system = dataclasses.replace(loop.system, disturbance=Disturbance(0.1, 0.01))
    return RandomLoop("B1-small with W", system, loop.initial_set, 0.7)


def test_sound_tubes_are_not_accused() -> None:
    for loop in (None, small_set(), disturbed_loop()):
        found = checked(Faulty(sound), loop=loop)
        assert (found.escapes, found.undecided, found.trajectories) == (0, 0, 600)
        assert found.complete
        assert found.proved_until_s == found.horizon_s
        assert all(each.absolute > 0.0 for each in found.closest.values())
    # The speed of B1 is a linear system of its own: its tube is exact but for rounding.
    exact = checked(Faulty(sound))
    assert exact.closest["speed"].absolute < 1e-11
    assert exact.reintegrated > 0


@pytest.mark.parametrize("name", ["x", "y", "steering", "speed", "heading"])
def test_a_tube_two_per_cent_too_narrow_is_left(name: str) -> None:
    found = checked(Faulty(shrunk(name)))
    assert found.escapes > 0
    assert found.closest[name].absolute < 0.0
    assert found.closest[name].relative is not None
    assert -0.1 < found.closest[name].relative < 0.0


def test_a_hair_is_noticed() -> None:
    """The speed's tube is exact but for rounding; floats could not tell so little."""
    slack = checked(Faulty(sound)).closest["speed"].absolute
    assert slack < 1e-11
    assert checked(Faulty(narrower("speed", 0.4 * slack))).escapes == 0
    found = checked(Faulty(narrower("speed", 40.0 * slack)))
    assert found.escapes > 0
    assert -40.0 * slack < found.closest["speed"].absolute < 0.0


def test_a_tube_without_segment_enclosures_is_left() -> None:
    assert checked(Faulty(without_segments, step_s=0.1), loop=small_set()).escapes > 0


def test_a_tube_that_forgets_the_disturbance_is_left() -> None:
    assert checked(WithoutDisturbance(), loop=disturbed_loop()).escapes > 0


def test_the_rounding_of_a_numerical_tube_is_no_escape_and_more_is() -> None:
    for slack, escapes in ((5e-13, False), (1e-9, True)):
        found = checked(Faulty(narrower("speed", slack, Rigor.NUMERICAL)))
        assert (found.escapes > 0) == escapes
        assert found.undecided == 0


def test_runs_that_cannot_be_settled_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "_EFFORT", 0.0)
    found = checked(Faulty(sound))
    assert found.undecided > 0
    assert found.escapes == 0


def test_a_proof_that_never_begins_follows_no_trajectory() -> None:
    center = {**dict.fromkeys(b1().initial_set.names, 0.0), "steering": 1.57, "speed": 2.0}
    start = Box.around(center, radius={"steering": 0.05})
    loop = RandomLoop("at the pole", b1().system, start, 1.0)
    found = checked(ValidatedTube(), loop=loop)
    assert not found.complete
    assert found.escapes == 0


def test_a_small_campaign_finds_no_escape() -> None:
    found = []
    for index, loop in enumerate(random_loops(10, seed=6)):
        shorter = dataclasses.replace(loop, horizon_s=min(loop.horizon_s, 0.73))
        found.append(check_loop(shorter, ValidatedTube(), count=200, seed=index))
    assert [(loop.escapes, loop.undecided) for loop in found] == [(0, 0)] * 10
    assert sum(loop.trajectories for loop in found) == 2000
    assert sum(loop.complete for loop in found) >= 7


def test_a_campaign_shares_the_trajectories_out_and_counts_its_loops() -> None:
    done: list[int] = []
    result = run_campaign(
        ValidatedTube(0.1), loops=2, trajectories=201, seed=SEED, progress=done.append
    )
    assert done == [1, 1]
    assert [loop.trajectories for loop in result.loops] == [101, 100]
    assert (result.trajectories, result.escapes, result.undecided) == (201, 0, 0)
    assert result.seed == SEED


def test_too_few_trajectories_are_wrong_use() -> None:
    with pytest.raises(InputError, match="fewer loops"):
        run_campaign(ValidatedTube(0.05), loops=5, trajectories=100)


def test_the_command_reports_and_its_status_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    words = (
        "campaign",
        "--loops",
        "1",
        "--trajectories",
        "200",
        "--seed",
        str(SEED),
        "--step",
        "0.1",
    )
    done = invoke(*words)
    assert done.status == 0
    assert "200 trajectories" in done.out
    assert f"0 undecided, 0 escapes (seed {SEED})" in done.out
    assert "campaign: 100%" in done.err
    data = invoke(*words, "--json", "--method", "validated").data
    assert (data["trajectories"], data["escapes"], data["method"]) == (200, 0, "validated")
    assert set(data["loops"][0]["closest"]) >= {"steering", "speed"}
    sound_check = campaign.check_loop

    def accused(*arguments, **named) -> LoopResult:
        return dataclasses.replace(sound_check(*arguments, **named), escapes=1)

    monkeypatch.setattr(campaign, "check_loop", accused)
    found = invoke(*words, "--method", "online-linear")
    assert found.status == 1
    assert "1 escapes, 0 undecided" in found.out


@pytest.mark.parametrize(
    "words",
    [("--trajectories", "10"), ("--loops", "0"), ("--method", "magic"), ("--step", "-1")],
)
def test_the_command_refuses_wrong_use(words: tuple[str, ...]) -> None:
    assert invoke("campaign", *words).status == 2


@pytest.mark.parametrize(
    ("words", "warned"),
    [(("--trajectories", "100000000"), True), (("--loops", "5000"), True), ((), False)],
)
def test_a_campaign_of_hours_is_announced(
    words: tuple[str, ...], warned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "run_campaign", lambda *_, **__: CampaignResult(1, ()))
    found = invoke("campaign", *words)
    assert found.status == 0
    assert ("h; fewer --loops or --trajectories take less" in found.err) is warned
