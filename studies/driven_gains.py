"""Gains of the simulated vehicle that keep every bound of `driven_gains.toml` have a proved tube of
less area after 3 s than the present ones, and in the shipped library of scenarios they touch nobody
avoidably. How often they stop needlessly, and stand, is said beside.

The sweep is that of `workbench gains sweep`, by the Parzen estimator, and its drives. Run with
Python (extras `analysis`, `study`); an argument names the picture. It takes some ten minutes and
fails when the claim does.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

from workbench.simulation.campaign.workers import InProcess
from workbench.simulation.gain_sweep.deciding import Verdict, verdict
from workbench.simulation.gain_sweep.driving import drive_missing, driven_figures
from workbench.simulation.gain_sweep.store import SweepStore
from workbench.simulation.gain_sweep.sweeping import sweep

# Specification
STUDY = Path(__file__).with_suffix(".toml")
AREA, NEEDLESS = "area_3s_m2", "needless_per_km"


def analyse(folder: Path) -> Verdict:
    """The finished sweep with its drives, and its decision."""
    store = SweepStore(folder)
    plan = store.begin(STUDY)
    store.build()
    sweep(store, InProcess(), lambda _: None)
    drive_missing(store, InProcess(), lambda _: None)
    return verdict(store.rows(), plan.decision, driven_figures(store))


def check(found: Verdict) -> str:
    """Raise AssertionError unless the claim holds; says it with its figures."""
    assert found.best is not None, "no gains keep the bounds"
    was, now = found.present.figures, found.best.figures
    assert found.changes
    assert now[AREA] < was[AREA], f"tube area {now[AREA]:.4g} m² against {was[AREA]:.4g} m²"
    assert now["avoidable"] == 0.0
    return (
        f"point {found.best.index} of {len(found.points)}: tube area at 3 s {now[AREA]:.4g} m² "
        f"instead of {was[AREA]:.4g} m², needless stops per km {now[NEEDLESS]:.3g} against "
        f"{was[NEEDLESS]:.3g}, share of time at standstill {now['standing']:.3g} against "
        f"{was['standing']:.3g}, avoidable contacts {now['avoidable']:g}"
    )


def plot(found: Verdict, picture: Path) -> None:
    """What drives came to, present and recommended gains side by side."""
    assert found.best is not None
    canvas = Figure(figsize=(7.0, 3.5), layout="constrained")
    panels = canvas.subplots(1, 3)
    for axes, name, label in zip(
        panels, (AREA, NEEDLESS, "standing"),
        ("tube area at 3 s (m²)", "needless stops per km", "share of time at standstill"),
        strict=True,
    ):  # fmt: skip
        values = [point.figures[name] for point in (found.present, found.best)]
        axes.bar(["present", "recommended"], values)
        axes.set_ylabel(label)
    canvas.savefig(picture, dpi=120)


def main(picture: Path | None) -> str:
    """Model, analysis, claim, plot."""
    with tempfile.TemporaryDirectory() as place:
        found = analyse(Path(place) / "sweep")
    claim = check(found)
    if picture is not None:
        plot(found, picture)
    return claim


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
