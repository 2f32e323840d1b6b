"""The figures of learned bounds: who leaves a tube is counted right; tables stand at the marks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workbench.bench import learned_figures
from workbench.bench.into_document import put_between
from workbench.bench.learned_cases import (
    Score,
    Trajectories,
    learned,
    proved,
    published,
    score,
    trajectories,
)
from workbench.errors import InputError
from workbench.sensitivity.learning.exponential import SetExponential


def _seen() -> Trajectories:
    """Two random and one vertex run of two states at three instants; the second is not judged."""
    random = np.zeros((2, 3, 2))
    random[1, 1, 0] = 2.0
    random[:, :, 1] = 9.0
    vertices = np.zeros((1, 3, 2))
    vertices[0, :, 0] = (0.5, 3.0, 3.0)
    return Trajectories(random, vertices, (0,), true_x=2.0)


def test_trajectories_that_leave_are_counted_once_and_instants_each() -> None:
    found = score(np.array([[1.0, 0.0], [1.0, 0.0], [4.0, 0.0]]), _seen(), 0.1)
    assert found == Score(0.5, 1.0, 0.75, 0.5, 2.0, 0.1)


def test_published_learned_and_proved_tubes_of_b1_come_in_their_order() -> None:
    seen = trajectories(300)
    assert len(seen.vertices) == 32
    assert seen.judged == (0, 1, 2, 3, 4)
    assert seen.random.shape == (300, 61, 7)
    certain = proved(seen)
    assert (certain.random_leave, certain.vertices_leave) == (0.0, 0.0)
    assert 1.0 <= certain.width < 1.02
    ticks: list[int] = []
    (tool,) = published([1], seen, lambda: ticks.append(1))
    (ours,) = learned(
        SetExponential(), 300, delta=1e-6, seeds=[1], seen=seen, tick=lambda: ticks.append(1)
    )
    assert len(ticks) == 2
    assert tool.vertices_leave > ours.vertices_leave > 0.0
    assert tool.random_leave > 10.0 * ours.random_leave
    assert np.isnan(tool.epsilon)
    assert 0.0 < ours.epsilon < 0.2


def test_a_row_shows_the_median_with_its_ends() -> None:
    scores = [Score(share, 1.0, 0.99, 0.5, 1.5, float("nan")) for share in (0.1, 0.2, 0.4)]
    shown = learned_figures.row("tool", scores)
    assert shown[:4] == ["tool", "3", "none", "20 % (10 .. 40)"]
    assert learned_figures.row("tube", [Score(0.0, 0.0, 1.0, 1.0, 1.0, 0.0)])[2] == "0 (proof)"


def test_the_table_goes_between_the_marks_and_nowhere_else(tmp_path: Path) -> None:
    begin, end = learned_figures.MARKS
    file = tmp_path / "page.md"
    file.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    put_between(file, learned_figures.MARKS, "new")
    assert file.read_text() == f"before\n{begin}\n\nnew\n\n{end}\nafter\n"
    file.write_text("nothing")
    with pytest.raises(InputError, match="once each"):
        put_between(file, learned_figures.MARKS, "new")
    assert file.read_text() == "nothing"


def test_the_document_has_the_marks_and_the_table() -> None:
    text = (Path(__file__).parent.parent / "docs" / "learned-beta.md").read_text(encoding="utf-8")
    begin, end = learned_figures.MARKS
    table = text.partition(begin)[2].partition(end)[0]
    assert " | ".join(learned_figures.HEADINGS) in table
    assert "| validated tube | 1 | 0 (proof) | 0 % | 0 % |" in table
