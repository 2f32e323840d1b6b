"""Fitted guards hold the share they were fitted to, and are judged on recordings they never saw."""

from __future__ import annotations

import csv
import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest
from guard_walkers import crowd

from workbench.errors import InputError
from workbench.estimation import guard_scores
from workbench.estimation.guard_fit import GuardRows, fit_guard, fitted_together
from workbench.estimation.guard_model import GuardFit, GuardModel, VelocityError, is_inside
from workbench.estimation.guard_motion import motion_rows
from workbench.estimation.guard_scores import (
    binomial_interval,
    guard_lines,
    guard_table,
    held_out_fits,
)
from workbench.estimation.people_data import PersonTrack
from workbench.runtime import MotionLimits

LIMITS = MotionLimits(2.0, 1.5)
NONE = VelocityError(*[0.0] * 10)
SLOW = GuardModel(0.1, dataclasses.replace(NONE, base_mps=0.5), 1.0, LIMITS, "slow")
FAST = GuardModel(0.1, dataclasses.replace(NONE, base_mps=3.0), 1.0, MotionLimits(9.0, 3.0), "fast")


@pytest.fixture(scope="module")
def people() -> list[PersonTrack]:
    return crowd(11, 3, 8, LIMITS)


@pytest.fixture(scope="module")
def fitted(people: list[PersonTrack]) -> GuardFit:
    return fit_guard(people, people, inside=0.99)


@pytest.mark.parametrize("kind", ["ped", "cyclist"])
def test_the_share_is_inside_at_every_horizon_and_not_much_more_at_one(
    people: list[PersonTrack], fitted: GuardFit, kind: str
) -> None:
    own = [track for track in people if track.kind == kind]
    tight = []
    for horizon in (0.5, 1.0, 2.0):
        rows = motion_rows(own, own, horizon)
        rows = rows.take(rows.motion.known)
        assert is_inside(fitted.of(kind), rows).mean() >= 0.99
        # Without the margin of twelve people a fair size leaves some outside.
        tight.append(is_inside(fitted.of(kind).scaled(0.8 / (1.05 + 10 / 12)), rows).mean())
    assert min(tight) < 0.99


def test_a_fit_keeps_the_speeds_it_saw_and_says_what_it_saw(fitted: GuardFit) -> None:
    margin = 1.05 + 10.0 / 12.0
    assert 1.0 * margin < fitted.of("ped").limits.speed_mps <= 2.0 * margin
    assert 3.0 * margin < fitted.of("cyclist").limits.speed_mps <= 6.0 * margin
    said = "12 people (ped) in 3 recordings, shape with 12 others"
    assert fitted.of("ped").provenance == said


def test_faults_of_the_labels_are_not_fitted_to(people: list[PersonTrack]) -> None:
    far = people[0].xy_m.copy()
    far[30:] += 500.0
    jumped = [dataclasses.replace(people[0], xy_m=far), *people[1:]]
    fit = fit_guard(jumped, jumped, inside=0.99)
    assert fit.of("ped").limits.speed_mps < 5.0


def test_a_kind_without_a_model_gets_its_family_or_the_widest() -> None:
    fit = GuardFit({"ped": SLOW, "cyclist": FAST})
    assert fit.of("sitting") is SLOW
    assert fit.of("skater") is FAST
    assert fit.of("horse") is FAST


def test_few_people_share_the_shape_of_all(people: list[PersonTrack]) -> None:
    assert fitted_together(GuardRows.of(people, people), "cyclist") == ("cyclist", "ped")
    many = [dataclasses.replace(track, agent=f"{i}-{track.agent}")
            for i in range(10) for track in people]  # fmt: skip
    assert fitted_together(GuardRows.of(many, many), "cyclist") == ("cyclist",)


def test_the_recording_that_is_judged_is_never_fitted_to(
    people: list[PersonTrack], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def spy(rows: GuardRows, *, inside: float) -> GuardFit:
        left = {int(number) for part in rows.parts for number in part.recording}
        assert left == {
            rows.recordings.index(people[i].recording) for part in rows.parts for i in part.person
        }
        seen.append({rows.recordings[number] for number in left})
        return GuardFit({"ped": SLOW, "cyclist": FAST})

    monkeypatch.setattr(guard_scores, "fit_rows", spy)
    fits = held_out_fits(people, people)
    assert dict(zip(fits, seen, strict=True)) == {
        "r0": {"r1", "r2"}, "r1": {"r0", "r2"}, "r2": {"r0", "r1"}
    }  # fmt: skip


def _write(folder: Path, tracks: list[PersonTrack]) -> Path:
    with (folder / "peds.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(("recording", "agent", "kind", "t", "x", "y"))
        for track in tracks:
            for t, (x, y) in zip(track.t_s, track.xy_m, strict=True):
                table.writerow((track.recording, track.agent, track.kind, t, x, y))
    return folder


def test_scores_are_those_counted_one_by_one(
    tmp_path: Path, people: list[PersonTrack], monkeypatch: pytest.MonkeyPatch
) -> None:
    error = dataclasses.replace(NONE, base_mps=0.1)
    tight = dataclasses.replace(SLOW, error=error, limits=MotionLimits(1.5, 0.2))
    fit = GuardFit({"ped": tight, "cyclist": FAST})
    monkeypatch.setattr(
        guard_scores, "held_out_fits", lambda *_: dict.fromkeys(["r0", "r1", "r2"], fit)
    )
    scores = guard_table(_write(tmp_path, people))
    score = next(s for s in scores if (s.kind, s.horizon_s, s.seen) == ("ped", 1.0, "fresh"))
    hits: list[bool] = []
    errors: dict[float, list[float]] = {window: [] for window in guard_scores.WINDOWS_S}
    for track in (track for track in people if track.kind == "ped"):
        for k in range(1, len(track.t_s) - 10):
            guard = tight.guard(track, float(track.t_s[k]), body_radius_m=0.0)
            assert guard is not None
            x, y = track.xy_m[k + 10].tolist()
            p, w = guard.position, guard.velocity
            near = math.hypot(x - p.x - w.x, y - p.y - w.y) <= 0.1 + w.radius + 0.1
            hits.append(near and math.hypot(x - p.x, y - p.y) <= 0.1 + 1.5)
            for window, found in errors.items():
                first = min(int(np.searchsorted(track.t_s, track.t_s[k] - window - 1e-9)), k - 1)
                span = slice(first, k + 1)
                v = np.polyfit(track.t_s[span] - track.t_s[k], track.xy_m[span], 1)[0]
                found.append(float(np.hypot(*(track.xy_m[k + 10] - track.xy_m[k] - v))))
    assert (score.rows, score.people) == (len(hits), 12)
    assert score.inside == pytest.approx(sum(hits) / len(hits))
    assert 0.0 < score.inside < 1.0
    smallest = min(sorted(found)[sum(hits) - 1] for found in errors.values())
    assert score.disc_m2 == pytest.approx(math.pi * smallest**2, rel=1e-6)
    assert score.area_m2 <= math.pi * 1.6**2
    assert len(list(guard_lines(scores))) == len(scores) + 2


def test_an_interval_is_the_known_one() -> None:
    assert binomial_interval(0, 10) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 10)))
    assert binomial_interval(10, 10) == pytest.approx((0.025 ** (1 / 10), 1.0))
    assert binomial_interval(5, 10) == pytest.approx((0.18709, 0.81291), abs=1e-5)


def test_one_recording_cannot_be_held_out(tmp_path: Path, people: list[PersonTrack]) -> None:
    with pytest.raises(InputError, match="two recordings or more"):
        guard_table(_write(tmp_path, people[:8]))


def test_tracks_too_short_to_fit_to_are_refused(people: list[PersonTrack]) -> None:
    short = [track.until(0.4) for track in people]
    with pytest.raises(InputError, match="tracks longer than"):
        fit_guard(short, short, inside=0.99)


@pytest.mark.campaign
@pytest.mark.skipif("WORKBENCH_DATA" not in os.environ, reason="needs the recordings")
@pytest.mark.parametrize(
    ("folder", "kinds"),
    [("ucy", {"ped"}), ("sdd", {"ped", "cyclist", "skater"}), ("kitti", {"ped"})],
)
def test_on_recordings_the_guard_holds_in_less_than_the_disc(folder: str, kinds: set[str]) -> None:
    scores = guard_table(Path(os.environ["WORKBENCH_DATA"]) / folder)
    fresh = [score for score in scores if score.seen == "fresh" and score.kind in kinds]
    assert len(fresh) == 2 * len(kinds)
    assert all(score.inside >= 0.999 for score in fresh)
    assert all(score.area_m2 <= score.disc_m2 for score in fresh)
