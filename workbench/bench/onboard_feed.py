"""A program: turns of a real core as fast as they come; times, memory and queries into files.

It runs as a file of its own, so that nothing but what is on the vehicle is in its memory: the
package it lies in would bring all analysis along.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from array import array
from collections import Counter
from pathlib import Path
from typing import Final, final

from workbench.runtime.bundle import Bundle, load_bundle
from workbench.runtime.contents import LIBRARY_FILE
from workbench.runtime.native import NativeKernel
from workbench.runtime.onboard.attending import memory_mib
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.sensors_file import settings_from
from workbench.runtime.onboard.states import Mode
from workbench.runtime.onboard.times import DECIDE_EVERY, TURN_US
from workbench.runtime.onboard.turns import TurnResult
from workbench.simulation.onboard_car import Crowd, OnboardCar, Sent, straight_road
from workbench.simulation.onboard_operator import Operator

FIRST_M: Final = -8_000.0
"""Localisation frames carry up to 8388 m to either side of their origin."""
_LAST_M: Final = 8_000.0
_MARKS: Final = 100
_QUERIES: Final = 200
_NAP: Final = 0.12
"""Share of a turn's time that follows it as a pause. Linux stops a real-time process that takes
more than 95 % of a core, for 50 ms of every second; the loop on a vehicle comes nowhere near."""
_DECIDED_US: Final = 1_500
"""What the core is told that a decision took: the run must not depend on the machine."""


@final
class Timed:
    """Times of turns (us), kept in memory that is there from the beginning."""

    def __init__(self, most: int) -> None:
        self.times_us = array("d", bytes(8 * most))
        self.count = 0

    def add(self, ns: int) -> None:
        """One more; what there is no room for is left out."""
        if self.count < len(self.times_us):
            self.times_us[self.count] = ns / 1e3
            self.count += 1

    def bytes(self) -> bytes:
        """Those that were added."""
        return self.times_us[: self.count].tobytes()


@final
class Feed:
    """A core, its car and its operator, turn by turn in virtual time.

    decided, others: from handing in the last frame before a turn until its frames were there, for
    turns with and without a decision; kernel: until the decision had ended.
    """

    def __init__(self, bundle: Bundle, decisions: int) -> None:
        self._bundle = bundle
        self._road = straight_road(FIRST_M, _LAST_M)
        self.decided, self.ended = Timed(decisions), Timed(decisions)
        self.others = Timed(decisions * DECIDE_EVERY)
        self.states: Counter[str] = Counter()
        self.verdicts: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.laps = 0
        self._begin()

    def _begin(self) -> None:
        """At the road's beginning, with a new core."""
        settings = settings_from(self._bundle.manifest, signed=True, tag=0)
        self._core = Core(self._bundle, self._road, settings, mode=Mode.DRIVE)
        self._car = OnboardCar(settings, Crowd(), x_m=FIRST_M + 30.0)
        self._operator = Operator()
        self._result: TurnResult | None = None
        self._at_us = 0
        self.laps += 1

    def turn(self) -> TurnResult:
        """Everything that comes until the next turn, the turn, and a pause."""
        begun_s = time.perf_counter()
        result = self._next()
        time.sleep(_NAP * (time.perf_counter() - begun_s))
        return result

    def _next(self) -> TurnResult:
        if self._car.x_m > _LAST_M - 30.0:
            self._begin()
        self._at_us += TURN_US
        asked = self._operator.asks(self._result)
        if asked is not None:
            self._core.request(asked, self._at_us)
        came = [*self._car.until(self._at_us)]
        for each in came[:-1]:
            self._core.receive(each.identifier, each.data, each.at_us)
        self._result = result = self._timed(came[-1] if came else None)
        for frame in result.frames:
            self._car.hear(frame.identifier, frame.data)
        self.states[result.state.name] += 1
        self.faults.update(found.fault.name for found in result.faults)
        return result

    def _timed(self, last: Sent | None) -> TurnResult:
        ended_ns = 0

        def ended() -> int:
            nonlocal ended_ns
            ended_ns = time.perf_counter_ns()
            return self._at_us + _DECIDED_US

        begun_ns = time.perf_counter_ns()
        if last is not None:
            self._core.receive(last.identifier, last.data, last.at_us)
        result = self._core.turn(self._at_us, ended)
        done_ns = time.perf_counter_ns()
        if result.decision is None:
            self.others.add(done_ns - begun_ns)
        else:
            self.decided.add(done_ns - begun_ns)
            self.ended.add(ended_ns - begun_ns)
            self.verdicts[result.decision.verdict.name] += 1
        return result


def main(folder: str, decisions: int, out: str) -> None:
    """Feed the bundle in `folder` until so many decisions, and write into the folder `out`."""
    bundle, kernel = _with_kernel(Path(folder))
    feed, into = Feed(bundle, decisions), Path(out)
    warm = max(decisions // 100, 1)
    while feed.decided.count < warm:
        feed.turn()
    gc.collect()
    gc.freeze()
    marks, begun_s = [(feed.decided.count, memory_mib())], time.perf_counter()
    with (into / "queries").open("wb") as queries:
        while feed.decided.count < decisions:
            decided = feed.turn().decision is not None
            count = feed.decided.count
            if decided and count % max(decisions // _QUERIES, 1) == 0:
                queries.write(bytes(kernel.query))
            if decided and count % max(decisions // _MARKS, 1) == 0:
                marks.append((count, memory_mib()))
                sys.stdout.write(f"{count}\n")
                sys.stdout.flush()
    for name in ("decided", "ended", "others"):
        (into / name).write_bytes(getattr(feed, name).bytes())
    told = {
        "marks": marks, "seconds": time.perf_counter() - begun_s, "laps": feed.laps,
        "states": feed.states, "verdicts": feed.verdicts, "faults": feed.faults,
        "query_size": bundle.manifest.kernel.query_size, "modules": sorted(sys.modules),
    }  # fmt: skip
    (into / "told.json").write_text(json.dumps(told))


def _with_kernel(folder: Path) -> tuple[Bundle, NativeKernel]:
    """The verified bundle around a kernel whose query can be read."""
    loaded = load_bundle(folder)
    kernel = NativeKernel((folder / LIBRARY_FILE).read_bytes(), loaded.manifest.kernel)
    return Bundle(loaded.manifest, kernel, loaded.manifest_sha256), kernel


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
