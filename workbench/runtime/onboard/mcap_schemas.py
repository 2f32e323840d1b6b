"""JSON schemas of the log's topics: Foxglove's, as far as they are used here, and our own."""

from __future__ import annotations

import json
from typing import Any, Final

_NUMBER: Final = {"type": "number"}
_INTEGER: Final = {"type": "integer"}
_TEXT: Final = {"type": "string"}
_TRUTH: Final = {"type": "boolean"}
# JSON has no word for infinities and NaN.
_FLOAT: Final = {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}
_MAYBE_FLOAT: Final = {"anyOf": [*_FLOAT["anyOf"], {"type": "null"}]}
_MAYBE_TEXT: Final = {"type": ["string", "null"]}


def _record(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _many(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_TIME: Final = _record(sec=_INTEGER, nsec=_INTEGER)
_XYZ: Final = _record(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE: Final = _record(
    position=_XYZ, orientation=_record(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
)
_COLOR: Final = _record(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_LINES: Final = _record(
    type=_INTEGER, pose=_POSE, thickness=_NUMBER, scale_invariant=_TRUTH, points=_many(_XYZ),
    color=_COLOR, colors=_many(_COLOR), indices=_many(_INTEGER),
)  # fmt: skip
_CYLINDER: Final = _record(
    pose=_POSE, size=_XYZ, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOR
)
_WORDS: Final = _record(
    pose=_POSE, billboard=_TRUTH, font_size=_NUMBER, scale_invariant=_TRUTH, color=_COLOR,
    text=_TEXT,
)  # fmt: skip
# Kinds of drawing that are never used here, but that readers expect to be there.
UNUSED_PRIMITIVES: Final = ("arrows", "cubes", "spheres", "triangles", "models")
_ENTITY: Final = _record(
    timestamp=_TIME, frame_id=_TEXT, id=_TEXT, lifetime=_TIME, frame_locked=_TRUTH,
    metadata=_many(_record(key=_TEXT, value=_TEXT)), cylinders=_many(_CYLINDER),
    lines=_many(_LINES), texts=_many(_WORDS),
    **{name: _many(_record()) for name in UNUSED_PRIMITIVES},
)  # fmt: skip
_DELETION: Final = _record(timestamp=_TIME, type=_INTEGER, id=_TEXT)
_SCENE: Final = _record(deletions=_many(_DELETION), entities=_many(_ENTITY))
_LOG: Final = _record(
    timestamp=_TIME, level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER
)

_VIOLATION: Final = _record(hypothesis=_TEXT, detail=_TEXT, refutes_plan=_TRUTH)
_ALERT: Final = _record(person=_MAYBE_TEXT, reason=_TEXT) | {"type": ["object", "null"]}
_POLICY: Final = _record(
    policy=_TEXT, verdict=_TEXT, action=_TEXT, reason=_TEXT, violations=_many(_VIOLATION),
    alert=_ALERT, brake_from_s=_MAYBE_FLOAT,
)  # fmt: skip
_DECISION: Final = _record(
    at_us=_INTEGER, decided_us=_INTEGER, state=_TEXT, verdict=_TEXT, action=_TEXT, reason=_TEXT,
    brake_from_s=_FLOAT, look_ahead=_POLICY, fail_safe=_POLICY, violations=_many(_VIOLATION),
    alert=_ALERT, clearance_m=_MAYBE_FLOAT, clearance_time_s=_MAYBE_FLOAT,
    clearance_person=_MAYBE_TEXT,
    level_verdicts={"type": "object", "additionalProperties": _many(_TEXT)}, deciding_level=_TEXT,
    rigor=_TEXT, faults=_many(_record(fault=_TEXT, detail=_TEXT, since_us=_INTEGER)),
    events=_many(_TEXT), elapsed_s=_FLOAT, digest=_TEXT,
)  # fmt: skip
_CAN: Final = _record(at_us=_INTEGER, id=_INTEGER, data=_TEXT, made=_TRUTH, upstream=_TRUTH)

SCENE_TOPIC: Final = "/scene"
DECISION_TOPIC: Final = "/decision"
DIAGNOSTICS_TOPIC: Final = "/diagnostics"
CAN_TOPIC: Final = "/can"
_TOPICS: Final = {
    SCENE_TOPIC: ("foxglove.SceneUpdate", _SCENE),
    DECISION_TOPIC: ("workbench.Decision", _DECISION),
    DIAGNOSTICS_TOPIC: ("foxglove.Log", _LOG),
    CAN_TOPIC: ("workbench.CanFrame", _CAN),
}


def schemas() -> dict[str, tuple[str, bytes]]:
    """By topic: the schema's name, and its text."""
    return {
        topic: (name, json.dumps({"title": name} | schema, separators=(",", ":")).encode())
        for topic, (name, schema) in _TOPICS.items()
    }
