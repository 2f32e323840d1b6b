"""Memory of the whole core on board, over as many decisions as a month of driving makes.

`python -m workbench.bench.onboard_memory [DECISIONS]` feeds the driving bundle in virtual time with
no other work on purpose, and fails where memory grows after the first tenth.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Final

from workbench.bench.onboard_board import GROWTH_MIB, growth_mib
from workbench.bench.onboard_bundle import build_driving
from workbench.bench.onboard_programs import Cores
from workbench.bench.onboard_turns import Turns, at_shares, turns
from workbench.runtime.onboard.times import TURN_US

_DECISIONS: Final = 1_000_000


def measured(decisions: int) -> Turns:
    """Turns until so many decisions, by a process that has nothing but the vehicle's modules."""
    with tempfile.TemporaryDirectory(prefix="workbench-") as name:
        bundle = build_driving(Path(name) / "bundle")
        return turns(bundle, decisions, cores=Cores.IDLE, turn_us=TURN_US, line=_counted)


def _counted(line: str) -> None:
    sys.stderr.write(f"decisions: {line}")


def check(found: Turns) -> str:
    """Raise AssertionError where memory grows; the figures as a sentence."""
    grown = growth_mib(found.marks)
    assert grown <= GROWTH_MIB, f"{grown:+.2f} MiB from 10 % to 100 %, at most {GROWTH_MIB:g}"
    shares = ", ".join(f"{mib:.2f} MiB at {share}" for share, mib in at_shares(found.marks).items())
    return (
        f"{found.decisions} decisions of the whole core in {found.seconds:.0f} s: resident {shares}"
    )


if __name__ == "__main__":
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else _DECISIONS
    sys.stdout.write(check(measured(wanted)) + "\n")
