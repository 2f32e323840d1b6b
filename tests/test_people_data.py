"""Tracks come out as written; what was measured by a time does not contain anything later."""

import numpy as np
import pytest
from motion_cases import crowd, write_peds

from workbench.errors import InputError
from workbench.estimation.people_data import PersonTrack, by_recording, load_measured, load_tracks


def test_tables_come_out_as_written(tmp_path):
    tracks = crowd(1)
    write_peds(tmp_path, tracks)
    read = load_tracks(tmp_path)
    assert [track.key for track in read] == [track.key for track in tracks]
    for before, after in zip(tracks, read, strict=True):
        assert np.array_equal(before.t_s, after.t_s)
        assert np.array_equal(before.xy_m, after.xy_m)
    assert [track.key for track in load_measured(tmp_path)] == [track.key for track in tracks]
    assert {name: len(people) for name, people in by_recording(read).items()} == {"r0": 6, "r1": 6}


def test_control_points_replace_samples_and_may_be_missing_for_a_person(tmp_path):
    tracks = crowd(2)
    write_peds(tmp_path, tracks)
    clicked = [
        PersonTrack(each.recording, each.agent, each.kind, each.t_s[::5], each.xy_m[::5])
        for each in reversed(tracks[1:])
    ]
    write_peds(tmp_path, clicked, "control_points")
    measured = load_measured(tmp_path)
    assert [track.key for track in measured] == [track.key for track in tracks]
    assert len(measured[0].t_s) == 0
    assert np.array_equal(measured[3].t_s, tracks[3].t_s[::5])


def test_until_keeps_the_past_only():
    track = PersonTrack("r", "p", "ped", np.array([0.0, 1.0, 2.0]), np.zeros((3, 2)))
    assert [len(track.until(t).t_s) for t in (-1.0, 0.0, 0.999, 1.0, 5.0)] == [0, 1, 1, 2, 3]
    assert len(track.until(2.0 - 1e-10).t_s) == 3


@pytest.mark.parametrize(
    ("t_s", "xy_m", "said"),
    [
        ([0.0, 0.0], np.zeros((2, 2)), "after 0.0, got 0.0"),
        ([0.0, 1.0], np.zeros((3, 2)), "(2,) and (3, 2)"),
        ([0.0, np.nan], np.zeros((2, 2)), "finite"),
    ],
)
def test_tracks_that_cannot_be_are_refused(t_s, xy_m, said):
    with pytest.raises(InputError) as refused:
        PersonTrack("r", "p", "ped", np.array(t_s), xy_m)
    assert said in str(refused.value)


def test_a_folder_that_is_none_is_named(tmp_path):
    with pytest.raises(InputError, match="found nothing"):
        load_tracks(tmp_path / "none")
