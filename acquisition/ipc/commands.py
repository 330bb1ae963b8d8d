"""Commands from the console to the loop, and the loop's answer: its status."""

import json
import struct
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from acquisition.control_loop.faults import GuardVerdict, from_plain, to_plain
from acquisition.control_loop.proof import ProofGoal
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import BusCondition, SafetyMode
from acquisition.ipc.latest_value import Slot
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.record_layout import struct_of

_VALUES = 12  # numbers that a command has at most
COMMAND_DTYPE = np.dtype(
    [("number", "<u8"), ("form", "<u8"), ("values", "<f8", (_VALUES,))]
)
_COMMAND: Final = struct_of(COMMAND_DTYPE)
_STATUS: Final = struct.Struct("<QBB?B4xqQQQQQ")
_NOTHING = (0.0,) * _VALUES


@dataclass(frozen=True, slots=True)
class EnterState:
    """Go into a state of the arm; see `Cycle.request`.

    Attributes:
        state: wanted.
        known: number of the newest verdict that the console knows.
    """

    state: ArmState
    known: int


@dataclass(frozen=True, slots=True)
class AwaitActivation:
    """Hold, until a person activates the arm; `known` as of `EnterState`."""

    known: int


@dataclass(frozen=True, slots=True)
class WatchTrial:
    """Switch the guard's limits for a trial on or off."""

    is_recording: bool


@dataclass(frozen=True, slots=True)
class SetBias:
    """Take `bias` for what the sensor reads without load [N, N m], six numbers."""

    bias: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MoveJoints:
    """Go to joint positions.

    Attributes:
        goal: joint positions [rad], seven.
        speed: that no joint exceeds [rad/s].
    """

    goal: tuple[float, ...]
    speed: float


@dataclass(frozen=True, slots=True)
class GiveProof:
    """Give the arm what `goal` says, in hold."""

    goal: ProofGoal


@dataclass(frozen=True, slots=True)
class LeaveLoop:
    """End the loop; the arm is idle by then, or is made so."""


Command = (
    EnterState
    | AwaitActivation
    | WatchTrial
    | SetBias
    | MoveJoints
    | GiveProof
    | LeaveLoop
)


class PostedCommand(NamedTuple):
    """A command as it was posted.

    Attributes:
        number: counts the commands from 1; the status says which was obeyed last.
        command: what is asked for.
    """

    number: int
    command: Command


class CommandQueue:
    """Both ends of the commands; the console posts, the loop takes."""

    def __init__(self, buffer: RingBuffer) -> None:
        self._buffer = buffer
        self._reader = buffer.reader()
        self.posted = buffer.written

    def post(self, command: Command) -> int:
        """Leave a command and return its number."""
        self.posted += 1
        form, values = _encode(command)
        padded = (*values, *_NOTHING[len(values) :])
        self._buffer.write(_COMMAND.pack(self.posted, form, *padded))
        return self.posted

    def take(self) -> list[PostedCommand]:
        """Return the commands that have come since the last call, oldest first."""
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


def _encode(command: Command) -> tuple[int, tuple[float, ...]]:
    """Return the form of a command and its numbers."""
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
        case GiveProof(goal):
            return 6, goal.values
        case LeaveLoop():
            return 7, ()


def _decode(form: int, values: tuple[float, ...]) -> Command:
    """Return the command that `_encode` has written."""
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
            return GiveProof(ProofGoal.of(values))
        case 7:
            return LeaveLoop()
        case _:
            raise ValueError(f"there is no command of form {form}")


def _text_of(verdicts: tuple[GuardVerdict, ...]) -> bytes:
    return json.dumps([to_plain(v) for v in verdicts]).encode() if verdicts else b""


def _verdicts_of(text: bytes) -> list[GuardVerdict]:
    return [from_plain(plain) for plain in json.loads(text)] if text else []
