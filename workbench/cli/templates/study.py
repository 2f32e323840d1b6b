"""example_study: a car that returns to its lane stays within 0.6 m of the middle.

Run this file with Python; the extra `analysis` must be installed. It reads in the order model,
specification, analysis, claim, plot. It fails when the claim does.
"""

from pathlib import Path

import casadi as ca

from workbench.models import System, system_from_casadi
from workbench.reach import ReachTube, compute_tube
from workbench.sets import Box

# Model: a car at constant speed whose yaw rate follows the offset of a point ahead of it.
SPEED_MPS = 2.0
LOOK_AHEAD_M = 2.0
GAIN_PER_M_S = 0.6

# Specification
START = Box.around(
    {"offset": 0.3, "heading_error": 0.0}, radius={"offset": 0.1, "heading_error": 0.05}
)
HORIZON_S = 3.0
LARGEST_OFFSET_M = 0.6


def example_study() -> System:
    """offset' = v sin(heading), heading' = -k (offset + l sin(heading))."""
    offset = ca.SX.sym("offset")
    heading = ca.SX.sym("heading_error")
    field = ca.vertcat(
        SPEED_MPS * ca.sin(heading),
        -GAIN_PER_M_S * (offset + LOOK_AHEAD_M * ca.sin(heading)),
    )
    states = ca.vertcat(offset, heading)
    return system_from_casadi(
        states, field, ("offset", "heading_error"), units=("m", "rad"), name="example_study"
    )


def plot(tube: ReachTube, file: Path) -> None:
    """The offset's bounds over time, with the limit."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    column = tube.names.index("offset")
    figure, axes = pyplot.subplots()
    axes.fill_between(tube.times, tube.lower_at[:, column], tube.upper_at[:, column], alpha=0.4)
    for limit in (-LARGEST_OFFSET_M, LARGEST_OFFSET_M):
        axes.axhline(limit, color="black", linestyle="--")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("offset (m)")
    figure.savefig(file)
    pyplot.close(figure)


def main() -> None:
    # Analysis
    tube = compute_tube(example_study(), initial_set=START, horizon_s=HORIZON_S)

    # Claim
    column = tube.names.index("offset")
    reached = max(-tube.lower[:, column].min(), tube.upper[:, column].max())
    assert tube.times[-1] >= HORIZON_S, tube.message
    assert reached <= LARGEST_OFFSET_M, f"offset up to {reached:.3f} m"
    print(f"holds ({tube.rigor.name}): the offset stays within {reached:.3f} m")

    # Plot
    file = Path(__file__).with_suffix(".png")
    plot(tube, file)
    print(f"plot: {file}")


if __name__ == "__main__":
    main()
