"""A small study of gains, its kernels, and rows made by hand, that tests of sweeps share."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from workbench.models.vehicle import Vehicle, load_vehicle
from workbench.simulation.gain_sweep.figures import FIGURES
from workbench.simulation.gain_sweep.kernels import Kernels, build_kernels
from workbench.simulation.simulated import simulated_path

STUDY = """\
[study]
name = "small"
claim = "Some gains keep the bounds."

[gains]
kp = [0.008, 0.012]
kd = 0.08
look-ahead = [5.0, 8.0]

[search]
method = "sobol"
points = 3
seed = 2

[cases]
speeds_mps = [2.0]
curvatures_per_m = [[0.0, 0.0], [0.05, 0.05]]
initial_sets = [{ name = "narrow", offset_m = 0.2, radius_factor = 0.5 }]

[decide]
trade = ["lateral_3s_m", "settling_s"]
choose = "lateral_3s_m"

[decide.at_least]
phase_deg = 40
"""


def study(folder: Path, old: str = "", new: str = "") -> Path:
    """The study's file, one text in it replaced."""
    assert STUDY.count(old) == 1 or not old
    file = folder / "study.toml"
    file.write_text(STUDY.replace(old, new) if old else STUDY, encoding="utf-8")
    return file


DRIVES = """
[drives]
scenarios = ["nobody_s_bend", "standing_far_beside"]
seeds = [1, 2]
finalists = 2
"""


def with_drives(folder: Path, extra: str = DRIVES, old: str = "", new: str = "") -> Path:
    """The study's file with drives."""
    file = study(folder, old, new)
    file.write_text(file.read_text(encoding="utf-8") + extra, encoding="utf-8")
    return file


@functools.cache
def vehicle() -> Vehicle:
    return load_vehicle(simulated_path())


RANGES = {
    "reference_speed": (0.5, 2.5), "look_ahead": (0.0, 12.0),
    "steering_gain_proportional": (0.0, 1.0), "steering_gain_derivative": (0.0, 2.0),
    "steering_gain_integral": (0.0, 0.1), "speed_gain_proportional": (0.2, 2.0),
    "speed_gain_integral": (0.0, 0.5),
}  # fmt: skip


@functools.cache
def kernels() -> Kernels:
    """For ranges far wider than any study's."""
    return Kernels.of(vehicle(), build_kernels(vehicle(), RANGES))


def row(point: int, case: int = 0, **changed: object) -> dict[str, Any]:
    """A row in which every figure is 1."""
    gains = {"kp": 0.1 * point, "ki": 0.0, "kd": 0.1, "look-ahead": 5.0, "speed-kp": 0.6,
             "speed-ki": 0.1}  # fmt: skip
    values = {"point": point, "case": case, "stable": True, **gains, **dict.fromkeys(FIGURES, 1.0)}
    return {**values, **changed}
