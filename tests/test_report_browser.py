"""In a real browser the pages log no errors and the player's slider changes the read-out."""

from __future__ import annotations

import dataclasses
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

import report_cases as cases

from workbench.report.demo import demo_page
from workbench.report.replay import replay_page

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-logging=stderr",
    "--virtual-time-budget=3000",
    "--window-size=390,844",
    "--dump-dom",
)

PROBE = """<script>
const found = [], say = (name) => found.push(name + "=" +
  document.querySelector(".readout ." + name).textContent);
const inked = () => { const c = document.querySelector(".view");
  return c.getContext("2d").getImageData(0, 0, c.width, c.height).data.filter((v) => v).length; };
const picture = () => document.querySelector(".view").toDataURL();
const press = (key) => document.querySelector(".view").dispatchEvent(
  new KeyboardEvent("keydown", { key: key, bubbles: true, cancelable: true }));
const slider = document.querySelector(".scrubber");
["time", "verdict", "speed", "clearance"].forEach(say);
found.push("inked=" + (inked() > 1000));
slider.value = slider.max; slider.dispatchEvent(new Event("input"));
["time", "verdict", "clearance"].forEach(say);
["sent", "policies", "levels", "named"].forEach((name) => found.push("last " + name + "=" +
  document.querySelector(".readout ." + name).textContent
    .replaceAll("\\n", " / ").replaceAll(";", ",")));
const shown = document.querySelector(".shown"), pixels = [];
for (const choice of ["0", "1", "2"]) {
  shown.value = choice; shown.dispatchEvent(new Event("change")); pixels.push(picture());
}
found.push("pictures=" + new Set(pixels).size);
press("ArrowLeft"); say("time");
press("Home"); say("time");
document.querySelector(".play").click();
found.push("wide=" + (document.documentElement.scrollWidth > innerWidth));
found.push("buttons=" + document.querySelectorAll("button.csv").length);
setTimeout(function () {
  found.push("played=" + (Number(slider.value) > 0));
  const result = document.createElement("output"); result.id = "probe";
  result.textContent = found.join(";"); document.body.append(result);
}, 1500);
</script></body>"""


def browse(browser: str, text: str, folder: Path) -> tuple[list[str], str]:
    page = folder / "page.html"
    page.write_text(text.replace("</body>", PROBE), encoding="utf-8")
    done = subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={folder / 'profile'}", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    console = "\n".join(line for line in done.stderr.splitlines() if "CONSOLE" in line)
    match = re.search(r'<output id="probe">([^<]*)</output>', done.stdout)
    assert match, f"the probe did not run; console: {console or done.stderr[-2000:]}"
    return match.group(1).split(";"), console


@pytest.fixture
def browser(require_tool: Callable[..., str]) -> str:
    return require_tool("chromium", "chromium-browser", "google-chrome")


def test_demo_player_follows_slider_keys_and_play_button(browser: str, tmp_path: Path) -> None:
    text = demo_page(cases.demo_report(), version="0", command="workbench demo").html()
    found, console = browse(browser, text, tmp_path)
    assert console == ""
    assert found[:8] == [
        "time=0.00 s",
        "verdict=SAFE",
        "speed=2.60 m/s",
        "clearance=14.00 m",
        "inked=true",
        "time=3.90 s",
        "verdict=INVALID",
        "clearance=none",
    ]
    assert found[8] == "last sent=BRAKE"
    assert found[9].startswith("last policies=LookAhead: INVALID, TRACK. as expected of Ada / Fail")
    assert found[10] == "last levels=track: INVALID, SAFE, SAFE / stop: UNPROVED, INVALID, SAFE"
    assert found[11].endswith("alert to Ada: braking is not proved to keep clear")
    assert found[12:15] == ["pictures=3", "time=3.80 s", "time=0.00 s"]
    assert "wide=false" in found
    assert "played=true" in found
    assert f"buttons={text.count('<caption>')}" in found


def test_hostile_names_run_nothing(browser: str, tmp_path: Path) -> None:
    report = cases.replay_report(name=cases.HOSTILE)
    report = dataclasses.replace(report, frames=cases.frames(names=(cases.HOSTILE,)))
    found, console = browse(browser, replay_page(report, version="0", command="x").html(), tmp_path)
    assert console == ""
    assert "verdict=SAFE" in found
