"""The page of `workbench survey`: its results as values of the report."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from workbench import __version__

if TYPE_CHECKING:
    from workbench.report.tables import Table
    from workbench.simulation.campaign.rows import Row
    from workbench.simulation.campaign.store import Store
    from workbench.simulation.campaign.tallies import Tally

_NOTES: Final = (
    "A contact counts while the car moves faster than 0.05 m/s; whoever walks into a standing car "
    "is not counted. Each drive ends at its first contact, when the scenario is passed or when its "
    "time is over.",
    "Avoidable: braking for good from some period between the first one after the car set off and "
    "the contact avoids it, found by driving them all again. To stay put is not counted as "
    "avoiding.",
    "Needless: a stop in a scenario that a car which never brakes goes through with at least 0.5 m "
    "to everybody. People who want to be hit make many stops needful that others would not.",
    "Baselines were tuned on one half of the scenarios, chosen by a hash of the index, by "
    "bisection to the least parameter that misses nothing there, and count on the other half "
    "alone. Needless stops are counted on that half for everybody.",
    "Bounds and intervals are those of scenarios that are drawn independently. Points of a Sobol "
    "sequence are spread more evenly: of most events less is left to chance, of some more.",
    "At the desk there are no frames, no dead reckoning and no checks for faults: drop-outs of the "
    "localisation, above all, do less harm than on the bus.",
)


def write_survey_page(
    args: argparse.Namespace, store: Store, found: tuple[list[Tally], list[Row]], command: str
) -> None:
    """Draw and write OUT/report.html."""
    from workbench.report.page import write_page
    from workbench.report.survey import Bar, SurveyReport, survey_page

    tallies, bad = found
    manifest = store.manifest()
    bars = tuple(Bar.of(each) for each in tallies)
    lead = (
        f"{sum(each.runs for each in tallies)} drives through sampled scenarios (family "
        f"{manifest.family}, seed {manifest.seed}), by {len(manifest.contenders)} "
        "contenders. All drives count, whatever could not be judged in them: see INVALID.",
    )
    report = SurveyReport(
        "Survey of sampled scenarios", lead, bars, _tables(store, tallies, bad), _NOTES
    )
    page = survey_page(report, version=__version__, command=command)
    write_page(args.out / "report.html", page.html())


def _tables(store: Store, tallies: Sequence[Tally], bad: Sequence[Row]) -> tuple[Table, ...]:
    from workbench.cli.survey_results import HEADINGS, cells
    from workbench.report.tables import Table
    from workbench.simulation.campaign.baselines import baseline

    tuned = [
        [plant, name, each["parameter"], baseline(name).unit, each["missed"], each["training"]]
        for plant, parameters in sorted(store.parameters().items())
        for name, each in parameters.items()
    ]
    worst = [
        [row.plant, row.contender, row.index, row.seed, row.contact_person or "none",
         row.contact_mps, "yes" if row.avoidable else "no", row.nearest_m, row.needless_stops]
        for row in bad
    ]  # fmt: skip
    return (
        Table("all drives, by who drives", HEADINGS, [cells(each) for each in tallies]),
        Table("baselines, tuned",
              ["plant", "baseline", "parameter", "unit", "missed", "of"], tuned),
        Table("worst drives: avoidable contacts first, then most needless stops",
              ["plant", "who drives", "index", "seed", "touched", "m/s", "avoidable",
               "nearest (m)", "needless stops"], worst),
    )  # fmt: skip
