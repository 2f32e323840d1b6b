"""The benchmark car B1 returns to its lane: after 3 s it is within 0.15 m, and never beyond 0.65 m.

Run with Python (extra `analysis`); an argument names the picture. It fails when the claim does.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from workbench.models.benchmarks import Benchmark, b1
from workbench.reach import ReachTube, ValidatedTube, compute_tube
from workbench.sensitivity.sampling import rollout, sample_initial_states

# Specification
HORIZON_S = 3.0
FARTHEST_M = 0.65
AT_THE_END_M = 0.15

# Analysis: steps of 0.025 s, the grid on which the sampled runs are compared as well.
STEP_S = 0.025
RUNS = 2000
# The sampled runs' own error, by Runge-Kutta steps of the same length; vertices touch the tube.
RUN_ERROR = 1e-6


def analyse(model: Benchmark) -> ReachTube:
    """A tube for every initial state at once."""
    return compute_tube(
        model.system,
        initial_set=model.initial_set,
        horizon_s=HORIZON_S,
        method=ValidatedTube(STEP_S),
    )


def check(model: Benchmark, tube: ReachTube) -> str:
    """Assert the claim and return it in words."""
    assert tube.complete, tube.message
    y = tube.names.index("y")
    farthest = float(max(-tube.lower[:, y].min(), tube.upper[:, y].max()))
    at_end = float(max(-tube.lower_at[-1, y], tube.upper_at[-1, y]))
    assert farthest <= FARTHEST_M, f"offset up to {farthest:.3f} m"
    assert at_end <= AT_THE_END_M, f"offset {at_end:.3f} m at the end"
    # The second route: sampled runs, all vertices of the initial set included, stay inside.
    starts = sample_initial_states(model.initial_set, count=RUNS, seed=1)
    runs = rollout(model.system, starts, horizon_s=HORIZON_S, step_s=STEP_S)
    outside = np.any(
        (runs < tube.lower_at - RUN_ERROR) | (runs > tube.upper_at + RUN_ERROR), axis=(1, 2)
    ).sum()
    assert outside == 0, f"{outside} of {RUNS} sampled runs leave the tube"
    return (
        f"{tube.rigor.name}: the offset stays within {farthest:.3f} m and is at most "
        f"{at_end:.3f} m after {HORIZON_S:g} s; {RUNS} sampled runs inside"
    )


def plot(tube: ReachTube, file: Path) -> None:
    """Offset and steering over time with the specification."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(2, 1, sharex=True)
    for axes, (name, label) in zip(
        panels, (("y", "offset (m)"), ("steering", "steering (rad)")), strict=True
    ):
        column = tube.names.index(name)
        axes.fill_between(tube.times, tube.lower_at[:, column], tube.upper_at[:, column], alpha=0.4)
        axes.set_ylabel(label)
    panels[0].axhline(FARTHEST_M, color="black", linestyle="--")
    panels[1].set_xlabel("time (s)")
    figure.savefig(file)
    pyplot.close(figure)


def main(picture: Path | None) -> str:
    """Model, analysis, claim, plot."""
    model = b1()
    tube = analyse(model)
    claim = check(model, tube)
    if picture is not None:
        plot(tube, picture)
    return claim


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
