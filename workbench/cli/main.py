"""Entry point of `workbench`: finds a command's module and turns failures into one sentence."""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import sys
import textwrap
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NoReturn, final

from workbench import __version__
from workbench.cli.interruption import check, stoppable
from workbench.errors import InputError

COMMANDS: Final = {
    "derive": "compare every bound on the spread of a closed loop and recommend one",
    "check": "verify a certificate with a small independent checker",
    "learn": "learn a bound from sampled trajectories",
    "examine": "hold a learned bound against the proved ones and try to refute it",
    "reach": "compute a tube that contains every trajectory",
    "inner": "prove how tight a tube is, by validated trajectories",
    "gains": "show poles, margins and the tube for a vehicle's gains",
    "track": "follow people through images or a video, on the ground",
    "intent": "say where recorded people go, score it and answer questions",
    "localise": "say where a car was in a recorded drive, with nested sets",
    "commission": "fit steering zero, speed scale and wheelbase to a recorded drive",
    "build": "compile a monitor bundle",
    "build-localiser": "compile the localiser of a site for a vehicle",
    "keygen": "make the keys for signing bundles",
    "sign": "sign a bundle, for vehicles that load no other",
    "bench": "score tightness and time, side by side",
    "drives": "record closed-loop runs of simulated cars",
    "conform": "fit what a vehicle file is unsure of to measured motion",
    "reproduce": "repeat the paper's tables and figures on simulated drives",
    "campaign": "attack tubes with trajectories of random loops",
    "survey": "drive sampled scenarios with every policy and with others",
    "new": "write a runnable example of a model, a vehicle or a study",
    "doctor": "show what this machine has and what is missing",
    "can": "decode a log of CAN frames",
    "replay": "run a monitor bundle over a recording",
    "simulate": "drive a scenario with the monitor, and see what happened",
    "demo": "run the whole chain on a generated crossing and write a report",
}

PACKAGES_OF_EXTRAS: Final = {
    "analysis": (
        "numpy",
        "casadi",
        "control",
        "scipy",
        "cvxpy",
        "clarabel",
        "filterpy",
        "matplotlib",
        "rosbags",
    ),
    "study": ("dask", "optuna", "pyarrow"),
    "perception": ("onnxruntime", "av", "PIL"),
    "commonroad": ("commonroad",),
}

DONE: Final = 0
CLAIM_FAILS: Final = 1
WRONG_USE: Final = 2
DEFECT: Final = 70  # EX_SOFTWARE: an unexpected error must not look like a failed claim
INTERRUPTED: Final = 130
READER_GONE: Final = 141


@final
@dataclass(frozen=True, slots=True)
class Command:
    """A command as its module states it: HELP, EXAMPLE, configure and run."""

    name: str
    help: str
    example: str
    configure: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]

    def parser(self) -> argparse.ArgumentParser:
        """Its argument parser, with `--json` and the example below the options."""
        parser = _Parser(
            prog=f"workbench {self.name}",
            description=self.help,
            epilog="example:\n" + textwrap.indent(textwrap.dedent(self.example).strip(), "  "),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        self.configure(parser)
        parser.add_argument(
            "--json", action="store_true", help="write the result as JSON to standard output"
        )
        return parser


class _Parser(argparse.ArgumentParser):
    """Adds the nearest option to the message about one that does not exist."""

    given: Sequence[str] = ()

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """As the base class does; remembers the words for `error`."""
        self.given = tuple(args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Leave with exit status 2 and one line, with a hint for every misspelt option."""
        known = list(self._option_string_actions)
        for word in self.given:
            option = word.partition("=")[0]
            if option.startswith("--") and option not in ("--", *known):
                near = difflib.get_close_matches(option, known, n=1)
                message += f"; {option}: did you mean {near[0]}?" if near else ""
        message = message.removeprefix("argument ")
        self.exit(WRONG_USE, f"{self.prog}: {message}; `{self.prog} --help` shows the options\n")


def load_command(name: str) -> Command:
    """Import the module of one command. Raises InputError when the installation lacks it."""
    path = f"workbench.cli.{name.replace('-', '_')}"
    try:
        module = importlib.import_module(path)
    except ModuleNotFoundError as error:
        if error.name != path:
            raise
        raise InputError(
            f"expected the module {path}, and this installation lacks it; install the package again"
        ) from error
    return Command(name, module.HELP, module.EXAMPLE, module.configure, module.run)


def usage() -> str:
    """The overview that `workbench --help` prints."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {text}" for name, text in COMMANDS.items()]
    return "\n".join(
        [
            "usage: workbench [--help] [--version] COMMAND ...",
            "",
            "Proves how far the trajectories of an automated vehicle can spread, and compiles the",
            "proof into the monitor that drives on it.",
            "",
            "commands:",
            *lines,
            "",
            "`workbench COMMAND --help` shows a command's options and an example.",
            "exit status: 0 done, 1 the claim fails, 2 wrong use.",
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; `argv` defaults to the process's arguments."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments else ""
    try:
        with stoppable():
            status = _answer(name, arguments[1:])
            check()
            return status
    except KeyboardInterrupt:
        return _fail(name, "interrupted", INTERRUPTED)


def _answer(name: str, rest: list[str]) -> int:
    try:
        status = _dispatch(name, rest)
        sys.stdout.flush()
        return status
    except SystemExit as leaving:  # argparse leaves this way after --help and on wrong options
        return leaving.code if isinstance(leaving.code, int) else DONE
    except BrokenPipeError:
        # The interpreter flushes standard output once more while it shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except Exception as error:
        check()  # what a stop leaves behind it is neither wrong use nor a defect
        return _explain(name, error)


def _explain(name: str, error: Exception) -> int:
    if isinstance(error, InputError):
        return _fail(name, str(error), WRONG_USE)
    if isinstance(error, OSError):
        return _fail(name, _describe(error), WRONG_USE)
    if isinstance(error, MemoryError):
        return _fail(
            name, f"expected a task that fits in memory ({error}); ask for less", WRONG_USE
        )
    if isinstance(error, ImportError):
        missing = (error.name or "").partition(".")[0]
        for extra, packages in PACKAGES_OF_EXTRAS.items():
            if missing in packages:
                return _lacks_extra(name, extra, missing)
    return _defect(name)


def _dispatch(name: str, rest: list[str]) -> int:
    if name in ("-h", "--help", "help"):
        print(usage())
        return DONE
    if name == "--version":
        print(f"workbench {__version__}")
        return DONE
    if name not in COMMANDS:
        raise InputError(_unknown(name))
    command = load_command(name)
    return command.run(command.parser().parse_args(rest))


def _unknown(name: str) -> str:
    known = ", ".join(COMMANDS)
    if not name:
        return f"expected a command, got none; the commands are {known}"
    near = difflib.get_close_matches(name, COMMANDS, n=1)
    hint = f"did you mean {near[0]!r}? The commands are" if near else "the commands are"
    return f"unknown command {name!r}; {hint} {known}"


def _describe(error: OSError) -> str:
    if error.filename is None or error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror}"


def _lacks_extra(name: str, extra: str, missing: str) -> int:
    print(
        f"`workbench {name}` needs the {extra} extra ({missing} is missing): "
        f"pip install 'reach-workbench[{extra}]'",
        file=sys.stderr,
    )
    return WRONG_USE


def _defect(name: str) -> int:
    traceback.print_exc()
    return _fail(
        name, "unexpected error, a defect of workbench; please report the lines above", DEFECT
    )


def _fail(name: str, message: str, status: int) -> int:
    prog = f"workbench {name}" if name in COMMANDS else "workbench"
    print(f"{prog}: {message}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
