"""How many small changes of the decision core and the codecs the tests notice: `--help` says how.

Works in a copy of the tree. Every test runs once under coverage, which says which tests reach which
line; then each mutant runs those tests, the ones that have just killed others first, until one
fails. A mutant that computes for longer than its tests may take is noticed, too.
"""

from __future__ import annotations

import argparse
import compileall
import json
import random
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from mutant_tests import (
    Host,
    Killer,
    Tests,
    frozen,
    in_child,
    measure_reach,
    prepared,
    run_tests,
)
from mutants import Mutant, mutants_of, row_of, rows_in

ROOT: Final = Path(__file__).resolve().parent.parent
RUNTIME: Final = "workbench/runtime"
ONBOARD: Final = (
    "core", "turns", "states", "permission", "helm", "actuation", "commands", "pid", "limits",
    "faults", "found_on_bus", "found_in_car", "following", "watching", "arming", "last_resort",
    "gate", "found_in_intents", "way_tubes", "ways",
)  # fmt: skip
DECISION_CORE: Final = ("judgement", "monitor", "observation", "decision", "grounds")
TESTS: Final = (
    "test_policies_*", "test_can_*", "test_actuation_laws", "test_actuation_edges",
    "test_onboard_core*", "test_onboard_commands*", "test_onboard_faults", "test_onboard_found_*",
    "test_onboard_following_*", "test_onboard_gate_edges", "test_onboard_permission_edges",
    "test_onboard_watching_*",
    "test_onboard_intake", "test_localiser_ranges", "test_onboard_way*",
    "test_onboard_last_resort", "test_onboard_limits",
    "test_onboard_pid*", "test_onboard_intake_sets", "test_onboard_states*", "test_onboard_turns",
    "test_onboard_campaign_causes", "test_runtime_decisions", "test_runtime_fail_safe",
    "test_runtime_grounds", "test_runtime_judgement", "test_runtime_monitor_*",
    "test_runtime_observation*",
    "test_runtime_roundings", "test_runtime_skew", "test_runtime_watched",
)  # fmt: skip
EXPLAINED: Final = "docs/mutation.md"
_FIRST: Final = 12
_LEFT_BEHIND: Final = (".git", "out", ".venv", "__pycache__", ".mypy_cache", ".hypothesis")


def modules() -> tuple[str, ...]:
    """The decision core and the codecs, as paths below the runtime."""
    found = [*DECISION_CORE, *(f"onboard/{name}" for name in ONBOARD)]
    for folder in ("policies", "protocols"):
        found += [f"{folder}/{each.stem}" for each in (ROOT / RUNTIME / folder).glob("[a-z]*.py")]
    return tuple(sorted(found))


def _survives(copy: Path, path: str, mutant: Mutant, tests: Tests, limit_s: float) -> bool:
    """Whether every test passes in a fresh process with the mutant in place."""
    text = (copy / path).read_text()
    while True:
        chosen, takes_s = tests.of(mutant, limit_s)
        status, test = _fresh(copy, path, mutant.text, chosen, 10.0 + 4.0 * takes_s)
        alone = [test]
        if not test or tests.killed(test, lambda: not _fresh(copy, path, text, alone, 60.0)[0]):  # noqa: B023
            (copy / path).write_text(text)
            return status == 0


def _fresh(copy: Path, path: str, text: str, chosen: list[str], cpu_s: float) -> tuple[int, str]:
    """0 and '' where all tests pass with this text; else a status, and what failed first."""
    target, killer = copy / path, Killer(copy / "killer")
    for stale in target.parent.glob(f"__pycache__/{target.stem}.*.pyc"):
        stale.unlink()
    target.write_text(text)

    def work() -> int:
        prepared(copy)
        frozen()
        # Most fall to the first few, and these need not load the files of all others.
        parts = filter(None, (chosen[:_FIRST], chosen[_FIRST:]))
        return next((code for code in (run_tests(some, killer) for some in parts) if code), 0)

    return in_child(work, cpu_s), killer.found


def _settled(
    copy: Path, path: str, mutants: list[Mutant], tests: Tests, limit_s: float
) -> dict[int, bool]:
    """What one process that loads the tests once can say of mutants, by their index."""
    name, into = path.removesuffix(".py").replace("/", "."), copy / "settled.json"

    def work() -> int:
        prepared(copy)
        frozen()
        host = Host(name, tests, mutants, limit_s)
        run_tests(tests.some(limit_s), host)
        into.write_text(json.dumps(host.settled))
        return 0

    into.write_text("{}")
    in_child(work, 3600.0)
    return {int(k): survives for k, survives in json.loads(into.read_text()).items()}


def _try_module(
    copy: Path, module: str, reach: dict[str, Any], known: set[tuple[str, str, str, str]],
    options: argparse.Namespace,
) -> tuple[int, int, int]:  # fmt: skip
    """Mutants tried, survivors that are explained, survivors that are not."""
    path = f"{RUNTIME}/{module}.py"
    text = (copy / path).read_text()
    tests, chance = Tests(copy, reach, path), random.Random(f"{options.seed} {module}")
    every = [m for m in mutants_of(text) if options.share >= 1.0 or chance.random() < options.share]
    if options.again:
        again = rows_in(options.again.read_text())
        every = [mutant for mutant in every if row_of(module, mutant) in again]
    given = len(every)
    if not options.all:
        every = [mutant for mutant in every if row_of(module, mutant) not in known]
    settled = _settled(copy, path, every, tests, options.limit_s) if every else {}
    seen, unseen = given - len(every), 0
    if options.quick:
        every = [mutant for k, mutant in enumerate(every) if k in settled]
        settled = dict(enumerate(settled[k] for k in sorted(settled)))
        given = seen + len(every)
    for k, mutant in enumerate(every):
        row = row_of(module, mutant)
        survives = settled.get(k)
        if survives is None:
            survives = _survives(copy, path, mutant, tests, options.limit_s)
        if survives:
            seen, unseen = seen + (row in known), unseen + (row not in known)
            if row not in known:
                line, change = mutant.lines[0], f"`{row[2]}` → `{row[3]}`"
                say(f"{path}:{line}: | `{module}` | `{row[1]}` | {change} |")
        elif row in known:
            say(f"{path}:{mutant.lines[0]}: is noticed, and its row can go: {row}")
    (copy / path).write_text(text)
    return given, seen, unseen


def say(line: str) -> None:
    """One line of the report, at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _options(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("modules", nargs="*", help="as policies/plan; none: all of them")
    parser.add_argument("--share", type=float, default=1.0, help="of the mutants, drawn by --seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit-s", type=float, default=20.0, help="of tests, for one mutant")
    parser.add_argument("--reach", type=Path, help="file of what tests reach: read, or made")
    parser.add_argument("--tests", nargs="+", default=TESTS, help="files of tests, as test_can_*")
    parser.add_argument("--again", type=Path, help="a report: only its survivors are tried")
    parser.add_argument("--quick", action="store_true", help="only what one process can try")
    parser.add_argument("--all", action="store_true", help="try the explained ones as well")
    return parser.parse_args(arguments)


def _figures(name: str, counted: tuple[int, ...]) -> str:
    every, seen, unseen = counted
    return f"{name}: {every} mutants, {seen} explained, {unseen} unexplained, the others noticed"


def main(arguments: Sequence[str]) -> int:
    """0 where every survivor is explained."""
    options = _options(arguments)
    wanted = options.modules or modules()
    known = rows_in((ROOT / EXPLAINED).read_text())
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "tree"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*_LEFT_BEHIND), symlinks=True)
        for part in ("workbench", "tests"):
            compileall.compile_dir(copy / part, quiet=2)
        reach_file = options.reach or Path(folder) / "reach.json"
        if not reach_file.exists():
            measure_reach(copy, reach_file, options.tests)
        reach = json.loads(reach_file.read_text())
        for test in reach["failed"]:
            say(f"fails without a mutant, and is left out: {test}")
        tried = []
        for name in wanted:
            tried.append(_try_module(copy, name, reach, known, options))
            say(_figures(name, tried[-1]))
    total = tuple(sum(column) for column in zip(*tried, strict=True))
    say(_figures("all", total))
    return 1 if total[2] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
