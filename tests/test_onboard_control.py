"""Nothing but the code that was just read arms the monitor, and nobody but its user can say it."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.runtime.onboard.control import SOCKET, ControlSocket, Word, ask, main


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "control"
    made.mkdir(mode=0o700)
    return made


@pytest.fixture
def control(folder: Path) -> Iterator[ControlSocket]:
    made = ControlSocket(folder)
    yield made
    made.close()


def said(control: ControlSocket, folder: Path, text: str, state: str = "DISARMED") -> tuple[
    tuple[Word, ...], dict[str, object]
]:  # fmt: skip
    """What the monitor hears and what the operator reads."""
    answers: list[dict[str, object]] = []
    asking = threading.Thread(target=lambda: answers.append(dict(ask(folder, text))))
    asking.start()
    words: tuple[Word, ...] = ()
    while asking.is_alive():
        words += control.heard({"state": state, "faults": []})
        asking.join(0.001)
    return words, answers[0]


def test_only_the_code_of_the_last_status_arms(control: ControlSocket, folder: Path) -> None:
    words, answer = said(control, folder, "status")
    assert (words, answer["state"]) == ((), "DISARMED")
    code = answer["code"]
    other = f"{(int(str(code)) + 1) % 10**6:06d}"
    for text in ("arm", f"arm {other}", f"arm {code} {code}", f"disarm {code}", "arm now"):
        words, answer = said(control, folder, text)
        assert words == (), text
        assert "refused" in answer
    assert said(control, folder, f"arm {code}")[0] == (Word.ARM,)
    assert said(control, folder, f"arm {code}")[0] == (), "a code serves once"


def test_a_code_does_not_outlive_its_state(control: ControlSocket, folder: Path) -> None:
    _, answer = said(control, folder, "status", "YIELDED")
    assert said(control, folder, f"rearm {answer['code']}", "DISARMED")[0] == ()


def test_disarming_needs_no_code(control: ControlSocket, folder: Path) -> None:
    assert said(control, folder, "disarm")[0] == (Word.DISARM,)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=100))
def test_other_bytes_do_nothing(control: ControlSocket, folder: Path, text: bytes) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asking:
        asking.sendto(text, str(folder / SOCKET))
    words = control.heard({"state": "DISARMED"})
    assert set(words) <= {Word.DISARM}
    assert not words or text.split() == [b"disarm"]


def test_a_flood_of_words_does_not_hold_up_a_turn(control: ControlSocket, folder: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as asking:
        asking.setblocking(False)
        sent = 0
        try:
            for _ in range(1000):
                asking.sendto(b"disarm", str(folder / SOCKET))
                sent += 1
        except OSError:
            pass
    assert sent > 4
    assert len(control.heard({"state": "ARMED"})) == 4


@pytest.mark.parametrize("mode", [0o777, 0o750, 0o701])
def test_a_folder_that_others_can_open_is_refused(folder: Path, mode: int) -> None:
    os.chmod(folder, mode)
    with pytest.raises(InputError, match="0700"):
        ControlSocket(folder)


def test_a_missing_folder_a_link_and_a_second_monitor_are_refused(
    control: ControlSocket, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="install -d"):
        ControlSocket(tmp_path / "none")
    (tmp_path / "link").symlink_to(folder)
    with pytest.raises(InputError, match="0700"):
        ControlSocket(tmp_path / "link")
    with pytest.raises(InputError, match="another one listens"):
        ControlSocket(folder)


def test_a_folder_with_a_name_too_long_for_sockets_is_refused_and_the_longest_is_not(
    tmp_path: Path,
) -> None:
    room = 107 - len("/operator-12345678/answer")
    for spare in (0, -1):
        with tempfile.TemporaryDirectory(prefix="") as short:
            letters = "c" * (room - spare - len(short) - 1)
            long = Path(short) / letters
            long.mkdir(mode=0o700)
            if spare < 0:
                with pytest.raises(InputError, match=f"at most {room} bytes"):
                    ControlSocket(long)
                continue
            found = ControlSocket(long)
            with pytest.raises(InputError, match="that answers"):
                ask(long, "status", wait_s=0.01)
            found.close()


def test_what_a_dead_monitor_left_does_no_harm(folder: Path) -> None:
    left = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    left.bind(str(folder / SOCKET))
    left.close()
    ControlSocket(folder).close()
    assert not (folder / SOCKET).exists()


def test_the_command_prints_the_answer(
    control: ControlSocket, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done: list[int] = []
    text: list[str] = []
    for words, status in ((["status"], 0), (["arm", "000000x"], 1), (["disarm"], 0)):
        asking = threading.Thread(
            target=lambda words=words: done.append(main([str(folder), *words], said=text.append))  # type: ignore[misc]
        )
        asking.start()
        while asking.is_alive():
            control.heard({"state": "DISARMED"})
            asking.join(0.001)
        assert done[-1] == status
    assert "code: " in text[0]
    assert "refused: " in text[1]
    control.close()
    assert main([str(folder), "status"], said=text.append) == 1
    assert "expected a monitor that answers" in capsys.readouterr().err


def test_a_folder_that_is_none_is_misuse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / "none"), "status"])
    assert ended.value.code == 2
    assert "--control folder" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
