"""A core's settings as plain values and back, so that a log holds all that its replay needs."""

from __future__ import annotations

import dataclasses
import enum
import math
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Final

from workbench.errors import InputError
from workbench.runtime.bundle import Bundle
from workbench.runtime.onboard.core import Core
from workbench.runtime.onboard.onboard_settings import OnboardSettings
from workbench.runtime.onboard.recorder_header import LogHeader
from workbench.runtime.onboard.states import Mode
from workbench.runtime.path import PathTable

_INFINITE: Final = {"inf": math.inf, "-inf": -math.inf}
_ROAD_WHEEL: Final = "drive_by_wire.steering.road_wheel.at"


def log_header(
    bundle: Bundle,
    path: PathTable,
    settings: OnboardSettings,
    *,
    mode: Mode,
    manifest_sha256: str,
    started_unix_us: int,
) -> LogHeader:
    """What a log of a core that is made of these says once.

    manifest_sha256: of the bundle's manifest.json as it was read; started_unix_us: the wall clock
    at the core's 0. Raises InputError for settings that plain values cannot hold.
    """
    body = bundle.manifest.vehicle
    return LogHeader(
        manifest_sha256=manifest_sha256,
        mode=mode.name,
        protocol=settings.drive_by_wire.protocol,
        path=path,
        settings=plain_settings(settings),
        outline_m=(body.front_m, body.rear_m, body.half_width_m),
        started_unix_us=started_unix_us,
        created_by=bundle.manifest.created_by,
    )


def core_again(bundle: Bundle, header: LogHeader) -> Core:
    """A core as the one that the log was made with. Raises InputError for what it cannot be."""
    if header.mode not in Mode.__members__:
        raise InputError(
            f"the log's header: expected a mode out of {list(Mode.__members__)}, got "
            f"{header.mode!r}; take the run.json that was written beside the log"
        )
    settings = settings_again(header.settings)
    return Core(bundle, header.path, settings, mode=Mode[header.mode])


def plain_settings(settings: OnboardSettings) -> dict[str, Any]:
    """Every number of the settings, bit for bit; one function, the steering map's, by its name.

    Raises InputError where `sensors.road_wheel` is another one than the steering map's `at`.
    """
    if settings.sensors.road_wheel != settings.drive_by_wire.steering.road_wheel.at:
        raise InputError(
            f"sensors.road_wheel: expected {_ROAD_WHEEL}, which a log can name, got "
            f"{settings.sensors.road_wheel!r}; give that, or no log"
        )
    content: dict[str, Any] = _plain(settings)
    return content


def settings_again(content: Mapping[str, Any]) -> OnboardSettings:
    """The settings that `plain_settings` made plain. Raises InputError for anything else."""
    try:
        values = dict(content)
        hints = typing.get_type_hints(OnboardSettings)
        drive_by_wire = _again(hints["drive_by_wire"], values["drive_by_wire"])
        named = {_ROAD_WHEEL: drive_by_wire.steering.road_wheel.at}
        settings: OnboardSettings = _again(OnboardSettings, values, named)
        # The very same object twice, as the core had it.
        return dataclasses.replace(settings, drive_by_wire=drive_by_wire)
    except InputError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the log's header: expected the settings of a core of this version, got {error!r}; "
            "replay the log with the workbench that recorded it"
        ) from error


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and math.isinf(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if callable(value):
        return _ROAD_WHEEL
    raise InputError(f"settings: expected numbers, words and tuples of them, got {value!r}")


def _again(kind: Any, value: Any, named: Mapping[str, Callable[..., Any]] | None = None) -> Any:
    """A value of the annotated kind out of plain ones; named: functions by what stands for them."""
    if named is not None and isinstance(value, str) and value in named:
        return named[value]
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        hints = typing.get_type_hints(kind)
        return kind(**{name: _again(hints[name], item, named) for name, item in value.items()})
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return kind[value]
    origin = typing.get_origin(kind)
    if origin is tuple:
        kinds = typing.get_args(kind)
        each = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(_again(k, item, named) for k, item in zip(each, value, strict=True))
    if origin in (typing.Union, types.UnionType):
        others = [k for k in typing.get_args(kind) if k is not type(None)]
        return None if value is None else _again(others[0], value, named)
    if kind is float and isinstance(value, str):
        return _INFINITE[value]
    return value
