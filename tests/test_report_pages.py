"""Report pages are one well-formed file that fetches nothing and escapes every foreign string."""

from __future__ import annotations

import dataclasses
import functools
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

import report_cases as cases

from workbench.claims import Assumption, Rigor, Verdict
from workbench.errors import InputError
from workbench.report.demo import demo_page
from workbench.report.page import (
    Assumptions,
    Claim,
    Claims,
    Notice,
    Page,
    Paragraph,
    Section,
    write_page,
)
from workbench.report.plane import plane_figure
from workbench.report.replay import replay_page
from workbench.report.scene import Scene
from workbench.report.tables import Table
from workbench.report.timeline import summary_table, verdict_timeline
from workbench.simulation.frames import LevelVerdicts, PolicyAnswer

VOID = {"meta", "link", "input", "br", "img"}


class Strict(HTMLParser):
    """Collects tags and attributes and insists that every element is closed in turn."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.ids: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(key, value or "") for key, value in attrs]
        self.ids += [value or "" for key, value in attrs if key == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1:] == [tag], f"</{tag}> inside {self.open}"
        self.open.pop()


@functools.cache
def demo_text() -> str:
    return demo_page(cases.demo_report(), version="0.0", command="workbench demo").html()


def replay_text(**changes: object) -> str:
    report = cases.replay_report(**changes)  # type: ignore[arg-type]
    return replay_page(report, version="0.0", command="workbench replay").html()


@pytest.mark.parametrize("make", [demo_text, replay_text])
def test_page_is_well_formed_and_fetches_nothing(make: object) -> None:
    text = make()  # type: ignore[operator]
    page = Strict(text)
    assert len(page.ids) == len(set(page.ids))
    for key, value in page.attributes:
        if key in {"src", "href", "xlink:href", "action", "data", "srcset"}:
            assert value.startswith(("#", "data:")), (key, value)
    without_namespaces = re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert not re.search(r"https?:|@import|//\w+\.\w", without_namespaces)
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    assert 'name="viewport"' in text
    assert "prefers-color-scheme" in text


def test_every_reference_inside_a_page_has_its_target() -> None:
    text = demo_text()
    targets = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    assert targets
    assert targets <= set(Strict(text).ids)


def test_same_report_gives_the_same_text() -> None:
    assert demo_text.__wrapped__() == demo_text.__wrapped__()


def test_long_replay_stays_below_four_megabytes() -> None:
    assert len(replay_text(count=350).encode()) < 4_000_000


def test_very_long_replay_is_thinned_to_its_budget_and_says_so() -> None:
    frames = cases.frames(1500, tuple(f"p{k}" for k in range(12)))
    text = Scene(frames, "long", budget_bytes=400_000).html()
    assert len(text.encode()) < 450_000
    assert '"total":1500' in text


def test_hostile_strings_stay_text_everywhere() -> None:
    bad = cases.HOSTILE
    frame = dataclasses.replace(
        cases.frame(2.7, (bad, "Ben")),
        sent=bad,
        policies=(PolicyAnswer(bad, Verdict.SAFE, bad, bad),),
        levels=(LevelVerdicts(bad, (Verdict.SAFE,)),),
        violations=(bad,),
        alert=bad,
    )
    blocks = (
        Paragraph(bad),
        Notice(bad, bad),
        Claims((Claim(bad, Rigor.SAMPLED),)),
        Assumptions((Assumption(bad, bad, bad),)),
        Table(bad, (bad,), ((bad,),), folded=True),
        plane_figure(frame),
        verdict_timeline([frame]),
        Scene([frame], bad),
    )
    text = Page(bad, (bad,), (Section(bad, blocks),), bad, bad).html()
    page = Strict(text)
    assert "b" not in page.tags
    assert "<script>alert" not in text
    # One script for the page, and for the scene one with data and one with code.
    assert page.tags.count("script") == 3


def test_page_says_how_it_was_made_and_that_replay_is_open_loop() -> None:
    text = replay_text()
    assert "open-loop" in text
    assert "workbench replay" in text
    assert "3 samples above 8 m/s were left out." in text
    for name in ("model", "people"):
        assert f"<h3>{name}</h3>" in text


def test_a_page_says_who_decided_and_what_each_policy_asks() -> None:
    text = demo_text()
    assert "Deciding: both." in text
    for words in ("LookAhead permits TRACK while", "FailSafe permits it while", "violation PEOPLE"):
        assert words in text


def test_demo_shows_each_bound_with_its_rigor_and_finding() -> None:
    text = demo_text()
    for word in ("refuted", "implied by proof", "ENCLOSED", "NUMERICAL", "SAMPLED"):
        assert word in text


def test_summary_counts_every_decision() -> None:
    frames = cases.frames(40)
    rows = {row[0]: row[1] for row in summary_table(frames).rows}
    assert rows["decisions"] == 40
    assert sum(rows[f"verdict {verdict.value}"] for verdict in Verdict) == 40  # type: ignore[misc]
    assert rows["action TRACK"] == rows["verdict SAFE"]
    assert rows["policy LookAhead SAFE"] == rows["verdict SAFE"]
    assert 0 < rows["policy FailSafe SAFE"] < rows["verdict SAFE"]  # type: ignore[operator]
    assert rows["sent BRAKE"] == sum(frame.sent == "BRAKE" for frame in frames)
    assert rows["violation PEOPLE"] == sum(bool(frame.violations) for frame in frames)
    assert rows["alert to a person"] == sum(frame.alert is not None for frame in frames)


def test_a_page_of_frames_without_policies_is_whole() -> None:
    """Frames need not come from a monitor."""
    bare = [
        dataclasses.replace(frame, policies=(), levels=(), violations=(), alert=None, sent="")
        for frame in cases.frames(5)
    ]
    report = dataclasses.replace(cases.demo_report(), frames=tuple(bare))
    text = demo_page(report, version="0.0", command="x").html()
    Strict(text)
    assert not any("policy" in str(row[0]) for row in summary_table(bare).rows)


def test_writing_replaces_the_whole_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "report.html"
    write_page(path, "old")
    write_page(path, "new é")
    assert path.read_text(encoding="utf-8") == "new é"
    assert [entry.name for entry in path.parent.iterdir()] == ["report.html"]


def test_unwritable_place_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"expected to write the report to .*report\.html"):
        write_page(tmp_path / "file" / "report.html", "x")
    (tmp_path / "report.html").mkdir()
    with pytest.raises(InputError, match="expected to write"):
        write_page(tmp_path / "report.html", "x")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "report.html"]


def test_wrong_rows_and_empty_or_unsorted_decisions_are_refused() -> None:
    with pytest.raises(InputError, match="expected 2 cells"):
        Table("t", ("a", "b"), ((1,),))
    with pytest.raises(InputError, match="at least one decision"):
        Scene((), "none")
    with pytest.raises(InputError, match="time order"):
        verdict_timeline((cases.frame(1.0, ("A",)), cases.frame(0.5, ("A",))))
