"""The monitor: one observation in, one decision out, and braking whenever it cannot judge."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Mapping, Sequence
from typing import final

from workbench.claims import Rigor, Verdict, weakest
from workbench.errors import InputError
from workbench.runtime.arc import Interval
from workbench.runtime.bundle import Bundle
from workbench.runtime.contents import Field, Manifest
from workbench.runtime.decision import Action, Decision
from workbench.runtime.floats import float_mode_fault
from workbench.runtime.judgement import CannotJudgeError, Judgement, Question, judge
from workbench.runtime.layout import PERSON_NUMBERS, query_counts, result_counts
from workbench.runtime.observation import Observation, Person, fault_in_observation
from workbench.runtime.path import NoProjection, PathTable
from workbench.sets import Box

__all__ = ["STATES", "Action", "Decision", "Monitor", "Observation", "Person"]

STATES = (
    "station",
    "offset",
    "steering",
    "speed",
    "heading_error",
    "speed_integral",
    "offset_integral",
)
"""The kernel's states, in order, that a `Monitor` can fill from an `Observation`."""

_REFERENCE_SPEED = "reference_speed"
_NODES_BEHIND = 4
_NODES_PER_SHIFT = 8


@final
class Monitor:
    """Decides, observation by observation, whether the vehicle may go on tracking its path.

    bundle: the compiled proof. path: the whole route; each query gets a window of it around the
    vehicle. release_steps: how many SAFE verdicts in a row end braking once it was decided (1: the
    first does; a monitor that never braked needs one). clearance_required_m >= 0: distance between
    body and person that SAFE must prove. start_station_m: where on the path the vehicle starts,
    needed only where the path meets itself; None finds it out. Raises InputError when the bundle's
    kernel does not take or give what a monitor needs.
    """

    def __init__(
        self,
        bundle: Bundle,
        path: PathTable,
        *,
        release_steps: int,
        clearance_required_m: float,
        start_station_m: float | None = None,
    ) -> None:
        _check_settings(release_steps, clearance_required_m, start_station_m)
        manifest = bundle.manifest
        _check_interface(manifest)
        query = {field.name: field for field in manifest.query}
        self._bundle = bundle
        self._path = path
        self._release_steps = release_steps
        self._clearance_m = clearance_required_m
        self._station_m = start_station_m
        self._path_nodes = query["path_x"].count
        self._people = query["people"].count // PERSON_NUMBERS
        self._parameters = [parameter.nominal for parameter in manifest.parameters]
        names = [parameter.name for parameter in manifest.parameters]
        self._reference = names.index(_REFERENCE_SPEED)
        self._safe_in_a_row = release_steps
        self._window_start: float | None = None
        self._window: Mapping[str, Sequence[float]] = {}
        body = manifest.vehicle
        self._fixed = {
            "front_m": (body.front_m,),
            "rear_m": (body.rear_m,),
            "half_width_m": (body.half_width_m,),
            "clearance_required_m": (clearance_required_m,),
        }
        # Path coordinates are proved up to a fixed allowance for rounding, hence at most NUMERICAL.
        self._rigor = weakest(manifest.rigor, Rigor.NUMERICAL)

    def step(self, observation: Observation) -> Decision:
        """Judge one observation; never raises, whatever the observation holds.

        SAFE permits TRACK once release_steps are met; UNPROVED and INVALID brake. The next call
        must come from the same thread.
        """
        started_s = time.perf_counter()
        try:
            judgement = self._judge(observation)
        except CannotJudgeError as error:
            judgement = Judgement(Verdict.INVALID, f"invalid: {error}")
        except Exception as error:
            # Whatever went wrong, the vehicle must get an answer, and braking is the one that
            # holds.
            judgement = Judgement(Verdict.INVALID, f"invalid: {type(error).__name__}: {error}")
        action, note = self._release(judgement.verdict)
        return Decision(
            verdict=judgement.verdict,
            action=action,
            reason=judgement.reason + note,
            clearance_m=judgement.clearance_m,
            clearance_time_s=judgement.clearance_time_s,
            clearance_person=judgement.clearance_person,
            assumptions=self._bundle.manifest.assumptions,
            occupancy=judgement.occupancy,
            tube_lower=judgement.tube_lower,
            tube_upper=judgement.tube_upper,
            elapsed_s=time.perf_counter() - started_s,
            rigor=self._rigor,
        )

    def _release(self, verdict: Verdict) -> tuple[Action, str]:
        if verdict is not Verdict.SAFE:
            self._safe_in_a_row = 0
            return Action.BRAKE, ""
        self._safe_in_a_row = min(self._safe_in_a_row + 1, self._release_steps)
        if self._safe_in_a_row < self._release_steps:
            return Action.BRAKE, (
                f"; braking until {self._release_steps} SAFE in a row, this is number "
                f"{self._safe_in_a_row}"
            )
        return Action.TRACK, ""

    def _judge(self, observation: Observation) -> Judgement:
        manifest = self._bundle.manifest
        fault = fault_in_observation(observation) or float_mode_fault()
        if fault is not None:
            raise CannotJudgeError(fault)
        if len(observation.people) > self._people:
            raise CannotJudgeError(
                f"{len(observation.people)} people are seen, the kernel holds {self._people}"
            )
        state = self._path_state(observation)
        _check_region(manifest, state)
        initial = Box.from_intervals(state)
        values = {
            **self._fixed,
            **self._path_window(state["station"]),
            **self._people_values(observation.people),
            "initial_center": initial.center,
            "initial_radius": initial.radius,
            "parameters": self._parameter_values(observation.reference_speed_mps),
        }
        result = self._bundle.call(values)
        fault = float_mode_fault()
        if fault is not None:
            raise CannotJudgeError(f"the kernel changed the processor's mode: {fault}")
        names = tuple(person.name for person in observation.people)
        question = Question(
            initial.center, names, self._clearance_m, manifest.steps, manifest.step_s
        )
        return judge(result, question)

    def _path_state(self, observation: Observation) -> dict[str, Interval]:
        pose = self._path.project(
            observation.x,
            observation.y,
            observation.heading,
            near_station_m=self._station_m,
        )
        if isinstance(pose, NoProjection):
            raise CannotJudgeError(f"no path coordinates: {pose.reason}")
        self._station_m = 0.5 * (pose.station[0] + pose.station[1])
        return {
            "station": pose.station,
            "offset": pose.offset,
            "steering": observation.steering,
            "speed": observation.speed,
            "heading_error": pose.heading_error,
            "speed_integral": observation.speed_integral,
            "offset_integral": observation.offset_integral,
        }

    def _path_window(self, station: Interval) -> Mapping[str, Sequence[float]]:
        path = self._path
        node = math.floor((station[0] - path.start_m) / path.spacing_m) - _NODES_BEHIND
        start_m = path.station_m(max(node, 0) // _NODES_PER_SHIFT * _NODES_PER_SHIFT)
        if start_m != self._window_start:
            # Half a bin on, so that rounding cannot choose the node before.
            window = path.window(start_m + 0.5 * path.spacing_m, count=self._path_nodes)
            self._window = _window_values(window, self._path_nodes)
            self._window_start = start_m
        return self._window

    def _people_values(self, people: Sequence[Person]) -> dict[str, Sequence[float]]:
        numbers = [number for person in people for number in person.numbers]
        spare = self._people * PERSON_NUMBERS - len(numbers)
        return {"people_count": (float(len(people)),), "people": numbers + [0.0] * spare}

    def _parameter_values(self, reference_speed_mps: float) -> list[float]:
        parameter = self._bundle.manifest.parameters[self._reference]
        if not parameter.lower <= reference_speed_mps <= parameter.upper:
            raise CannotJudgeError(
                f"reference speed: the proof covers [{parameter.lower!r}, {parameter.upper!r}] "
                f"m/s, got {reference_speed_mps!r}"
            )
        values = self._parameters.copy()
        values[self._reference] = reference_speed_mps
        return values


def _check_settings(
    release_steps: int, clearance_required_m: float, start_station_m: float | None
) -> None:
    if release_steps < 1:
        raise InputError(f"expected release_steps >= 1, got {release_steps!r}")
    if not 0.0 <= clearance_required_m < math.inf:
        raise InputError(
            f"expected a finite clearance_required_m >= 0, got {clearance_required_m!r}"
        )
    if start_station_m is not None and not math.isfinite(start_station_m):
        raise InputError(f"expected a finite start_station_m or None, got {start_station_m!r}")


def _check_region(manifest: Manifest, state: Mapping[str, Interval]) -> None:
    if manifest.region is None:
        return
    for name in manifest.region.names:
        lower, upper = manifest.region.interval(name)
        low, high = state[name]
        if not (lower <= low and high <= upper):
            raise CannotJudgeError(
                f"{name}: the proof covers [{lower!r}, {upper!r}], got [{low!r}, {high!r}]"
            )


def _window_values(window: PathTable, nodes: int) -> dict[str, Sequence[float]]:
    def padded(column: Sequence[float]) -> array[float]:
        return array("d", (*column, *[0.0] * (nodes - len(column))))

    return {
        "path_count": (float(len(window.x)),),
        "path_start_m": (window.start_m,),
        "path_spacing_m": (window.spacing_m,),
        "path_x": padded(window.x),
        "path_y": padded(window.y),
        "path_heading": padded(window.heading),
        "path_curvature_lower": padded(window.curvature_lower),
        "path_curvature_upper": padded(window.curvature_upper),
    }


def _check_interface(manifest: Manifest) -> None:
    states = tuple(state.name for state in manifest.states)
    if states != STATES:
        raise InputError(f"expected a kernel in the states {STATES}, the bundle has {states}")
    if _REFERENCE_SPEED not in (parameter.name for parameter in manifest.parameters):
        raise InputError(f"expected a kernel with the parameter {_REFERENCE_SPEED!r}, it has none")
    query = {field.name: field for field in manifest.query}
    path_nodes = query["path_x"].count if "path_x" in query else 2
    people = query["people"].count // PERSON_NUMBERS if "people" in query else 1
    wanted = query_counts(
        states=len(STATES),
        parameters=len(manifest.parameters),
        path_nodes=path_nodes,
        people=people,
    )
    _check_fields("query", wanted, manifest.query)
    answered = result_counts(states=len(STATES), steps=manifest.steps)
    _check_fields("result", answered, manifest.result)
    unknown = [f.name for f in manifest.query if f.default is None and f.name not in wanted]
    if unknown:
        raise InputError(f"the kernel's query needs {unknown}, which a monitor does not know")


def _check_fields(buffer: str, wanted: Mapping[str, int], fields: Sequence[Field]) -> None:
    found = {field.name: field.count for field in fields}
    wrong = {name: count for name, count in wanted.items() if found.get(name) != count}
    instead = {name: found.get(name, 0) for name in wrong}
    if wrong:
        raise InputError(
            f"the kernel's {buffer} does not fit a monitor: expected {wrong} (numbers per field), "
            f"got {instead}; rebuild with `workbench build`"
        )
