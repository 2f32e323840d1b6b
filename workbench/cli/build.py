"""`workbench build`: compile the monitor of a vehicle into a bundle."""

from __future__ import annotations

import argparse
from pathlib import Path

from workbench.cli.common import add_vehicle_option, chosen_vehicle, writable_folder
from workbench.cli.output import emit

HELP = (
    "Compiles the monitor of a vehicle file into a bundle: a folder with the shared object, its C "
    "text, "
    "a manifest with golden vectors, and checksums. The bundle is loaded and tried before success "
    "is "
    "reported."
)
EXAMPLE = """\
workbench build --out out/bundle
workbench build --vehicle my_shuttle.toml --horizon 3 --step 0.025 --out out/bundle
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_vehicle_option(parser)
    add_grid_options(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("out/bundle"),
        help="folder of the bundle (default: out/bundle)",
    )  # fmt: skip


def add_grid_options(parser: argparse.ArgumentParser) -> None:
    """Add `--horizon` and `--step`, the grid of the compiled tube."""
    parser.add_argument(
        "--horizon",
        type=float,
        default=3.0,
        metavar="S",
        help="length of every tube, s (default: 3)",
    )
    parser.add_argument(
        "--step",
        type=float,
        default=0.025,
        metavar="S",
        help="step of the tube, s (default: 0.025)",
    )


def run(args: argparse.Namespace) -> int:
    """Build, load and report."""
    from workbench.codegen import MonitorSpec, build_bundle
    from workbench.runtime import load_bundle

    spec = MonitorSpec(chosen_vehicle(args), args.horizon, args.step)
    folder = build_bundle(spec, writable_folder(args.out))
    manifest = load_bundle(folder).manifest
    size = (folder / "kernel.so").stat().st_size
    text = (
        f"bundle for {manifest.name}: {manifest.steps} steps of {manifest.step_s:g} s, "
        f"rigor {manifest.rigor.name}, kernel {size / 1024:.0f} kB for {manifest.machine}, "
        f"{len(manifest.golden)} golden vectors repeated bit for bit\n{folder}"
    )
    emit(args, text, {
        "folder": str(folder), "name": manifest.name, "steps": manifest.steps,
        "step_s": manifest.step_s, "horizon_s": manifest.horizon_s, "rigor": manifest.rigor.name,
        "machine": manifest.machine, "compiler": manifest.compiler, "kernel_bytes": size,
        "golden_vectors": len(manifest.golden),
    })  # fmt: skip
    return 0
