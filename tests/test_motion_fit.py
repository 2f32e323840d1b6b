"""A fit on generated people finds numbers that predict them, never sees a recording that is left
out, and its file reads back as it was."""

import os
from pathlib import Path

import numpy as np
import pytest
from motion_cases import crowd, write_peds

from workbench.errors import InputError
from workbench.estimation.motion_fit import FIELDS, MOTIONS, Scored, fit_motion, fitted, gather
from workbench.estimation.motion_parameters import (
    load_motion,
    shipped_motion,
    shipped_motion_path,
)
from workbench.estimation.prediction_scores import score_motion


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("generated")
    write_peds(place, crowd(7, recordings=3, people=5))
    return place


def test_a_fit_is_one_of_the_candidates_and_reads_back(folder, tmp_path):
    found = fit_motion(folder, credit="generated")
    assert found.numbers in MOTIONS
    assert found.field in FIELDS
    assert found.provenance == "generated; fitted to the recordings r0, r1, r2"
    path = tmp_path / "motion.toml"
    path.write_text(found.toml())
    assert load_motion(path) == found


def test_a_recording_that_is_left_out_changes_nothing(folder, tmp_path):
    write_peds(
        tmp_path, (*crowd(7, recordings=3, people=5)[:10], *crowd(8, recordings=3, people=5)[10:])
    )
    others = np.array([True, True, False])
    fits = [fitted(gather(place), others, "held out") for place in (folder, tmp_path)]
    assert fits[0] == fits[1]


def test_scores_name_every_method_and_steady_walkers_are_no_worse_than_on_a_line(folder):
    scores = score_motion(folder, shipped_motion())
    fde = {(off.method, off.horizon_s): off.fde_m for off in scores.off if off.questions == "fresh"}
    for horizon in (1.0, 2.0, 3.0, 5.0):
        held_out = fde["recording held out", horizon]
        assert held_out <= fde["constant velocity", horizon]
    assert {held.level for held in scores.held} == {0.9, 0.99}
    assert "| fresh | constant velocity | 1 |" in scores.text()


def test_the_best_candidate_has_the_least_relative_error_on_the_chosen_recordings():
    of_each = np.array([[[2.0], [9.0]], [[3.0], [1.0]]])
    scored = Scored(of_each, np.array([[4.0], [4.0]]))
    assert [scored.best(np.array(mask)) for mask in ([True, False], [False, True])] == [0, 1]


def test_broken_files_say_where(tmp_path):
    path = tmp_path / "motion.toml"
    with pytest.raises(InputError, match="no such motion file; copy the shipped one"):
        load_motion(path)
    text = shipped_motion_path().read_text()
    for old, new, said in (
        ("[motion]", "[motions]", "unknown key 'motions'"),
        ("softening_m = ", "softening_m = -", "softening_m: expected a number above 0"),
        ("levels = [0.5", 'levels = ["x"', "expected lists of numbers"),
        (
            "preferred_s = ",
            "preferred_s = true #",
            "preferred_s: expected a finite number, got True",
        ),
        ("[motion]", "[motion", "expected a TOML file"),
    ):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError) as refused:
            load_motion(path)
        assert said in str(refused.value)
        assert str(path) in str(refused.value)


def test_the_shipped_file_credits_its_recordings():
    assert "Lerner" in shipped_motion().provenance
    assert "2007" in shipped_motion().provenance


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["kitti", "sdd", "ucy"])
def test_recorded_people_are_no_worse_than_on_a_line_and_radii_hold(name):
    if "WORKBENCH_DATA" not in os.environ:
        pytest.skip("WORKBENCH_DATA names no folder of recordings")
    scores = score_motion(Path(os.environ["WORKBENCH_DATA"]) / name, shipped_motion())
    table = {(o.method, o.questions, o.horizon_s): o for o in scores.off}
    for (method, questions, horizon), off in table.items():
        line = table["constant velocity", questions, horizon]
        if method != "constant velocity" and questions != "goal known afterwards":
            assert off.ade_m <= line.ade_m
            assert off.fde_m <= line.fde_m
            assert horizon < 3.0 or off.fde_m < line.fde_m
    for held in scores.held:
        if held.radii == "free, recording held out":
            assert abs(held.share - held.level) <= 0.02
