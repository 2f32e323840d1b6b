"""A bound of a decision's instructions for 0 to 32 people, from what is limited by construction."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from workbench.bench.decision_cost import COUNTS_FILE, counted, decision_folder, write_input
from workbench.bench.decision_kernel import DecisionKernel
from workbench.bench.decision_scenes import (
    Scene,
    hostile_scenes,
    people_values,
    telling_scenes,
    worst_people,
)
from workbench.codegen.compiler import compile_shared
from workbench.codegen.decision_source import MOST_TUBES, DecisionSizes
from workbench.errors import InputError
from workbench.runtime.layout import TUBES
from workbench.runtime.person_tubes import MOST_PIECES, TrackedPerson
from workbench.runtime.person_tubes import MOST_TUBES as MOST_PERSON_TUBES

STEP: Final = "wb_drive_row"
ATTEMPT: Final = "wb_attempt"
ROW: Final = "wb_compare"
BOXES: Final = "wb_box_people"
_PARTS: Final = (STEP, ATTEMPT, ROW, BOXES)
_NAME: Final = re.compile(r"c?fn=\((\d+)\)(?: (\S+))?")
# The telling scene whose people are replaced: a third of the initial set, where all is proved.
_SCENE: Final = 2
# Kinds of people: two intents and a guard, each between two pieces; and the most that fits.
CROWDS: Final = ((3, 2), (MOST_PERSON_TUBES, MOST_PIECES))


@final
@dataclass(frozen=True, slots=True)
class Limits:
    """What the text of the kernel limits, whatever the query.

    steps: attempted steps of integration, the budget; runs: tubes begun, at most twice (coarse and
    fine) for every level and for every cell of the deciding one, in each of the three tubes; rows:
    compared with people: each has at least one attempted step, but for one row at standstill per
    run; boxes: how often boxes are put around the people.
    """

    steps: int
    runs: int
    rows: int
    boxes: int

    @classmethod
    def of(cls, sizes: DecisionSizes) -> Limits:
        """Those of a kernel with these sizes."""
        runs = len(TUBES) * 2 * (sizes.levels + MOST_TUBES - 1)
        return cls(sizes.budget, runs, sizes.budget + runs, len(TUBES))


@final
@dataclass(frozen=True, slots=True)
class Parts:
    """Instructions of one decision: total; in steps, and how many were attempted; in rows compared
    with people; in boxes around people; rest: all else."""

    scene: str
    total: int
    steps: int
    attempts: int
    rows: int
    compared: int
    boxes: int

    @property
    def rest(self) -> int:
        """Checks, starts of tubes, cells, reports."""
        return self.total - self.steps - self.rows - self.boxes

    @property
    def per_attempt(self) -> float:
        """Mean instructions of a step per attempt."""
        return self.steps / max(1, self.attempts)


@final
@dataclass(frozen=True, slots=True)
class PeopleBound:
    """For so many people with `tubes` tubes each, of each of which `pieces` are in force at once
    and none is skipped: the dearest single row and boxes that were seen, what all else took at
    most, the bound from these, and the largest decision that was seen."""

    people: int
    tubes: int
    pieces: int
    row: int
    boxes: int
    rest: int
    bound: int
    largest: int


@final
@dataclass(frozen=True, slots=True)
class Bound:
    """limits: by construction; step: the most instructions per attempted step in integrating one
    row, of `steps_seen` rows; rest: of the dearest scene, all but steps, rows and boxes; scenes:
    the parts that were counted; people: the bound for each number."""

    limits: Limits
    step: float
    steps_seen: int
    rest: int
    scenes: tuple[Parts, ...]
    people: tuple[PeopleBound, ...]


@final
@dataclass(frozen=True, slots=True)
class BoundPlan:
    """people: numbers of people; scenes: counted besides the telling and hostile ones; stepped: of
    how many scenes, those with the dearest steps, every single step is counted."""

    people: tuple[int, ...]
    scenes: tuple[Scene, ...]
    stepped: int

    @property
    def units_of_work(self) -> int:
        """How often `instruction_bound` counts on."""
        return len(self.all_scenes()) + self.stepped + len(CROWDS) * len(self.people)

    def all_scenes(self) -> tuple[Scene, ...]:
        """Everything that is counted."""
        return (*telling_scenes(), *hostile_scenes(), *self.scenes)


def instruction_bound(
    kernel: DecisionKernel, plan: BoundPlan, *, advance: Callable[[], None] = lambda: None
) -> Bound | None:
    """Count parts of decisions and put them together; None without valgrind.

    bound(n) = (steps + runs) s + rows r(n) + boxes b(n) + rest(n): steps, runs, rows and boxes are
    `Limits`; s is the largest cost per attempt of integrating one row, of all rows of the `stepped`
    scenes (a tube may end in a row without an attempt), r and b the largest of all calls with n
    people, rest(n) what is left there, and in the dearest scene besides.
    By construction: the four numbers of times, and that every loop inside of them has a fixed end.
    Measured, and so no proof: s, r, b, rest. The parts are kept apart from their callers while they
    are compiled, which adds a call to each. `advance` is called after every scene.
    """
    kernel = with_parts_apart(kernel)
    limits, scenes = Limits.of(kernel.sizes), plan.all_scenes()
    found = []
    for each in scenes:
        counted_parts = parts(kernel, each)
        if counted_parts is None:
            return None
        found.append(counted_parts)
        advance()
    order = sorted(range(len(scenes)), key=lambda k: -found[k].per_attempt)
    step, seen = 0.0, 0
    for k in order[: plan.stepped]:
        costs = [total / max(1, tries) for total, tries in single_calls(kernel, scenes[k], STEP)]
        step, seen = max(step, *costs), seen + len(costs)
        advance()
    rest = max(part.rest for part in found)
    bounds = []
    for (tubes, pieces), count in itertools.product(CROWDS, plan.people):
        crowd = worst_people(count, tubes=tubes, bounds=pieces)
        bounds.append(
            _with_people(
                kernel, crowd, (tubes, pieces), base=(limits.steps + limits.runs) * step + rest
            )
        )
        advance()
    return Bound(limits, step, seen, rest, tuple(found), tuple(bounds))


def _with_people(
    kernel: DecisionKernel, crowd: Sequence[TrackedPerson], kind: tuple[int, int], *, base: float
) -> PeopleBound:
    limits = Limits.of(kernel.sizes)
    few, many = (
        replace(each, values={**each.values, **people_values(crowd)})
        for each in (telling_scenes()[_SCENE], hostile_scenes()[1])
    )
    seen = [part for each in (few, many) if (part := parts(kernel, each)) is not None]
    row = max(total for total, _ in single_calls(kernel, few, ROW))
    boxes = max(total for total, _ in single_calls(kernel, few, BOXES))
    rest = max(part.rest for part in seen)
    bound = int(base + limits.rows * row + limits.boxes * boxes + rest)
    largest = max(part.total for part in seen)
    return PeopleBound(len(crowd), *kind, row, boxes, rest, bound, largest)


def with_parts_apart(kernel: DecisionKernel) -> DecisionKernel:
    """The kernel with the functions that are counted kept as functions of their own."""
    source = kernel.source
    for name in _PARTS:
        source, found = re.subn(
            rf"^static (?=\w+ {name}\()", "__attribute__((noinline)) static ", source, flags=re.M
        )
        if found != 1:
            raise InputError(f"expected one function {name} in the kernel's text, got {found}")
    return replace(kernel, source=source, shared_object=compile_shared(source).shared_object)


def parts(kernel: DecisionKernel, scene: Scene) -> Parts | None:
    """What one decision spends where; None without valgrind."""
    with decision_folder(kernel) as folder:
        write_input(kernel, [scene], folder)
        total = counted(folder)
        if total is None:
            return None
        calls = _calls((folder / COUNTS_FILE).read_text())
    (steps, _), (_, attempts), (rows, compared), (boxes, _) = (calls.get(p, (0, 0)) for p in _PARTS)
    return Parts(scene.name, total, steps, attempts, rows, compared, boxes)


def single_calls(kernel: DecisionKernel, scene: Scene, name: str) -> list[tuple[int, int]]:
    """Instructions of every single call of a function, and how many steps were attempted in it."""
    with decision_folder(kernel) as folder:
        write_input(kernel, [scene], folder)
        if counted(folder, toggle=name, dump_after=name) is None:
            return []
        return list(_dumps(folder))


def _dumps(folder: Path) -> Iterator[tuple[int, int]]:
    """callgrind numbers its dumps; names are written out in the first one only."""
    numbers: dict[str, str] = {}
    count = len(list(folder.glob(f"{COUNTS_FILE}.*")))
    for k in range(1, count + 1):
        text = (folder / f"{COUNTS_FILE}.{k}").read_text()
        total = re.search(r"^summary: (\d+)", text, re.M)
        if total is not None and int(total.group(1)) > 0:
            yield int(total.group(1)), _calls(text, numbers).get(ATTEMPT, (0, 0))[1]


def _calls(text: str, numbers: dict[str, str] | None = None) -> dict[str, tuple[int, int]]:
    """Function -> instructions inside all calls of it, and how many calls, in a callgrind file."""
    numbers = {} if numbers is None else numbers
    found: dict[str, tuple[int, int]] = {}
    lines = iter(text.split("\n"))
    called = ""
    for line in lines:
        if match := _NAME.match(line):
            number, name = match.groups()
            if name is not None:
                numbers[number] = name.split(".")[0]
            called = numbers.get(number, "")
        elif line.startswith("calls="):
            cost, count = int(next(lines).split()[1]), int(line[6:].split()[0])
            before = found.get(called, (0, 0))
            found[called] = (before[0] + cost, before[1] + count)
    return found
