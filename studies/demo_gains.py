"""Gains of the GEM e2 that keep every bound of `demo_gains.toml`, at least the benchmark's delay
margin among them, have a proved tube of half the area at most after 3 s; they are those of the
shipped file that `workbench demo` drives with.

The sweep is that of `workbench gains sweep`, by NSGA-II. Another version of Optuna may draw other
points: the shipped gains are then held against the bounds and the present gains alone, which they
always are. Run with Python (extras `analysis`, `study`); an argument names the picture. It fails
when the claim does.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from studies.steering_gains import plot
from workbench.models.vehicle import gem_e2_recommended_path, load_vehicle
from workbench.simulation.campaign.workers import InProcess
from workbench.simulation.gain_sweep.deciding import NOT_DRIVEN, Point, Verdict, point_of, verdict
from workbench.simulation.gain_sweep.gains import Gains, own_gains
from workbench.simulation.gain_sweep.scores import score
from workbench.simulation.gain_sweep.store import SweepStore
from workbench.simulation.gain_sweep.sweeping import sweep

# Specification
STUDY = Path(__file__).with_suffix(".toml")
AREA = "area_3s_m2"
SMALLER = 0.5
# Shipped gains are as good as what is found, up to this share.
AS_GOOD = 0.05


def begun(folder: Path) -> SweepStore:
    """The study's folder with its kernels."""
    store = SweepStore(folder)
    store.begin(STUDY)
    store.build()
    return store


def scored(store: SweepStore, gains: Gains) -> Point:
    """These gains in every case of the study."""
    plan, kernels = store.plan(), store.kernels()
    rows = [{"point": 0, **score(kernels, gains, case)} for case in plan.cases]
    return point_of(0, rows, plan.decision, NOT_DRIVEN)


def check_shipped(store: SweepStore) -> tuple[Point, Point]:
    """Raise AssertionError unless the shipped gains keep the bounds with half the area; the present
    gains and they."""
    present = scored(store, own_gains(store.vehicle()))
    shipped = scored(store, own_gains(load_vehicle(gem_e2_recommended_path())))
    assert shipped.keeps, f"the shipped gains fail {shipped.fails}"
    was, now = present.figures[AREA], shipped.figures[AREA]
    assert now <= SMALLER * was, f"tube area {now:.4g} m² against {was:.4g} m²"
    assert shipped.figures["delay_margin_s"] >= present.figures["delay_margin_s"]
    return present, shipped


def check_found(found: Verdict, shipped: Point) -> str:
    """Raise AssertionError unless the search finds what is shipped, or nothing much better."""
    assert found.best is not None, "no gains keep the bounds"
    best = found.best.figures[AREA]
    assert shipped.figures[AREA] <= (1.0 + AS_GOOD) * best, f"{best:.4g} m² were found"
    return "the same gains" if found.best.gains == shipped.gains else "others, as good"


def main(picture: Path | None) -> str:
    """Model, analysis, claim, plot."""
    with tempfile.TemporaryDirectory() as place:
        store = begun(Path(place) / "sweep")
        present, shipped = check_shipped(store)
        sweep(store, InProcess(), lambda _: None)
        found = verdict(store.rows(), store.plan().decision)
        same = check_found(found, shipped)
    if picture is not None:
        plot(found, (shipped, "shipped"), AREA, picture)
    return (
        f"shipped gains: tube area at 3 s {shipped.figures[AREA]:.4g} m² instead of "
        f"{present.figures[AREA]:.4g} m², delay margin {shipped.figures['delay_margin_s']:.3g} s "
        f"instead of {present.figures['delay_margin_s']:.3g} s; the search finds {same} among "
        f"{len(found.points)} points"
    )


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
