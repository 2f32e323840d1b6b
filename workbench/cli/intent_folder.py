"""What `workbench intent` reads: people, goals, labels, and which scene each recording shows."""

from __future__ import annotations

import argparse
import contextlib
import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, final

from workbench.cli.output import warn
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.estimation.goals import Goal
    from workbench.estimation.intent_cloud import FilterSettings
    from workbench.estimation.intent_labels import Label, Prior
    from workbench.estimation.people_data import PersonTrack

_OWN_GOALS: Final = ("goals.csv", "goals.csv.gz")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Folder:
    """Tracks and what was measured of them, in one order; labels; goals by scene; scenes by the
    recordings whose goals are asked."""

    path: Path
    tracks: tuple[PersonTrack, ...]
    measured: tuple[PersonTrack, ...]
    labels: tuple[Label, ...]
    goals: dict[str, tuple[Goal, ...]]
    scenes: dict[str, str]

    def prior_of(self, recording: str, kind: str) -> Prior:
        """The prior of the recording's goals: `equal`, or `learned` from other recordings."""
        from workbench.estimation.intent_labels import Prior, learned_prior

        scene = self.scenes[recording]
        if kind == "equal":
            return Prior.equal(self.goals[scene])
        return learned_prior(
            self.goals[scene], self.labels, scene=scene, without=frozenset({recording})
        )

    def recordings(self) -> list[str]:
        """The names, in the order of the table of samples."""
        return list(dict.fromkeys(track.recording for track in self.tracks))


def read_folder(
    args: argparse.Namespace, asked: Iterable[str] | None = None, *, helped: Iterable[str] = ()
) -> Folder:
    """Everything that the options name, checked; goals only where some recording's are asked.

    asked: the recordings whose goals are asked, None for all; helped: recordings whose goals are
    read too where there are any. Raises InputError on what cannot be used.
    """
    from workbench.estimation.goals import load_goals
    from workbench.estimation.intent_labels import load_labels, scenes_of
    from workbench.estimation.people_data import load_measured, load_tracks

    tracks = load_tracks(args.folder)
    known_recording(args.recording, tracks)
    there = dict.fromkeys(track.recording for track in tracks)
    names = [name for name in there if asked is None or name in set(asked)]
    goals, scenes = {}, {}
    if names:
        goals = load_goals(args.goals or _goals_of(args.folder))
        scenes = scenes_of(args.folder, names, list(goals), given=args.scene)
    scenes |= _helpful(args, goals, [name for name in there if name in set(helped) - set(names)])
    labels = load_labels(args.folder)
    if goals and labels and _other_goals(args, goals):
        warn("--goals: the folder's labels are about its own goals.csv; they are left out")
        labels = ()
    return Folder(args.folder, tracks, load_measured(args.folder), labels, goals, scenes)


def _helpful(
    args: argparse.Namespace, goals: dict[str, tuple[Goal, ...]], helped: Sequence[str]
) -> dict[str, str]:
    """Scenes of recordings whose goals nobody asks, as far as they are known; adds their goals."""
    from workbench.estimation.goals import load_goals
    from workbench.estimation.intent_labels import scenes_of

    own = any((args.folder / name).is_file() for name in _OWN_GOALS)
    if not helped or (args.goals is None and not own):
        return {}
    goals |= load_goals(args.goals or _goals_of(args.folder))
    found: dict[str, str] = {}
    for name in helped:
        with contextlib.suppress(*(() if args.scene else (InputError,))):
            found |= scenes_of(args.folder, [name], list(goals), given=args.scene)
    return found


def _other_goals(args: argparse.Namespace, goals: Mapping[str, tuple[Goal, ...]]) -> bool:
    """Were other goals given than those of the folder, which its labels name?"""
    from workbench.estimation.goals import load_goals

    if args.goals is None or not any((args.folder / name).is_file() for name in _OWN_GOALS):
        return False
    return load_goals(_goals_of(args.folder)) != goals


def known_recording(name: str | None, tracks: Sequence[PersonTrack]) -> None:
    """Raise InputError where --recording names none of them."""
    names = sorted({track.recording for track in tracks})
    if name is None or name in names:
        return
    near = difflib.get_close_matches(name, names, n=1)
    raise InputError(
        f"--recording: no recording {name!r}; "
        + (f"did you mean {near[0]!r}? " if near else "")
        + f"The folder has {', '.join(names[:20]) or 'none'}"
    )


def _goals_of(folder: Path) -> Path:
    for name in _OWN_GOALS:
        if (folder / name).is_file():
            return folder / name
    raise InputError(
        f"{folder} has no goals.csv; name a table of goals with --goals FILE, or write one from "
        "the ends of the tracks with --learn-goals FILE"
    )


def chosen_filter(args: argparse.Namespace) -> FilterSettings:
    """The settings that --filter names."""
    from workbench.estimation.intent_cloud import FilterSettings

    return FilterSettings.paper() if args.filter == "paper" else FilterSettings.chosen()
