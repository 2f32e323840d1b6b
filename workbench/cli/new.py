"""`workbench new`: write a runnable example of a model, a vehicle or a study."""

from __future__ import annotations

import argparse
import enum
import re
from importlib.resources import files
from pathlib import Path

from workbench.cli.common import add_output_option, writable_folder, write_text
from workbench.cli.output import emit
from workbench.errors import InputError

HELP = (
    "Writes an example that runs as it is: a model and its tube, a vehicle file (vehicle: for the "
    "desk; drive: with the maps of its drive-by-wire), what its sensors keep to, or a study."
)
EXAMPLE = """\
workbench new model pendulum --out examples
python examples/pendulum.py

workbench new vehicle my_shuttle --out examples
workbench reach --vehicle examples/my_shuttle.toml
"""


class Kind(enum.Enum):
    """What can be written, with the shipped file it starts from and the name to replace in it."""

    MODEL = ("model", "cli/templates/model.py", "example_model")
    VEHICLE = ("vehicle", "models/data/gem_e2.toml", "")
    DRIVE = ("drive", "models/data/gem_e2_drive.toml", "")
    SENSORS = ("sensors", "models/data/gem_e2_sensors.toml", "")
    STUDY = ("study", "cli/templates/study.py", "example_study")

    def __init__(self, word: str, source: str, placeholder: str) -> None:
        self.word = word
        self.source = source
        self.placeholder = placeholder

    @property
    def suffix(self) -> str:
        """Ending of the file that is written."""
        return Path(self.source).suffix


_USES = {
    Kind.VEHICLE: "workbench reach --vehicle",
    Kind.DRIVE: "workbench build --horizon 2 --vehicle",
    Kind.SENSORS: "workbench build --vehicle DRIVE.toml --path PATH.csv --clearance 0.3 --sensors",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Kind, name, folder, and whether an existing file may be replaced."""
    parser.add_argument("kind", choices=[kind.word for kind in Kind], help="what to write")
    parser.add_argument(
        "name", help="name of the new file: lower-case letters, digits, underscores"
    )
    add_output_option(parser, default=".")
    parser.add_argument("--force", action="store_true", help="replace a file that is already there")


def run(args: argparse.Namespace) -> int:
    """Write the file and say how to run it."""
    kind = next(kind for kind in Kind if kind.word == args.kind)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", args.name):
        raise InputError(
            "expected a name of lower-case letters, digits and underscores that begins with a "
            f"letter, got {args.name!r}; for example my_{kind.word}"
        )
    target = args.out / f"{args.name}{kind.suffix}"
    if target.exists() and not args.force:
        raise InputError(
            f"expected no file {target}, and there is one; choose another name or pass --force"
        )
    text = written(kind, args.name)
    writable_folder(args.out)
    write_text(target, text)
    use = f"{_USES.get(kind, 'python')} {target}"
    emit(args, f"wrote {target}\nrun it: {use}", {"kind": kind, "file": target, "run": use})
    return 0


def written(kind: Kind, name: str) -> str:
    """The shipped example under its new name."""
    text = files("workbench").joinpath(kind.source).read_text(encoding="utf-8")
    if kind in (Kind.VEHICLE, Kind.DRIVE):
        return re.sub(r'(?m)^name\s*=\s*".*?"', f'name = "{name}"', text, count=1)
    return text.replace(kind.placeholder, name) if kind.placeholder else text
