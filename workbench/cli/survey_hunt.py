"""`workbench survey` with --hunt, --point or --index: the worst scenario, and any one once more."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from workbench.cli.analysis_options import text_table
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.simulation.campaign.rows import Row
    from workbench.simulation.campaign.sampled import SampledScenario
    from workbench.simulation.campaign.store import Store

_HEADINGS = [
    "plant", "who drives", "contact", "avoidable", "m/s", "nearest (m)", "stops",
    "needless", "way (m)",
]  # fmt: skip


def hunted(args: argparse.Namespace, store: Store) -> int:
    """Hunt in a survey's folder, one contender and plant after the other; 1 where any trial of
    FailSafe or of both policies has an avoidable contact."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.output import Progress, emit
    from workbench.cli.survey import GUARANTEED, begun, chosen_contenders
    from workbench.simulation.campaign.contenders import proves
    from workbench.simulation.campaign.hunting import Quarry, hunt
    from workbench.simulation.campaign.workers import workers

    lines, data, failed = [], [], False
    with workers(args.jobs, args.scheduler) as crew:
        known = begun(args, store).contenders
        names = [each for each in known if proves(each)]
        if args.contenders:
            names = list(chosen_contenders(args))
            _require_known(names, known, store)
        for plant in args.plants:
            for name in names:
                quarry = Quarry(args.hunt, name, plant, args.seed)
                with Progress(quarry.name, args.trials) as progress:
                    found = hunt(
                        store, quarry, args.trials, crew, at_once=args.jobs,
                        advance=progress.advance,
                    )  # fmt: skip
                avoidable = sum(each.row.avoidable for each in found)
                lines.append(
                    f"{plant}, {name}: {avoidable} of {len(found)} with an avoidable contact; the "
                    f"worst: {_said(found[0].row)}; --point {store.folder}/hunts/{quarry.name}/"
                    "best.json drives it again"
                )
                data.append({"trials": len(found), "avoidable": avoidable, "worst": found[0]})
                failed |= name in GUARANTEED and avoidable > 0
    emit(args, "\n".join(lines), data)
    return CLAIM_FAILS if failed else DONE


def _require_known(names: Sequence[str], known: Sequence[str], store: Store) -> None:
    unknown = [name for name in names if name not in known]
    if unknown:
        raise InputError(
            f"--contenders: expected some that {store.folder} was begun with, {', '.join(known)}, "
            f"got {unknown[0]!r}; name another folder with --out"
        )


def drive_again(args: argparse.Namespace, store: Store) -> int:
    """Drive a caught or a sampled scenario with everybody; 1 as `hunted`."""
    from workbench.cli.main import CLAIM_FAILS, DONE
    from workbench.cli.output import emit
    from workbench.cli.survey import GUARANTEED
    from workbench.simulation.campaign.surveying import driven_again

    rows = []
    for plant, index, scenario in _chosen(args, store):
        rows += driven_again(store, plant, index, scenario)
    emit(args, text_table(_HEADINGS, [_cells(row) for row in rows]), rows)
    failed = any(row.avoidable and row.contender in GUARANTEED for row in rows)
    return CLAIM_FAILS if failed else DONE


def _chosen(args: argparse.Namespace, store: Store) -> list[tuple[str, int, SampledScenario]]:
    """Plant, index (0 for what a hunt found) and scenario."""
    from workbench.simulation.campaign.hunting import load_catches
    from workbench.simulation.campaign.sampled import MOST_POINTS, sampled

    seed = store.manifest().seed
    if args.point is not None:
        catch = load_catches(args.point)[0]
        return [(catch.quarry.plant, 0, catch.scenario)]
    if not 0 <= args.index < MOST_POINTS:
        raise InputError(f"--index: expected 0 to {MOST_POINTS - 1}, got {args.index}")
    (scenario,) = sampled(range(args.index, args.index + 1), seed)
    return [(plant, args.index, scenario) for plant in args.plants]


def _cells(row: Row) -> list[str | int | float | None]:
    touched = row.contact_person if row.contact else "none"
    return [
        row.plant, row.contender, touched,
        "yes" if row.avoidable else "no", f"{row.contact_mps:.2f}",
        f"{row.nearest_m:.2f}", row.stops, row.needless_stops, f"{row.way_m:.1f}",
    ]  # fmt: skip


def _said(row: Row) -> str:
    if row.contact:
        kind = "avoidable" if row.avoidable else "unavoidable"
        return f"touched {row.contact_person} with {row.contact_mps:.2f} m/s, {kind}"
    return f"nearest {row.nearest_m:.2f} m, {row.needless_stops} needless stops"
