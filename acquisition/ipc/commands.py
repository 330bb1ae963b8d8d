"""Commands from the console to the loop, and the loop's status."""

import json
import struct
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from acquisition.control_loop.faults import GuardVerdict, from_plain, to_plain
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import BusCondition, SafetyMode
from acquisition.ipc.latest_value import Slot
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.record_layout import struct_of

_VALUES = 12  # largest number of values of a command
COMMAND_DTYPE = np.dtype(
    [("number", "<u8"), ("form", "<u8"), ("values", "<f8", (_VALUES,))]
)
_COMMAND: Final = struct_of(COMMAND_DTYPE)
_STATUS: Final = struct.Struct("<QBB?B4xqQQQQQ")
_NOTHING = (0.0,) * _VALUES


@dataclass(frozen=True, slots=True)
class EnterState:
    """Request a state of the arm; see `Cycle.request`.

    Attributes:
        state: requested state.
        known: number of the newest verdict known to the console.
    """

    state: ArmState
    known: int


@dataclass(frozen=True, slots=True)
class AwaitActivation:
    """Hold until a person activates the arm; `known` as in `EnterState`."""

    known: int


@dataclass(frozen=True, slots=True)
class WatchTrial:
    """Switch the guard's limits for a trial on or off."""

    is_recording: bool


@dataclass(frozen=True, slots=True)
class SetBias:
    """Set the sensor's reading without load [N, N m], six numbers."""

    bias: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MoveJoints:
    """Move to joint positions.

    Attributes:
        goal: joint positions [rad], seven.
        speed: joint speed limit [rad/s].
    """

    goal: tuple[float, ...]
    speed: float


@dataclass(frozen=True, slots=True)
class StartPoweredTest:
    """Start a powered test, in hold."""

    goal: PoweredTestGoal


@dataclass(frozen=True, slots=True)
class LeaveLoop:
    """End the loop, with the arm idle."""


Command = (
    EnterState
    | AwaitActivation
    | WatchTrial
    | SetBias
    | MoveJoints
    | StartPoweredTest
    | LeaveLoop
)


class PostedCommand(NamedTuple):
    """A numbered command.

    Attributes:
        number: sequence number from 1; the status reports the last one executed.
        command: the command.
    """

    number: int
    command: Command


class CommandQueue:
    """Command queue; the console posts, the loop takes."""

    def __init__(self, buffer: RingBuffer) -> None:
        self._buffer = buffer
        self._reader = buffer.reader()
        self.posted = buffer.written

    def post(self, command: Command) -> int:
        """Post a command and return its number."""
        self.posted += 1
        form, values = _encode(command)
        padded = (*values, *_NOTHING[len(values) :])
        self._buffer.write(_COMMAND.pack(self.posted, form, *padded))
        return self.posted

    def take(self) -> list[PostedCommand]:
        """Return the commands posted since the last call, oldest first."""
        if not self._reader.backlog:
            return []
        return [
            PostedCommand(number, _decode(form, tuple(values)))
            for number, form, *values in _COMMAND.iter_unpack(
                self._reader.read().tobytes()
            )
        ]


@dataclass(slots=True)
class LoopStatus:
    """Status of the loop for the console.

    Attributes:
        obeyed: number of the last executed command.
        is_running: the loop is running.
        bus_condition: condition of the arm's bus at the last request.
        cycles: number of cycles run.
        skipped: cycles skipped after an overrun.
        late: cycles that began late.
        worst_late_ns: largest delay [ns].
        control: state of the arm and the guard's verdicts.
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
        standing = control.active_verdicts
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
        """Return the newest status; defaults before the first cycle."""
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


def _encode(command: Command) -> tuple[int, tuple[float, ...]]:
    """Return type number and values of a command."""
    match command:
        case EnterState(state, known):
            return 1, (state, known)
        case AwaitActivation(known):
            return 2, (known,)
        case WatchTrial(is_recording):
            return 3, (is_recording,)
        case SetBias(bias):
            return 4, bias
        case MoveJoints(goal, speed):
            return 5, (*goal, speed)
        case StartPoweredTest(goal):
            return 6, goal.values
        case LeaveLoop():
            return 7, ()


def _decode(form: int, values: tuple[float, ...]) -> Command:
    """Return the command encoded by `_encode`."""
    match form:
        case 1:
            return EnterState(ArmState(int(values[0])), int(values[1]))
        case 2:
            return AwaitActivation(int(values[0]))
        case 3:
            return WatchTrial(bool(values[0]))
        case 4:
            return SetBias(values[:6])
        case 5:
            return MoveJoints(values[:7], values[7])
        case 6:
            return StartPoweredTest(PoweredTestGoal.of(values))
        case 7:
            return LeaveLoop()
        case _:
            raise ValueError(f"there is no command of form {form}")


def _text_of(verdicts: tuple[GuardVerdict, ...]) -> bytes:
    return json.dumps([to_plain(v) for v in verdicts]).encode() if verdicts else b""


def _verdicts_of(text: bytes) -> list[GuardVerdict]:
    return [from_plain(plain) for plain in json.loads(text)] if text else []
