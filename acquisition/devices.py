"""What the loop asks of an arm and of a wrist sensor."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


class SafetyMode(IntEnum):
    """State of the arm's safety circuit, numbered as in the recording."""

    E_STOP = 0
    IDLE = 1
    ACTIVE = 2
    UNKNOWN = 7


# In these the windings of the motors are shorted: no torque drives the arm.
SHORTED = frozenset({SafetyMode.E_STOP, SafetyMode.IDLE})


class BusCondition(IntEnum):
    """What is known of the bus between host and arm."""

    SOUND = 0
    DOWN = 1  # the interface refuses to send and receive
    FULL = 2  # the interface's queue is full: nothing leaves
    OFF = 3  # the controller has left the bus; what is sent vanishes
    UNHEARD = 4  # nobody acknowledges what is sent


@dataclass(frozen=True, slots=True)
class PositionJump:
    """A position that no motion explains, and which is therefore not believed.

    Attributes:
        motor: its number, 1-7.
        counts: from its last believed position [encoder counts].
        speed: of the fastest joint that this motor turns, were it true [rad/s].
    """

    motor: int
    counts: int
    speed: float


@dataclass(frozen=True, slots=True)
class MotorChange:
    """A property of a motor's controller that is not what it was at the start.

    Attributes:
        motor: its number, 1-7.
        name: of the property.
        was: its value at the start.
        value: its value now.
    """

    motor: int
    name: str
    was: int
    value: int


@dataclass(frozen=True, slots=True)
class LatePositions:
    """Positions that came in a cycle in which none was asked for.

    They answer an earlier question, and so may all positions before and after them.

    Attributes:
        motors: bit i set = that of motor i+1 came.
        age_ns: since the question that they can answer at best [ns].
        in_a_row: such cycles in a row, this one included; the cycles between them, in
            which positions are asked for, do not count.
    """

    motors: int
    age_ns: int
    in_a_row: int


@dataclass(slots=True)
class ArmReading:
    """Joint positions of one cycle.

    Attributes:
        host_ns: monotonic time at which the positions were asked for [ns].
        arm_ns: monotonic time at which the last reply arrived [ns], 0 = none.
        counts: motor positions as received [encoder counts], seven of them.
        q: joint positions [rad], shape (7,); extrapolated where a reply is missing.
        qd: joint velocities [rad/s], shape (7,), filtered as the controller uses them.
        qd7_raw: unfiltered difference of joint 7 over its last two replies [rad/s].
        fresh: bit i set = the reply of motor i+1 arrived in this cycle, or none was
            asked for.
        is_complete: all replies that were asked for arrived.
        missing_cycles: incomplete cycles in a row, 0 = this one is complete.
        jump: a position that was not believed in this cycle; None = all were.
        foreign_id: identifier of a frame that another master sent; None = none ever.
        has_bus_error: the bus's controller reported an error since the last reading.
        bus_ns: monotonic time at which the bus had the last reply [ns], 0 = it does
            not tell.
        is_unasked: no position was asked for in this cycle, on purpose: all of them
            are extrapolated by one cycle.
        late: positions that came although none was asked for; None = none did.
        change: of a motor's controller since the start; None = none was seen.
        disobeys: how a motor's controller contradicts what it was told, `was`; told in
            one cycle. None = none does.
        doubled: motor, 1-7, whose position came more often than it was asked for; 0 =
            none.
    """

    host_ns: int
    arm_ns: int
    counts: list[int]
    q: Vector
    qd: Vector
    qd7_raw: float
    fresh: int
    is_complete: bool
    missing_cycles: int
    jump: PositionJump | None = None
    foreign_id: int | None = None
    has_bus_error: bool = False
    bus_ns: int = 0
    is_unasked: bool = False
    late: LatePositions | None = None
    change: MotorChange | None = None
    disobeys: MotorChange | None = None
    doubled: int = 0


@dataclass(slots=True)
class WrenchSample:
    """One sample of the wrist sensor as it came.

    Attributes:
        t_ns: monotonic time of acquisition as well as it is known [ns].
        counter: device time or counter as received; 0 = the device has none.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m], calibrated, not tared.
        status: device status bits as received.
        is_valid: the device vouches for the numbers.
        saturated: bit i set = axis i (fx fy fz tx ty tz) is beyond its range.
    """

    t_ns: int
    counter: int
    wrench: tuple[float, float, float, float, float, float]
    status: int
    is_valid: bool
    saturated: int


class Arm(Protocol):
    """A robot arm with seven joints that takes joint torques."""

    @property
    def sent_ns(self) -> int:
        """Return when torques were last handed over [monotonic ns], 0 = never."""
        ...

    @property
    def bus_condition(self) -> BusCondition:
        """Return what became of the bus at the last question."""
        ...

    def read(self, now_ns: int) -> ArmReading:
        """Ask for the joint positions and return them; waits 1.5 ms at most.

        Now and then it does not ask, to see whether an earlier question is answered.
        """
        ...

    def listen(self, now_ns: int) -> ArmReading:
        """Ask for no position, so that the safety circuit misses its heartbeat.

        The state of the circuit is asked for, and idle again. Returns an incomplete
        reading; does not wait.
        """
        ...

    def send(self, tau: Vector, tau_gravity: Vector) -> Vector:
        """Send joint torques [N m] and return them as sent: clipped, rounded.

        When a motor's limit cuts, `tau_gravity` is kept and the rest scaled.
        """
        ...

    def safety_mode(self) -> SafetyMode:
        """Return the last known state of the safety circuit; does not wait."""
        ...

    @property
    def safety_heard_ns(self) -> int:
        """Return when the safety circuit last reported its state [ns], 0 = never."""
        ...

    def safety_warnings(self) -> tuple[str, ...]:
        """Return the monitors that warn, such as "velocity"; does not wait."""
        ...

    def safety_faults(self) -> tuple[str, ...]:
        """Return the monitors in fault, such as "torque"; does not wait.

        After `idle` they say why the safety circuit stopped the arm, if it did.
        """
        ...

    def idle(self) -> bool:
        """Idle the arm, then send zero torque; return whether it is confirmed."""
        ...

    def close(self) -> None:
        """Give the bus back; the arm is idle afterwards."""
        ...


class WrenchSensor(Protocol):
    """A six-axis force/torque sensor in the wrist."""

    def open(self) -> None:
        """Configure the device and start its stream; raises when it is silent."""
        ...

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return every sample that has arrived since the last call, oldest first."""
        ...

    def describe(self) -> dict[str, str]:
        """Return model, serial number, firmware and rate for the recording."""
        ...

    def stream_metadata(self) -> dict[str, str]:
        """Return what became of its samples since it was opened, as text."""
        ...

    def close(self) -> None:
        """Stop the stream and give the port back."""
        ...
