"""Requests of the console to arm and sensor while the loop does not run.

`arm_service` executes them, in the thread of the console or in a process.
"""

from dataclasses import dataclass

from acquisition.control_loop.realtime import GrantResult
from acquisition.devices import SafetyMode
from acquisition.ipc.requests import Request
from wam.driver.startup import ArmInfo
from wam.driver.survey import ReplyCounts, RestTraffic

EXCHANGE_CYCLES = 100  # cycles with a position request


@dataclass(frozen=True, slots=True)
class ExchangeTimes:
    """Timing of position requests without torque.

    Attributes:
        replies_ns: times from request to seventh position [ns], complete exchanges
            only.
        unasked: cycles without a position request.
        late: of these, cycles in which positions arrived: they answer an earlier
            request.
        age_ns: time from the last request to the last late position [ns], 0 = none was
            late.
        answer_ns: median time from a property request to its reply [ns]; 0 = no reply.
        jumps: cycles with an implausible position; the arm stands still.
    """

    replies_ns: list[int]
    unasked: int = 0
    late: int = 0
    age_ns: int = 0
    answer_ns: int = 0
    jumps: int = 0


@dataclass(frozen=True, slots=True)
class ClaimArm(Request[None]):
    """Open the bus and refuse an arm used by another program.

    Raises PreflightError: another master talks, or the arm is active; LinkError: the
    bus cannot be opened, or is down.
    """


@dataclass(frozen=True, slots=True)
class StartArm(Request[ArmInfo]):
    """Find and wake the arm, read its properties; raises as `WamArm.start`.

    On a shared bus another program's arm is refused first, as by `ClaimArm`; nothing is
    ever sent to it then.
    """


@dataclass(frozen=True, slots=True)
class Listen(Request[RestTraffic]):
    """Listen silently for `seconds`; returns the traffic. Raises LinkError."""

    seconds: float


@dataclass(frozen=True, slots=True)
class CountAnswers(Request[ReplyCounts]):
    """Count the replies of devices to a request sent `times` times."""

    times: int


@dataclass(frozen=True, slots=True)
class LastAnswers(Request[list[dict[str, int | None]]]):
    """Properties of pucks 1 to 7 as read at the last start, by name."""


@dataclass(frozen=True, slots=True)
class MeasureExchange(Request[ExchangeTimes]):
    """Request all positions `EXCHANGE_CYCLES` times, once a period, without torque."""


@dataclass(frozen=True, slots=True)
class DefinePosition(Request[None]):
    """Define the present joint positions as `q` [rad], seven; see `WamArm`."""

    q: list[float]


@dataclass(frozen=True, slots=True)
class OpenSensor(Request[dict[str, str]]):
    """Open the wrist sensor; returns its description.

    Raises LinkError: the sensor is silent; DeviceFaultError: it reports a fault.
    """


@dataclass(frozen=True, slots=True)
class AskStream(Request[dict[str, str]]):
    """Counters of the sensor's stream since it was opened, as text."""


@dataclass(frozen=True, slots=True)
class BeginLoop(Request[None]):
    """Start the loop after the reply."""


@dataclass(frozen=True, slots=True)
class IdleArm(Request[bool]):
    """Idle the arm; returns whether that is confirmed."""


@dataclass(frozen=True, slots=True)
class AskSafetyMode(Request[SafetyMode]):
    """Latest mode reported by the safety module."""


@dataclass(frozen=True, slots=True)
class AskGrants(Request[list[GrantResult]]):
    """Scheduling rights granted to this process."""
