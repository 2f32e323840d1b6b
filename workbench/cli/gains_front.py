"""What `workbench gains recommend` writes: vehicle file, page of the front, points as CSV."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench import __version__
from workbench.cli.common import write_text

if TYPE_CHECKING:
    from workbench.report.tables import Cell, Table
    from workbench.simulation.gain_sweep.deciding import Point, Verdict
    from workbench.simulation.gain_sweep.plan import Plan
    from workbench.simulation.gain_sweep.store import SweepStore


_MOST: Final = 1000
"""Points in a page's table."""


def write_files(folder: Path, store: SweepStore, found: Verdict, why: str) -> list[Path]:
    """vehicle-recommended.toml (where there is a recommendation), report.html, points.csv."""
    from workbench.report.gain_front import front_page
    from workbench.report.page import write_page
    from workbench.simulation.gain_sweep.vehicle_text import with_written_gains

    files = []
    if found.best is not None:
        text = (folder / "vehicle.toml").read_text(encoding="utf-8")
        written = with_written_gains(text, found.best.gains, why)
        write_text(folder / "vehicle-recommended.toml", written)
        files.append(folder / "vehicle-recommended.toml")
    plan = store.plan()
    tables = (costs_table(found), front_table(found), points_table(found))
    page = front_page(
        plan.name, (plan.claim, *why.splitlines()), found, tables,
        (__version__, f"workbench gains recommend --out {folder}"),
    )  # fmt: skip
    write_page(folder / "report.html", page.html())
    return [*files, folder / "report.html", _write_points(folder / "points.csv", found)]


def provenance(plan: Plan, found: Verdict) -> str:
    """Why these gains, in sentences; also the provenance in the vehicle file."""
    from workbench.simulation.gain_sweep.figures import figure
    from workbench.simulation.gain_sweep.plan import shown_bounds

    asked = "; ".join(shown_bounds(plan.decision)) or "none"
    cases = f"{len(plan.cases)} case{'s' * (len(plan.cases) > 1)}"
    swept = (
        f"{len(found.points)} gains in {cases} ({plan.method}, seed {plan.seed}) "
        f"by the study {plan.name!r}, workbench {__version__}. Bounds in every case: {asked}."
    )
    if found.best is None:
        near = min(found.points, key=lambda p: (not p.stable, len(p.fails)))
        return (
            f"No gains keep the bounds among {swept}\nNearest: point {near.index}, which fails "
            f"{'; '.join(near.fails) or 'to be stable'}."
        )
    best, chosen = found.best, figure(plan.decision.choose)
    was, now = found.present.figures[chosen.name], best.figures[chosen.name]
    gains = ", ".join(f"{name} {value:.4g}" for name, value in best.gains.items())
    kept = "which keep the bounds too" if found.present.keeps else (
        f"which fail {'; '.join(found.present.fails) or 'to be stable'}"
    )  # fmt: skip
    head = f"Gains: {gains}." if found.changes else f"The present gains stay: {gains}."
    return (
        f"{head}\nOf the {found.kept} that keep the bounds they have the best {chosen.label}, in "
        f"the worst case {now:.4g}; the present gains, {kept}, have "
        f"{'none' if math.isnan(was) else f'{was:.4g}'}.\n"
        f"Chosen from {swept}\nWidths and stopping distance are proved for the vehicle file's sets "
        "as they are; margins are of the linearised loop; settling, saturation and what is left at "
        f"the end are of runs. {_driven(plan)} What [uncertainty] says was found "
        "with the gains of its time: measure it again with these before a bundle relies on it."
    )


def _driven(plan: Plan) -> str:
    each = plan.drives
    if each is None:
        return "Needless stops were not counted."
    best = "the best point" if each.finalists == 1 else f"the best {each.finalists} points"
    return (
        f"The present gains and {best} of the front drove each "
        f"{len(each.scenarios)} scenarios with {len(each.seeds)} "
        f"seed{'s' * (len(each.seeds) > 1)} ({each.plant}, {each.policy}), at the file's speed; "
        "points that did not drive have no figures of drives."
    )


def costs_table(found: Verdict) -> Table:
    """Every figure of the present and of the recommended gains."""
    from workbench.report.tables import Table
    from workbench.simulation.gain_sweep.deciding import cost_rows

    return Table(
        "recommended against present gains, worst over all cases"
        + ("; drives all together" if found.driven else ""),
        ["figure", "how it is known", "present", "recommended", "change"],
        [[f.label, f.how, was, now, words] for f, was, now, words in cost_rows(found)],
    )


def front_table(found: Verdict) -> Table:
    """The front's points: gains, what is traded, and what came of drives."""
    from workbench.report.tables import Table
    from workbench.simulation.gain_sweep.deciding import shown_figures
    from workbench.simulation.gain_sweep.figures import DRIVEN

    driven = [name for name in shown_figures(found) if name in DRIVEN]
    names = tuple(dict.fromkeys((*found.decision.trade, *driven)))
    headings, rows = _listed(found, found.front, names)
    return Table("points within the bounds that none beats in all that is traded", headings, rows)


def points_table(found: Verdict) -> Table:
    """All points and figures; of very many the present one, the front, and the first others."""
    from workbench.report.tables import Table
    from workbench.simulation.gain_sweep.deciding import shown_figures

    points, words = found.points, "all points"
    if len(points) > _MOST:
        known = dict.fromkeys([found.present, *found.front, *points])
        points = tuple(sorted(list(known)[:_MOST], key=lambda p: p.index))
        words = f"{_MOST} of {len(found.points)} points, the front's among them; points.csv has all"
    headings, rows = _listed(found, points, tuple(shown_figures(found)))
    return Table(f"{words}, worst over all cases", headings, rows, folded=True)


def _listed(
    found: Verdict, points: tuple[Point, ...], names: tuple[str, ...]
) -> tuple[list[str], list[list[Cell]]]:
    from workbench.simulation.gain_sweep.figures import figure
    from workbench.simulation.gain_sweep.gains import GAINS

    headings = ["point", *(each.label for each in GAINS.values()),
                *(figure(name).label for name in names), "note"]  # fmt: skip
    rows: list[list[Cell]] = [
        [p.index, *(p.gains[name] for name in GAINS), *(p.figures[name] for name in names),
         _note(found, p)]
        for p in points
    ]  # fmt: skip
    return headings, rows


def _note(found: Verdict, point: Point) -> str:
    notes = []
    if point is found.best:
        notes.append("recommended")
    if point is found.present:
        notes.append("present")
    if not point.stable:
        notes.append("unstable")
    notes += [f"fails: {each}" for each in point.fails]
    return ", ".join(notes)


def _write_points(file: Path, found: Verdict) -> Path:
    """All points as CSV: gains, worst figures, whether they keep the bounds."""
    from workbench.simulation.gain_sweep.deciding import shown_figures

    stream = io.StringIO()
    rows = [
        {"point": p.index, **p.gains, "stable": p.stable, "keeps_bounds": p.keeps,
         "on_front": p in found.front, **{name: p.figures[name] for name in shown_figures(found)}}
        for p in found.points
    ]  # fmt: skip
    writer = csv.DictWriter(stream, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    write_text(file, stream.getvalue())
    return file
