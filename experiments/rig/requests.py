"""What the console asks of arm and sensor while the loop does not run.

`arm_service` carries it out, in the thread of the console or in a process.
"""

from dataclasses import dataclass

from acquisition.control_loop.realtime import Grant
from acquisition.devices import SafetyMode
from acquisition.ipc.requests import Request
from wam.driver.startup import ArmInfo
from wam.driver.survey import Answers, RestTraffic

EXCHANGE_CYCLES = 100  # in which positions are asked for


@dataclass(frozen=True, slots=True)
class ExchangeTimes:
    """What came of questions for the positions, without torque.

    Attributes:
        replies_ns: from request to seventh position [ns]; incomplete exchanges are left
            out.
        unasked: cycles in which no position was asked for.
        late: of these, in which positions came: they answer an earlier question.
        age_ns: between the last question and the last position that came [ns], 0 =
            none came after its cycle.
        answer_ns: from a question for a property to its answer [ns], median; 0 = none
            was answered.
        jumps: cycles with a position that was not believed; the arm stands.
    """

    replies_ns: list[int]
    unasked: int = 0
    late: int = 0
    age_ns: int = 0
    answer_ns: int = 0
    jumps: int = 0


@dataclass(frozen=True, slots=True)
class ClaimArm(Request[None]):
    """Open the bus and refuse an arm that is another program's.

    Raises PreflightError: another master talks, or the arm is active; LinkError: the
    bus cannot be opened, or is down.
    """


@dataclass(frozen=True, slots=True)
class StartArm(Request[ArmInfo]):
    """Find, wake and question the arm; raises as `WamArm.start`.

    Where the bus is shared, another program's arm is refused first, as by `ClaimArm`;
    nothing is sent to it then, not even at the end.
    """


@dataclass(frozen=True, slots=True)
class Listen(Request[RestTraffic]):
    """Ask for nothing for `seconds`; what was heard. Raises LinkError."""

    seconds: float


@dataclass(frozen=True, slots=True)
class CountAnswers(Request[Answers]):
    """How often do devices answer a question that is asked `times` times?"""

    times: int


@dataclass(frozen=True, slots=True)
class LastAnswers(Request[list[dict[str, int | None]]]):
    """What did pucks 1 to 7 say at the last start, by name?"""


@dataclass(frozen=True, slots=True)
class MeasureExchange(Request[ExchangeTimes]):
    """Ask `EXCHANGE_CYCLES` times for the positions, a period apart, without torque."""


@dataclass(frozen=True, slots=True)
class DefinePosition(Request[None]):
    """Tell the arm that its joints stand at `q` [rad], seven; see `WamArm`."""

    q: list[float]


@dataclass(frozen=True, slots=True)
class OpenSensor(Request[dict[str, str]]):
    """Open the wrist sensor; what it says about itself.

    Raises LinkError: it is silent; DeviceFaultError: it is not well.
    """


@dataclass(frozen=True, slots=True)
class AskStream(Request[dict[str, str]]):
    """What became of the sensor's samples since it was opened, as text?"""


@dataclass(frozen=True, slots=True)
class BeginLoop(Request[None]):
    """Let the loop run once this is answered."""


@dataclass(frozen=True, slots=True)
class IdleArm(Request[bool]):
    """Idle the arm; is that confirmed?"""


@dataclass(frozen=True, slots=True)
class AskSafetyMode(Request[SafetyMode]):
    """Which mode did the safety module report last?"""


@dataclass(frozen=True, slots=True)
class AskGrants(Request[list[Grant]]):
    """What did the kernel grant to this process?"""
