"""Every page of the product is one file that fetches nothing, with units on every axis, no meaning
in colour alone, and each picture's numbers in a table beside it."""

from __future__ import annotations

import functools
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("casadi", reason="needs the optional package casadi")
pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from matplotlib.axes import Axes
from matplotlib.collections import Collection, PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure as Canvas
from page_cases import MADE_BY, PAGES
from test_report_pages import Strict

import workbench
from workbench.report import drawing
from workbench.report.drawing import INK, PALETTE, Figure, Key, svg_panel
from workbench.report.page import Page, Section

UNITS = {
    "1", "%", "10⁶", "deg", "m", "m s", "m/s", "m/s²", "m/s³", "rad", "rad/m", "rad/s", "s", "us",
    "1/km", "1/s", "rad/(s m)", "rad/(s² m)",
}  # fmt: skip
"""What may stand in brackets at the end of an axis' label; 1: no unit."""
Made = tuple[str, list[Canvas]]


def recorded(make: Callable[[Path], str]) -> Made:
    """A page and all that was drawn for it."""
    drawn: list[Canvas] = []

    class Recorder(Canvas):
        def __init__(self, *args: Any, **rest: Any) -> None:
            super().__init__(*args, **rest)
            drawn.append(self)

    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr(drawing, "Canvas", Recorder)
        return make(Path(folder)), drawn


made = functools.cache(recorded)


@pytest.fixture(params=PAGES, ids=lambda make: make.__name__)
def page(request: pytest.FixtureRequest) -> Made:
    return made(request.param)


def unit_of(label: str) -> str:
    """What stands in brackets at its end."""
    found = re.search(r"\(((?:[^()]|\([^()]*\))*)\)(, log scale)?$", label)
    return found.group(1) if found else ""


def unlabelled(axes: Axes) -> Iterator[str]:
    """Axes with numbers beside them and no known unit."""
    for axis in (axes.xaxis, axes.yaxis):
        texts = [each.get_text() for each in axis.get_ticklabels() if each.get_visible()]
        numbers = [text for text in texts if re.fullmatch(r"[−-]?[\d.]+(e.*)?", text)]
        if numbers and axis.get_visible() and unit_of(axis.get_label_text()) not in UNITS:
            yield axis.get_label_text() or f"no label: {texts}"


def grey(colour: str) -> bool:
    return colour == INK or len({colour[k : k + 2] for k in (1, 3, 5)}) == 1


def looks(axes: Axes) -> Iterator[tuple[tuple[object, ...], str]]:
    """How each thing drawn looks without its colour, and its colour."""
    for line in axes.lines:
        # The dashes themselves; `get_linestyle` calls all but four of them the same.
        dashes = str(line._dash_pattern if line.get_linestyle() != "None" else None)  # type: ignore[attr-defined]
        size = line.get_linewidth() if line.get_linestyle() != "None" else 0.0
        yield ("line", dashes, line.get_marker(), size > 1.0), to_hex(line.get_color())
    for patch in axes.patches:
        filled = patch.get_facecolor()[3] > 0.0
        look = (type(patch).__name__, patch.get_hatch(), filled, str(patch.get_linestyle()))
        yield look, to_hex(patch.get_facecolor() if filled else patch.get_edgecolor())
    for each in axes.collections:
        assert isinstance(each, Collection)
        marker = len(each.get_paths()[0].vertices) if isinstance(each, PathCollection) else 0
        faces = each.get_facecolor()
        colour = to_hex(faces[0]) if len(faces) else INK
        yield (type(each).__name__, each.get_hatch(), marker), colour


def by_colour_alone(axes: Axes) -> dict[tuple[object, ...], set[str]]:
    """What differs in nothing but colour, unless words in the picture tell it apart."""
    found: dict[tuple[object, ...], set[str]] = {}
    for look, colour in looks(axes):
        if not grey(colour):
            found.setdefault(look, set()).add(colour)
    words = len({text.get_text() for text in axes.texts})
    return {look: colours for look, colours in found.items() if 1 < len(colours) > words}


def test_it_is_one_whole_file_that_fetches_nothing(page: Made) -> None:
    text, _ = page
    read = Strict(text)
    assert len(read.ids) == len(set(read.ids))
    for key, value in read.attributes:
        if key in {"src", "href", "xlink:href", "action", "data", "srcset"}:
            assert value.startswith(("#", "data:")), (key, value)
            assert value[1:] in read.ids or value.startswith("data:")
    assert not re.search(r"https?:|@import|//\w+\.\w", re.sub(r'xmlns(:\w+)?="[^"]*"', "", text))
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", text))
    assert 'name="viewport" content="width=device-width' in text
    assert "prefers-color-scheme:dark" in text
    assert len(text.encode()) < 600_000
    # Letters of 10 pt are not much smaller on a phone, 358 px beside the margins.
    assert all(float(wide) < 360 for wide in re.findall(r'viewBox="0 0 ([\d.]+) ', text))


def test_every_axis_has_a_unit(page: Made) -> None:
    wrong = [label for canvas in page[1] for axes in canvas.axes for label in unlabelled(axes)]
    assert not wrong


def test_colours_are_those_that_all_readers_tell_apart(page: Made) -> None:
    text, drawn = page
    used = {c.lower() for c in re.findall(r"(?:fill|stroke)[:=] ?\"?(#[0-9a-fA-F]{6})", text)}
    allowed = {colour.lower() for colour in PALETTE}
    assert {colour for colour in used if not grey(colour)} <= allowed
    assert "#000000" not in used, "black is not seen on a dark page"
    assert not drawn or used & allowed


def test_nothing_is_told_by_colour_alone(page: Made) -> None:
    text, drawn = page
    found = [
        (axes.get_xlabel(), alone)
        for c in drawn
        for axes in c.axes
        if (alone := by_colour_alone(axes))
    ]
    assert not found
    for legend in re.findall(r'<ul class="legend">(.*?)</ul>', text, re.DOTALL):
        samples = re.findall(r"<svg.*?>(.*?)</svg> (\w: )?", legend)
        plain = [re.sub(r"#\w{6}", "a colour", sample) + letter for sample, letter in samples]
        assert len(plain) == len(set(plain)), legend


def test_numbers_of_every_picture_are_in_a_table_of_its_section(page: Made) -> None:
    text, drawn = page
    pictures = 0
    for section in re.findall(r"<section.*?</section>", text, re.DOTALL):
        figures = section.count("<figure>")
        pictures += figures
        tables = re.findall(r'<div class="table".*?<caption><span>(.*?)</span>', section, re.DOTALL)
        assert not figures or tables
    assert bool(pictures) == bool(drawn)
    assert "Save as CSV" in text
    assert text.count('<div class="table"') == text.count("<caption>")


def test_no_page_is_left_out() -> None:
    package = Path(workbench.__file__).parent
    makers = {
        str(file.relative_to(package))
        for file in package.rglob("*.py")
        if re.search(r"(?<!\w)Page\(", file.read_text(encoding="utf-8"))
    }
    assert makers == set(MADE_BY)
    assert set(MADE_BY.values()) == set(PAGES)


def test_these_checks_find_what_is_wrong() -> None:
    def paint(canvas: Canvas) -> None:
        axes = canvas.add_subplot()
        for k, colour in enumerate(PALETTE[:2]):
            axes.plot([0, 1], [k, 2], color=colour)
        axes.set_xlabel("time (s)")
        axes.set_ylabel("offset")

    def page(_: Path) -> str:
        keys = (Key("one", PALETTE[0]), Key("other", PALETTE[1]))
        figure = Figure((svg_panel(paint, label="x"),), keys, "A caption.")
        return Page("T", (), (Section("S", (figure,)),), "0", "c").html()

    wrong = recorded(page)
    assert list(unlabelled(wrong[1][0].axes[0])) == ["offset"]
    for check in (
        test_every_axis_has_a_unit,
        test_nothing_is_told_by_colour_alone,
        test_numbers_of_every_picture_are_in_a_table_of_its_section,
    ):
        with pytest.raises(AssertionError):
            check(wrong)
