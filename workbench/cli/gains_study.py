"""The full study of `workbench gains`: its text, its JSON, its page and its CSV files."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from workbench import __version__
from workbench.cli.analysis_options import command_line, text_table
from workbench.cli.common import write_text
from workbench.cli.gains_options import changed_gains, chosen_effort, chosen_ranges, chosen_timing

if TYPE_CHECKING:
    from workbench.models.control_view import QuickStudy
    from workbench.models.gains import GainStudy
    from workbench.models.gains.stability_map import StabilityMap
    from workbench.models.vehicle import Vehicle
    from workbench.report.curves import TubeCurves
    from workbench.report.tables import Table

Rows = Sequence[Mapping[str, object]]


def full_study(args: argparse.Namespace, vehicle: Vehicle) -> GainStudy:
    """The study that the options ask for."""
    from workbench.models.gains import study_gains

    return study_gains(
        vehicle,
        gains=changed_gains(args),
        speed_range_mps=tuple(args.speeds) if args.speeds else None,
        ranges=chosen_ranges(args),
        sampling=chosen_timing(args),
        effort=chosen_effort(args),
    )


def study_text(study: GainStudy) -> str:
    """The study for a terminal."""
    from workbench.models.gains import Schedule
    from workbench.report.drawing import thinned
    from workbench.report.gains import lead
    from workbench.report.gains_maps import timing_text
    from workbench.report.gains_tables import along_table, checked_table, jitter_table

    fixed = study.over_speed.of(Schedule.FIXED)
    shown = [fixed[k] for k in thinned(len(fixed), 7)]
    speeds = text_table(
        ["speed (m/s)", "slowest pole (1/s)", "damping", "phase margin (deg)", "delay margin (s)",
         "disk margin", "gain from (factor)"],
        [[p.speed_mps, p.abscissa_per_s, p.damping, p.phase_deg, p.delay_s, p.disk, p.gain_low]
         for p in shown],
    )  # fmt: skip
    along, checked, jitter = (
        along_table(study), checked_table(study.checked), jitter_table(study.jitter),
    )  # fmt: skip
    return "\n".join(
        [
            *lead(study),
            "",
            "fixed gains over speed",
            speeds,
            "",
            *_texts(along),
            f"grid points at which eigenvalues say otherwise: {study.disagreements}",
            "",
            *_texts(checked),
            "",
            timing_text(study),
            *_texts(jitter),
        ]
    )


def _texts(table: Table) -> tuple[str, str]:
    return table.caption, text_table(list(table.headings), [list(row) for row in table.rows])


def study_data(study: GainStudy) -> dict[str, object]:
    """The study for `--json`."""
    return {
        "loop": study.loop,
        "reason": study.reason.value,
        "speed_range_mps": study.speed_range_mps,
        "stable_speeds_mps": study.stable_speeds_mps,
        "stable_at_every_speed_proved": study.always_stable,
        "along": [
            {"axis": name, "from": p.low, "to": p.high, "reason": p.reason.name}
            for name, pieces in study.along
            for p in pieces
        ],
        "over_speed": study.over_speed.rows(),
        "steps": [
            {"speed_mps": s.speed_mps, "start_m": s.start_m, "settling_linear_s": s.settling_s[0],
             "settling_s": s.settling_s[1], "overshoot_linear": s.overshoot[0],
             "overshoot": s.overshoot[1], "saturated": s.saturated}
            for s in study.responses.steps
        ],
        "maps": [_map_data(each) for each in (*study.maps, study.without_ahead)],
        "checked": [each.row() for each in study.checked],
        "sampling": study.sampling,
        "sampled_stable_without_jitter": study.timing_stable,
        "critical_delay": study.critical,
        "jitter": study.jitter.rows(),
        "linear_up_to_offset_m": study.linear_offset_m,
    }  # fmt: skip


def _map_data(found: StabilityMap) -> dict[str, object]:
    return {
        "x": found.x_name, "y": found.y_name, "look_ahead_m": found.loop.look_ahead_m,
        "compared": found.compared, "disagreeing": found.disagreeing,
        "lines": [
            {"x": x, "pieces": [
                {"from": p.low, "to": p.high, "reason": p.reason.name} for p in pieces
            ]}
            for x, pieces in zip(found.x.tolist(), found.pieces, strict=True)
        ],
    }  # fmt: skip


def tables(study: GainStudy) -> dict[str, Rows]:
    """File name -> rows, for `--csv`."""
    names = ("at_rate", "gains_at_rate", "periods")
    return {
        "over_speed.csv": study.over_speed.rows(),
        "steps.csv": study.responses.rows(),
        "frequency.csv": [row for each in study.responses.frequency for row in each.rows()],
        "root_locus.csv": [row for each in study.responses.loci for row in each.rows()],
        **{f"map_{m.x_name}_{m.y_name}.csv": m.rows() for m in study.maps},
        "map_without_look-ahead.csv": study.without_ahead.rows(),
        **{
            f"sampled_{name}.csv": each.rows()
            for name, each in zip(names, study.sampled, strict=True)
        },
        "jitter.csv": study.jitter.rows(),
        "checked.csv": [each.row() for each in study.checked],
    }


def write_tables(folder: Path, study: GainStudy) -> tuple[Path, ...]:
    """One CSV file per table, numbers in full."""
    written = []
    for name, rows in tables(study).items():
        stream = io.StringIO()
        writer = csv.DictWriter(stream, list(rows[0]) if rows else ["nothing"])
        writer.writeheader()
        writer.writerows(rows)
        write_text(folder / name, stream.getvalue())
        written.append(folder / name)
    return tuple(written)


def write_gains_page(
    args: argparse.Namespace, study: GainStudy, quick: QuickStudy, tube: TubeCurves | None
) -> None:
    """Draw and write the page that `--plot` names."""
    from workbench.report.gains import GainReport, gains_page
    from workbench.report.page import write_page

    report = GainReport(study, quick, tube)
    page = gains_page(report, version=__version__, command=_command(args))
    write_page(args.plot, page.html())


def _command(args: argparse.Namespace) -> str:
    """Every option written out; `--range` once per axis."""
    plain = argparse.Namespace(
        **{k: v for k, v in vars(args).items() if k not in ("range", "quick")}
    )
    words = command_line("gains", plain)
    return " ".join([words, *(f"--range {' '.join(each)}" for each in args.range or ())])
