"""CAN frames to values and back: PACMod 2, PACMod 3 and the workbench's own. Base install only."""

from workbench.runtime.protocols.codec import (
    Decoded,
    Reason,
    Refusal,
    decode,
    decode_received,
    encode,
)
from workbench.runtime.protocols.frame_sets import NoSet, SetFault
from workbench.runtime.protocols.integrity import counter_step, frame_crc
from workbench.runtime.protocols.localisation import (
    LocalisationSet,
    Localised,
    localisation_frames,
)
from workbench.runtime.protocols.own_frames import worst_rounding
from workbench.runtime.protocols.people import (
    CAPACITY,
    PeopleSeen,
    PersonKind,
    PersonSet,
    SentPerson,
    people_frames,
)
from workbench.runtime.protocols.tables import PROTOCOLS, Protocol, load_protocol

__all__ = [
    "CAPACITY",
    "PROTOCOLS",
    "Decoded",
    "LocalisationSet",
    "Localised",
    "NoSet",
    "PeopleSeen",
    "PersonKind",
    "PersonSet",
    "Protocol",
    "Reason",
    "Refusal",
    "SentPerson",
    "SetFault",
    "counter_step",
    "decode",
    "decode_received",
    "encode",
    "frame_crc",
    "load_protocol",
    "localisation_frames",
    "people_frames",
    "worst_rounding",
]
