"""The board of the monitor on the vehicle: what is measured of it, and what must hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, final

from workbench.bench.onboard_bundle import require_driving
from workbench.bench.onboard_heap import Heap, heap
from workbench.bench.onboard_install import base_distributions
from workbench.bench.onboard_period import Period, period
from workbench.bench.onboard_programs import REALTIME, Cores, has_realtime
from workbench.bench.onboard_start import (
    ColdStart,
    Resident,
    Started,
    can_start,
    cold_start,
    resident,
)
from workbench.bench.onboard_turns import Turns, at_shares, turns
from workbench.runtime.contents import LIBRARY_FILE
from workbench.runtime.onboard.times import TURN_US

COLD_START_S: Final = 0.5
RESIDENT_MB: Final = 45.0
DISTRIBUTIONS: Final = 12
GROWTH_MIB: Final = 1.0
_SHARE: Final = 10
_PARTS: Final = 100
_STARTS: Final = 3


@final
@dataclass(frozen=True, slots=True)
class OnboardPlan:
    """How much is measured.

    decisions: of the whole core beside busy cores, with real-time priority where the system grants
    it, and then a tenth of them without; kernel_calls: of the compiled decision alone; seconds: of
    the loop in real time, per setting; processes: that are started, per kind; resident_s: after
    which memory is looked at.
    """

    decisions: int
    kernel_calls: int
    seconds: float
    processes: int
    resident_s: float


@final
@dataclass(frozen=True, slots=True)
class Keys:
    """The bundle as it is, and a signed copy with the public key that opens it."""

    bundle: Path
    signed: Path
    public_key: Path


@final
@dataclass(frozen=True, slots=True)
class Claim:
    """What must hold, as a sentence with the figure that was measured."""

    holds: bool
    sentence: str


@final
@dataclass(frozen=True, slots=True)
class OnboardBoard:
    """All figures. budget: of the bundle; turns, periods: one per setting; cold_starts, resident:
    None where python-can cannot talk to a serial line; claims: everything that is claimed of the
    figures."""

    budget: int
    turns: tuple[Turns, ...]
    periods: tuple[Period, ...]
    heap: Heap
    cold_starts: tuple[ColdStart, ...] | None
    resident: Resident | None
    distributions: tuple[str, ...]
    claims: tuple[Claim, ...] = field(init=False)

    def __post_init__(self) -> None:
        claims = (*_about_turns(self), *_about_memory(self), *_about_processes(self))
        object.__setattr__(self, "claims", claims)

    @property
    def failing(self) -> int:
        """Claims that do not hold."""
        return sum(not claim.holds for claim in self.claims)


def settings() -> tuple[Cores, ...]:
    """What else runs while it is measured; real-time priority only where the system grants it."""
    every = tuple(Cores)
    return every if has_realtime() else every[:-1]


def units_of_work(plan: OnboardPlan) -> int:
    """How often `onboard_board` calls `advance`."""
    kinds = _STARTS * (2 if has_realtime() else 1) if can_start() else 0
    feeds = len([cores for cores in settings() if cores is not Cores.IDLE])
    return _PARTS * (feeds + 1) + len(settings()) + kinds * plan.processes + (1 if kinds else 0)


def onboard_board(keys: Keys, plan: OnboardPlan, *, advance: Callable[[], None]) -> OnboardBoard:
    """Measure; InputError where the bundle does not drive, or without a C compiler."""
    bundle = require_driving(keys.bundle)
    parts = _Parts(advance)
    with TemporaryDirectory(prefix="workbench-") as name:
        queries = Path(name) / "queries"
        fed = [
            turns(
                keys.bundle, _of(plan.decisions, cores), cores=cores, turn_us=TURN_US,
                queries=queries, line=parts.again(),
            )
            for cores in settings() if cores is not Cores.IDLE
        ]  # fmt: skip
        counted = heap(
            keys.bundle / LIBRARY_FILE, queries, kernel=bundle.manifest.kernel,
            calls=plan.kernel_calls, prefix=REALTIME if has_realtime() else (), line=parts.again(),
        )  # fmt: skip
    parts.done()
    periods = []
    for cores in settings():
        periods.append(period(keys.bundle, plan.seconds, cores=cores))
        advance()
    colds: tuple[ColdStart, ...] | None = None
    held: Resident | None = None
    if can_start():
        kinds = _kinds(keys, Path(keys.signed).parent)
        colds = tuple(
            cold_start(bundle, kind, processes=plan.processes, advance=advance) for kind in kinds
        )
        held = resident(bundle, kinds[-1], after_s=plan.resident_s)
        advance()
    return OnboardBoard(
        bundle.manifest.budget, tuple(fed), tuple(periods), counted, colds, held,
        base_distributions(),
    )  # fmt: skip


@final
class _Parts:
    """Lines of programs as hundredths: every program advances by `_PARTS`, however many it says."""

    def __init__(self, advance: Callable[[], None]) -> None:
        self._advance, self._left = advance, 0

    def again(self) -> Callable[[str], None]:
        """For the next program."""
        self.done()
        self._left = _PARTS
        return self._line

    def done(self) -> None:
        """The last program has ended."""
        while self._left:
            self._line("")

    def _line(self, _: str) -> None:
        if self._left:
            self._left -= 1
            self._advance()


def _of(decisions: int, cores: Cores) -> int:
    """All of them with the priority of a vehicle, fewer for comparison."""
    return decisions if cores is settings()[-1] else max(decisions // _SHARE, 100)


def _kinds(keys: Keys, folder: Path) -> tuple[Started, ...]:
    control = folder / "control"
    control.mkdir(mode=0o700, exist_ok=True)
    signed = (f"--bundle={keys.signed}", f"--public-key={keys.public_key}")
    plain = (
        Started("unsigned, shadow", (f"--bundle={keys.bundle}",)),
        Started("signed, shadow", signed),
        Started("signed, drive", (*signed, "--mode=drive", f"--control={control}"), sends=True),
    )
    if not has_realtime():
        return plain
    return plain + tuple(
        replace(each, kind=f"{each.kind}, real-time", prefix=REALTIME) for each in plain
    )


def _about_turns(board: OnboardBoard) -> list[Claim]:
    # The last setting is the one of a vehicle: the loop has the priority that it needs.
    fed, live = board.turns[-1], board.periods[-1]
    found = [
        Claim(
            fed.decided_us[1] <= TURN_US,
            f"last frame in to commands out, {fed.cores.value}: p99.9 "
            f"{fed.decided_us[1] / 1e3:.1f} ms, within a turn of {TURN_US / 1e3:g} ms",
        )
    ]
    found += [
        Claim(
            each.unanswered == 0,
            f"deadlines missed in {each.seconds:g} s, {each.cores.value}: "
            f"{sum(m.times for m in each.missed)}, {each.unanswered} without the answer owed",
        )
        for each in board.periods
    ]
    commanded = live.gap_us is not None
    return [
        *found, Claim(commanded, f"the car was armed and commanded, {live.cores.value}")
    ]  # fmt: skip


def _about_memory(board: OnboardBoard) -> list[Claim]:
    calls = sum(board.heap.by_kind.values())
    found = [Claim(calls == 0, f"{calls} heap calls in {board.heap.calls} decisions in C")]
    for what, marks in (
        ("the compiled decision", board.heap.marks), ("the whole core", board.turns[-1].marks)
    ):  # fmt: skip
        grown = growth_mib(marks)
        found.append(
            Claim(
                grown <= GROWTH_MIB,
                f"{what}: {grown:+.2f} MiB from 10 % to 100 % of {marks[-1][0]} decisions, at most "
                f"{GROWTH_MIB:g}",
            )
        )
    return found


def growth_mib(marks: Sequence[tuple[int, float]]) -> float:
    """By how much memory grew after the first tenth."""
    at = at_shares(tuple(marks))
    return at["100 %"] - at["10 %"]


def _about_processes(board: OnboardBoard) -> list[Claim]:
    # The last kinds of start are those with the priority of a vehicle, where it is granted.
    found = [
        Claim(
            each.first_s < COLD_START_S,
            f"cold start, {each.kind}: {each.first_s:.3f} s, below {COLD_START_S:g} s",
        )
        for each in (board.cold_starts or ())[-_STARTS:]
    ]
    if board.resident is not None:
        found.append(
            Claim(
                board.resident.now_mb <= RESIDENT_MB,
                f"resident after {board.resident.after_s:g} s: {board.resident.now_mb:.1f} MB, at "
                f"most {RESIDENT_MB:g} MB",
            )
        )
    count = len(board.distributions)
    found.append(
        Claim(count <= DISTRIBUTIONS, f"{count} distributions installed, at most {DISTRIBUTIONS}")
    )
    return found
