"""The online board measures what it states: width, escapes, cost, memory, agreement of bits."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from workbench.bench import online_agreement, online_board
from workbench.bench.online_agreement import LEVELS, agreement, random_inputs, same_bits
from workbench.bench.online_board import OnlineBoard, OnlinePlan, OnlineRow, ValidatedRow
from workbench.bench.online_cost import CostCase, online_costs
from workbench.bench.online_kernels import (
    Setting,
    all_settings,
    cells_of,
    compiled,
    kernel_functions,
    tube_of_cells,
)
from workbench.bench.online_memory import online_memory, stack_bound
from workbench.bench.online_text import online_text, summary_text
from workbench.bench.tightness import Samples
from workbench.claims import Rigor
from workbench.cli.bench_files import marks
from workbench.cli.bench_online import online_page
from workbench.cli.main import main
from workbench.codegen.online_source import tube_source
from workbench.errors import InputError
from workbench.models.benchmarks import b1_small, b2
from workbench.reach import ReachTube, TubeStatus
from workbench.reach.online.kernels import Form
from workbench.report.frontier import Frontier, FrontierPoint, frontier_figure

BEGIN, END = marks("online")
ONE = Setting("local", Form.LINEAR, 0.05, 1)
QUADRATIC = replace(ONE, form=Form.QUADRATIC)
SETTINGS = (replace(ONE, step_s=0.1), ONE, replace(ONE, cells=8))
PLAN = OnlinePlan(SETTINGS, 1500, 1, 0.0125, inputs=60, rounds=3, growth_s=(0.8, 1.6))


HORIZON_S = 0.8


@pytest.fixture(scope="module", autouse=True)
def short_horizon() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(online_board, "HORIZON_S", HORIZON_S)
        yield


@pytest.fixture(scope="module")
def board(short_horizon: None) -> OnlineBoard:
    done: list[int] = []
    found = online_board.online_board(b1_small(), PLAN, advance=lambda: done.append(1))
    assert len(done) == PLAN.units_of_work
    return found


def test_every_setting_is_scored_beside_the_validated_tubes(board: OnlineBoard) -> None:
    assert [row.setting for row in board.rows] == list(SETTINGS)
    assert [row.cells for row in board.validated] == [1, 8]
    assert (board.escapes, board.disagreements) == (0, 0)
    by = {row.setting: row.score for row in board.rows}
    every: list[OnlineRow | ValidatedRow] = [*board.rows, *board.validated]
    for row in every:
        assert (row.rigor, row.status, row.proved_until_s) == ("ENCLOSED", "COMPLETE", HORIZON_S)
        assert row.score.trajectories == 1500
        for name in ("x", "y", "steering", "heading"):
            ratio = row.score.width_ratio[name]
            assert ratio is not None
            assert 1.0 <= ratio < 1.5
            assert 0.0 <= row.score.excess_mean[name] <= row.score.excess_worst[name]
    widths = [by[setting].width_ratio["y"] or 0.0 for setting in SETTINGS]
    assert widths[0] > widths[1] > widths[2]


def test_costs_count_every_cell_and_every_step(board: OnlineBoard) -> None:
    costs = {row.setting: row.cost for row in board.rows}
    one, eight, coarse = costs[ONE], costs[replace(ONE, cells=8)], costs[SETTINGS[0]]
    assert one is not None
    assert eight is not None
    assert coarse is not None
    assert one.trajectory_us < one.tube_us < 0.5 * eight.tube_us < 1e5
    growth = [cost.tube_us for cost in board.kernels[0].growth]
    assert growth[1] > 1.3 * growth[0]
    if shutil.which("valgrind") is None:
        assert one.instruction_ratio is None
        pytest.skip("needs the optional tool valgrind")
    assert one.tube_instructions is not None
    assert one.instruction_ratio == one.tube_instructions / (one.trajectory_instructions or 0)
    assert coarse.trajectory_instructions == one.trajectory_instructions
    assert 4 < (eight.tube_instructions or 0) / one.tube_instructions < 16
    assert 0.3 < (coarse.tube_instructions or 0) / one.tube_instructions < 0.8
    first, second = board.kernels[0].growth
    assert first.trajectory_instructions is not None
    assert second.trajectory_instructions == pytest.approx(
        2 * first.trajectory_instructions, rel=0.01
    )


def test_early_ends_are_said_and_cost_nothing(
    monkeypatch: pytest.MonkeyPatch, board: OnlineBoard
) -> None:
    def early(kernel: object, benchmark: object, setting: Setting, *, horizon_s: float) -> object:
        tube = tube_of_cells(kernel, benchmark, setting, horizon_s=horizon_s)  # type: ignore[arg-type]
        if setting is not ONE:
            return tube
        return ReachTube(
            tube.times[:7], tube.lower[:6], tube.upper[:6], tube.lower_at[:7],
            tube.upper_at[:7], tube.names, TubeStatus.LEFT_REGION, Rigor.ENCLOSED, "",
        )  # fmt: skip

    monkeypatch.setattr(online_board, "tube_of_cells", early)
    monkeypatch.setattr(online_board, "_facts", lambda *_: board.kernels[0])
    plan = replace(PLAN, settings=(ONE, QUADRATIC), growth_s=(0.8,), inputs=5)
    found = online_board.online_board(b1_small(), plan, advance=lambda: None)
    first, second = found.rows
    assert (first.cost, first.score.covered) == (None, False)
    assert first.proved_until_s == pytest.approx(0.3)
    assert second.cost is not None
    line = next(line for line in online_text(found).split("\n") if "LEFT_REGION" in line)
    assert re.search(r"- +- +- +- +to 0.30 s \(LEFT_REGION\) +0 +- +- +- +-$", line)


def test_a_run_outside_one_tube_is_an_escape_and_fails_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], board: OnlineBoard
) -> None:
    def narrow(kernel: object, benchmark: object, setting: Setting, *, horizon_s: float) -> object:
        tube = tube_of_cells(kernel, benchmark, setting, horizon_s=horizon_s)  # type: ignore[arg-type]
        upper = tube.upper_at.copy()
        upper[8, 1] -= 0.1 * (upper[8, 1] - tube.lower_at[8, 1])
        return replace(tube, upper_at=upper) if setting.step_s == 0.05 else tube

    monkeypatch.setattr(online_board, "tube_of_cells", narrow)
    monkeypatch.setattr(online_board, "_facts", lambda *_: board.kernels[0])
    monkeypatch.setattr("workbench.bench.online_kernels.all_settings", lambda: SETTINGS[:2])
    monkeypatch.setattr("workbench.cli.bench._TRAJECTORIES_QUICK", 1000)
    command = ["bench", "--quick", "--board", "online", "--only", "B1-small", "--inputs", "5"]
    assert main([*command, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["online"][0]
    assert [row["setting"]["step_s"] for row in found["rows"]] == [0.1, 0.05]
    assert found["rows"][0]["score"]["escapes"] == 0 < found["rows"][1]["score"]["escapes"]


def test_the_command_writes_page_and_document(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    board: OnlineBoard,
) -> None:
    monkeypatch.setattr(online_board, "online_board", lambda *_, **__: board)
    document, page = tmp_path / "figures.md", tmp_path / "figures.html"
    document.write_text(f"Before.\n{BEGIN}\nold\n{END}\nAfter.\n")
    command = ["bench", "--board", "online", "--only", "B1-small", "--into", str(document)]
    assert main([*command, "--plot", str(page)]) == 0
    shown = capsys.readouterr().out
    assert summary_text([board], 1) == "online kernels: 0 escapes, 0 disagreements in all (seed 1)"
    assert summary_text([board], 1) in shown
    once = document.read_text()
    assert once.startswith(f"Before.\n{BEGIN}\n")
    assert once.endswith(f"{END}\nAfter.\n")
    assert "old" not in once
    assert online_text(board) in once
    assert main([*command, "--plot", str(page)]) == 0
    assert document.read_text() == once
    html = page.read_text()
    assert html.count("<svg viewBox") == 3
    assert "local, linear" in html
    assert "http" not in re.sub(r'xmlns(:xlink)?="[^"]*"', "", html)


@pytest.mark.parametrize("content", ["no marks", f"{END}\n{BEGIN}", f"{BEGIN}{BEGIN}{END}", BEGIN])
def test_a_document_without_marks_is_refused_before_work(content: str, tmp_path: Path) -> None:
    document = tmp_path / "figures.md"
    document.write_text(content)
    assert main(["bench", "--board", "online", "--into", str(document)]) == 2
    assert document.read_text() == content
    assert main(["bench", "--board", "time", "--plot", str(tmp_path / "p.html")]) == 2


@pytest.mark.parametrize("form", Form)
def test_generated_code_has_the_bits_of_its_expressions(form: Form) -> None:
    benchmark = b2()
    functions = kernel_functions(benchmark, "local", form)
    found = agreement(benchmark, functions, inputs=2000, seed=3)
    assert [each.function for each in found[:-1]] == [f.name() for f in functions.all()]
    assert found[-1].function == "wb_tube"
    assert all(each.differing == dict.fromkeys(LEVELS, 0) for each in found)
    # Inputs that only overflow or that no tube survives would compare nothing.
    assert all(each.undefined < each.inputs / 2 for each in found)


def test_a_changed_last_bit_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    source = tube_source

    def changed(*args: object, **options: object) -> str:
        text = source(*args, **options)  # type: ignore[arg-type]
        return re.sub(r"=\((a\d+)\+(a\d+)\);", r"=(\1+\2)*(1.0+0x1p-52);", text)

    monkeypatch.setattr(online_agreement, "tube_source", changed)
    benchmark = b1_small()
    functions = kernel_functions(benchmark, "local", Form.LINEAR)
    found = agreement(benchmark, functions, inputs=100, seed=3)
    assert {each.function: each.differing["-O2"] > 0 for each in found[:-1]} == dict.fromkeys(
        (f.name() for f in functions.all()), True
    )


def test_bits_are_compared_not_values() -> None:
    nan = float("nan")
    first = np.array([[1.0, nan], [0.0, 1.0], [1.0, 1.0], [nan, 1.0]])
    second = np.array([[1.0, -nan], [-0.0, 1.0], [1.0, np.nextafter(1.0, 2.0)], [1.0, 1.0]])
    assert same_bits(first, second).tolist() == [True, False, False, False]


def test_random_inputs_fill_the_ranges() -> None:
    functions = kernel_functions(b2(), "local", Form.QUADRATIC)
    rng = np.random.default_rng(1)
    for function in functions.all():
        rows = random_inputs(function, functions, 500, rng)
        assert [row.shape for row in rows] == [
            (500, function.nnz_in(i)) for i in range(function.n_in())
        ]
        by = dict(zip(function.name_in(), rows, strict=True))
        if "x" in by:
            box = functions.ranges.states
            assert np.all((by["x"] >= box.lower) & (by["x"] <= box.upper))
            assert np.ptp(by["x"], axis=0) == pytest.approx(
                np.subtract(box.upper, box.lower), rel=0.05
            )
        if "lower" in by:
            assert np.all(by["lower"] <= by["upper"])
            assert np.any(by["lower"] < by["upper"])


def test_stack_that_is_touched_stays_below_the_bound() -> None:
    benchmark = b1_small()
    kernel = compiled(kernel_functions(benchmark, "local", Form.LINEAR), horizon_s=1.0, step_s=0.05)
    memory = online_memory(benchmark, CostCase(kernel, ONE, 1.0))
    if memory.stack_bound is None:
        pytest.skip("needs gcc's call graph")
    # What the harness's functions and the C library's memcpy and memset take is touched too, and
    # not in the bound: a few registers and return addresses each.
    assert 1000 < memory.stack_touched <= memory.stack_bound + 256
    assert memory.stack_touched > memory.stack_bound / 4
    assert memory.caller > 8 * 2 * 7 * 40
    if shutil.which("size") is not None:
        assert memory.static == 0
        assert 10_000 < (memory.code or 0) < 1_000_000
        assert (memory.tables or 0) > 7 * 8


def node(name: str, size: int, kind: str = "static") -> str:
    return f'node: {{ title: "{name}" label: "{name}\\nk.c:1:1\\n{size} bytes ({kind})" }}\n'


def edge(source: str, target: str) -> str:
    return f'edge: {{ sourcename: "{source}" targetname: "{target}" label: "k.c:1:1" }}\n'


GRAPH = (
    node("wb_tube", 100) + node("k.c:f.default", 10) + node("k.c:f.avx2", 30) + node("g", 7)
    + edge("wb_tube", "k.c:f") + edge("k.c:f.avx2", "g") + edge("wb_tube", "g")
    + node("unused", 9999)
)  # fmt: skip


def test_the_bound_is_the_deepest_chain_of_calls() -> None:
    assert stack_bound(GRAPH, "wb_tube") == 100 + 30 + 7
    assert stack_bound(GRAPH, "g") == 7


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (edge("g", "wb_tube"), "g calls wb_tube"),
        (edge("g", "g"), "g calls g"),
        (edge("k.c:f.avx2", "__indirect_call"), "calls __indirect_call"),
        (node("k.c:h", 8, "dynamic"), "k.c:h has one that grows"),
    ],
)
def test_no_bound_is_made_up(more: str, reason: str) -> None:
    with pytest.raises(InputError, match=re.escape(reason)):
        stack_bound(GRAPH + more, "wb_tube")
    with pytest.raises(InputError, match="to hold wb_other"):
        stack_bound(GRAPH, "wb_other")


def test_runs_inside_a_block_are_skipped_only_when_all_are_inside() -> None:
    times = np.linspace(0.0, 0.2, 17)
    at, between = np.ones((3, 1)), np.full((2, 1), 2.0)
    tube = ReachTube(
        np.array([0.0, 0.1, 0.2]), -between, between, -at, at, ("x",), TubeStatus.COMPLETE,
        Rigor.ENCLOSED, "",
    )  # fmt: skip
    samples = Samples(times, (tube,))
    for value in (0.5, -0.5, 1.5, np.nan):
        samples.add(np.full((1, 17, 1), value))
    assert samples.escapes(0, 0.2) == 2
    fine = Samples(times, (tube,))
    fine.add(0.5 * np.ones((1, 17, 1)))
    fine.add(-0.5 * np.ones((1, 17, 1)))
    # At 0.05 s and 0.15 s only the segment, of twice the width, is known.
    assert fine.score(0, 0.2).width_ratio == {"x": pytest.approx(3.0)}
    longer = fine.score(0, 0.2, grid_s=0.1)
    assert longer.width_ratio == {"x": pytest.approx(2.0)}
    assert longer.excess_mean == {"x": pytest.approx(1.5)}


def test_settings_cells_and_misuse() -> None:
    assert len(all_settings()) == len(set(all_settings())) == 24
    whole = b1_small().initial_set
    cells = cells_of(b1_small(), 3)
    assert len(cells) == 27
    assert min(cell.lower for cell in cells) == whole.lower
    with pytest.raises(InputError, match="a cube of cells such as 1, 8 or 27, got 9"):
        replace(ONE, cells=9)
    with pytest.raises(
        InputError, match="no online kernel 'other'; expected one of local, enclosed"
    ):
        kernel_functions(b1_small(), "other", Form.LINEAR)
    with pytest.raises(InputError, match="at least one tube of B1"):
        Frontier("B1", (), {}, 1.0)
    kernel = compiled(kernel_functions(b2(), "local", Form.LINEAR), horizon_s=1.0, step_s=0.05)
    far = replace(b2(), initial_set=replace(b2().initial_set, upper=(99.9,) * 7))
    with pytest.raises(InputError, match="to measure the kernels, it failed"):
        online_costs(far, [CostCase(kernel, ONE, 1.0)], rounds=1)


def test_the_frontier_draws_each_tube_and_the_stairs() -> None:
    points = [FrontierPoint("a", 0.1, 1, 10.0, 1.5), FrontierPoint("b", 0.05, 8, 100.0, 1.0)]
    figure = frontier_figure([Frontier("B1", points, {27: 1.01}, 4.0)], signal="y")
    assert figure.numbers is not None
    assert [row[4:] for row in figure.numbers.rows] == [[10.0, 1.5], [100.0, 1.0]]
    assert [key.label for key in figure.legend][:2] == ["a: a", "b: b"]
    assert "● 0.1 s, ■ 0.05 s" in figure.caption
    for text in (">a1<", ">b8<", ">27<", "log scale"):
        assert text in figure.panels[0]


def test_a_loop_without_a_complete_tube_still_has_a_page(board: OnlineBoard) -> None:
    rows = tuple(replace(row, cost=None) for row in board.rows)
    facts = tuple(replace(each, growth=()) for each in board.kernels)
    none = replace(board, loop="none", rows=rows, kernels=facts)
    both = online_page([none, board], "x").html()
    assert both.count("<svg viewBox") == 3
    alone = online_page([none], "x").html()
    assert "<svg viewBox" not in alone
