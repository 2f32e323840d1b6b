"""Recommended gains against the present ones, of finished sweeps, as a table for a document.

Run with Python (extra `study`): `python -m workbench.bench.gain_choice DIR...` prints the tables of
sweeps' folders; `--into docs/gain-sweeps.md` puts them between the document's marks. It fails where
no gains keep the bounds of a study.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from workbench.bench.into_document import markdown, put_between
from workbench.simulation.gain_sweep.deciding import Verdict, verdict
from workbench.simulation.gain_sweep.driving import driven_figures
from workbench.simulation.gain_sweep.figures import DRIVEN, figure
from workbench.simulation.gain_sweep.plan import Plan
from workbench.simulation.gain_sweep.store import SweepStore

MARKS: Final = ("<!-- recommended gains: begin -->", "<!-- recommended gains: end -->")
_SHOWN: Final = (
    "area_3s_m2", "lateral_3s_m", "along_3s_m", "phase_deg", "delay_margin_s", "disk", "stopping_m",
    "settling_s", "saturated",
)  # fmt: skip


def choice(store: SweepStore) -> tuple[str, bool]:
    """The table of a finished sweep in Markdown, and whether there is a recommendation."""
    plan = store.plan()
    found = verdict(store.rows(), plan.decision, driven_figures(store))
    if found.best is None:
        return f"{plan.name}: no gains keep the bounds.", False
    was, now = found.present, found.best
    rows = [
        [f"{name}", f"{was.gains[name]:.4g}", f"{now.gains[name]:.4g}"]
        for name in plan.varied
    ] + [
        [figure(name).label, _shown(was.figures[name]), _shown(now.figures[name])]
        for name in (*_SHOWN, *(DRIVEN if found.driven else ()))
    ]  # fmt: skip
    table = markdown(["", "present", "recommended"], rows)
    return f"{_said(plan, found)}\n\n{table}", True


def _said(plan: Plan, found: Verdict) -> str:
    text = (
        f"**{plan.name}**: {len(found.points)} gains ({plan.method}), worst over "
        f"{len(plan.cases)} case{'s' * (len(plan.cases) > 1)}."
    )
    if plan.drives is None:
        return text + " Nobody drove."
    return (
        f"{text} Drives: {len(plan.drives.scenarios)} scenarios, "
        f"{len(plan.drives.seeds)} seed{'s' * (len(plan.drives.seeds) > 1)}, "
        f"{plan.drives.plant}, {plan.drives.policy}."
    )


def _shown(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.4g}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print or put the tables; 1 where there is no recommendation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR", help="of finished sweeps")
    parser.add_argument("--into", type=Path, metavar="FILE", help="a document with the marks")
    args = parser.parse_args(arguments)
    found = [choice(SweepStore(folder)) for folder in args.folders]
    text = "\n\n".join(each for each, _ in found)
    if args.into:
        put_between(args.into, MARKS, text)
    sys.stdout.write(text + "\n")
    return 0 if all(chosen for _, chosen in found) else 1


if __name__ == "__main__":
    sys.exit(main())
