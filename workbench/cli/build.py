"""`workbench build`: compile the monitor of a vehicle into a bundle."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.claims import Rigor
from workbench.cli.analysis_options import check_steps, count, positive
from workbench.cli.build_learned import add_learned_options, chosen_learned
from workbench.cli.common import (
    MONITOR_STEP_S,
    RELEASE_STEPS,
    add_deciding_option,
    add_vehicle_option,
    chosen_deciding,
    chosen_vehicle,
    output_folder,
)
from workbench.cli.output import emit
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.runtime.contents import Manifest
    from workbench.runtime.monitor_settings import MonitorSettings

HELP = (
    "Compiles the monitor of a vehicle file into a bundle: a folder with the shared object, its C "
    "text, a manifest with golden vectors, and checksums. The bundle is loaded and tried before "
    "success is reported."
)
EXAMPLE = """\
workbench build --out out/bundle
workbench build --vehicle my_shuttle.toml --horizon 3 --step 0.025 --out out/bundle
workbench build --deciding FailSafe --deciding-level "two thirds" --out out/bundle
workbench build --step 0.05 --kernel enclosed --form quadratic --out out/bundle
workbench build --step 0.05 --learned --regions 2 --out out/learned
workbench build --vehicle my_shuttle.toml --path route.csv --clearance 0.2 --horizon 2
"""

KERNELS: Final = ("local", "enclosed")
FORMS: Final = ("linear", "quadratic")
_WHOLE_S = 1e-9
# Every third turn of 30 Hz decides; a check may take as long as the next one waits.
_TIMING_S: Final = (0.12, 0.1, 0.055)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_vehicle_option(parser)
    add_grid_options(parser)
    add_deciding_option(parser)
    parser.add_argument(
        "--budget",
        type=count,
        metavar="N",
        help="most steps of integration that one decision may try (default: 3000); what is not "
        "done by then is not proved. 200 take about 1 ms and need a --step of 0.05 s to "
        "prove much, see docs/decision-benchmarks.md",
    )
    _add_method_options(parser)
    add_learned_options(parser)
    parser.add_argument(
        "--deciding-level",
        default="whole",
        metavar="NAME",
        help="the nested set whose SAFE permits TRACK: whole, two thirds, one third (of the "
        "observation's radii; default: whole); the others advise",
    )
    _add_driving_options(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("out/bundle"),
        help="folder of the bundle (default: out/bundle)",
    )  # fmt: skip


def _add_driving_options(parser: argparse.ArgumentParser) -> None:
    """Add what the monitor on a vehicle needs besides [drive_by_wire] of the vehicle file."""
    parser.add_argument(
        "--path",
        type=Path,
        metavar="FILE",
        help="CSV file with the columns x_m,y_m: the path that the bundle drives, as positions of "
        "the rear axle's middle in the localisation's frame",
    )
    parser.add_argument(
        "--sensors",
        type=Path,
        metavar="FILE",
        help="TOML file with what sensors, clocks and people keep to; `workbench new sensors NAME` "
        "writes one to edit",
    )
    parser.add_argument(
        "--key",
        type=Path,
        metavar="FILE",
        help="private key that signs the bundle at once; see `workbench keygen` and `sign`",
    )
    parser.add_argument(
        "--clearance",
        type=positive,
        metavar="M",
        help="distance between body and person that SAFE must prove, m; puts the monitor's "
        "settings into the bundle",
    )
    parser.add_argument(
        "--release-steps",
        type=count,
        metavar="N",
        help="SAFE verdicts in a row that end braking (with --clearance; default: "
        f"{RELEASE_STEPS})",
    )
    parser.add_argument(
        "--timing",
        type=positive,
        nargs=3,
        metavar=("PERIOD", "LATENCY", "GAP"),
        help="longest time between stamps, from a stamp to the end of its check, and between two "
        "turns of the sender, s (with --clearance; default: "
        f"{' '.join(f'{each:g}' for each in _TIMING_S)})",
    )


def _monitor_settings(args: argparse.Namespace) -> MonitorSettings | None:
    from workbench.runtime.monitor_settings import MonitorSettings
    from workbench.runtime.policies import Timing

    if args.clearance is None:
        if args.release_steps is not None or args.timing is not None:
            raise InputError(
                "--clearance: expected beside --release-steps and --timing, which are part of the "
                "monitor's settings; add --clearance M"
            )
        return None
    period_s, latency_s, gap_s = args.timing or _TIMING_S
    timing = Timing(period_s=period_s, latency_s=latency_s, send_gap_s=gap_s)
    return MonitorSettings(args.release_steps or RELEASE_STEPS, args.clearance, timing)


def _add_method_options(parser: argparse.ArgumentParser) -> None:
    """Add `--kernel` and `--form`, by which every tube is computed."""
    parser.add_argument(
        "--kernel",
        choices=KERNELS,
        default=KERNELS[0],
        help="how the tubes' rounding is proved: local, by a budget over the operating region; "
        "enclosed, outward throughout, which takes more time (default: local)",
    )
    parser.add_argument(
        "--form",
        choices=FORMS,
        default=FORMS[0],
        help="order to which the tubes follow the initial deviations exactly; quadratic ones are "
        "narrower and take more time, see docs/decision-benchmarks.md (default: linear)",
    )


def add_grid_options(parser: argparse.ArgumentParser) -> None:
    """Add `--horizon` and `--step`, the grid of the compiled tube."""
    parser.add_argument(
        "--horizon",
        type=positive,
        default=3.0,
        metavar="S",
        help="length of every tube, s (default: 3)",
    )
    parser.add_argument(
        "--step",
        type=positive,
        default=MONITOR_STEP_S,
        metavar="S",
        help=f"step of the tube, s (default: {MONITOR_STEP_S:g})",
    )


def check_grid(args: argparse.Namespace) -> None:
    """Raise InputError where `--horizon` and `--step` make no grid that can be compiled."""
    from workbench.codegen.bundle import MOST_STEPS

    check_steps(args, most=MOST_STEPS)
    steps = args.horizon / args.step
    if abs(round(steps) * args.step - args.horizon) > _WHOLE_S:
        raise InputError(
            f"expected a horizon of whole steps, got --horizon {args.horizon:g} / --step "
            f"{args.step:g} = {steps:.6g} steps; give --horizon {round(steps) * args.step:.12g}"
        )


def _check_level(name: str) -> None:
    from workbench.codegen.bundle import LEVELS

    names = [level.name for level in LEVELS]
    if name not in names:
        raise InputError(f"--deciding-level: expected one of {names}, got {name!r}")


def run(args: argparse.Namespace) -> int:
    """Build, load and report."""
    check_grid(args)
    _check_level(args.deciding_level)
    from workbench.cli.path_file import path_from_csv
    from workbench.cli.private_key import read_private_key
    from workbench.cli.sign import sign_bundle
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.codegen.bundle import BUDGET
    from workbench.reach.online.kernels import Form, Method
    from workbench.runtime import load_bundle

    vehicle = chosen_vehicle(args)
    spec = MonitorSpec(
        vehicle, args.horizon, args.step, deciding=chosen_deciding(args),
        deciding_level=args.deciding_level, budget=args.budget or BUDGET,
        method=Method(args.kernel, Form(args.form)),
        path=None if args.path is None else path_from_csv(args.path),
        monitor=_monitor_settings(args),
        sensors=None if args.sensors is None else _text(args.sensors),
        learned=chosen_learned(args, vehicle, horizon_s=args.horizon, step_s=args.step),
    )  # fmt: skip
    if args.key is not None:
        read_private_key(args.key)
    with output_folder(args.out) as out:
        folder = build_bundle(spec, out)
    if args.key is not None:
        sign_bundle(folder, args.key)
    manifest = load_bundle(folder).manifest
    size = (folder / "kernel.so").stat().st_size
    text = (
        f"bundle for {manifest.name}: {manifest.steps} steps of {manifest.step_s:g} s, "
        f"rigor {manifest.rigor.name}, deciding: {manifest.deciding}, for the level "
        f"{manifest.deciding_level!r}, tubes: {manifest.tubes}, kernel {size / 1024:.0f} kB for "
        f"{manifest.machine}, {len(manifest.golden)} golden vectors repeated bit for bit; "
        f"{_driving_text(manifest)}\n{folder}"
    )
    emit(args, text, {
        "folder": str(folder), "name": manifest.name, "steps": manifest.steps,
        "step_s": manifest.step_s, "horizon_s": manifest.horizon_s, "rigor": manifest.rigor.name,
        "machine": manifest.machine, "compiler": manifest.compiler, "kernel_bytes": size,
        "golden_vectors": len(manifest.golden), "deciding": manifest.deciding,
        "deciding_level": manifest.deciding_level,
        "levels": {level.name: level.share for level in manifest.levels},
        "budget": manifest.budget, "tubes": manifest.tubes, "drives": _drives(manifest),
    })  # fmt: skip
    return 0


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--sensors: expected a text file that can be read, got {path} ({error}); `workbench "
            "new sensors NAME` writes one to edit"
        ) from error


def _drives(manifest: Manifest) -> dict[str, bool]:
    """Which of the entries that the monitor on a vehicle needs the bundle has."""
    names = ("drive_by_wire", "path", "monitor", "sensors")
    return {name: getattr(manifest, name) is not None for name in names}


def _driving_text(manifest: Manifest) -> str:
    missing = [name for name, there in _drives(manifest).items() if not there]
    if manifest.rigor is Rigor.SAMPLED:
        return "not for gating or driving, its tubes are SAMPLED"
    return f"not for driving, it lacks {', '.join(missing)}" if missing else "for driving"
