"""`workbench doctor`: what this machine offers, what is missing, and how to mend it."""

from __future__ import annotations

import argparse
import enum
import importlib.metadata
import platform
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench import __version__
from workbench.cli.output import emit
from workbench.runtime.floats import float_mode_fault

HELP = (
    "Lists Python, packages, compilers, optional tools, the machine and its floating-point mode. "
    "Exit status 1 when something is missing that the installed extras need; the base install, "
    "which runs a finished bundle, is complete without the analysis extra and without a compiler."
)
EXAMPLE = """\
workbench doctor
workbench doctor --json
"""

# Distribution names, as importlib.metadata knows them, by the extra that brings them.
PACKAGES: Final = {
    "base": ("python-can", "pynacl"),
    "analysis": (
        "numpy",
        "casadi",
        "control",
        "scipy",
        "cvxpy",
        "clarabel",
        "filterpy",
        "matplotlib",
    ),
    "study": ("dask", "optuna", "pyarrow"),
    "perception": ("onnxruntime", "av"),
    "commonroad": ("commonroad-io",),
    "dev": ("pytest", "hypothesis", "ruff", "mypy", "import-linter", "python-flint", "cantools"),
}
# numpy, scipy and matplotlib come with many other things and tell nothing.
_TELLS_ANALYSIS: Final = ("casadi", "control", "cvxpy", "clarabel", "filterpy")
_NO_ANALYSIS: Final = (
    "analysis extra not installed (needed for derive, build, replay, demo): "
    "pip install 'reach-workbench[analysis]'"
)
COMPILERS: Final = ("cc", "gcc", "clang")
OPTIONAL_TOOLS: Final = {
    "make": ("make",),
    "valgrind": ("valgrind",),
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
}


class State(enum.Enum):
    """How a finding bears on what the installed extras are for."""

    PRESENT = "ok"
    ABSENT = "-"
    MISSING = "MISSING"


@final
@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked for: what was found, and the mend when it is absent ('' when present)."""

    group: str
    name: str
    state: State
    found: str
    mend: str = ""


def configure(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def run(args: argparse.Namespace) -> int:
    """Print the findings; 0 when all that the installed extras need is here, 1 when not."""
    analysis = any(map(_version, _TELLS_ANALYSIS))
    findings = [
        *_interpreter(), *_packages(analysis=analysis), *_compilers(needed=analysis), *_tools(),
        *_floating_point(),
    ]  # fmt: skip
    missing = [finding for finding in findings if finding.state is State.MISSING]
    data = {
        "workbench": __version__,
        "machine": platform.machine(),
        "system": platform.platform(),
        "ready": not missing,
        "analysis_installed": analysis,
        "findings": findings,
    }
    emit(args, _text(findings, missing, analysis=analysis), data)
    return 1 if missing else 0


def _text(findings: list[Finding], missing: list[Finding], *, analysis: bool) -> str:
    lines = [f"workbench {__version__} on {platform.machine()}, {platform.platform()}"]
    group = ""
    for finding in findings:
        if finding.group != group:
            group = finding.group
            lines += ["", group]
        tail = f"{finding.found}  ({finding.mend})" if finding.mend else finding.found
        lines.append(f"  {finding.state.value:<7}  {finding.name:<14}  {tail}")
    lines.append("")
    if missing:
        lines.append("missing: " + ", ".join(finding.name for finding in missing))
    elif analysis:
        lines.append("ready: everything that deriving, building and replaying need is here")
    else:
        lines.append("ready: everything that the base install, running a bundle, needs is here")
    if not analysis:
        lines.append(_NO_ANALYSIS)
    return "\n".join(lines)


def _judged(present: bool, *, needed: bool) -> State:
    if present:
        return State.PRESENT
    return State.MISSING if needed else State.ABSENT


def _interpreter() -> list[Finding]:
    enough = sys.version_info >= (3, 11)
    mend = "" if enough else "install Python 3.11 or later"
    state = _judged(enough, needed=True)
    return [Finding("Python", "python", state, platform.python_version(), mend)]


def _version(package: str) -> str:
    """Its version; '' when it is absent."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _packages(*, analysis: bool) -> list[Finding]:
    needed = ("base", "analysis") if analysis else ("base",)
    findings = []
    for extra, names in PACKAGES.items():
        target = "reach-workbench" if extra == "base" else f"reach-workbench[{extra}]"
        for name in names:
            version = _version(name)
            mend = "" if version else f"pip install '{target}'"
            state = _judged(bool(version), needed=extra in needed)
            findings.append(Finding(f"packages, {extra}", name, state, version or "absent", mend))
    return findings


def _compilers(*, needed: bool) -> list[Finding]:
    working = {name: version for name in COMPILERS if (version := _compiler_version(name))}
    findings = []
    for name in COMPILERS:
        mend = (
            "" if name in working else "optional" if working else "sudo apt install gcc libc6-dev"
        )
        state = _judged(name in working, needed=needed and not working)
        found = working.get(name, "absent, or cannot build a shared object")
        findings.append(Finding("C compilers", name, state, found, mend))
    return findings


def _compiler_version(name: str) -> str:
    """First line of the compiler's version; '' when it cannot build a shared object."""
    if shutil.which(name) is None:
        return ""
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch, "probe.c")
        source.write_text("#include <math.h>\ndouble f(double x) { return floor(x); }\n")
        build = [name, "-shared", "-fPIC", "-o", str(source.with_suffix(".so")), str(source)]
        if subprocess.run(build, capture_output=True, check=False).returncode != 0:
            return ""
    return _first_line([name, "--version"])


def _first_line(command: list[str]) -> str:
    try:
        ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return "gives no version"
    return (ran.stdout.strip() or ran.stderr.strip() or "gives no version").splitlines()[0]


def _tools() -> list[Finding]:
    findings = []
    for name, programs in OPTIONAL_TOOLS.items():
        program = next((path for each in programs if (path := shutil.which(each))), None)
        found = "absent" if program is None else _first_line([program, "--version"])
        mend = f"optional: sudo apt install {name}" if program is None else ""
        state = _judged(program is not None, needed=False)
        findings.append(Finding("optional tools", name, state, found, mend))
    return findings


def _floating_point() -> list[Finding]:
    fault = float_mode_fault()
    state = _judged(fault is None, needed=True)
    mend = "some library of this process has changed the mode; find it" if fault else ""
    found = fault or "to nearest, ties to even; subnormals kept"
    return [Finding("floating point", "rounding", state, found, mend)]
