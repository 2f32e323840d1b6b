"""What `workbench survey` says of the results that are there: text, Markdown, JSON and a page."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Final

from workbench.cli.analysis_options import command_line, text_table

if TYPE_CHECKING:
    from workbench.simulation.campaign.store import Store
    from workbench.simulation.campaign.tallies import Rate, Tally

HEADINGS: Final = [
    "plant", "who drives", "runs", "contacts", "avoidable", "avoidable, 95 % bound",
    "needless stops per km", "standing", "mean speed", "passed", "UNPROVED", "INVALID",
    "out of region",
]  # fmt: skip
_WORST: Final = 20
Cells = list[str | int | float | None]


def summed_up(args: argparse.Namespace, store: Store, *, guaranteed: tuple[str, ...]) -> int:
    """Print and write; 1 where one of the guaranteed had an avoidable contact."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.output import emit
    from workbench.errors import InputError
    from workbench.simulation.campaign.tallies import tallies, worst

    manifest, stored = store.manifest(), store.rows()
    if not stored:
        raise InputError(f"{args.out}: expected results, found none yet; survey without --table")
    found = tallies(stored)
    bad = worst(stored, _WORST)
    data = {
        "manifest": manifest, "baselines": store.parameters(), "tallies": found, "worst": bad,
    }  # fmt: skip
    rows = [cells(each) for each in found]
    unjudged = unjudged_lines(manifest.contenders, found)
    if args.table:
        text = "\n\n".join([_markdown(rows), *unjudged])
    else:
        text = "\n".join(
            [text_table(HEADINGS, rows), *unjudged, *tuned_lines(store), *_ending(found)]
        )
    if args.plot:
        from workbench.cli.survey_page import write_survey_page

        write_survey_page(args, store, (found, bad), command_line("survey", args))
    emit(args, text, data)
    failed = any(each.avoidable for each in found if each.contender in guaranteed)
    return CLAIM_FAILS if failed else DONE


def cells(tally: Tally) -> Cells:
    """One line of the table."""
    from workbench.simulation.campaign.contenders import proves

    shares = [f"{each:.2%}" for each in (tally.unproved, tally.invalid, tally.out_of_region)]
    return [
        tally.plant, tally.contender, tally.runs, tally.contacts, tally.avoidable,
        f"{tally.avoidable_most:.2%}", shown(tally.needless), f"{tally.standing:.1%}",
        f"{tally.mean_mps:.2f} m/s", f"{tally.passed:.1%}",
        *(shares if proves(tally.contender) else ["–"] * len(shares)),
    ]  # fmt: skip


def shown(rate: Rate) -> str:
    """With its interval."""
    if math.isnan(rate.per_km):
        return "none to count"
    if math.isnan(rate.low):
        return f"{rate.per_km:.1f} (too few for an interval)"
    return f"{rate.per_km:.1f} [{rate.low:.1f}, {rate.high:.1f}]"


def unjudged_lines(contenders: tuple[str, ...], found: list[Tally]) -> list[str]:
    """Which baselines have driven and are not counted, and what is needed for that."""
    from workbench.simulation.campaign.contenders import is_baseline

    lines = []
    for plant in dict.fromkeys(each.plant for each in found):
        counted = {each.contender for each in found if each.plant == plant}
        left = [name for name in contenders if is_baseline(name) and name not in counted]
        if left:
            lines.append(
                f"{plant}: {', '.join(left)} are judged on the half of the scenarios that they are "
                "not tuned on, of which none was driven; survey more, such as --scenarios 8"
            )
    return lines


def tuned_lines(store: Store) -> list[str]:
    """What the baselines' parameters are, and what they miss where they were tuned."""
    from workbench.simulation.campaign.baselines import baseline

    lines = []
    for plant, tuned in sorted(store.parameters().items()):
        for name, each in tuned.items():
            rest = "misses none of" if not each["missed"] else f"misses {each['missed']} of"
            lines.append(
                f"{plant}, {name}: {each['parameter']:.3g} {baseline(name).unit}, {rest} "
                f"{each['training']} scenarios it was tuned on"
            )
    return lines


def _ending(found: list[Tally]) -> list[str]:
    runs = sum(each.runs for each in found)
    return [
        f"{runs} runs; avoidable: braking at an earlier period avoids the contact; needless: a car "
        "that never brakes keeps 0.5 m from everybody, counted on the "
        f"{max(each.judged for each in found)} scenarios that baselines are judged on",
    ]


def _markdown(rows: list[Cells]) -> str:
    lines: list[Cells] = [[*HEADINGS], ["---"] * len(HEADINGS), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
