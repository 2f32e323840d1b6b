"""example_model: a damped pendulum, and a tube that contains each of its trajectories.

Run this file with Python; the extra `analysis` must be installed.
"""

import casadi as ca

from workbench.models import System, system_from_casadi
from workbench.reach import ReachTube, compute_tube
from workbench.sets import Box

GRAVITY_MPS2 = 9.81
LENGTH_M = 1.0
DAMPING_PER_S = 0.4


def example_model() -> System:
    """angle'' = -(gravity / length) sin(angle) - damping angle'."""
    angle = ca.SX.sym("angle")
    rate = ca.SX.sym("rate")
    acceleration = -(GRAVITY_MPS2 / LENGTH_M) * ca.sin(angle) - DAMPING_PER_S * rate
    return system_from_casadi(
        ca.vertcat(angle, rate),
        ca.vertcat(rate, acceleration),
        ("angle", "rate"),
        units=("rad", "rad/s"),
        name="example_model",
    )


def tube() -> ReachTube:
    """The tube over 2 s from every start within 0.05 rad and 0.05 rad/s of (0.5, 0)."""
    start = Box.around({"angle": 0.5, "rate": 0.0}, radius={"angle": 0.05, "rate": 0.05})
    return compute_tube(example_model(), initial_set=start, horizon_s=2.0)


def main() -> None:
    result = tube()
    print(f"{result.status.name}, {result.rigor.name}, proved to {result.times[-1]:.2f} s")
    for column, name in enumerate(result.names):
        low, high = result.lower_at[-1][column], result.upper_at[-1][column]
        print(f"{name:>6} at the end: [{low:+.4f}, {high:+.4f}]")


if __name__ == "__main__":
    main()
