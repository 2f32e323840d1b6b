"""Entries of the vehicle's loop as messages of an MCAP file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final, final

from workbench.runtime.onboard.mcap import McapWriter
from workbench.runtime.onboard.mcap_scene import path_scene, turn_scene
from workbench.runtime.onboard.mcap_schemas import (
    CAN_TOPIC,
    DECISION_TOPIC,
    DIAGNOSTICS_TOPIC,
    SCENE_TOPIC,
    schemas,
)
from workbench.runtime.onboard.recorder_entries import LoggedFrame, decision_of
from workbench.runtime.onboard.recorder_header import LogHeader

HEADER_METADATA: Final = "workbench"
_INFO: Final = 2
_WARNING: Final = 3


@final
class McapLog:
    """The MCAP log of one run, filled entry by entry."""

    def __init__(self, writer: McapWriter, header: LogHeader) -> None:
        self._writer = writer
        self._header = header
        self._start_ns = header.started_unix_us * 1000
        self._topics = {
            topic: writer.channel(topic, schema_name=name, schema=schema)
            for topic, (name, schema) in schemas().items()
        }
        self._faults: Mapping[str, str] = {}
        writer.metadata(HEADER_METADATA, {"header": header.to_json()})
        self._add(SCENE_TOPIC, 0, path_scene(header, self._time(0)))

    def frame(self, frame: LoggedFrame) -> None:
        """One line of the raw log."""
        made, upstream = ("true" if each else "false" for each in (frame.made, frame.upstream))
        content = (
            f'{{"at_us":{frame.at_us},"id":{frame.identifier},"data":"{frame.data.hex()}",'
            f'"made":{made},"upstream":{upstream}}}'
        )
        at_ns = self._start_ns + frame.at_us * 1000
        self._writer.add(self._topics[CAN_TOPIC], at_ns, content.encode())

    def turn(self, record: Mapping[str, Any]) -> None:
        """What a turn found, said and decided."""
        at_us = record["at_us"]
        faults = {str(found["fault"]): str(found["detail"]) for found in record["faults"]}
        for fault in faults.keys() - self._faults.keys():
            self.say(at_us, _WARNING, f"{fault}: {faults[fault]}")
        for fault in self._faults.keys() - faults.keys():
            self.say(at_us, _INFO, f"{fault}: over")
        self._faults = faults
        for event in record["events"]:
            self.say(at_us, _INFO, str(event))
        if record["decision"] is not None:
            self._add(DECISION_TOPIC, at_us, decision_of(record))
            self._add(SCENE_TOPIC, at_us, turn_scene(record, self._header, self._time(at_us)))

    def say(self, at_us: int, level: int, message: str) -> None:
        """A line for people."""
        line = {
            "timestamp": self._time(at_us), "level": level, "message": message,
            "name": "workbench-monitor", "file": "", "line": 0,
        }  # fmt: skip
        self._add(DIAGNOSTICS_TOPIC, at_us, line)

    def lost(self, at_us: int, entries: int, why: str) -> None:
        """Entries that are missing from here on."""
        self.say(at_us, _WARNING, f"{entries} entries of this log are lost: {why}")

    def _time(self, at_us: int) -> dict[str, int]:
        seconds, micros = divmod(self._header.started_unix_us + at_us, 1_000_000)
        return {"sec": seconds, "nsec": micros * 1000}

    def _add(self, topic: str, at_us: int, content: object) -> None:
        data = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        self._writer.add(self._topics[topic], self._start_ns + at_us * 1000, data)
