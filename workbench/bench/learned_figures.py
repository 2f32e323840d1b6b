"""Figures of learned bounds on B1: the published tool, our learner, and the proof.

Run with Python (extra `analysis`): `python -m workbench.bench.learned_figures` prints the table;
`--into docs/learned-beta.md` puts it between the document's marks. It fails when a trajectory
leaves the proved tube. `--seeds` and `--few` make it shorter.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.bench.into_document import put_between
from workbench.bench.learned_cases import (
    Score,
    Trajectories,
    learned,
    proved,
    published,
    trajectories,
)
from workbench.models.benchmarks import b1
from workbench.sensitivity.learning.evidence import APriori
from workbench.sensitivity.learning.exponential import SetExponential
from workbench.sensitivity.learning.form import Form
from workbench.sensitivity.learning.matrix_form import MatrixForm
from workbench.sensitivity.learning.piecewise import PiecewiseExponential

# Specification
DELTA = 1e-6
EPSILON = 1e-3
USUAL_PAIRS = 2000
RANDOM = 5000
# The last of these forms takes much longer than the others: fewer of its seeds are tried.
SLOWER = 3
FORMS: tuple[Form, ...] = (SetExponential(), PiecewiseExponential(4), MatrixForm(6))
MARKS = (
    "<!-- figures of learned bounds: begin -->",
    "<!-- figures of learned bounds: end -->",
)
HEADINGS = (
    "bound", "seeds", "epsilon (delta 1e-6)", "random starts that leave", "vertices that leave",
    "instants inside, random", "instants inside, vertices", "half width in x at 3 s / true",
)  # fmt: skip


def row(name: str, scores: Sequence[Score]) -> list[str]:
    """Medians, with the least and largest of several seeds."""
    epsilon = np.array([each.epsilon for each in scores])
    stated = "none" if np.isnan(epsilon).any() else f"{np.median(epsilon):.3g}"
    if len(scores) == 1 and epsilon[0] == 0.0:
        stated = "0 (proof)"
    columns = (
        ([each.random_leave for each in scores], "{:.3g} %"),
        ([each.vertices_leave for each in scores], "{:.3g} %"),
        # Shares near one differ in what is missing.
        ([each.random_inside for each in scores], "{:.6g} %"),
        ([each.vertices_inside for each in scores], "{:.4g} %"),
    )
    return [
        name,
        str(len(scores)),
        stated,
        *(_spread([100.0 * value for value in column], text) for column, text in columns),
        _spread([each.width for each in scores], "{:.3f}"),
    ]


def _spread(values: Sequence[float], text: str) -> str:
    middle = text.format(float(np.median(values)))
    if len(values) == 1:
        return middle
    low, high = (text.format(end).removesuffix(" %") for end in (min(values), max(values)))
    return f"{middle} ({low} .. {high})"


def table(rows: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (HEADINGS, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(HEADINGS), *lines[1:]])


def figures(seeds: int, few: int, random: int, *, epsilon: float) -> tuple[list[list[str]], bool]:
    """All rows, and whether no trajectory leaves the proved tube."""
    seen = trajectories(random)
    rows = [
        row("published tool, 10 runs", published(range(seeds), seen, _tick("published", seeds)))
    ]
    rows.append(_row_of(SetExponential(), USUAL_PAIRS, seeds, seen))
    scale = np.array(b1().initial_set.reordered(b1().system.ode.names).radius)
    needed = APriori(delta=DELTA).needed(epsilon, parameters=FORMS[0].parameters(scale))
    rows += [_row_of(form, needed, few, seen) for form in FORMS[:-1]]
    rows.append(_row_of(FORMS[-1], needed, max(1, few // SLOWER), seen))
    certain = proved(seen)
    rows.append(row("validated tube", [certain]))
    return rows, certain.random_leave == 0.0 and certain.vertices_leave == 0.0


def _row_of(form: Form, pairs: int, seeds: int, seen: Trajectories) -> list[str]:
    name = f"learned, {form.name}, {pairs} pairs"
    found = learned(
        form, pairs, delta=DELTA, seeds=range(seeds), seen=seen, tick=_tick(name, seeds)
    )
    return row(name, found)


class _Ticks:
    """Tells how far one row is."""

    def __init__(self, name: str, total: int) -> None:
        self._name, self._total, self._done = name, total, 0
        self._begun = time.perf_counter()

    def __call__(self) -> None:
        self._done += 1
        took = time.perf_counter() - self._begun
        sys.stderr.write(f"\r{self._name}: {self._done} of {self._total}, {took:.0f} s")
        if self._done == self._total:
            sys.stderr.write("\n")


def _tick(name: str, total: int) -> _Ticks:
    return _Ticks(name, total)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print or put the table; 1 when the proof fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=60, help="of the quick rows (default: 60)")
    parser.add_argument("--few", type=int, default=10, help="of the slow rows (default: 10)")
    parser.add_argument("--into", type=Path, metavar="FILE", help="a document with the marks")
    args = parser.parse_args(arguments)
    rows, holds = figures(args.seeds, args.few, RANDOM, epsilon=EPSILON)
    text = table(rows)
    if args.into:
        put_between(args.into, MARKS, text)
    sys.stdout.write(text + "\n")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
