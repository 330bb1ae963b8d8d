"""Interfaces of arm and wrist sensor for the control loop."""

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


# In these modes the motor windings are shorted: commanded torques have no effect.
SHORTED = frozenset({SafetyMode.E_STOP, SafetyMode.IDLE})


class BusCondition(IntEnum):
    """Condition of the bus between host and arm."""

    SOUND = 0
    DOWN = 1  # the interface refuses to send and receive
    FULL = 2  # the interface's send queue is full
    OFF = 3  # bus-off: the controller does not take part in the bus
    UNACKNOWLEDGED = 4  # no node acknowledges frames


@dataclass(frozen=True, slots=True)
class PositionJump:
    """A rejected position: the step from the last accepted one is implausible.

    Attributes:
        motor: motor number, 1-7.
        counts: step from the last accepted position [encoder counts].
        speed: apparent speed of the fastest joint of this motor [rad/s].
    """

    motor: int
    counts: int
    speed: float


@dataclass(frozen=True, slots=True)
class MotorChange:
    """A property of a motor controller with an unexpected value.

    Attributes:
        motor: motor number, 1-7.
        name: name of the property.
        was: value at the start, or as commanded.
        value: present value.
    """

    motor: int
    name: str
    was: int
    value: int


@dataclass(frozen=True, slots=True)
class LatePositions:
    """Stale positions: received in a cycle without a request.

    They answer an earlier request, and so may all positions in the cycles around.

    Attributes:
        motors: bit i set = position of motor i+1 received.
        age_ns: least possible age: time since the latest request [ns].
        in_a_row: consecutive cycles without a request in which positions were received,
            this one included.
    """

    motors: int
    age_ns: int
    in_a_row: int


@dataclass(slots=True)
class ArmReading:
    """Joint positions of one cycle.

    Attributes:
        host_ns: monotonic time of the request [ns].
        arm_ns: monotonic arrival time of the last reply [ns], 0 = none.
        counts: motor positions as received [encoder counts], seven of them.
        q: joint positions [rad], shape (7,); extrapolated where a reply is missing.
        qd: filtered joint velocities as used by the controller [rad/s], shape (7,).
        qd7_raw: unfiltered difference of joint 7 over its last two replies [rad/s].
        fresh: bit i set = the reply of motor i+1 arrived in this cycle, or none was
            requested.
        is_complete: all requested replies arrived.
        missing_cycles: consecutive incomplete cycles, 0 = this one is complete.
        jump: a position rejected in this cycle, or None.
        foreign_id: identifier of a frame from another bus master, or None.
        has_bus_error: the CAN controller reported an error since the last reading.
        bus_ns: monotonic bus time of the last reply [ns], 0 = not known.
        is_without_request: a cycle without a request, on purpose: all positions are
            extrapolated by one cycle.
        late: stale positions in a cycle without a request, or None.
        change: changed property of a motor controller since the start, or None.
        disobeys: mismatch of a motor controller with its command (`was`), reported in
            one cycle; None = no mismatch.
        doubled: motor, 1-7, with more replies than requests; 0 = none.
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
    is_without_request: bool = False
    late: LatePositions | None = None
    change: MotorChange | None = None
    disobeys: MotorChange | None = None
    doubled: int = 0


@dataclass(slots=True)
class WrenchSample:
    """One sample of the wrist sensor as received.

    Attributes:
        t_ns: best estimate of the monotonic time of acquisition [ns].
        counter: device time or counter as received; 0 = the device has none.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m], calibrated; the tare,
            taken in `experiments.run.tare`, is not subtracted.
        status: device status bits as received.
        is_valid: the device reports valid data.
        saturated: bit i set = axis i (fx fy fz tx ty tz) is beyond its range.
    """

    t_ns: int
    counter: int
    wrench: tuple[float, float, float, float, float, float]
    status: int
    is_valid: bool
    saturated: int


class Arm(Protocol):
    """A torque-controlled robot arm with seven joints."""

    @property
    def sent_ns(self) -> int:
        """Time of the last torques sent [monotonic ns], 0 = never."""
        ...

    @property
    def bus_condition(self) -> BusCondition:
        """Condition of the bus at the last request."""
        ...

    def read(self, now_ns: int) -> ArmReading:
        """Request the joint positions and return them; waits 1.5 ms at most.

        Some cycles send no request, to detect stale replies.
        """
        ...

    def listen(self, now_ns: int) -> ArmReading:
        """Send no position request, so that the safety circuit misses its heartbeat.

        Still requests the state of the circuit and repeats the idle command. Returns
        an incomplete reading without waiting.
        """
        ...

    def send(self, tau: Vector, tau_gravity: Vector) -> Vector:
        """Send joint torques [N m] and return them as sent: clipped and rounded.

        Beyond a motor's limit `tau_gravity` is kept and the remainder scaled.
        """
        ...

    def safety_mode(self) -> SafetyMode:
        """Return the last known state of the safety circuit; does not wait."""
        ...

    @property
    def safety_heard_ns(self) -> int:
        """Time of the safety circuit's last report [monotonic ns], 0 = never."""
        ...

    def safety_warnings(self) -> tuple[str, ...]:
        """Return the monitors in warning, such as "velocity"; does not wait."""
        ...

    def safety_faults(self) -> tuple[str, ...]:
        """Return the monitors in fault, such as "torque"; does not wait.

        After `idle` they give the reason if the safety circuit stopped the arm.
        """
        ...

    def idle(self) -> bool:
        """Idle the arm, then send zero torque; return whether idle is confirmed."""
        ...

    def close(self) -> None:
        """Idle the arm and release the bus."""
        ...


class WrenchSensor(Protocol):
    """A six-axis force/torque sensor in the wrist."""

    def open(self) -> None:
        """Configure the device and start its stream; raises if it is silent."""
        ...

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return the samples since the last call, oldest first."""
        ...

    def describe(self) -> dict[str, str]:
        """Return model, serial number, firmware and rate for the recording."""
        ...

    def stream_metadata(self) -> dict[str, str]:
        """Return the counters of the stream since it was opened, as text."""
        ...

    def close(self) -> None:
        """Stop the stream and close the port."""
        ...
