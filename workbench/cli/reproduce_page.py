"""The page of `workbench reproduce paper`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from workbench import __version__
from workbench.cli.analysis_options import percent

if TYPE_CHECKING:
    from workbench.cli.reproduce_work import Found
    from workbench.report.page import Block, Page

_TABLE_1: Final = (
    "The paper timed reach sets of TRACK on the vehicle's computer, presumably the three nested "
    "ones of its figure; it calls the time at T = 3 s a maximum, and the growth with T linear. The "
    "first rows are three such sets by the compiled code that the vehicle runs, "
    "each computed to its end (on the vehicle the first set that settles the question spares the "
    "others): with the paper's model, and with N and W of the vehicle file. The next rows are "
    "whole decisions, once for each set: TRACK, TRACK then BRAKE to standstill, and BRAKE, of "
    "which only the first grows with T; where a step is too coarse for a proof it is repeated in "
    "finer ones. ValidatedTube is the desk's reference, timed at T = 3 s alone. "
    "Times are of the machine named here; what "
    "compares is the growth with T.",
    "Ours bound every state at every time, rounding included, under every error and disturbance "
    "that they are given; the paper's bound was learned from simulations, and so is that of the "
    "row by its method, which is compiled like the others. A tube that ends before T takes less "
    "time, and is left out; where some are, a line says how many at each T, and the times at two T "
    "are not of the same starts.",
)
_TABLE_2: Final = (
    "The paper replayed simulated drives and checked, at each step, whether the reach set held the "
    "car. This can be read in two ways, of steps and of whole sets, and its numbers stand under "
    "both. Here: a tube of TRACK for every decision, from the set that the monitor had "
    "measured, and the car's true position (middle of its rear axle) at every turn of the monitor, "
    "32.5 ms apart, as long as TRACK is what was sent. After a BRAKE nothing is compared; steps "
    "before it count, the trajectory then does not count as a whole one. Where a tube ends before "
    "T, later steps count as not contained; in brackets are those where it had not ended and the "
    "car was outside.",
    "High confidence is the whole measured set, which is made to hold the car. Low is the smallest "
    "share of its radii that held the car at every decision of other drives, medium the middle of "
    "the two (with --thirds: two thirds and one third, which nothing makes hold the car). The last "
    "column of the count says how often they did. A tube says nothing of a car that did not start "
    "in it; what it contains all the same is owed to N and W. The tables of decisions with the car "
    "in the set leave the others out.",
    "The first method has the paper's model, a bicycle under its controller that reads its state "
    "without error: what it misses is the honest lower figure. The second has N and W of the "
    "vehicle file, and the reference speed on its way from that of the decision to the one that "
    "is wanted, as the vehicle brings it there while every decision is TRACK (up to two periods of "
    "deciding early or late). The third "
    "holds the reference of the decision, as the vehicle's monitor does, which decides anew at "
    "every change: a car that goes on to be brought up to speed leaves it ahead. The last is the "
    "paper's own: the measured set is cut into regions, the same "
    "model simulated once from the middle of each, and every simulation bloated by a bound that "
    "was learned before from pairs of runs of the model. It is SAMPLED: nothing is proved, least "
    "of all of a car that is not the model. What it contains it owes to its width; compare the "
    "areas.",
    "Windows overlap and those of one drive are alike. The first interval (Clopper and Pearson) "
    "counts runs, not windows (as many trials as runs of these lengths are worth, by Kish's "
    "formula); the second draws runs anew and has no width where all runs agree. Containment "
    "says nothing without the area: a tube over the whole street contains everything. An area "
    "with a share of rows behind it is of tubes that ended early, without their last and widest "
    "rows: a tube to T would be wider.",
)


def paper_page(found: Found, *, command: str, require: float) -> Page:
    """Tables with ours and the paper's, pictures, settings."""
    from workbench.cli.reproduce_tables import accuracy_tables, count_table, time_table
    from workbench.report.page import Notice, Page, Paragraph, Section
    from workbench.report.paper import results_figure
    from workbench.report.paper_intent import intent_figure, intent_person
    from workbench.simulation.paper.accuracy import AT_SPEED_MPS, STARTS

    least = found.least
    reached = "which is what was asked" if least >= require else "which is less than asked"
    lead = (
        "The paper's evaluation, repeated on simulated drives: a car that the analysis did not "
        "write, driven over CAN frames by the code that runs on the vehicle.",
        f"The tubes with N and W of the vehicle file contain at least {percent(least)} of the "
        "steps on every plant, at every T and confidence, of decisions at any speed and at "
        f"{AT_SPEED_MPS:g} m/s and more, {reached} ({require:.2%}); the paper's contain 92.08 % to "
        f"98.91 %. {found.outside} steps were outside of a tube that had not ended.",
    )
    table_1: list[Block] = [time_table(found.times), *map(Paragraph, _TABLE_1)]
    calls = "; ".join(
        f"{row.what}: {row.calls} times three sets per T, {sum(row.incomplete)} in all left out "
        "because a tube ended before T"
        for row in found.times.rows
    )
    table_1.append(Notice("Machine.", f"{found.times.processor}, one core. {calls}."))
    first, *others = (each.name for each in STARTS)
    table_2: list[Block] = [
        *accuracy_tables(found, starts=first),
        count_table(found, starts=first),
        *map(Paragraph, _TABLE_2),
    ]
    for starts in others:
        table_2 += [*accuracy_tables(found, starts=starts), count_table(found, starts=starts)]
    sections = (
        Section("Time of reach sets", table_1),
        Section("Accuracy of reach sets", table_2),
        Section(
            "The four scenarios",
            [results_figure(found.panels[:2]), results_figure(found.panels[2:])],
        ),
        Section("Somebody's intents", [intent_figure(intent_person())]),
        Section("Settings", [_settings(found)]),
    )
    return Page("The paper's tables and figures", lead, sections, __version__, command)


def _settings(found: Found) -> Block:
    from workbench.report.tables import Table
    from workbench.simulation.paper.accuracy import AT_SPEED_MPS
    from workbench.simulation.paper.learned import REGIONS
    from workbench.simulation.paper.replayed import TURN_S
    from workbench.simulation.paper.tubes import BUDGET, STEP_S

    unmeasured = sum(run.unmeasured for run in found.runs)
    rows = [
        ("scenarios of Table II", ", ".join(found.scenarios)),
        ("plants", ", ".join(found.plants)),
        ("seeds of all errors, actuators and people", ", ".join(map(str, found.seeds))),
        (
            "High, medium and low: shares of the measured set's radii",
            ", ".join(f"{share:.2f}" for share in found.shares),
        ),
        ("policy that drives", "LookAhead, as in the paper"),
        ("runs", str(len(found.runs))),
        ("decisions without a measured set, not counted", str(unmeasured)),
        ("rows of a tube (s)", f"{STEP_S:g}"),
        ("between compared instants (s)", f"{TURN_S:g}"),
        ("at speed (m/s)", f"{AT_SPEED_MPS:g} and more at the decision"),
        ("steps of integration per decision, at most", str(BUDGET)),
        ("regions of each set, learned beta", str(math.prod(REGIONS.values()))),
        ("what the learned beta rests on", found.learned),
    ]
    return Table("how it was made", ("what", "value"), rows)
