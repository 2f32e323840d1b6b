"""Turn by turn, the frames that command a PACMod 2 vehicle; nothing else makes command frames."""

from __future__ import annotations

from typing import Final, NamedTuple, final

from workbench.errors import InputError
from workbench.runtime.onboard.actuation import (
    Actuated,
    DriveByWire,
    Outputs,
    Sent,
    Wanted,
    actuate,
    brake_outputs,
    held,
    resting,
)
from workbench.runtime.protocols import Protocol, encode, load_protocol

COMMANDED: Final = ("pacmod2",)


class Frame(NamedTuple):
    """One classic CAN data frame with a standard identifier."""

    identifier: int
    data: bytes


@final
class Commander:
    """Makes every command frame of a vehicle; one thread, one method per turn.

    Each method gives the whole frame set of its turn, in the order of sending, at least 500 us
    apart. by-wire control is enabled by `enable` alone, with both pedals free; until then, and
    after `give_up`, `track`, `brake` and `hold` give no frame. IGNORE_OVERRIDE is never set, no
    gear is ever commanded. `last` tells what the last turn sent and whether the proof covers it.
    drive_by_wire: of the bundle. Raises InputError for a protocol that it cannot command.
    """

    def __init__(self, drive_by_wire: DriveByWire) -> None:
        name = drive_by_wire.protocol
        if name not in COMMANDED:
            raise InputError(
                f"expected a vehicle that is commanded by {' or '.join(COMMANDED)}, got {name!r}, "
                "whose frames can be read but not yet commanded; use mode shadow"
            )
        self._dbw = drive_by_wire
        self._protocol = load_protocol(name)
        self._sent: Sent | None = None
        self._last: Actuated | None = None

    @property
    def last(self) -> Actuated | None:
        """What the last turn of `track`, `brake` or `hold` sent; None while nothing is enabled."""
        return self._last

    @property
    def enabled(self) -> bool:
        """Whether the last frame set asked for by-wire control."""
        return self._sent is not None

    def silent(self) -> tuple[Frame, ...]:
        """Nothing, and nothing is enabled any more: the vehicle's own time-out disables it."""
        self._forget()
        return ()

    def clear_override(self) -> tuple[Frame, ...]:
        """CLEAR_OVERRIDE with ENABLE 0: a set of its own, never together with `enable`."""
        self._forget()
        return (self._global(enable=0, clear=1),)

    def enable(self, read_back_rad: float) -> tuple[Frame, ...]:
        """ENABLE with accelerator 0, brake 0 and the steering wheel where it is reported.

        No frame, and nothing enabled, where the read-back is not finite or out of range.
        """
        self._forget()
        self._sent = resting(self._dbw, read_back_rad)
        return () if self._sent is None else self._set(self._sent.outputs)

    def track(
        self,
        acceleration_mps2: float,
        steering_rate_radps: float,
        *,
        read_back_rad: float,
        elapsed_s: float,
        made_s: float = 0.0,
    ) -> tuple[Frame, ...]:
        """TRACK: see `actuate`. elapsed_s: since the last turn; made_s: since this one began."""
        if self._sent is None:
            return ()
        wanted = Wanted(acceleration_mps2, steering_rate_radps)
        return self._carried_out(
            actuate(
                self._dbw,
                wanted,
                read_back_rad=read_back_rad,
                before=self._sent,
                elapsed_s=elapsed_s,
                made_s=made_s,
            )
        )

    def brake(
        self,
        steering_rate_radps: float,
        *,
        read_back_rad: float,
        elapsed_s: float,
        made_s: float = 0.0,
    ) -> tuple[Frame, ...]:
        """BRAKE while the path is known: the brake profile, steering as the law says."""
        if self._sent is None:
            return ()
        return self._carried_out(
            brake_outputs(
                self._dbw,
                steering_rate_radps,
                read_back_rad=read_back_rad,
                before=self._sent,
                elapsed_s=elapsed_s,
                made_s=made_s,
            )
        )

    def hold(self) -> tuple[Frame, ...]:
        """BRAKE without a path: the brake profile, the wheel where the last path command had it."""
        return () if self._sent is None else self._carried_out(held(self._dbw, self._sent))

    def give_up(self) -> tuple[Frame, ...]:
        """YIELD: ENABLE 0 once, then nothing; nothing at all where nothing was enabled."""
        if self._sent is None:
            return ()
        self._forget()
        return (self._global(enable=0, clear=0),)

    def _forget(self) -> None:
        self._sent = self._last = None

    def _carried_out(self, actuated: Actuated) -> tuple[Frame, ...]:
        self._sent, self._last = actuated.sent, actuated
        return self._set(actuated.sent.outputs)

    def _set(self, outputs: Outputs) -> tuple[Frame, ...]:
        accelerator = _frame(self._protocol, "ACCEL_CMD", ACCEL_CMD=outputs.accelerator)
        brake = _frame(self._protocol, "BRAKE_CMD", BRAKE_CMD=outputs.brake)
        # The pedal that is let go comes first, so that the vehicle never holds both; the pedals
        # come before all else, because a brake must not wait.
        pedals = (brake, accelerator) if outputs.accelerator > 0.0 else (accelerator, brake)
        return (
            *pedals,
            _frame(
                self._protocol, "STEERING_CMD",
                POSITION_VALUE=outputs.wheel_rad, SPEED_LIMIT=outputs.wheel_rate_radps,
            ),
            self._global(enable=1, clear=0),
        )  # fmt: skip

    def _global(self, *, enable: int, clear: int) -> Frame:
        return _frame(
            self._protocol, "GLOBAL_CMD",
            PACMOD_ENABLE=enable, CLEAR_OVERRIDE=clear, IGNORE_OVERRIDE=0,
        )  # fmt: skip


def _frame(protocol: Protocol, name: str, **values: float) -> Frame:
    data = encode(protocol, name, values)
    assert isinstance(data, bytes), f"the last clamp let through what cannot be sent: {data}"
    return Frame(protocol.by_name[name].frame_id, data)
