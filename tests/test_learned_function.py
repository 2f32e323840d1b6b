"""A user's function is a black box: its runs are used as they are, and its faults are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.sensitivity.learning.drawing import Drawing, Workforce
from workbench.sensitivity.learning.function_simulator import FunctionSimulator
from workbench.sensitivity.learning.simulated_pairs import SimulatedPairs
from workbench.sets import Box

TIMES = np.array([0.0, 0.5, 1.0])
BOX = Box.around({"a": 1.0, "b": 0.5}, radius={"a": 0.1, "b": 0.2})


def _simulator(folder: Path, text: str, name: str = "run") -> FunctionSimulator:
    file = folder / "box.py"
    file.write_text(text)
    return FunctionSimulator(file, name, BOX.names, TIMES)


def _runs(simulator: FunctionSimulator) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    states = np.array([[1.0, 0.5], [1.1, 0.3]])
    return simulator.runs(states, np.array([3, 3], dtype=np.uint64))


def test_states_instants_and_seed_go_in_and_states_come_out(tmp_path: Path) -> None:
    text = (
        "import beside\ndef run(state, times, seed):\n    return beside.rows(state, times, seed)\n"
    )
    (tmp_path / "beside.py").write_text(
        "import numpy as np\n"
        "def rows(state, times, seed):\n"
        "    assert isinstance(seed, int)\n"
        "    return state + np.outer(times, [seed, -seed])\n"
    )
    found = _runs(_simulator(tmp_path, text))
    assert np.allclose(found[1], [[1.1, 0.3], [2.6, -1.2], [4.1, -2.7]])


def test_a_file_may_use_dataclasses_with_postponed_annotations(tmp_path: Path) -> None:
    text = (
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        "@dataclass\nclass Gain:\n    value: float\n"
        "def run(state, times, seed):\n    return [state * Gain(1.0).value] * 3\n"
    )
    assert np.array_equal(_runs(_simulator(tmp_path, text))[0], [[1.0, 0.5]] * 3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def run(state, times, seed):\n    return state", r"expected shape \(3, 2\).*got \(2,\)"),
        ("def run(state, times, seed):\n    return 'no'", "expected numbers of shape"),
        ("def run(state, times, seed):\n    return None", r"expected shape \(3, 2\).*got \(\)"),
        ("def run(state, times, seed):\n    return [[state[0], float('nan')]] * 3",
         r"expected finite numbers, got nan in b at 0 s from the state a = 1, b = 0\.5"),
        ("def run(state, times, seed):\n    return [[0.0, 0.0]] * 3",
         "expected the first row to be the state it was given, got 0 in a for 1"),
        ("def run(state, times, seed):\n    raise RuntimeError('no road')",
         r"got RuntimeError: no road \(from the state a = 1"),
        ("def run(state, times, seed):\n    state += 1.0\n    return [state] * 3",
         r"not its own, so work on a copy: state = state\.copy\(\)"),
        ("def run(state, times, seed):\n    times[0] = 1.0\n    return [state] * 3", "on a copy"),
        ("def run(state):\n    return [state] * 3", r"write `def run\(state, times, seed\)"),
        ("import random\ndef run(state, times, seed):\n"
         "    return [state, state, state * random.random()]",
         "expected the same answer to the same arguments, got states up to"),
        ("def other(state, times, seed):\n    return 1", "expected a function 'run', found other"),
        ("run = 3", "expected a function 'run', found no function"),
        ("def run(:\n", "expected a Python file that can be executed, got SyntaxError"),
        ("raise SystemError('x')", "can be executed, got SystemError: x"),
    ],
)  # fmt: skip
def test_what_is_no_run_is_refused_by_name(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said) as found:
        _runs(_simulator(tmp_path, text))
    assert "box.py" in str(found.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a Python file"):
        _runs(FunctionSimulator(tmp_path / "none.py", "run", BOX.names, TIMES))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def run(state, times, seed):\n    raise RuntimeError('no road')", "no road"),
        ("import os\ndef run(state, times, seed):\n    os._exit(3)", "what it ran ended it"),
        ("import sys\ndef run(state, times, seed):\n    sys.exit(3)", "got SystemExit: 3"),
    ],
)
def test_a_function_that_ends_its_process_does_not_end_the_command(
    text: str, said: str, tmp_path: Path
) -> None:
    pairs = SimulatedPairs(_simulator(tmp_path, text), BOX, 1)
    with (
        Drawing(pairs, 8, Workforce(1, 4, isolated=True)) as drawing,
        pytest.raises(InputError, match=said),
    ):
        drawing.block(0, 8)


def test_what_it_prints_does_not_reach_standard_output(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = "def run(state, times, seed):\n    print('hello', flush=True)\n    return [state] * 3"
    pairs = SimulatedPairs(_simulator(tmp_path, text), BOX, 1)
    with Drawing(pairs, 2, Workforce(1, 4, isolated=True)) as drawing:
        drawing.block(0, 2)
    shown = capfd.readouterr()
    assert shown.out == ""
    assert "hello" in shown.err
