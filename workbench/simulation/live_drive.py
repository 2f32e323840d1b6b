"""A scenario in real time: the real `workbench-monitor` drives, as a process of its own.

The same world as in virtual time, with its frames on serial lines of the system (`slcan`). The
process loads a signed bundle, is armed over its control socket, and writes its own log. What it
decided is read from that log, by a core that is given all frames again at the same microseconds.
With beacons around, `workbench-localiser` is a process on the same bus.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError
from workbench.runtime import load_bundle
from workbench.runtime.onboard.playback import Compared, compare
from workbench.runtime.onboard.playback_logs import MCAP_SUFFIX, open_log
from workbench.runtime.onboard.playback_settings import core_again
from workbench.runtime.onboard.states import State
from workbench.runtime.protocols import Refusal, decode, load_protocol
from workbench.simulation.bus_drive import BusDrive, Recorded
from workbench.simulation.bus_world import BusWorld
from workbench.simulation.live_processes import (
    Ended,
    Installed,
    Operator,
    Program,
    localiser_on,
    monitor_on,
)
from workbench.simulation.live_story import LiveStory, PlayedAgain
from workbench.simulation.measures import Progress
from workbench.simulation.pacmod2_unit import CanFrame
from workbench.simulation.run_up import BEGUN_US as RUN_UP_US
from workbench.simulation.serial_line import SerialLine

_OWN: Final = load_protocol("workbench")
_NEVER_US: Final = 10**12
_READY_S: Final = 40.0
_ENDS_S: Final = 20.0
_PACE_S: Final = 0.002
_SOON_US: Final = 200_000


@final
@dataclass(frozen=True, slots=True)
class LiveDrive:
    """driven: as in virtual time, without what a localiser told, whose clock is its own; log: of
    the monitor; compared: the log against what was decided again; ready_s: from the start of the
    processes until they were; behind_s: most that the world was late; lost: frames that a line did
    not take; located: sets with a heading that a localiser sent while the scenario ran; monitor,
    localiser: how they ended, None for none."""

    driven: BusDrive
    log: Path
    compared: Compared
    ready_s: float
    behind_s: float
    lost: int
    located: int
    monitor: Ended
    localiser: Ended | None = None


def drive_live(
    world: BusWorld, installed: Installed, log: Path, recorded: Recorded, *,
    progress: Progress | None = None,
) -> LiveDrive:  # fmt: skip
    """Let the monitor drive until the scenario is over, then let it end.

    log: folder of its log, which must not hold one, and of the localiser's. A localiser is
    installed where the world ranges for one elsewhere (`Ranging.elsewhere`); then a driver takes
    the car to the path's beginning first. Takes the scenario's duration and some seconds. Raises
    InputError, with the last words of a process that refuses to start, or of a monitor that cannot
    be armed.
    """
    world.begin(_NEVER_US)
    story = LiveStory(world, recorded)
    with contextlib.ExitStack() as open_things:
        lines = [SerialLine()]
        open_things.callback(lines[0].close)
        monitor, operator = open_things.enter_context(
            monitor_on(lines[0].name, installed, log, wait_s=_READY_S)
        )
        programs = [monitor]
        if installed.localiser is not None:
            lines.append(SerialLine())
            open_things.callback(lines[1].close)
            programs.append(
                open_things.enter_context(
                    localiser_on(lines[1].name, installed, log, wait_s=_READY_S)
                )
            )
        live = _Live(world, lines, story)
        ready_s = live.until_ready(operator, programs)
        live.until_over(operator, programs, progress)
        story.ends()
        ended = [live.until_ended(each) for each in programs]
    file = next(iter(sorted(log.glob(f"*{MCAP_SUFFIX}"))), log / "no log")
    driven, compared = _again(installed.bundle, file, story)
    return LiveDrive(
        driven, file, compared, ready_s, live.behind_s, sum(line.lost for line in lines),
        live.located, *ended,
    )  # fmt: skip


@final
class _Live:
    """The world, kept to the clock on the wall; every line hears what comes from the others."""

    def __init__(self, world: BusWorld, lines: Sequence[SerialLine], story: LiveStory) -> None:
        self._world, self._lines, self._story = world, lines, story
        self._begun_s = time.monotonic()
        self.behind_s = 0.0
        self.located = 0

    def _elapsed_s(self) -> float:
        return time.monotonic() - self._begun_s

    def step(self) -> None:
        """What has come goes in, what is due goes out."""
        world = self._world
        for k, line in enumerate(self._lines):
            for frame in line.receive(0.0 if k else _PACE_S):
                self._hear(frame)
                self._send(frame, *(each for each in self._lines if each is not line))
        now_us = round(1e6 * self._elapsed_s())
        if world.scenario_s > 0.0:
            self.behind_s = max(self.behind_s, (now_us - world.now_us) / 1e6)
        for sent in world.until(now_us):
            self._send((sent.identifier, sent.data), *self._lines)

    def _hear(self, frame: CanFrame) -> None:
        identifier, data = frame
        self._world.hear(identifier, data)
        said = decode(_OWN, identifier, data)
        if isinstance(said, Refusal):
            return
        if said.message == "HEARTBEAT":
            self._story.beat(data, State(int(said.values["STATE"])))
        self.located += said.message == "LOC_RADII" and self._world.scenario_s >= 0.0

    def _send(self, frame: CanFrame, *lines: SerialLine) -> None:
        for line in lines:
            line.send(frame)

    def until_ready(self, operator: Operator, programs: Sequence[Program]) -> float:
        """The car stands, until the monitor waits to be armed; how long that took, s.

        A car with a localiser is driven to the path's beginning then.
        """
        others = programs[1:]
        while operator.state != State.DISARMED.name or not all(each.listens for each in others):
            self.step()
            for each in programs:
                each.require_alive()
            if self._elapsed_s() > _READY_S:
                said = "; ".join(f"{each.name}: {each.said.strip()[-300:]!r}" for each in programs)
                raise InputError(
                    f"expected everybody to be ready within {_READY_S:g} s, they said: {said}"
                )
        world = self._world
        world.begin(world.now_us + (_SOON_US if world.ranged is None else RUN_UP_US))
        return self._elapsed_s()

    def until_over(
        self, operator: Operator, programs: Sequence[Program], progress: Progress | None
    ) -> None:
        """The scenario, which the operator waits for."""
        duration_s, done = self._world.scene.scenario.duration_s, 0
        while self._world.scenario_s < duration_s:
            self.step()
            for each in programs:
                each.require_alive()
            if self._world.scenario_s >= 0.0:
                operator.may_arm()
            if progress is not None and done < int(self._world.scenario_s):
                done = int(self._world.scenario_s)
                progress(done, max(done, int(duration_s)))

    def until_ended(self, program: Program) -> Ended:
        """It is told to end; a monitor brakes to standstill and leaves."""
        program.terminate()
        since_s = self._elapsed_s()
        while program.runs and self._elapsed_s() - since_s < _ENDS_S:
            self.step()
        if program.runs:
            raise InputError(
                f"expected {program.name} to end within {_ENDS_S:g} s of SIGTERM, it goes on"
            )
        return program.ended()


def _again(folder: Path, file: Path, story: LiveStory) -> tuple[BusDrive, Compared]:
    """The drive with every decision that the log holds."""
    log = open_log(file)
    assert log.header is not None, "the monitor writes one"
    played = PlayedAgain(core_again(load_bundle(folder), log.header))
    compared = compare(played, log.events, exact=log.exact)
    return story.told(played.results), compared
