"""In real time `workbench-localiser` tells `workbench-monitor` where the car is, both as processes.

What the monitor takes for possible holds the truth; whether the car drives hangs on the machine.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="needs the extra analysis")
pytest.importorskip("nacl", reason="needs the package for signatures")
pytest.importorskip("serial", reason="needs the optional package pyserial")

from simulated_worlds import scenario
from test_ranged_drives import seen_rightly

from workbench.cli.simulate import configure
from workbench.cli.simulate_live import driven_live
from workbench.errors import InputError
from workbench.simulation.live_processes import LOCALISER_LOG, Installed, localiser_on
from workbench.simulation.rig import Trial


def asked(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    configure(parser)
    return parser.parse_args(["nobody", "--real-time", "--localiser", *words])


def test_both_processes_end_orderly_and_the_monitor_is_told_the_truth(tmp_path: Path) -> None:
    trial = Trial(scenario(duration_s=4.0), "bicycle", 0)
    _, driven, took_s, notes = driven_live(asked(f"--out={tmp_path}"), trial, lambda *_: None)
    # The driver takes the car to the path's beginning first.
    assert took_s > 20.0
    monitor, instead, localiser = notes[:3]
    assert "exit status 0" in monitor
    assert "decisions made again are those of the log" in monitor
    assert "not used" in instead
    assert "exit status 0" in localiser
    assert int(localiser.split(" and sent ")[1].split()[0]) > 5
    told = [i for i in driven.instants if i.observation is not None]
    assert len(told) > 5
    assert all(seen_rightly(i.motion, i.observation) for i in told if i.observation)
    assert (tmp_path / "log" / LOCALISER_LOG).read_text(encoding="utf-8").count("\n") > 10


def test_a_localiser_that_refuses_is_heard(tmp_path: Path) -> None:
    nothing = Installed(tmp_path, tmp_path / "no.pub", tmp_path / "no localiser")
    with localiser_on("nobody", nothing, tmp_path / "log", wait_s=1.0) as program:
        program.ended()
        with pytest.raises(InputError, match=r"workbench-localiser to run, it ended: .*refused"):
            program.require_alive()
    assert not program.runs
