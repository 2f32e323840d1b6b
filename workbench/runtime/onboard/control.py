"""How an operator arms the monitor: a socket in a private folder, and a code that must be repeated.

The bus cannot reach it, it needs no terminal, and nothing is armed by one keystroke, an old line of
a shell's history, or a signal to the wrong process: `arm` and `rearm` need the code that `status`
has just printed, and the code changes with the state.
"""

from __future__ import annotations

import argparse
import enum
import json
import os
import secrets
import socket
import stat
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, final

from workbench.errors import InputError

SOCKET: Final = "monitor.socket"
_LONGEST: Final = 4096
_PER_TURN: Final = 4
_ANSWER_S: Final = 1.0
_LONGEST_NAME: Final = 107
"""Bytes of a socket's name (`sun_path` of Linux, less its end)."""
_OPERATOR: Final = "operator-"
_RANDOM: Final = "12345678"
"""As many letters as `tempfile` makes up."""
_ANSWER: Final = "answer"


@final
class Word(enum.Enum):
    """What an operator can say. ARM and REARM need the code of the last `status`."""

    STATUS = "status"
    ARM = "arm"
    DISARM = "disarm"
    REARM = "rearm"


CODED: Final = frozenset({Word.ARM, Word.REARM})


@final
class ControlSocket:
    """Listens for one operator at a time; `heard` is called once per turn and never waits.

    folder: owned by this process' user and closed to everybody else (0700), because who can write
    into it can arm the vehicle. Raises InputError where it is not, where its name is too long for a
    socket, or where a monitor that is alive listens already.
    """

    __slots__ = ("_code", "_path", "_socket", "_state")

    def __init__(self, folder: Path) -> None:
        _check_private(folder)
        self._path = folder / SOCKET
        if _answers(self._path):
            raise InputError(
                f"{self._path}: expected no monitor here, another one listens; stop it first"
            )
        self._path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(str(self._path))
        self._code = _new_code()
        self._state = ""

    def heard(self, situation: Mapping[str, object]) -> tuple[Word, ...]:
        """What was asked since the last call; situation: what `status` answers, `state` in it."""
        if situation["state"] != self._state:
            self._state, self._code = str(situation["state"]), _new_code()
        words = []
        for _ in range(_PER_TURN):
            try:
                text, sender = self._socket.recvfrom(_LONGEST)
            except OSError:
                break
            word, answer = self._understood(text, situation)
            if word is not None:
                words.append(word)
            self._answer(sender, answer)
        return tuple(words)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def _understood(
        self, text: bytes, situation: Mapping[str, object]
    ) -> tuple[Word | None, Mapping[str, object]]:
        said = text.decode("ascii", "replace").split()
        known = {word.value: word for word in Word}
        word = known.get(said[0]) if said else None
        if word is None or len(said) > 2 or (len(said) == 2 and word not in CODED):
            return None, {"refused": f"expected one of {sorted(known)}, got {said[:3]}"}
        if word is Word.STATUS:
            return None, {**situation, "code": self._code}
        if word in CODED and said[1:] != [self._code]:
            return None, {"refused": "the code is not that of the last status; ask for it again"}
        # A code serves once: what was repeated by mistake is refused.
        self._code = _new_code()
        return word, {"asked": word.value}

    def _answer(self, sender: str | None, answer: Mapping[str, object]) -> None:
        if sender:
            try:
                self._socket.sendto(json.dumps(answer).encode(), sender)
            except OSError:
                # The operator does not wait for the answer any more; the vehicle does not either.
                return


def _new_code() -> str:
    return f"{secrets.randbelow(10**6):06d}"


def _check_private(folder: Path) -> None:
    longest = folder / f"{_OPERATOR}{_RANDOM}" / _ANSWER
    if len(os.fsencode(longest)) > _LONGEST_NAME:
        most = _LONGEST_NAME - len(os.fsencode(longest)) + len(os.fsencode(folder))
        raise InputError(
            f"{folder}: expected a folder for the control socket whose name has at most {most} "
            "bytes, since the system takes no longer names of sockets; choose a shorter one, such "
            "as /run/workbench"
        )
    try:
        found = os.lstat(folder)
    except OSError as error:
        raise InputError(
            f"{folder}: expected a private folder for the control socket ({error.strerror}); "
            "make one with `install -d -m 700`"
        ) from None
    closed = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    if not closed or found.st_uid != os.getuid():
        raise InputError(
            f"{folder}: expected a folder of this user with mode 0700, got owner {found.st_uid} "
            f"and mode {stat.filemode(found.st_mode)}; who can write there can arm the vehicle"
        )


def _answers(path: Path) -> bool:
    """Whether somebody listens at a socket; a dead monitor leaves its file behind."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def ask(folder: Path, text: str, *, wait_s: float = _ANSWER_S) -> Mapping[str, object]:
    """One word to a monitor and its answer. Raises InputError when none comes."""
    with (
        tempfile.TemporaryDirectory(dir=folder, prefix=_OPERATOR) as own,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asking,
    ):
        asking.bind(str(Path(own) / _ANSWER))
        asking.settimeout(wait_s)
        try:
            asking.sendto(text.encode("ascii", "replace"), str(folder / SOCKET))
            answer = json.loads(asking.recv(_LONGEST))
        except OSError as error:
            raise InputError(f"{folder}: expected a monitor that answers ({error})") from None
    return dict(answer)


def main(
    arguments: Sequence[str] | None = None, *, said: Callable[[str], object] = sys.stdout.write
) -> int:
    """`workbench-arm FOLDER status | arm CODE | disarm | rearm CODE`: 0 asked, 1 refused, 2 misuse.

    What was asked takes effect with the monitor's next turn, or not: `status` tells.
    """
    parser = argparse.ArgumentParser(prog="workbench-arm", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="the monitor's --control folder")
    parser.add_argument("word", choices=[word.value for word in Word])
    parser.add_argument("code", nargs="?", default="", help="what the last `status` printed")
    args = parser.parse_args(arguments)
    if not args.folder.is_dir():
        parser.error(
            f"expected the --control folder of a running monitor, got {args.folder}, which is no "
            "folder; name the one that `workbench-monitor` was started with"
        )
    try:
        answer = ask(args.folder, f"{args.word} {args.code}".strip())
    except (InputError, OSError) as error:
        sys.stderr.write(f"workbench-arm: {error}\n")
        return 1
    said("".join(f"{key}: {value}\n" for key, value in answer.items()))
    return 1 if "refused" in answer else 0
