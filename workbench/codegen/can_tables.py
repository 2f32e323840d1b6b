"""Turns the DBC files beside `workbench.runtime.protocols` into the tables that drive.

`python -m workbench.codegen.can_tables` writes them; a test fails while they are not up to date.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import workbench.runtime.protocols
from workbench.codegen.dbc_reader import read_dbc
from workbench.runtime.protocols.tables import PROTOCOLS, RANGES, Protocol, table_of

FOLDER = Path(workbench.runtime.protocols.__file__).parent


def table_text(protocol: Protocol) -> str:
    """A table as JSON, one line per signal, so that a change of a signal is a change of a line."""
    table = table_of(protocol)
    head = ",\n".join(f"{json.dumps(k)}: {json.dumps(table[k])}" for k in list(table)[:-1])
    messages = ",\n".join(_message_text(row) for row in table["messages"])
    return f'{{\n{head},\n"messages": [\n{messages}\n]\n}}\n'


def _message_text(row: list[object]) -> str:
    *head, signals = row
    assert isinstance(signals, list)
    lines = ",\n".join(f"  {json.dumps(signal)}" for signal in signals)
    return f" [{json.dumps(head)[1:-1]}, [\n{lines}\n ]]"


def made_table(name: str, folder: Path = FOLDER) -> str:
    """The table that a protocol's DBC file demands. Raises InputError as `read_dbc` does."""
    return table_text(read_dbc((folder / f"{name}.dbc").read_text(encoding="utf-8"), name=name))


def write_tables(folder: Path = FOLDER, names: Iterable[str] = PROTOCOLS) -> None:
    """Write the table of every protocol beside its DBC file."""
    for name in names:
        (folder / f"{name}.json").write_text(made_table(name, folder), encoding="utf-8")


if __name__ == "__main__":
    write_tables(names=(*PROTOCOLS, RANGES))
