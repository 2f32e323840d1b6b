"""The board of the vehicle's monitor measures what it states, and fails with each of its limits."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")

from workbench.bench import onboard_board, onboard_memory, onboard_programs
from workbench.bench.onboard_board import OnboardBoard, OnboardPlan
from workbench.bench.onboard_bundle import build_driving
from workbench.bench.onboard_heap import KINDS, heap
from workbench.bench.onboard_install import NAME, base_distributions
from workbench.bench.onboard_period import Missed, TurnSeen, missed_deadlines
from workbench.bench.onboard_programs import Cores
from workbench.bench.onboard_start import ColdStart, Resident, can_start
from workbench.bench.onboard_text import claims_text, onboard_text
from workbench.bench.onboard_turns import at_shares, turns
from workbench.cli import bench_onboard
from workbench.cli.bench_files import marks
from workbench.cli.main import main
from workbench.codegen.compiler import compile_shared
from workbench.errors import InputError
from workbench.runtime.contents import Kernel
from workbench.runtime.onboard.states import Request, State
from workbench.runtime.onboard.turns import TurnResult
from workbench.simulation.onboard_operator import Operator

PLAN = OnboardPlan(decisions=120, kernel_calls=500, seconds=2.0, processes=1, resident_s=0.3)
BEGIN, END = marks("onboard")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_driving(tmp_path_factory.mktemp("onboard") / "bundle")


@pytest.fixture(scope="module")
def board(bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[OnboardBoard]:
    """Measured without real-time priority, which a test must not take."""
    done: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(onboard_board, "has_realtime", lambda: False)
        keys = bench_onboard.signed_copy(bundle, tmp_path_factory.mktemp("signed"))
        yield onboard_board.onboard_board(keys, PLAN, advance=lambda: done.append(1))
        assert len(done) == onboard_board.units_of_work(PLAN)


@pytest.fixture(scope="module")
def kept(board: OnboardBoard) -> OnboardBoard:
    """The same with times that keep every limit, whatever the machine did."""
    starts = tuple(ColdStart(kind, 1, 0.3, 0.4, 0.2, 0.1) for kind in ("a", "b", "c"))
    fed = replace(board.turns[-1], decided_us=(2e3, 3e3, 4e3))
    periods = tuple(replace(each, missed=(), gap_us=36_000) for each in board.periods)
    return replace(
        board, turns=(fed,), periods=periods, cold_starts=starts,
        resident=Resident(10.0, 36.0, 37.0),
    )  # fmt: skip


def test_the_core_drives_decides_and_is_timed(board: OnboardBoard) -> None:
    (fed,) = board.turns
    assert (fed.cores, fed.decisions, fed.laps) == (Cores.BUSY, PLAN.decisions, 1)
    assert fed.states["TRACKING"] > 0.5
    assert fed.verdicts["SAFE"] > 0.5
    assert sum(fed.states.values()) == pytest.approx(1.0)
    assert 0.0 < fed.ended_us[0] < fed.decided_us[0] <= fed.decided_us[1] <= fed.decided_us[2]
    assert fed.others_us[0] < fed.decided_us[0]
    assert [*at_shares(fed.marks)] == ["start", "10 %", "50 %", "100 %"]
    assert fed.marks[-1][0] == PLAN.decisions
    assert all(5.0 < mib < 100.0 for _, mib in fed.marks)


def test_the_loop_turns_in_real_time(board: OnboardBoard) -> None:
    assert [each.cores for each in board.periods] == [Cores.IDLE, Cores.BUSY]
    for each in board.periods:
        assert 10 < each.turns <= 2.1 / 0.033
        assert each.jitter_us[0] <= each.jitter_us[1] <= each.jitter_us[2]
        assert each.unanswered <= sum(missed.times for missed in each.missed)


def test_the_decision_calls_no_heap_and_imports_none(board: OnboardBoard) -> None:
    assert board.heap.by_kind == dict.fromkeys(KINDS, 0)
    assert board.heap.calls == board.heap.marks[-1][0] == PLAN.kernel_calls
    assert board.heap.queries > 50
    assert set(board.heap.imports or ()) <= {"memset", "memcpy", "memmove"}


def test_a_decision_that_calls_the_heap_is_caught(tmp_path: Path) -> None:
    source = """
    #include <stdlib.h>
    long long wb_work_size(void) { return 1; }
    int wb_decide(const double *q, double *r, double *w) {
      double *p = malloc(sizeof *p);
      *p = *q;
      p = realloc(p, 99);
      *r = *p + *w;
      free(p);
      return 0;
    }
    """
    flags = ("-std=c99", "-O0", "-fPIC", "-shared")
    (tmp_path / "kernel.so").write_bytes(compile_shared(source, flags=flags).shared_object)
    (tmp_path / "queries").write_bytes(bytes(8 * 3))
    one = Kernel("wb_decide", 1, 1, 1)
    found = heap(tmp_path / "kernel.so", tmp_path / "queries", kernel=one, calls=70)
    assert found.by_kind == {"malloc": 70, "calloc": 0, "realloc": 70, "free": 70, "aligned": 0}
    with pytest.raises(InputError, match="to decide"):
        heap(tmp_path / "none.so", tmp_path / "queries", kernel=one, calls=1)


def test_the_program_starts_signed_and_unsigned(board: OnboardBoard) -> None:
    if not can_start():
        assert (board.cold_starts, board.resident) == (None, None)
        assert "pyserial is missing" in onboard_text(board)
        pytest.skip("needs the optional package pyserial")
    assert board.cold_starts is not None
    assert [each.kind for each in board.cold_starts] == [
        "unsigned, shadow", "signed, shadow", "signed, drive",
    ]  # fmt: skip
    for each in board.cold_starts:
        assert 0.0 < each.opened_s < each.first_s + 0.5 < 20.0
        assert each.processor_s > 0.0
    assert board.resident is not None
    assert 10.0 < board.resident.now_mb <= board.resident.peak_mb < 200.0


def test_the_base_install_holds_no_analysis_package() -> None:
    names = base_distributions()
    assert names[0] == NAME
    assert {"python-can", "pynacl"} <= set(names)
    assert not set(names) & onboard_programs.ANALYSIS


def test_analysis_packages_in_a_program_are_refused(
    monkeypatch: pytest.MonkeyPatch, bundle: Path
) -> None:
    monkeypatch.setattr(onboard_programs, "ANALYSIS", frozenset({"json"}))
    with pytest.raises(InputError, match=r"without analysis packages, got \['json'\]"):
        turns(bundle, 5, cores=Cores.IDLE, turn_us=33_000)
    with pytest.raises(InputError, match=r"onboard_feed\.py to measure the bundle, it failed"):
        turns(bundle / "none", 5, cores=Cores.IDLE, turn_us=33_000)


def seen(at_us: int, **changed: object) -> TurnSeen:
    usual = TurnSeen(at_us, None, at_us + 3_000, at_us + 2_000, 0, "TRACKING", ())
    return usual._replace(**changed)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "faults", "kind"),
    [
        ({"begun_us": 90_000, "ended_us": 93_000}, ["LATE_TURN"], "turn begun late"),
        ({"decided_us": 134_000}, ["OVERRUN"], "decision late"),
        ({"unsent": 2}, ["NOT_COVERED"], "frames not sent in time"),
        ({"set_us": 51_000}, ["NOT_COVERED"], "set on the bus late"),
        ({"set_us": 51_000, "state": "BRAKING"}, [], "set on the bus late"),
        ({"ended_us": 70_000}, [], "turn ended late"),
    ],
)
def test_a_missed_deadline_owes_its_answer(
    changed: dict[str, object], faults: list[str], kind: str
) -> None:
    def missed(named: list[str]) -> tuple[Missed, ...]:
        turn = seen(33_000, **changed)
        after = seen(99_000, faults=named, unsent=turn.unsent, state="BRAKING")
        return missed_deadlines([seen(0), turn, after], gap_us=50_000, latency_us=100_000)

    (answered,) = missed(faults)
    assert (answered.kind, answered.times, answered.answered) == (kind, 1, True)
    assert answered.answer.endswith("; BRAKING")
    (silent,) = missed([])
    assert silent.answered is not bool(faults)
    assert missed_deadlines([seen(0), seen(33_000), seen(66_000)], gap_us=5e4, latency_us=1e5) == ()


def test_every_limit_fails_the_board(kept: OnboardBoard) -> None:
    assert kept.failing == 0
    fed, live, start = kept.turns[0], kept.periods[-1], ColdStart("c", 1, 0.6, 0.7, 0.2, 0.1)
    silent = (Missed("turn begun late", "no LATE_TURN; TRACKING", 3, False),)
    grown = ((1, 20.0), (10, 21.0), (100, 22.5))
    for bad in (
        replace(kept, turns=(replace(fed, decided_us=(2e3, 34e3, 4e4)),)),
        replace(kept, turns=(replace(fed, marks=grown),)),
        replace(kept, periods=(replace(live, missed=silent), live)),
        replace(kept, periods=(live, replace(live, gap_us=None))),
        replace(kept, heap=replace(kept.heap, by_kind={"free": 1})),
        replace(kept, heap=replace(kept.heap, marks=grown)),
        replace(kept, cold_starts=(start,)),
        replace(kept, resident=Resident(10.0, 45.1, 46.0)),
        replace(kept, distributions=tuple("abcdefghijklm")),
    ):
        assert bad.failing == 1
        assert claims_text(bad).count("FAILS: ") == 1
    # What took nothing in the first tenth is not growth.
    assert (
        replace(kept, turns=(replace(fed, marks=((1, 1.0), (10, 9.0), (100, 9.0))),)).failing == 0
    )


def test_the_command_writes_the_document_and_fails_with_a_claim(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    kept: OnboardBoard,
) -> None:
    document = tmp_path / "figures.md"
    document.write_text(f"Before.\n{BEGIN}\nof before\n{END}\nAfter.\n")
    monkeypatch.setattr(bench_onboard, "measure", lambda _: kept)
    command = ["bench", "--board", "onboard", "--only", "B1-small"]
    assert main([*command, "--into", str(document)]) == 0
    assert onboard_text(kept) in capsys.readouterr().out
    text = document.read_text()
    assert text.startswith(f"Before.\n{BEGIN}\n")
    assert text.endswith(f"{END}\nAfter.\n")
    assert "of before" not in text
    for part in (onboard_text(kept), claims_text(kept), "onboard: 0 claims fail"):
        assert part in text
    bad = replace(kept, distributions=tuple("abcdefghijklm"))
    monkeypatch.setattr(bench_onboard, "measure", lambda _: bad)
    assert main([*command, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["onboard"]
    assert [claim["holds"] for claim in found["claims"]].count(False) == 1
    assert found["turns"][0]["cores"] == "BUSY"


def test_little_is_measured_quickly_and_much_by_default() -> None:
    def plan(**given: object) -> OnboardPlan:
        usual = {"quick": False, "decisions": None, "seconds": None}
        return bench_onboard.plan(SimpleNamespace(**usual | given))  # type: ignore[arg-type]

    full, quick = plan(), plan(quick=True)
    assert (full.decisions, full.kernel_calls, full.seconds) == (10**5, 10**6, 60.0)
    assert quick.decisions * 10 < full.decisions
    both = plan(decisions=10**6)
    assert (both.decisions, both.kernel_calls) == (10**6, 10**6)


def test_a_bundle_that_does_not_drive_is_refused_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "--board", "onboard", "--bundle", str(tmp_path)]) == 2
    assert re.search("not a complete bundle", capsys.readouterr().err)


def test_the_operator_asks_for_what_the_state_needs() -> None:
    def asked(state: State) -> Request | None:
        operator, answers = Operator(), set[Request | None]()
        result = TurnResult(0, (), state, None, None, None, (), ())
        for _ in range(61):
            answers.add(operator.asks(result))
        return next((each for each in answers if each is not None), None)

    assert asked(State.DISARMED) is Request.ARM
    assert asked(State.FAULT) is Request.DISARM
    assert asked(State.YIELDED) is Request.REARM
    assert asked(State.TRACKING) is None
    assert Operator().asks(None) is None


def test_memory_of_the_whole_core_may_not_grow(board: OnboardBoard) -> None:
    flat = replace(board.turns[-1], marks=((1, 1.0), (100, 9.0), (1000, 9.5)))
    assert "9.50 MiB at 100 %" in onboard_memory.check(flat)
    with pytest.raises(AssertionError, match=r"\+1\.50 MiB"):
        onboard_memory.check(replace(flat, marks=((1, 1.0), (100, 8.0), (1000, 9.5))))
