"""A tight bound for B1, shrunk by 1 % at one time in one state, is refuted; a true one never is.

The bound is the largest distance that another integrator and another search find, at every
examined instant. It is shrunk at one instant in one state at a time and examined. Run with Python
(extra `analysis`); an argument names the picture. It fails when the claim does.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.bench.tight_envelope import CENTRE, NAMES, TightEnvelope, runs, tight_envelope
from workbench.claims import Rigor
from workbench.models.benchmarks import b1
from workbench.reach import ValidatedTube, compute_tube
from workbench.sensitivity import (
    Discrepancy,
    Examination,
    ExaminationVerdict,
    Examiner,
    ProvedEnvelope,
    cross_examine,
)
from workbench.sensitivity.vectorised import Array
from workbench.sensitivity.witness import AnyWitness

# Specification
HORIZON_S = 3.0
SHRUNK_BY = (0.01, 0.05, 0.2)
AT_S = (0.0, 0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
LONGEST_S = 60.0

# Analysis
STEP_S = 0.1
STARTS = 2
# The search finds the envelope to a few millionths; a bound this much above it is true.
SLACK = 1e-4
# A bound this much above the proved tube stays above it when it is shrunk.
ABOVE = 1.3
SEED = 1


@dataclass(frozen=True)
class Tabulated:
    """The rows (K+1, 7) at multiples of `step_s`, for every pair at most the half widths apart."""

    rows: Array
    step_s: float

    def half_widths(self, initial: tuple[float, ...], t_s: float) -> tuple[float, ...]:
        """The row of `t_s`, whatever the initial distances."""
        del initial
        return tuple(self.rows[round(t_s / self.step_s)].tolist())


@dataclass(frozen=True)
class Lie:
    """Where the bound was shrunk, by what share, and what came of it."""

    state: str
    at_s: float
    by: float
    witness: AnyWitness | None
    took_s: float


def examine(rows: Array, step_s: float, proved: Sequence[ProvedEnvelope] = ()) -> Examination:
    """The examination of tabulated half widths as `workbench examine` does it."""
    claim = Discrepancy(
        names=NAMES,
        region=None,
        horizon_s=step_s * (len(rows) - 1),
        norm="planted",
        rigor=Rigor.SAMPLED,
        condition="one of the two runs starts in the middle of the set",
        growth=Tabulated(rows, step_s),
    )
    model = b1()
    return cross_examine(
        model.system,
        initial_set=model.initial_set,
        horizon_s=claim.horizon_s,
        learned=claim,
        proved=proved,
        method=Examiner(
            samples=1000,
            seed=SEED,
            step_s=step_s,
            goals_per_coordinate=8,
            rounds=4,
            starts=3,
            second_order_rounds=2,
            any_centre=False,
            closer=True,
            stays_in_region=Rigor.ENCLOSED,
        ),
    )


def planted(
    envelope: TightEnvelope, at_s: Sequence[float], shrunk_by: Sequence[float]
) -> list[Lie]:
    """Every lie, one examination each; a state that cannot differ yet is left out."""
    step_s = float(envelope.times_s[1])
    lies = []
    for k in (round(t / step_s) for t in at_s):
        for i in np.flatnonzero(envelope.distance[k]).tolist():
            for by in shrunk_by:
                rows = (1.0 + SLACK) * envelope.distance
                rows[k, i] = (1.0 - by) * envelope.distance[k, i]
                begun = time.perf_counter()
                found = examine(rows, step_s)
                took_s = time.perf_counter() - begun
                lies.append(Lie(NAMES[i], k * step_s, by, found.witness, took_s))
    return lies


def check_lies(lies: Sequence[Lie]) -> None:
    """Each is found where it was planted, in time, and stands for the other integrator as well."""
    for lie in lies:
        what = f"{lie.state} at {lie.at_s:g} s, shrunk by {lie.by:.0%}"
        assert lie.witness is not None, f"not found: {what}"
        assert lie.witness.coordinate == lie.state, what
        assert abs(lie.witness.time_s - lie.at_s) < 1e-9, what
        assert lie.took_s < LONGEST_S, f"{lie.took_s:.1f} s: {what}"
        if lie.at_s > 0.0:
            both = np.array([lie.witness.first, lie.witness.second])
            ends = runs(both, np.array([0.0, lie.at_s]))[:, -1, NAMES.index(lie.state)]
            assert abs(ends[1] - ends[0]) > lie.witness.bound, f"DOP853 disagrees: {what}"


def proved_tube() -> ProvedEnvelope:
    """B1's validated tube as a bound about the middle run."""
    model = b1()
    tube = compute_tube(
        model.system,
        initial_set=model.initial_set,
        horizon_s=HORIZON_S,
        method=ValidatedTube(STEP_S / 2.0),
    )
    assert tube.complete, tube.message
    middle = runs(np.array([CENTRE]), tube.times)[0]
    rows = np.maximum(tube.upper_at - middle, middle - tube.lower_at)

    def half_widths(t_s: float) -> list[float]:
        return [float(value) for value in rows[round(2.0 * t_s / STEP_S)]]

    return ProvedEnvelope("validated tube", half_widths, tube.rigor, "one run from the middle")


def check_true_bounds(envelope: TightEnvelope, proved: ProvedEnvelope) -> int:
    """Shrunk or not, a bound that is still true is let be, and implied where it is proved."""
    tube = np.array([proved.half_widths(t) for t in envelope.times_s.tolist()])
    examined = 0
    for by in (0.0, *SHRUNK_BY):
        for base, expected in (
            ((1.0 + SLACK) / (1.0 - by) * envelope.distance, ExaminationVerdict.CONSISTENT),
            (ABOVE * tube, ExaminationVerdict.IMPLIED_BY_PROOF),
        ):
            rows = base.copy()
            rows[len(rows) // 2] *= 1.0 - by
            found = examine(rows, STEP_S, [proved])
            assert found.verdict is expected, f"{found.verdict} after shrinking by {by:.0%}"
            examined += 1
    return examined


def plot(envelope: TightEnvelope, lies: Sequence[Lie], file: Path) -> None:
    """The envelope of each state, and the witnesses against it shrunk by the least share."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(2, 4, sharex=True, figsize=(11.0, 5.0), layout="constrained")
    for i, axes in enumerate(panels.flat[: len(NAMES)]):
        axes.plot(envelope.times_s, envelope.distance[:, i], color="black", label="tight bound")
        caught = [lie for lie in lies if lie.state == NAMES[i] and lie.by == min(SHRUNK_BY)]
        axes.plot(
            [lie.at_s for lie in caught],
            [lie.witness.distance if lie.witness else np.nan for lie in caught],
            "o",
            label=f"witness after shrinking by {min(SHRUNK_BY):.0%}",
        )
        axes.set_title(NAMES[i])
        axes.set_xlabel("time (s)")
    panels.flat[-1].axis("off")
    panels.flat[-1].legend(*panels.flat[0].get_legend_handles_labels(), loc="center")
    figure.savefig(file)
    pyplot.close(figure)


def main(picture: Path | None) -> str:
    """Envelope, lies, claim, plot."""
    times = np.linspace(0.0, HORIZON_S, round(HORIZON_S / STEP_S) + 1)
    envelope = tight_envelope(times, starts=STARTS, seed=SEED)
    lies = planted(envelope, AT_S, SHRUNK_BY)
    check_lies(lies)
    true = check_true_bounds(envelope, proved_tube())
    if picture is not None:
        plot(envelope, lies, picture)
    slowest = max(lie.took_s for lie in lies)
    return (
        f"{len(lies)} lies planted, all found, the slowest in {slowest:.1f} s; {true} bounds that "
        "are still true left alone, every run inside"
    )


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
