"""The command tells the decision's figures in text, page and document, and fails with a claim."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")
pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from workbench.bench import decision_board, online_board, online_text
from workbench.bench.decision_agreement import DecisionAgreement
from workbench.bench.decision_board import DecisionBoard, DecisionPlan, TellingRow
from workbench.bench.decision_bound import Bound, Limits, Parts, PeopleBound
from workbench.bench.decision_growth import Growth, GrowthPoint
from workbench.bench.decision_latency import Latency
from workbench.bench.decision_memory import DecisionMemory
from workbench.bench.decision_methods import METHODS, MethodCost
from workbench.bench.decision_text import decision_text, growth_claim, summary_text
from workbench.bench.online_board import OnlineBoard
from workbench.cli import bench_online
from workbench.cli.bench_decision_page import decision_page
from workbench.cli.bench_files import marks
from workbench.cli.main import main
from workbench.report.page import Page
from workbench.runtime.layout import TUBES


def _latency(
    budget: int, p999_us: float, proved: float, *, method: str = "local, linear"
) -> Latency:
    by_tube = dict.fromkeys(TUBES, proved)
    return Latency(
        method, budget, 1000, p999_us, 2 * p999_us, 3 * p999_us, (p999_us / 9, p999_us, 3.0),
        proved, by_tube, proved, budget // 2, budget,
    )  # fmt: skip


def _growth(over: str, *values: float, power: float = 1.0) -> Growth:
    costs = [10.0 * (value or 0.5) ** power for value in values]
    points = [
        GrowthPoint(v, 7, c, round(1e6 * c)) for v, c in zip(values, costs, strict=True)
    ]  # fmt: skip
    return Growth(over, tuple(points))


def _method(k: int, method: str) -> MethodCost:
    row = _latency(3000, 9876.0 * (1.0 + 0.5 * k), 0.8, method=method)
    return MethodCost(row, 4_567_890 * (k + 2) // 2, 20_000 + k, 0)


BEGIN, END = marks("decision")
BOARD = DecisionBoard(
    sizes={"horizon_s": 3.0, "step_s": 0.05, "levels": 3, "budget": 3000},
    latencies=(
        _latency(3000, 9876.0, 0.8), _latency(200, 987.0, 0.6),
        _latency(3000, 12345.0, 0.8, method="enclosed, linear"),
    ),
    sweep=(_latency(200, 987.0, 0.6), _latency(3000, 9876.0, 0.8)),
    methods=tuple(_method(k, str(method)) for k, method in enumerate(METHODS)),
    telling=(
        TellingRow("a scene", 167, 1234.0, 8_000_000, {"track": True, "stop": True, "brake": False},
                   dict.fromkeys(TUBES, 3)),
    ),
    bound=Bound(
        Limits(3000, 66, 3066, 3), 54_321.0, 99, 765_432,
        (Parts("a scene", 1000, 600, 3, 200, 4, 100),),
        (PeopleBound(0, 3, 2, 10, 20, 30, 163_000_000, 1_000_000),
         PeopleBound(32, 3, 2, 10, 20, 30, 906_000_000, 45_000_000)),
    ),
    growth=(
        _growth("horizon (s)", 1.0, 2.0, 4.0, power=1.5), _growth("tubes computed for TRACK", 1, 3),
        _growth("people", 0.0, 1.0, 2.0),
    ),
    memory=DecisionMemory(11, 12, 0, 13, 14, 15, 16, 17, 18),
    agreement=(DecisionAgreement("local, linear", 300, 2000, 0, 1500, 400, 100),),
)  # fmt: skip


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[DecisionPlan]:
    """Plans that were asked for; the board is the one above."""
    plans: list[DecisionPlan] = []

    def board(plan: DecisionPlan, **_: object) -> DecisionBoard:
        plans.append(plan)
        return BOARD

    monkeypatch.setattr(decision_board, "decision_board", board)
    return plans


def test_the_command_writes_page_and_document(
    measured: list[DecisionPlan], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    document, page = tmp_path / "figures.md", tmp_path / "figures.html"
    document.write_text(f"Before.\n{BEGIN}\nof before\n{END}\nAfter.\n")
    command = ["bench", "--board", "decision", "--into", str(document), "--plot", str(page)]
    assert main(command) == 0
    assert decision_text(BOARD) in capsys.readouterr().out
    once = document.read_text()
    assert once.startswith(f"Before.\n{BEGIN}\n")
    assert once.endswith(f"{END}\nAfter.\n")
    assert "of before" not in once
    assert decision_text(BOARD) in once
    assert main([*command, "--quick", "--inputs", "17"]) == 0
    html = page.read_text()
    # The frontier, three kinds of growth, the bound.
    assert html.count("<svg viewBox") == 5
    assert all(f"<td>{method}</td>" in html for method in METHODS)
    assert "http" not in re.sub(r'xmlns(:xlink)?="[^"]*"', "", html)
    full, quick = measured
    assert (full.calls, full.inputs, full.people) == (100_000, 100_000, (0, 1, 2, 4, 8, 16, 32))
    assert full.horizons_s == (1.0, 2.0, 3.0, 4.0, 5.0)
    assert 3000 in full.all_budgets
    assert (quick.calls <= 10_000, quick.inputs) == (True, 17)
    assert quick.units_of_work < full.units_of_work


def test_every_figure_is_told(measured: list[DecisionPlan]) -> None:
    text = decision_text(BOARD)
    for figure in (
        "9876",
        "4567890",
        "54321 instructions per attempted step",
        "3066 rows",
        "906",
        "12345",
    ):
        assert figure in text
    assert "SAFE (3)" in text
    assert "UNPROVED (3)" in text
    assert re.search(r"^11 +12 +0 +13 +14 +15 +16 +17 +18$", text, re.M)
    # Over `local, linear`: time, then instructions.
    for method, ratio in zip(METHODS, ("1.00", "1.50", "2.00", "2.50"), strict=True):
        assert re.search(rf"^{method} .* {ratio} +{ratio}$", text, re.M)
    bare = replace(BOARD, bound=None, latencies=(BOARD.latencies[0], BOARD.latencies[2]))
    assert "valgrind is missing" in decision_text(bare)
    assert "no budget of those below keeps p99.9 below 1000 us" in decision_text(bare)
    assert decision_page(bare, "x").html().count("<svg viewBox") == 4


def test_slopes_are_the_exponents_of_power_laws() -> None:
    steep, straight, people = BOARD.growth
    assert steep.slope == pytest.approx(1.5, abs=1e-6)
    assert growth_claim(steep).endswith("(more than linear)")
    assert [straight.slope, straight.slope_at_end] == pytest.approx([1.0, 1.0])
    assert growth_claim(people).endswith("between the last two 1.00 (linear or better)")
    hidden = Growth("people", (*_growth("", 1, 2).points, GrowthPoint(4.0, 7, 9.0, 90_000_000)))
    assert hidden.slope < hidden.slope_at_end == pytest.approx(2.17, abs=0.01)
    assert growth_claim(hidden).endswith("(more than linear)")


@pytest.mark.parametrize(
    "bad",
    [
        replace(BOARD, agreement=(replace(BOARD.agreement[0], differing=1),)),
        replace(BOARD, sweep=(replace(BOARD.sweep[0], spent_max=201),)),
        replace(
            BOARD, methods=(MethodCost(replace(BOARD.sweep[1], spent_max=3001), 4_567_890, 1, 0),)
        ),
    ],
)
def test_other_bits_and_exceeded_budgets_fail_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], bad: DecisionBoard
) -> None:
    monkeypatch.setattr(decision_board, "decision_board", lambda *_, **__: bad)
    assert main(["bench", "--board", "decision", "--quick", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["decision"]
    assert found["sizes"]["budget"] == 3000
    assert found["methods"][0]["latency"]["method"] == "local, linear"
    assert found["methods"][0]["instructions"] == 4_567_890
    one = summary_text(bad)
    assert sum(map(int, re.findall(r"\d+", one))) == 1


@pytest.mark.parametrize("content", ["no marks", f"{END}\n{BEGIN}", f"{BEGIN}{BEGIN}{END}", BEGIN])
def test_a_document_without_marks_is_refused_before_work(
    measured: list[DecisionPlan], content: str, tmp_path: Path
) -> None:
    document = tmp_path / "figures.md"
    document.write_text(content)
    assert main(["bench", "--board", "decision", "--into", str(document)]) == 2
    assert document.read_text() == content
    assert measured == []


def test_each_document_gets_the_tables_of_its_marks(
    monkeypatch: pytest.MonkeyPatch, measured: list[DecisionPlan], tmp_path: Path
) -> None:
    figures = OnlineBoard("B9", 1, (), (), ())
    monkeypatch.setattr(online_board, "online_board", lambda *_, **__: figures)
    monkeypatch.setattr(online_text, "online_text", lambda board: f"tables of {board.loop}")
    drawn = Page("Online kernels", ["Tubes."], [], "1", "x")
    monkeypatch.setattr(bench_online, "online_page", lambda *_: drawn)
    documents = {board: tmp_path / f"{board}.md" for board in ("online", "decision")}
    for board, path in documents.items():
        path.write_text("\n".join(marks(board)))
    page = tmp_path / "both.html"
    options = [word for path in documents.values() for word in ("--into", str(path))]
    command = ["bench", "--board", "online", "--board", "decision", "--only", "B1", *options]
    assert main([*command, "--plot", str(page)]) == 0
    assert decision_text(BOARD) in documents["decision"].read_text()
    assert decision_text(BOARD) not in documents["online"].read_text()
    assert "tables of B9\n\nonline kernels: 0 escapes" in documents["online"].read_text()
    both = " ".join(["--into", str(documents["online"]), "--into", str(documents["decision"])])
    assert all(both in path.read_text() for path in documents.values())
    assert "Online kernels and whole decision" in page.read_text()
    assert page.read_text().count("<svg viewBox") == 5


def test_files_that_nothing_is_for_are_refused_before_work(
    measured: list[DecisionPlan], tmp_path: Path
) -> None:
    document = tmp_path / "online.md"
    document.write_text("\n".join(marks("online")))
    twice = ["--into", str(document), "--into", str(document)]
    for options in (["--into", str(document)], twice, ["--plot", str(document), *twice[:2]]):
        assert main(["bench", "--board", "decision", *options]) == 2
    assert main(["bench", "--board", "cold-start", "--plot", str(tmp_path / "p.html")]) == 2
    assert measured == []
    assert document.read_text() == "\n".join(marks("online"))
