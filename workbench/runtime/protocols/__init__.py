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
from workbench.runtime.protocols.intents import (
    IntentSet,
    IntentsSeen,
    PersonWay,
    SentIntents,
    Way,
    intent_frames,
)
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
    "IntentSet",
    "IntentsSeen",
    "LocalisationSet",
    "Localised",
    "NoSet",
    "PeopleSeen",
    "PersonKind",
    "PersonSet",
    "PersonWay",
    "Protocol",
    "Reason",
    "Refusal",
    "SentIntents",
    "SentPerson",
    "SetFault",
    "Way",
    "counter_step",
    "decode",
    "decode_received",
    "encode",
    "frame_crc",
    "intent_frames",
    "load_protocol",
    "localisation_frames",
    "people_frames",
    "worst_rounding",
]
