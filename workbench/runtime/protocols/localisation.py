"""Where the vehicle is, on the bus: pose, speed and their radii as one set of four frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

from workbench.runtime.protocols.codec import Decoded, Refusal
from workbench.runtime.protocols.frame_sets import FrameSet, NoSet, SetLayout
from workbench.runtime.protocols.own_frames import encoded_frames

_LAYOUT: Final = SetLayout(header="LOC_STAMP", parts=("LOC_POSITION", "LOC_MOTION", "LOC_RADII"))


@final
@dataclass(frozen=True, slots=True)
class Localised:
    """Middle of the rear axle, heading and speed, each within its radius, at the sender's stamp_s.

    The numbers are those of the frames: add `worst_rounding` of their signals to the radii before
    relying on them.
    """

    number: int
    stamp_s: float
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    x_radius_m: float
    y_radius_m: float
    heading_radius_rad: float
    speed_radius_mps: float


_EMPTY: Final = FrameSet(_LAYOUT)


@final
@dataclass(frozen=True, slots=True)
class LocalisationSet:
    """Puts a localisation together from frames, as `FrameSet` describes.

    A heading that is not observable (HEADING_OBSERVED 0) is a refused frame: there is no set.
    """

    frames: FrameSet = _EMPTY

    def taking(self, frame: Decoded | Refusal) -> LocalisationSet:
        """The set after one more frame, of whatever message."""
        return LocalisationSet(self.frames.taking(frame))

    @property
    def outcome(self) -> Localised | NoSet:
        """The localisation, or why there is no complete one."""
        found = self.frames.outcome
        if isinstance(found, NoSet):
            return found
        v = {name: value for frame in found for name, value in frame.values.items()}
        return Localised(
            number=int(v["SET"]), stamp_s=v["STAMP"], x_m=v["X"], y_m=v["Y"],
            heading_rad=v["HEADING"], speed_mps=v["SPEED"], x_radius_m=v["X_RADIUS"],
            y_radius_m=v["Y_RADIUS"], heading_radius_rad=v["HEADING_RADIUS"],
            speed_radius_mps=v["SPEED_RADIUS"],
        )  # fmt: skip


def localisation_frames(
    localised: Localised, *, heading_observed: bool = True
) -> tuple[tuple[int, bytes], ...] | Refusal:
    """The frames (identifier, bytes) of one localisation in their order, or why it cannot be sent.

    heading_observed: False says that the heading is not known; nobody takes such a set for one.
    """
    v, place = localised, {"SET": localised.number}
    return encoded_frames(
        [
            ("LOC_STAMP", place | {"STAMP": v.stamp_s, "SPEED_RADIUS": v.speed_radius_mps}),
            ("LOC_POSITION", place | {"X": v.x_m, "Y": v.y_m}),
            (
                "LOC_MOTION",
                place
                | {
                    "HEADING": v.heading_rad,
                    "SPEED": v.speed_mps,
                    "HEADING_RADIUS": v.heading_radius_rad,
                },
            ),
            (
                "LOC_RADII",
                place
                | {
                    "X_RADIUS": v.x_radius_m,
                    "Y_RADIUS": v.y_radius_m,
                    "HEADING_OBSERVED": int(heading_observed),
                },
            ),
        ]
    )
