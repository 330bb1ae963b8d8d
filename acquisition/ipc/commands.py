"""Commands from the console to the loop, and the loop's answer: its status."""

import json
import struct
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

import numpy as np

from acquisition.control_loop.faults import GuardVerdict, from_plain, to_plain
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import BusCondition, SafetyMode
from acquisition.ipc.latest_value import Slot
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.record_layout import struct_of

_VALUES = 12  # numbers that a command has at most
COMMAND_DTYPE = np.dtype(
    [
        ("number", "<u8"),
        ("kind", "<u4"),
        ("argument", "<i4"),
        ("values", "<f8", (_VALUES,)),
    ]
)
_COMMAND: Final = struct_of(COMMAND_DTYPE)
_STATUS: Final = struct.Struct("<QBB?B4xqQQQQQ")
_NOTHING = (0.0,) * _VALUES


class CommandKind(IntEnum):
    """What a command asks for."""

    ENTER = 1  # argument: an ArmState; value: number of the newest verdict known
    WATCH_TRIAL = 2  # argument: 1 while a trial is recorded
    SET_BIAS = 3  # values: the sensor's reading without load, six of them
    MOVE = 4  # values: joint positions to go to, seven of them, and the speed
    LEAVE = 5  # end the loop; the arm is idle by then, or is made so
    PROVE = 6  # values: what the arm is given, four numbers as of `ProofGoal`
    START = 7  # hold, until a person activates the arm; value: as of ENTER


@dataclass(frozen=True, slots=True)
class Command:
    """One command.

    Attributes:
        number: counts the commands from 1; the status says which was obeyed last.
        kind: what is asked for.
        argument: a small number, see `CommandKind`.
        values: numbers, see `CommandKind`.
    """

    number: int
    kind: CommandKind
    argument: int
    values: tuple[float, ...]


class CommandQueue:
    """Both ends of the commands; the console posts, the loop takes."""

    def __init__(self, buffer: RingBuffer) -> None:
        self._buffer = buffer
        self._reader = buffer.reader()
        self.posted = buffer.written

    def post(
        self, kind: CommandKind, argument: int = 0, values: tuple[float, ...] = ()
    ) -> int:
        """Leave a command and return its number."""
        self.posted += 1
        padded = (*values, *_NOTHING[len(values) :])
        self._buffer.write(_COMMAND.pack(self.posted, kind, argument, *padded))
        return self.posted

    def take(self) -> list[Command]:
        """Return the commands that have come since the last call, oldest first."""
        if not self._reader.backlog:
            return []
        return [
            Command(number, CommandKind(kind), argument, tuple(values))
            for number, kind, argument, *values in _COMMAND.iter_unpack(
                self._reader.read().tobytes()
            )
        ]


@dataclass(slots=True)
class LoopStatus:
    """What the console sees of the loop.

    Attributes:
        obeyed: number of the last command that was obeyed.
        is_running: the loop goes on.
        bus_condition: what became of the arm's bus at the last question.
        cycles: cycles run.
        skipped: cycles that were skipped because one took too long.
        late: cycles that began late.
        worst_late_ns: the worst of them [ns].
        control: state of the arm and the guard's verdict.
    """

    obeyed: int = 0
    is_running: bool = False
    bus_condition: BusCondition = BusCondition.SOUND
    cycles: int = 0
    skipped: int = 0
    late: int = 0
    worst_late_ns: int = 0
    control: ControlStatus = field(default_factory=ControlStatus)


class StatusSlot:
    """Writes and reads the loop's status; each verdict is encoded once."""

    def __init__(self, slot: Slot) -> None:
        self._slot = slot
        self._verdicts: tuple[GuardVerdict, ...] = ()
        self._text = b""

    def write(self, status: LoopStatus) -> None:
        """Publish `status`."""
        control = status.control
        standing = control.standing
        if standing != self._verdicts:
            self._verdicts = standing
            self._text = _text_of(standing)
        head = _STATUS.pack(
            status.obeyed,
            control.state,
            control.safety,
            status.is_running,
            status.bus_condition,
            control.ft_age_ns,
            status.cycles,
            status.skipped,
            status.late,
            status.worst_late_ns,
            control.number,
        )
        self._slot.write(head + self._text)

    def read(self) -> LoopStatus:
        """Return the newest status; the first one before the loop ran."""
        raw = self._slot.read()
        if len(raw) < _STATUS.size:
            return LoopStatus()
        (
            obeyed,
            state,
            safety,
            running,
            bus,
            age,
            cycles,
            skipped,
            late,
            worst,
            number,
        ) = _STATUS.unpack_from(raw)
        verdicts = _verdicts_of(raw[_STATUS.size :])
        control = ControlStatus(
            state=ArmState(state),
            safety=SafetyMode(safety),
            verdict=verdicts[0] if verdicts else None,
            ft_age_ns=age,
            number=number,
            others=tuple(verdicts[1:]),
        )
        return LoopStatus(
            obeyed=obeyed,
            is_running=running,
            bus_condition=BusCondition(bus),
            cycles=cycles,
            skipped=skipped,
            late=late,
            worst_late_ns=worst,
            control=control,
        )


def _text_of(verdicts: tuple[GuardVerdict, ...]) -> bytes:
    return json.dumps([to_plain(v) for v in verdicts]).encode() if verdicts else b""


def _verdicts_of(text: bytes) -> list[GuardVerdict]:
    return [from_plain(plain) for plain in json.loads(text)] if text else []
