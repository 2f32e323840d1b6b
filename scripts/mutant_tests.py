"""Which tests reach which line, and which of them notice a mutant, each in a child process."""

from __future__ import annotations

import gc
import json
import math
import os
import resource
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final

import hypothesis
import pytest
from mutants import Mutant

_MEMORY_BYTES: Final = 8 << 30
_FLAGS: Final = (
    "-q",
    "-s",
    "--continue-on-collection-errors",
    "-p",
    "no:cacheprovider",
    "--tb=no",
    "--assert=plain",
)


class _Recorder:
    """Tells coverage which test runs, and how long each took."""

    def __init__(self, measured: Any) -> None:
        self._measured = measured
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        self._measured.switch_context(f"{item.nodeid}|setup")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_call(self, item: pytest.Item) -> None:
        self._measured.switch_context(f"{item.nodeid}|call")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        begun_s = time.process_time()
        result = yield
        # Of the processor alone: other programs make no test slow.
        self.seconds[item.nodeid] = time.process_time() - begun_s
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self.failed.add(report.nodeid)


def prepared(copy: Path) -> None:
    """A child's world: the copy is what it imports, and the same inputs come every time."""
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        "mutants", derandomize=True, database=None, deadline=None, phases=phases
    )
    hypothesis.settings.load_profile("mutants")
    os.chdir(copy)
    sys.path[:0] = [str(copy), str(copy / "tests")]
    os.environ["PYTHONPATH"] = str(copy)


def frozen() -> None:
    """What was compiled before serves every mutant: asserts stay plain, nothing is written."""
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"


def run_tests(tests: Sequence[str], plugin: object) -> int:
    """pytest's status."""
    return int(pytest.main([*_FLAGS, *tests], plugins=[plugin]))


def in_child(work: Callable[[], int], cpu_s: float) -> int:
    """What `work` returns in a process of its own; not 0 where it computes for longer."""
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(cpu_s),) * 2)
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silence, stream)
        try:
            os._exit(work())
        except BaseException:
            os._exit(70)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def measure_reach(copy: Path, into: Path, names: Sequence[str]) -> None:
    """Which tests reach which line, and how long each takes; only what passes is of use."""

    def work() -> int:
        import coverage

        prepared(copy)
        source = ["workbench.runtime"]
        measured = coverage.Coverage(data_file=None, source=source, config_file=False)
        recorder = _Recorder(measured)
        measured.start()
        files = sorted({str(each) for name in names for each in Path("tests").glob(f"{name}.py")})
        pytest.main([*_FLAGS, *files], plugins=[recorder])
        measured.stop()
        data = measured.get_data()
        lines = {
            str(Path(path).relative_to(copy)): data.contexts_by_lineno(path)
            for path in data.measured_files()
        }
        useful = {t: s for t, s in recorder.seconds.items() if t not in recorder.failed}
        failed = sorted(recorder.failed)
        into.write_text(json.dumps({"seconds": useful, "failed": failed, "lines": lines}))
        return 0

    if in_child(work, 3600.0):
        sys.exit("which tests reach which line could not be measured; run them by pytest")


class Tests:
    """Which tests to run for a mutant, in which order."""

    def __init__(self, copy: Path, reach: dict[str, Any], path: str) -> None:
        self._seconds: dict[str, float] = reach["seconds"]
        name = path.removesuffix(".py").replace("/", ".")
        files = {test.partition("::")[0] for test in self._seconds}
        self._naming = {each for each in files if name in (copy / each).read_text()}
        by_line = reach["lines"].get(path, {})
        self._early = {int(line) for line, found in by_line.items() if "" in found}
        self._lines = {int(line): self._tests(found) for line, found in by_line.items()}
        self._every = frozenset().union(*self._lines.values())
        self._named = frozenset(t for t in self._seconds if t.partition("::")[0] in self._naming)
        self._kills: Counter[str] = Counter()
        self._trusted: set[str] = set()
        self._dropped: set[str] = set()

    def _tests(self, contexts: Sequence[str]) -> frozenset[str]:
        """A fixture serves other tests of its file as well."""
        found = {each.removesuffix("|call") for each in contexts if each.endswith("|call")}
        files = {each.partition("::")[0] for each in contexts if each.endswith("|setup")}
        return frozenset(t for t in self._seconds if t in found or t.partition("::")[0] in files)

    def of(self, mutant: Mutant, limit_s: float) -> tuple[list[str], float]:
        """Those that killed before first, then those whose file names the module, then the
        quickest, as many as fit into the limit; and how long they take."""
        lines = range(mutant.lines[0], mutant.lines[1] + 1)
        reached = frozenset().union(*(self._lines.get(line, frozenset()) for line in lines))
        # What import has made, a test may use without running a line of the module.
        used = self._named if self.early(mutant) else frozenset()
        chosen: list[str] = []
        spent_s = 0.0
        for test in sorted(((reached or self._every) | used) - self._dropped, key=self._rank):
            if chosen and spent_s + self._seconds[test] > limit_s:
                continue
            spent_s += self._seconds[test]
            chosen.append(test)
        return chosen, spent_s

    def early(self, mutant: Mutant) -> bool:
        """Whether it stands where something runs while modules are imported."""
        return any(line in self._early for line in range(mutant.lines[0], mutant.lines[1] + 1))

    def some(self, limit_s: float) -> list[str]:
        """All that take no longer than the limit alone."""
        return [test for test in self._every if self._seconds[test] <= limit_s]

    def _rank(self, test: str) -> tuple[int, bool, float]:
        strange = test.partition("::")[0] not in self._naming
        return -self._kills[test], strange, self._seconds[test]

    def killed(self, test: str, passes: Callable[[], bool]) -> bool:
        """Whether a test that failed counts: it must pass without a mutant, which is tried once,
        or it is never asked again. One that counts is asked first from now on."""
        if test not in self._trusted:
            if not passes():
                self._dropped.add(test)
                return False
            self._trusted.add(test)
        self._kills[test] += 1
        return True


class Killer:
    """Notes the test that fails first, and ends the process."""

    def __init__(self, note: Path) -> None:
        self._note = note
        note.unlink(missing_ok=True)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """pytest's hook."""
        if report.failed:
            self._note.write_text(report.nodeid)
            os._exit(1)

    @property
    def found(self) -> str:
        """The test that failed, or ''."""
        return self._note.read_text() if self._note.exists() else ""


class Host:
    """Loads the tests of a module once, then tries mutants of its functions in forks of itself.

    settled: by mutant, whether it survives; left out is what stands outside of functions, and a
    survivor in what ran already while tests were loaded.
    """

    def __init__(
        self, module: str, tests: Tests, mutants: Sequence[Mutant], limit_s: float
    ) -> None:
        self._module, self._tests, self._mutants, self._limit_s = module, tests, mutants, limit_s
        self.settled: dict[int, bool] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """pytest's hook, in place of its own loop."""
        items = {item.nodeid: item for item in session.items}
        functions: dict[str, list[FunctionType]] = defaultdict(list)
        for each in gc.get_objects():
            if isinstance(each, FunctionType) and each.__module__ == self._module:
                functions[each.__qualname__].append(each)
        for k, mutant in enumerate(self._mutants):
            place = mutant.place.partition(" ")[0]
            found = functions.get(place, [])
            code = _code(compile(mutant.text, "mutant", "exec"), place)
            if code is None or not found or _same(code, found[0].__code__):
                continue
            survives = self._survives(items, mutant, found, code)
            if not (survives and self._tests.early(mutant)):
                self.settled[k] = survives
        return True

    def _survives(
        self, items: dict[str, pytest.Item], mutant: Mutant, functions: list[FunctionType],
        code: CodeType,
    ) -> bool:  # fmt: skip
        while True:
            chosen, takes_s = self._tests.of(mutant, self._limit_s)
            queue = [items[test] for test in chosen if test in items]
            status, test = _forked(queue, functions, code, 10.0 + 4.0 * takes_s)
            if not test:
                return status == 0
            alone, own = [items[test]], functions[0].__code__
            if self._tests.killed(test, lambda: _forked(alone, functions, own, 60.0)[0] == 0):  # noqa: B023
                return False


def _forked(
    queue: list[pytest.Item], functions: list[FunctionType], code: CodeType, cpu_s: float
) -> tuple[int, str]:
    """0 and '' where all pass with this code; else a status, and the test that failed first."""
    if not queue:
        return 0, ""
    manager = queue[0].config.pluginmanager
    killer = Killer(Path("killer"))
    manager.register(killer)

    def work() -> int:
        for function in functions:
            function.__code__ = code
        for item, after in zip(queue, [*queue[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        return 0

    status = in_child(work, cpu_s)
    manager.unregister(killer)
    return status, killer.found


def _code(code: CodeType, place: str) -> CodeType | None:
    """The code of a function within that of its module."""
    for each in code.co_consts:
        if isinstance(each, CodeType):
            if each.co_qualname == place:
                return each
            if place.startswith(f"{each.co_qualname}."):
                return _code(each, place)
    return None


def _same(one: CodeType, other: CodeType) -> bool:
    """Whether a mutant lies outside of the code, say in a default value, or does not fit in."""
    if one.co_freevars != other.co_freevars:
        return True
    return one.replace(co_filename=other.co_filename) == other
