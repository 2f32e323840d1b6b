"""What `workbench examine` found, in words, tables and JSON."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from workbench.cli.analysis_options import text_table
from workbench.cli.analysis_results import Array
from workbench.cli.examine_bounds import Beside
from workbench.sensitivity import Discrepancy, Examination
from workbench.sensitivity.witness import AnyWitness, Witness

VERDICTS: Final = {
    "REFUTED": "refuted",
    "CONSISTENT": "consistent (no pair breaks it; this proves nothing)",
    "IMPLIED_BY_PROOF": "implied by proof",
}
COVERAGE: Final = ["pairs", "number", "inside all along", "largest distance / bound"]
_ROUNDING: Final = 1e-9

Row = list[str | int | float | None]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The examination with what went into it.

    beside, error, sure: of a model only; the proofs, the estimated error (K+1, n) of its runs'
    distances, and the bounds that validated integration puts on the witness's distance. how: what
    the search used.
    """

    title: str
    units: tuple[str, ...]
    learned: Discrepancy
    found: Examination
    beside: Beside | None
    error: Array | None
    sure: tuple[float, float] | None
    how: str

    @property
    def methods(self) -> list[str]:
        """Names of the proved bounds, in the order of the curves."""
        return list(self.beside.bounds) if self.beside else []


def told(witness: AnyWitness) -> str:
    """The witness in one sentence."""
    error = "as the simulator repeats it"
    if isinstance(witness, Witness):
        error = f"integration error {witness.integration_error:.1e}"
    return (
        f"witness: two runs are {witness.distance:.6g} apart in {witness.coordinate} at "
        f"{witness.time_s:g} s ({error}), where the bound says {witness.bound:.6g}"
    )


def lead(outcome: Outcome) -> list[str]:
    """Verdict, witness, what confirms it, and how it was searched."""
    found = outcome.found
    lines = [f"verdict: {VERDICTS[found.verdict.name]}"]
    if found.witness is not None:
        lines.append(told(found.witness))
    if found.witness is not None and outcome.beside is not None:
        lines.append(_confirmed(found.witness.bound, outcome.sure))
    return [*lines, outcome.how]


def _confirmed(bound: float, sure: tuple[float, float] | None) -> str:
    if sure is None:
        return "validated integration does not reach the witness: it stands in floats only"
    low, high = sure
    proof = "which proves it" if low > bound else "which does not decide"
    return f"validated integration puts that distance between {low:.9g} and {high:.9g}, {proof}"


def doubts(outcome: Outcome) -> list[str]:
    """A run beyond a proved bound must not pass in silence, beyond the error of the runs."""
    found = outcome.found
    error = 0.0 if outcome.error is None else outcome.error
    return [
        f"a run lies beyond the proved bound {name} by the factor {curve.worst_ratio:.9g}, more "
        "than the estimated integration error of the runs: a defect of the proof, or a bad "
        "estimate; try a shorter --step"
        for name, curve in zip(outcome.methods, found.proved, strict=True)
        if not (found.driven - error <= (1.0 + _ROUNDING) * curve.half_widths).all()
    ]


def coverage_rows(found: Examination) -> list[Row]:
    """One row per group."""
    return [
        [each.group, each.pairs, f"{each.whole_run:.2%}", each.worst_ratio]
        for each in found.coverage
    ]


PROVED: Final = ["bound", "rigor", "implies the learned", "largest distance / bound"]


def proved_rows(outcome: Outcome) -> list[Row]:
    """One row per proved bound."""
    return [
        [name, curve.rigor.name, "yes" if curve.implies_learned else "no", curve.worst_ratio]
        for name, curve in zip(outcome.methods, outcome.found.proved, strict=True)
    ]


def tightness_headings(outcome: Outcome) -> list[str]:
    """Of the table of `tightness_rows`."""
    return ["bound", *outcome.found.names]


def tightness_rows(outcome: Outcome) -> list[Row]:
    """Mean over time of bound / distance reached, per state: the learned bound, then the proofs."""
    curves = zip(outcome.methods, outcome.found.proved, strict=True)
    rows = [("learned", outcome.found.tightness), *((name, c.tightness) for name, c in curves)]
    return [[name, *(None if np.isnan(v) else float(v) for v in values)] for name, values in rows]


def text(args: argparse.Namespace, outcome: Outcome) -> str:
    """For the terminal."""
    tables = [text_table(COVERAGE, coverage_rows(outcome.found)), ""]
    if outcome.found.proved:
        tables += [text_table(PROVED, proved_rows(outcome)), ""]
    refusals = outcome.beside.refusals if outcome.beside else {}
    return "\n".join(
        [
            f"{outcome.title}: a learned bound on trial up to {args.horizon:g} s",
            *lead(outcome),
            "",
            *tables,
            "bound over the largest distance reached, mean over time (1 is perfect)",
            text_table(tightness_headings(outcome), tightness_rows(outcome)),
            *(f"{name}: {why}" for name, why in refusals.items()),
            "",
            f"wrote {args.out / 'examine.html'} and {args.out / 'witness.json'}",
        ]
    )


def data(args: argparse.Namespace, outcome: Outcome) -> dict[str, object]:
    """For `--json`."""
    found, beside = outcome.found, outcome.beside
    return {
        "name": outcome.title,
        "verdict": found.verdict,
        "horizon_s": args.horizon,
        "witness": found.witness,
        "witness_proved_between": outcome.sure,
        "search": outcome.how,
        "coverage": [
            {"group": c.group, "pairs": c.pairs, "whole_run": c.whole_run, "worst": c.worst_ratio}
            for c in found.coverage
        ],
        "proved": [
            {
                "method": name,
                "rigor": curve.rigor,
                "implies_learned": curve.implies_learned,
                "worst": curve.worst_ratio,
                "tightness": dict(zip(found.names, _numbers(curve.tightness), strict=True)),
            }
            for name, curve in zip(outcome.methods, found.proved, strict=True)
        ],
        "refusals": beside.refusals if beside else {},
        "tightness": dict(zip(found.names, _numbers(found.tightness), strict=True)),
        "tube_status": beside.tube.status if beside else None,
        "files": [args.out / "examine.html", args.out / "witness.json"],
    }


def _numbers(values: Array) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
