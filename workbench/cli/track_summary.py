"""What `workbench track` says at the end: counts, who has no place, and what it rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from workbench.cli.analysis_options import text_table
from workbench.cli.track_tables import Note, State, sure_places

_SAID: Final = 6
_KIND: Final = 3


@final
@dataclass(frozen=True, slots=True)
class Unplaced:
    """A box of somebody who has no bounded position: when (s), in which image, and why."""

    t_s: float
    image: str
    why: str


@final
@dataclass(frozen=True, slots=True)
class Summary:
    """Counts of one run; places: in peds.csv, of discs up to sure_m;
    crowd: most people at once, assumed ones too; limits: what covers nobody
    or is taken for granted."""

    recording: str
    images: int
    from_s: float
    until_s: float
    boxes: int
    boxes_of_people: int
    begun: int
    given_up: int
    confirmed: int
    confirmed_after: int
    places: int
    sure_m: float
    crowd: int
    unplaced: tuple[Unplaced, ...]
    limits: tuple[str, ...]

    def text(self, wrote: Sequence[Path]) -> str:
        """For a terminal."""
        rows: list[list[str | int | float | None]] = [
            [f"images from {self.from_s:.2f} s to {self.until_s:.2f} s", self.images],
            ["boxes", self.boxes],
            ["boxes of people", self.boxes_of_people],
            ["boxes of people without a place", len(self.unplaced)],
            ["tracks begun", self.begun],
            ["tracks given up", self.given_up],
            [f"tracks seen in {self.confirmed_after} images or more", self.confirmed],
            [f"places for peds.csv, in discs up to {self.sure_m:g} m", self.places],
            ["most people at once, assumed ones too", self.crowd],
        ]
        lines = [text_table([f"recording {self.recording}", "count"], rows)]
        if self.unplaced:
            lines += ["", "without a place (all of them: detections.csv):"]
            lines += [f"  {each.t_s:.2f} s, {each.why}" for each in self.unplaced[:_SAID]]
            more = len(self.unplaced) - _SAID
            lines += [f"  and {more} more"] if more > 0 else []
        lines += ["", "this holds as long as:", *(f"  {limit}" for limit in self.limits)]
        return "\n".join([*lines, "", *(f"wrote {path}" for path in wrote)])


def summarised(
    recording: str,
    notes: Sequence[Note],
    limits: Sequence[str],
    *,
    confirmed_after: int,
    sure_m: float,
) -> Summary:
    """The counts of at least one image."""
    from workbench.runtime.person_tubes import MOST_PEOPLE

    people = [each for note in notes for each in note.people]
    states = [each.state for each in people]
    seen = {each.agent: each.seen for each in people if each.state is not State.ASSUMED}
    crowd = max(sum(each.state is not State.LOST for each in note.people) for note in notes)
    too_many = (
        f"the monitor takes {MOST_PEOPLE} people, and up to {crowd} are seen or assumed here: "
        "fewer slices make fewer and larger discs"
    )
    return Summary(
        recording=recording,
        images=len(notes),
        from_s=notes[0].t_s,
        until_s=notes[-1].t_s,
        boxes=sum(len(note.boxes) for note in notes),
        boxes_of_people=sum(row[_KIND] != "" for note in notes for row in note.boxes),
        begun=states.count(State.BORN),
        given_up=states.count(State.LOST),
        confirmed=sum(count >= confirmed_after for count in seen.values()),
        confirmed_after=confirmed_after,
        places=sum(1 for _ in sure_places(notes, sure_m)),
        sure_m=sure_m,
        crowd=crowd,
        unplaced=tuple(
            Unplaced(note.t_s, note.name, why) for note in notes for why in note.unplaced
        ),
        limits=(*limits, *([too_many] if crowd > MOST_PEOPLE else [])),
    )
