"""`workbench gains robust` tells proved from found in text, JSON, CSV and page, or says why not."""

from __future__ import annotations

import csv
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from cli_fixture import invoke
from matplotlib.figure import Figure

from workbench.models.gains.lateral import LateralLoop
from workbench.models.gains.ranged_loop import Ranges
from workbench.models.vehicle import gem_e2
from workbench.reach.robustness.verdict import Effort, over_size

ROBUST = ("gains", "robust", "--no-tube")
SCALE = ("--speed-scale", "0.98", "1.02")


class Labels(HTMLParser):
    """Labels of pictures and outer addresses of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.labels: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag == "svg" and found.get("role") == "img":
            self.labels.append(str(found.get("aria-label")))
        self.addresses += [str(found[k]) for k in ("src", "href", "xlink:href") if found.get(k)]


def test_proved_ranges_end_with_status_0() -> None:
    found = invoke(*ROBUST, *SCALE, "--wheelbase", "1.74", "1.76", "--delay", "0", "0.02")
    assert found.status == 0
    assert "Every car of the ranges is stable, proved" in found.out
    assert "proved for every car" in found.out
    assert "found by search" in found.out
    assert "half widths" not in found.out


def test_refuted_ranges_end_with_status_1_and_name_a_car() -> None:
    found = invoke(*ROBUST, "--delay", "0", "0.4", "--json")
    assert found.status == 1
    assert found.data["answer"] == "REFUTED"
    assert found.data["witness"]["delay_s"] > 0.29
    assert all(row["proved"] is None for row in found.data["margins"])


def test_an_open_answer_ends_with_status_1() -> None:
    words = ("--wheelbase", "1.4", "2.1", "--speed-scale", "0.8", "1.2", "--delay", "0", "0.19")
    found = invoke(*ROBUST, *words, "--boxes", "1", "--json")
    assert found.status == 1
    assert found.data["answer"] == "OPEN"
    assert found.data["witness"] is None


def test_gains_before_and_behind_the_word_count() -> None:
    before = invoke("gains", "--kp", "0.3", "--no-tube", "robust", *SCALE, "--json")
    behind = invoke(*ROBUST, "--kp", "0.3", *SCALE, "--json")
    other = invoke(*ROBUST, *SCALE, "--json")
    assert before.data["margins"] == behind.data["margins"] != other.data["margins"]


def test_tube_page_and_tables(tmp_path: Path) -> None:
    page, folder = tmp_path / "r.html", tmp_path / "csv"
    found = invoke(
        "gains", "robust", *SCALE, "--horizon", "0.2", "--step", "0.1", "--plot", page, "--csv",
        folder, "--json",
    )  # fmt: skip
    assert found.status == 0
    assert found.data["tube"]["rigor"] == "ENCLOSED"
    for row in found.data["tube"]["widths"]:
        assert row["found_by_search_half_width"] <= row["proved_half_width"] + 1e-9
    reader, text = Labels(), page.read_text(encoding="utf-8")
    reader.feed(text)
    assert all(each.startswith(("#", "data:")) for each in reader.addresses)
    assert sum("over size" in label for label in reader.labels) == 5
    assert any("Reach tube of offset" in label for label in reader.labels)
    assert "workbench gains robust" in text
    assert "--speed-scale 0.98 1.02" in text
    assert {each.name for each in folder.iterdir()} == {"margins.csv", "sizes.csv", "widths.csv"}
    with (folder / "sizes.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["answer"] for row in rows} == {"PROVED"}
    assert {row["size"] for row in rows} >= {"0.0", "1.0", "3.0"}


def test_sizes_have_rows_and_a_plot() -> None:
    loop, ranges = LateralLoop.of(gem_e2()), Ranges((1.75, 1.75), (0.99, 1.01), (0.0, 0.3))
    found = over_size(loop, ranges, effort=Effort(1000, 1), sizes=(0.0, 1.0))
    assert [row["answer"] for row in found.rows()[::5]] == ["PROVED", "REFUTED"]
    picture = found.plot()
    assert isinstance(picture, Figure)
    assert all(axes.get_ylabel().endswith(")") for axes in picture.axes)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "expected at least one range"),
        (("--delay", "0.1", "0"), "--delay: expected LOW <= HIGH"),
        (("--delay", "-0.1", "0"), "--delay: expected LOW <= HIGH, both 0 or more"),
        (("--wheelbase", "0", "2"), "--wheelbase: expected LOW <= HIGH, both above 0"),
        (("--speed-scale", "1.1", "0.9"), "--speed-scale: expected LOW <= HIGH"),
        ((*SCALE, "--speed", "-1"), "--speed: expected a speed > 0"),
        ((*SCALE, "--step", "0"), "--step: expected a time > 0"),
    ],
)
def test_what_cannot_be_is_refused_in_words(words: tuple[str, ...], said: str) -> None:
    found = invoke(*ROBUST, *words)
    assert found.status == 2
    assert said in found.err
    assert found.out == ""


def test_options_of_the_full_study_are_refused() -> None:
    found = invoke("gains", "--full", "robust", *SCALE)
    assert found.status == 2
    assert "--full: expected no option of the full study" in found.err
