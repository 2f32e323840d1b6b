"""`workbench gains --full` says what the study found, as text, JSON, CSV and page, or why not."""

from __future__ import annotations

import csv
import dataclasses
import re
import shutil
import subprocess
from collections.abc import Callable
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from cli_fixture import invoke
from matplotlib.figure import Figure

from workbench.models.control_view import quick_study
from workbench.models.gains import Effort, GainStudy, study_gains
from workbench.models.gains.jitter import Answer
from workbench.models.gains.routh import Reason
from workbench.models.vehicle import gem_e2, load_vehicle
from workbench.report.gains import GainReport, gains_page

SIMULATED = Path(str(files("workbench.simulation") / "data" / "gem_e2_simulated.toml"))
SMALL = Effort(points=9, speeds=5, patterns=10)
QUICK_STUDY = dataclasses.replace(quick_study(gem_e2()), warnings=("<b>mind",))
QUICK = ("gains", "--no-tube", "--points", "7")


@pytest.fixture(scope="module")
def study() -> GainStudy:
    return study_gains(gem_e2(), effort=SMALL)


class Reader(HTMLParser):
    """What a page holds: tags, addresses, and numbers of pictures and tables."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.labels: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        found = dict(attrs)
        self.addresses += [str(found[k]) for k in ("src", "href", "xlink:href") if found.get(k)]
        if tag == "svg" and found.get("role") == "img":
            self.labels.append(str(found.get("aria-label")))


def test_the_study_of_the_shipped_vehicle(study: GainStudy) -> None:
    assert study.reason is Reason.STABLE
    assert study.always_stable
    assert study.disagreements == 0
    assert study.without_ahead.reasons() == (Reason.NO_DAMPING,)
    assert study.checked
    assert all(each.agree for each in study.checked)
    assert {each.reason is Reason.STABLE for each in study.checked} == {True, False}
    assert study.timing_stable
    assert study.judged.answer is Answer.PROVED


def test_every_part_has_rows_and_a_plot(study: GainStudy) -> None:
    parts = (
        study.over_speed, study.responses, *study.maps, study.without_ahead, *study.sampled,
        study.jitter,
    )  # fmt: skip
    for part in parts:
        rows = part.rows()
        assert rows
        assert len({tuple(row) for row in rows}) == 1
        picture = part.plot()
        assert isinstance(picture, Figure)
        assert all(axes.get_xlabel().endswith(")") for axes in picture.axes)
        assert all(axes.get_ylabel().endswith(")") for axes in picture.axes)


def test_the_page_needs_nothing_else_and_shows_everything(study: GainStudy) -> None:
    text = gains_page(GainReport(study, QUICK_STUDY), version="0", command="c").html()
    reader = Reader()
    reader.feed(text)
    assert all(each.startswith(("#", "data:")) for each in reader.addresses)
    assert "&lt;b&gt;mind" in text
    for word in ("Nyquist", "Bode", "phase margin", "Root locus", "Spectral radius", "jitter"):
        assert any(word.lower() in label.lower() for label in reader.labels), word
    assert sum("Stability over" in label for label in reader.labels) == len(study.maps) + 1
    assert reader.tags.count("table") >= 12
    assert "mathdefault" not in text


def test_the_page_in_a_browser(
    study: GainStudy, require_tool: Callable[..., str], tmp_path: Path
) -> None:
    browser = require_tool("chromium", "chromium-browser", "google-chrome")
    probe = (
        '<script>const o = document.createElement("output"); o.id = "probe";'
        "o.textContent = [document.documentElement.scrollWidth > innerWidth,"
        'document.querySelectorAll("button.csv").length,'
        '[...document.querySelectorAll(".panel svg")].filter('
        "(s) => s.getBoundingClientRect().width > 100).length].join();"
        "document.body.append(o);</script></body>"
    )
    text = gains_page(GainReport(study, QUICK_STUDY), version="0", command="c").html()
    page = tmp_path / "gains.html"
    page.write_text(text.replace("</body>", probe), encoding="utf-8")
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
            "--no-first-run", "--disable-background-networking", "--disable-component-update",
            "--disable-sync", "--enable-logging=stderr", "--virtual-time-budget=3000",
            "--window-size=390,844", "--dump-dom", f"--user-data-dir={tmp_path / 'profile'}",
            page.as_uri(),
        ],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert not [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    found = re.search(r'<output id="probe">([^<]*)</output>', done.stdout)
    assert found, done.stderr[-1000:]
    wide, buttons, panels = found.group(1).split(",")
    assert wide == "false"
    assert int(buttons) == text.count("<caption>")
    assert int(panels) == text.count('class="panel"')


def test_full_study_as_text_and_files(tmp_path: Path) -> None:
    page, folder = tmp_path / "g" / "gains.html", tmp_path / "csv"
    ranges = ("--range", "kp", "0", "2", "--range", "speed", "0.5", "6")
    found = invoke(*QUICK, *ranges, "--plot", page, "--csv", folder)
    assert found.status == 0
    assert "asymptotically stable" in found.out
    assert "stable, proved" in found.out
    assert "half widths" not in found.out
    text = page.read_text(encoding="utf-8")
    assert "--plot" in text
    assert "--range kp 0 2 --range speed 0.5 6</pre>" in text
    names = {each.name for each in folder.iterdir()}
    assert {"over_speed.csv", "map_speed_kp.csv", "jitter.csv", "checked.csv"} <= names
    with (folder / "over_speed.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["schedule"] for row in rows} == {
        "fixed gains", "same response over distance", "same response over time"
    }  # fmt: skip
    assert all(float(row["speed_mps"]) > 0.0 for row in rows)


def test_full_study_as_json_with_other_gains() -> None:
    found = invoke(*QUICK, "--full", "--json", "--look-ahead", "0", "--speeds", "1", "3")
    assert found.status == 0
    assert found.data["stable"] is False
    data = found.data["study"]
    assert data["reason"].startswith("no damping")
    assert data["stable_speeds_mps"] == []
    assert data["stable_at_every_speed_proved"] is False
    assert {row["answer"] for row in data["jitter"]} == {Answer.REFUTED.value}
    assert "look_ahead_m is 0" in found.err
    assert [each["disagreeing"] for each in data["maps"]] == [0] * 7


def test_the_simulated_vehicle_is_stable_without_an_integral() -> None:
    found = invoke(*QUICK, "--full", "--json", "--vehicle", SIMULATED)
    assert found.status == 0
    assert "warning" not in found.err
    assert found.data["stable"] is True
    assert len(found.data["poles"]) == 5
    assert found.data["study"]["stable_at_every_speed_proved"] is True
    assert found.data["study"]["loop"]["look_ahead_m"] == 6.0


def test_changed_gains_reach_poles_and_tube() -> None:
    found = invoke("gains", "--kp", "0.3", "--speed", "2", "--horizon", "0.1", "--json")
    assert found.data["speed_mps"] == 2.0
    assert "tube" in found.data
    other = invoke("gains", "--horizon", "0.1", "--json")
    assert found.data["poles"] != other.data["poles"]
    assert found.data["tube"] != other.data["tube"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--speeds", "1", "2"), "--speeds: expected --full, --plot or --csv beside it"),
        (("--jitter", "0.01"), "--jitter: expected --full"),
        (("--full", "--speeds", "2", "1"), "--speeds: expected LOW < HIGH"),
        (("--speed", "-1"), "--speed: expected a speed > 0"),
        (("--look-ahead", "-1"), "--look-ahead: expected a distance >= 0"),
        (("--full", "--range", "gain", "0", "1"), "--range: expected AXIS, one of speed"),
        (("--full", "--range", "kp", "1", "0"), "--range kp: expected LOW < HIGH"),
        (("--full", "--range", "kp", "a", "0"), "--range kp: expected a finite number, got 'a'"),
        (("--full", "--range", "look-ahead", "-1", "2"), "expected distances >= 0"),
        (("--full", "--points", "1"), "--points: expected 2 to 401"),
        (("--full", "--jitter", "0.02"), "--jitter: expected 0 or more and less than half"),
        (("--full", "--actuation-delay", "0.2", "0.1"), "--actuation-delay: expected 0 <= LOW"),
        (("--full", "--actuation-delay", "0", "0.1"), "two commands could come out of order"),
        (("--full", "--actuation-delay", "0.6", "0.6"), "at most 12 periods"),
        (("--kp", "nan"), "expected a finite number"),
    ],
)
def test_what_cannot_be_is_refused_in_words(words: tuple[str, ...], said: str) -> None:
    found = invoke("gains", "--no-tube", *words)
    assert found.status == 2
    assert said in found.err
    assert found.out == ""


def test_a_page_that_cannot_be_written_is_refused_before_any_work(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    found = invoke("gains", "--no-tube", "--plot", folder)
    assert found.status == 2
    assert "it is a folder" in found.err
    shutil.rmtree(folder)


def test_efforts_and_vehicles_that_cannot_be_are_refused() -> None:
    from workbench.errors import InputError

    with pytest.raises(InputError, match=r"Effort\.points"):
        Effort(points=1)
    with pytest.raises(InputError, match="expected ranges of speed"):
        study_gains(gem_e2(), ranges={"x": (0.0, 1.0)}, effort=SMALL)
    with pytest.raises(InputError, match="speed > 0"):
        study_gains(load_vehicle(SIMULATED), gains={"speed": 0.0}, effort=SMALL)
    with pytest.raises(InputError, match="distance >= 0"):
        study_gains(gem_e2(), gains={"look-ahead": -1.0}, effort=SMALL)
