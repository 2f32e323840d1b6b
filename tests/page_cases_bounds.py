"""A small instance of each page about bounds and tubes, for the tests that look at all pages."""

from __future__ import annotations

import argparse
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from cli_fixture import SHORT, invoke

from workbench.claims import Rigor
from workbench.cli.comparison import Compared, Family
from workbench.cli.comparison_page import comparison_page
from workbench.cli.examine_page import examination_page
from workbench.sensitivity.examination import (
    Coverage,
    Examination,
    ExaminationVerdict,
    ProvedCurve,
)
from workbench.sets import Box

TIMES = np.linspace(0.0, 1.0, 11)


def reach(folder: Path) -> str:
    return _ran(folder, "reach", "--horizon", "0.2")


def inner(folder: Path) -> str:
    return _ran(folder, "inner", "--horizon", "0.2", "--rounds", "1", "--starts", "2")


def _ran(folder: Path, command: str, *words: str) -> str:
    page = folder / f"{command}.html"
    found = invoke(command, *SHORT, *words, "--plot", page)
    assert found.status == 0, found.err
    return page.read_text(encoding="utf-8")


def sampled(folder: Path) -> str:
    return _ran(folder, "reach", "--horizon", "0.1", "--sampled", "--rate", "20")


def derive(_: Path) -> str:
    subject: Any = SimpleNamespace(
        name="a loop", initial_set=Box(("x",), (0.0,), (1.0,)),
        system=SimpleNamespace(ode=SimpleNamespace(states=[SimpleNamespace(name="x", unit="m")])),
    )  # fmt: skip
    wide = np.stack([1.0 + TIMES], axis=1)
    samples = SimpleNamespace(times_s=TIMES, distances=wide)
    found = [
        Compared(f"{family.name} {k}", family, Rigor.ENCLOSED, (k + 1) * wide, (k + 1) + 0.0 * wide,
                 1.0, 0.1, statement="holds")
        for family in Family
        for k in range(3)
    ]  # fmt: skip
    told = SimpleNamespace(told=lambda what: f"{what}: the first")
    outcome: Any = SimpleNamespace(
        setting=SimpleNamespace(subject=subject, region=subject.initial_set, samples=samples),
        found=found, condition="shown", best=told, best_formula=told,
    )  # fmt: skip
    args = argparse.Namespace(horizon=1.0, command_line="")
    return comparison_page(args, outcome).html()


def examined() -> Examination:
    reached = np.stack([1.0 + TIMES], axis=1)
    proofs = tuple(
        ProvedCurve(
            f"proof {k}", (k + 2) * reached, Rigor.ENCLOSED, "none", True, 0.5, np.full(1, 2.0)
        )
        for k in range(3)
    )
    return Examination(
        ExaminationVerdict.CONSISTENT, None, ("x",), TIMES, 0.9 * reached, reached, 1.2 * reached,
        proofs, (Coverage("pairs", 10, np.ones(11), 1.0, 0.9),), np.full(1, 1.2),
    )  # fmt: skip


def examine(_: Path) -> str:
    found = examined()
    reached = 0.8 * found.driven
    beside = SimpleNamespace(bounds={p.name: None for p in found.proved}, inner=(TIMES, reached))
    learned = SimpleNamespace(norm="largest", condition="runs", rigor=Rigor.SAMPLED)
    outcome: Any = SimpleNamespace(
        title="a loop", units=("m",), learned=learned, found=found, beside=beside, error=None,
        sure=None, how="10 pairs", methods=[p.name for p in found.proved],
    )  # fmt: skip
    args = argparse.Namespace(horizon=1.0, any_centre=False)
    return examination_page(args, outcome).html()
