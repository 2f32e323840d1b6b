"""Gains of the simulated vehicle that keep every bound of `steering_gains.toml` have a proved tube
that is narrower by 5 % after 3 s than with the present gains.

The sweep is that of `workbench gains sweep`. What it found is held against python-control, from the
vehicle file that it would write. Run with Python (extras `analysis`, `study`); an argument names
the picture. It fails when the claim does.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

from workbench.models.control_view import margins
from workbench.models.gains import LateralLoop, Reason, conditions
from workbench.models.vehicle import load_vehicle
from workbench.simulation.campaign.workers import InProcess
from workbench.simulation.gain_sweep.deciding import Point, Verdict, verdict
from workbench.simulation.gain_sweep.figures import figure
from workbench.simulation.gain_sweep.store import SweepStore
from workbench.simulation.gain_sweep.sweeping import sweep
from workbench.simulation.gain_sweep.vehicle_text import with_written_gains

# Specification
STUDY = Path(__file__).with_suffix(".toml")
NARROWER = 0.05
WIDTH = "lateral_3s_m"
# The sweep's margins and python-control's are the same up to rounding.
AGREE = 1e-6


def analyse(folder: Path) -> tuple[SweepStore, Verdict]:
    """The finished sweep and its decision."""
    store = SweepStore(folder)
    plan = store.begin(STUDY)
    store.build()
    sweep(store, InProcess(), lambda _: None)
    return store, verdict(store.rows(), plan.decision)


def check(store: SweepStore, found: Verdict) -> str:
    """Raise AssertionError unless the claim holds; says it with its figures."""
    assert found.best is not None, "no gains keep the bounds"
    assert found.best.keeps
    was, now = found.present.figures[WIDTH], found.best.figures[WIDTH]
    assert now <= (1.0 - NARROWER) * was, f"half width {now:.4g} m against {was:.4g} m"
    text = (store.folder / "vehicle.toml").read_text(encoding="utf-8")
    written = store.folder / "written.toml"
    written.write_text(with_written_gains(text, found.best.gains, "this study"), encoding="utf-8")
    for speed_mps in {case.speed_mps for case in store.plan().cases}:
        loop = LateralLoop.of(load_vehicle(written), speed_mps=speed_mps)
        assert conditions(loop).reason() is Reason.STABLE
        known = margins(loop.open_loop())
        assert known.phase_margin_deg >= found.best.figures["phase_deg"] - AGREE
        assert known.delay_margin_s >= found.best.figures["delay_margin_s"] - AGREE
    return (
        f"point {found.best.index} of {len(found.points)}: lateral half width at 3 s {now:.4g} m "
        f"instead of {was:.4g} m, settling {found.best.figures['settling_s']:.4g} s instead of "
        f"{found.present.figures['settling_s']:.4g} s"
    )


def plot(found: Verdict, star: tuple[Point, str], name: str, picture: Path) -> None:
    """A figure against settling of every choice; the present gains and one more, named, stand
    out."""
    canvas = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = canvas.add_subplot()
    for points, marker, label in (
        (found.points, ".", "all choices"), (found.front, "o", "the front"),
        ([found.present], "s", "present gains"), ([star[0]], "*", star[1]),
    ):  # fmt: skip
        x, y = ([p.figures[each] for p in points] for each in ("settling_s", name))
        axes.scatter(x, y, marker=marker, label=label, s=90)
    axes.set_xlabel(figure("settling_s").label)
    axes.set_ylabel(figure(name).label)
    axes.grid(alpha=0.3)
    axes.legend()
    canvas.savefig(picture, dpi=120)


def main(picture: Path | None) -> str:
    """Model, analysis, claim, plot."""
    with tempfile.TemporaryDirectory() as place:
        store, found = analyse(Path(place) / "sweep")
        claim = check(store, found)
    if picture is not None and found.best is not None:
        plot(found, (found.best, "recommended"), WIDTH, picture)
    return claim


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
